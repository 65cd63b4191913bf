# Copyright 2026 The rt_robot_os authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Who else runs on the core's CPU: other tasks, interrupts, the daemon that moves interrupts."""

from __future__ import annotations

from collections.abc import Iterator
import re

from rt_robot_os.tools.doctor.facts import allowed_cpus
from rt_robot_os.tools.doctor.facts import asked_cpu
from rt_robot_os.tools.doctor.facts import command_line
from rt_robot_os.tools.doctor.facts import container
from rt_robot_os.tools.doctor.facts import core_cpu
from rt_robot_os.tools.doctor.facts import CPU
from rt_robot_os.tools.doctor.facts import cpu_list
from rt_robot_os.tools.doctor.facts import cpu_text
from rt_robot_os.tools.doctor.facts import online_cpus
from rt_robot_os.tools.doctor.facts import running
from rt_robot_os.tools.doctor.finding import absent
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import unknown
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.remedies import boot_parameters
from rt_robot_os.tools.doctor.remedies import of_machine
from rt_robot_os.tools.doctor.system import System

# Fewer than this since the machine was started do not disturb anybody.
_BUSY_INTERRUPT = 1000
_SHOWN = 3
_WORK_QUEUES = '/sys/devices/virtual/workqueue/cpumask'


def _isolated(system: System) -> list[int]:
    return cpu_list(system.read(f'{CPU}/isolated'))


def cpu(system: System) -> Iterator[Finding]:
    """Report which CPU the core would be pinned to, and whether it may."""
    allowed, online = allowed_cpus(system), online_cpus(system)
    if not allowed:
        yield unknown('neither /proc/self/status nor /proc/cpuinfo lists the CPUs')
        return
    chosen = asked_cpu(system)
    if chosen is None:
        yield warn('core.cpu is -2: the core moves from CPU to CPU', Remedy(
            ('ros2 run rt_robot_os robot --ros-args -p core.cpu:=-1',), 'or in your parameter '
            'file'), weight=45)
        return
    among = f'of {len(online)}' + ('' if len(allowed) == len(online)
                                   else f', this process may use {cpu_text(allowed)}')
    if chosen not in online:
        yield warn(f'CPU {chosen} does not run; there are {cpu_text(online)}: not pinned', Remedy(
            (), 'choose core.cpu among them, or -1'), weight=60)
    elif len(online) == 1:
        yield warn('there is one CPU only: the core shares it with everything', Remedy(
            (), 'a machine with two CPUs or more'), weight=50)
    else:
        yield ok(f'CPU {chosen} {among}')


def isolated(system: System) -> Iterator[Finding]:
    """Check whether ordinary tasks are kept off the core's CPU."""
    chosen, online, alone = core_cpu(system), online_cpus(system), _isolated(system)
    if chosen is None or len(online) < 2:
        yield absent('the core has no CPU of its own')
        return
    if chosen in alone:
        full = cpu_list(system.read(f'{CPU}/nohz_full'))
        ticks = 'no ticks (nohz_full)' if chosen in full else 'with ticks (no nohz_full)'
        better = boot_parameters(system, f'nohz_full={chosen} rcu_nocbs={chosen}')
        yield ok(f'CPU {chosen} is isolated, {ticks}', None if chosen in full else better)
        return
    if alone:
        # The affinity that a process inherits leaves isolated CPUs out, so -1 never finds them.
        yield warn(f'CPU {cpu_text(alone)} is isolated, but the core would run on {chosen}',
                   Remedy((f'ros2 run rt_robot_os robot --ros-args -p core.cpu:={alone[-1]}',),
                          'or in your parameter file; core.cpu: -1 never chooses an isolated CPU'),
                   weight=60)
        return
    yield warn(f'CPU {chosen} is open to every other task', boot_parameters(
        system, f'isolcpus=managed_irq,domain,{chosen} nohz_full={chosen} rcu_nocbs={chosen}')
        if not container(system) else _cpuset(system, chosen), weight=40)


def _cpuset(system: System, chosen: int) -> Remedy:
    base = boot_parameters(system, f'isolcpus=managed_irq,domain,{chosen} nohz_full={chosen}')
    return Remedy(base.commands, f'{base.note}; then give this container the CPU: '
                  f'--cpuset-cpus={cpu_text(online_cpus(system))}, and set core.cpu: {chosen}')


def _counts(system: System, chosen: int) -> dict[str, tuple[int, str]]:
    """Return for each numbered interrupt how often it came on the CPU, and its device."""
    lines = system.text('/proc/interrupts').splitlines()
    columns = re.findall(r'CPU(\d+)', lines[0]) if lines else []
    if str(chosen) not in columns:
        return {}
    column = columns.index(str(chosen))
    found = {}
    for line in lines[1:]:
        match = re.match(r'\s*(\d+):((?:\s+\d+)+)\s+(.*)', line)
        if match and len(match[2].split()) > column:
            found[match[1]] = int(match[2].split()[column]), (match[3].split() or ['?'])[-1]
    return found


def interrupts(system: System) -> Iterator[Finding]:
    """Look for devices whose interrupts arrive on the core's CPU."""
    chosen = core_cpu(system)
    if chosen is None:
        yield absent('the core is not pinned')
        return
    others = [one for one in online_cpus(system) if one != chosen]
    here = []
    for number, (count, name) in _counts(system, chosen).items():
        folder = f'/proc/irq/{number}'
        target = (system.read(f'{folder}/effective_affinity_list')
                  or system.read(f'{folder}/smp_affinity_list'))
        if chosen in cpu_list(target) and count >= _BUSY_INTERRUPT:
            here.append((count, number, name))
    if not here:
        yield ok(f'no busy one on CPU {chosen}')
        return
    here.sort(reverse=True)
    text = ', '.join(f'{name} {count}' for count, _, name in here[:_SHOWN])
    more = f' and {len(here) - _SHOWN} more' if len(here) > _SHOWN else ''
    finding = f'{len(here)} on CPU {chosen}, counted since boot: {text}{more}'
    if not others:
        yield ok(f'{finding} (there is no other CPU)')
        return
    numbers = ' '.join(number for _, number, _ in here)
    yield warn(finding, of_machine(
        system, f'for i in {numbers}; do',
        f'  echo {cpu_text(others)} | sudo tee /proc/irq/$i/smp_affinity_list; done',
        note='until the next boot; the queues of NVMe and some network cards refuse it: '
        'isolcpus=managed_irq,... moves those'), weight=35)


def irqbalance(system: System) -> Iterator[Finding]:
    """Look for the daemon that spreads interrupts over all CPUs."""
    chosen = core_cpu(system)
    if not running(system, 'irqbalance'):
        yield absent('irqbalance does not run')
        return
    settings = system.read('/etc/default/irqbalance')
    banned = re.search(r'^\s*IRQBALANCE_BANNED_CPULIST=["\']?([\d,-]+)', settings, re.MULTILINE)
    if chosen is None or chosen in cpu_list(banned[1] if banned else ''):
        yield ok(f'runs, and leaves CPU {chosen} alone (IRQBALANCE_BANNED_CPULIST)')
    elif chosen in _isolated(system):
        yield ok(f'runs, and leaves CPU {chosen} alone because it is isolated')
    else:
        yield warn(f'runs, and may move interrupts to CPU {chosen}', of_machine(
            system, f"echo 'IRQBALANCE_BANNED_CPULIST={chosen}' |",
            '  sudo tee -a /etc/default/irqbalance && sudo systemctl restart irqbalance'),
            weight=30)


def work_queues(system: System) -> Iterator[Finding]:
    """Look whether Linux may run its deferred work on the core's CPU."""
    chosen, online = core_cpu(system), online_cpus(system)
    text = system.read(_WORK_QUEUES)
    if chosen is None or len(online) < 2:
        yield absent('the core has no CPU of its own')
        return
    try:
        mask = int(text.replace(',', ''), 16)
    except ValueError:
        yield unknown(f'{_WORK_QUEUES} is not there')
        return
    if not mask >> chosen & 1:
        yield ok(f'not on CPU {chosen}')
        return
    kept = sum(1 << one for one in online if one != chosen)
    yield warn(f'may run on CPU {chosen}', of_machine(
        system, f'echo {kept:x} | sudo tee {_WORK_QUEUES}', note='until the next boot'),
        weight=38)


def boot(system: System) -> Iterator[Finding]:
    """Look for boot parameters that work against real time."""
    given = command_line(system)
    harmful = {'nohz': 'off', 'highres': 'off', 'idle': 'nomwait', 'nosmp': '', 'maxcpus': '1'}
    found = [f'{key}={value}' if value else key for key, value in harmful.items()
             if given.get(key) == value]
    if not system.read('/proc/cmdline'):
        yield unknown('/proc/cmdline cannot be read')
    elif found:
        yield warn(f'harmful: {" ".join(found)}', Remedy(
            ('grep -rn GRUB_CMDLINE /etc/default/grub /etc/default/grub.d',),
            'take them out there, then: sudo update-grub && sudo reboot'), weight=55)
    else:
        useful = [f'{key}={given[key]}' if given[key] else key for key in (
            'preempt', 'isolcpus', 'nohz_full', 'rcu_nocbs', 'irqaffinity', 'threadirqs', 'tsc',
            'intel_idle.max_cstate', 'processor.max_cstate', 'mitigations') if key in given]
        yield ok('nothing harmful' + (f'; has {" ".join(useful)}' if useful else ''))


CHECKS = (
    Check('isolation.cpu', 'CPU of the core', 'the core runs on one CPU, so that its caches stay '
          'warm and nothing moves it', cpu),
    Check('isolation.isolated', 'isolation',
          'tasks of the kernel and of others that start on this CPU cost the core some '
          'microseconds each', isolated),
    Check('isolation.interrupts', 'interrupts',
          'the handler of an interrupt runs before any task, the core as well', interrupts),
    Check('isolation.irqbalance', 'irqbalance',
          'an interrupt that was moved away by hand comes back', irqbalance),
    Check('isolation.work_queues', 'work queues',
          'bytes of serial ports are handed on there; behind a core that computes they wait for '
          'milliseconds', work_queues),
    Check('isolation.boot', 'boot parameters',
          'some parameters take away the timers or the CPUs that real time needs',
          boot),
)
