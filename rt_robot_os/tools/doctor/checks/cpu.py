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

"""The CPU that the core would run on: its clock, its sleep, its sibling, its temperature."""

from __future__ import annotations

from collections.abc import Iterator
import os
import re

from rt_robot_os.tools.doctor.facts import core_cpu
from rt_robot_os.tools.doctor.facts import CPU
from rt_robot_os.tools.doctor.facts import cpu_list
from rt_robot_os.tools.doctor.facts import cpu_text
from rt_robot_os.tools.doctor.facts import online_cpus
from rt_robot_os.tools.doctor.facts import virtual_machine
from rt_robot_os.tools.doctor.finding import absent
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import unknown
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.remedies import at_each_boot
from rt_robot_os.tools.doctor.remedies import no_frequency_scaling
from rt_robot_os.tools.doctor.remedies import of_machine
from rt_robot_os.tools.doctor.system import System

# Waking up from a sleep may take a fifth of the 100 us that a 1 kHz loop has.
_WAKE_LIMIT_US = 20
_HOT_MARGIN_C = 5.0
DMA_LATENCY = '/dev/cpu_dma_latency'
_HOLD = 'core.cpu_latency_us: 0'
_PI_THROTTLED = '/sys/devices/platform/soc/soc:firmware/get_throttled'


def _grouped(values: dict[int, str]) -> str:
    """Write values by CPU, the most frequent first: ``powersave on 0-6, performance on 7``."""
    groups: dict[str, list[int]] = {}
    for cpu, value in values.items():
        groups.setdefault(value, []).append(cpu)
    ordered = sorted(groups.items(), key=lambda item: (-len(item[1]), item[0]))
    return ', '.join(f'{value} on CPU {cpu_text(cpus)}' for value, cpus in ordered)


def governor(system: System) -> Iterator[Finding]:
    """Look at how the frequency of each CPU is chosen."""
    values = {cpu: value for cpu in online_cpus(system)
              if (value := system.read(f'{CPU}/cpu{cpu}/cpufreq/scaling_governor'))}
    if not values:
        why = no_frequency_scaling(system)
        yield absent(why) if why else unknown(f'{CPU}/cpu0/cpufreq is not there: no driver '
                                              'for frequency scaling, or it is off')
        return
    text = _grouped(values)
    cpu = core_cpu(system)
    of_core = values.get(-1 if cpu is None else cpu)
    if set(values.values()) == {'performance'} or of_core == 'performance':
        yield ok(text)
        return
    path = f'{CPU}/cpu*/cpufreq/scaling_governor'
    note = ''
    if system.exists('/usr/bin/powerprofilesctl'):
        note = 'the power mode of the desktop may set it back: powerprofilesctl set performance'
    # schedutil asks for the highest frequency as soon as a real-time task runs.
    weight = 35 if of_core == 'schedutil' else 65
    yield warn(text, at_each_boot(system, path, 'performance', 'governor', note), weight=weight)


def turbo(system: System) -> Iterator[Finding]:
    """Report whether the clock may rise above its nominal value."""
    no_turbo = system.read(f'{CPU}/intel_pstate/no_turbo')
    boost = system.read(f'{CPU}/cpufreq/boost')
    if not no_turbo and not boost:
        yield absent(no_frequency_scaling(system) or 'this CPU has none that Linux knows of')
        return
    on = no_turbo == '0' or (not no_turbo and boost == '1')
    path, value = (f'{CPU}/cpufreq/boost', 0)
    if no_turbo:
        path, value = (f'{CPU}/intel_pstate/no_turbo', 1)
    yield (ok('on: faster, by an amount that depends on the other CPUs and the temperature',
              of_machine(system, f'echo {value} | sudo tee {path}',
                         note='off, for execution times that vary less'))
           if on else ok('off: execution times vary less'))


def _idle_states(system: System, cpu: int) -> tuple[list[tuple[str, str]], str]:
    """Return folder and name of the deep states that are enabled, and the name of the deepest."""
    deep = []
    seen = ''
    for folder in system.glob(f'{CPU}/cpu{cpu}/cpuidle/state*'):
        latency = system.read(f'{folder}/latency')
        if latency.isdigit() and system.read(f'{folder}/disable', '0') == '0':
            seen = f'{system.read(f"{folder}/name")} ({latency} us)'
            if int(latency) > _WAKE_LIMIT_US:
                deep.append((folder, seen))
    return deep, seen


def idle(system: System) -> Iterator[Finding]:
    """Look at the deepest sleep of the core's CPU."""
    cpu = core_cpu(system) or 0
    deep, seen = _idle_states(system, cpu)
    if not seen:
        yield absent(f'the host of this virtual machine ({virtual_machine(system)}) decides'
                     if virtual_machine(system) else 'CPU has no states of sleep')
        return
    if not deep:
        yield ok(f'CPU {cpu}: the deepest is {seen}')
        return
    asked = system.wanted.cpu_latency_us
    may = system.may(DMA_LATENCY, os.W_OK)
    if 0 <= asked <= _WAKE_LIMIT_US and may:
        yield ok(f'CPU {cpu}: {deep[-1][1]}, which core.cpu_latency_us: {asked} prevents')
        return
    states = [re.sub(r'.*/', '', folder) for folder, _ in deep]
    files = ' '.join(f'{folder}/disable' for folder, _ in deep)
    if len(deep) > 1:
        numbers = ','.join(state.removeprefix('state') for state in states)
        files = f'{CPU}/cpu{cpu}/cpuidle/state{{{numbers}}}/disable'
    more = f', and {len(deep) - 1} more above {_WAKE_LIMIT_US} us' if len(deep) > 1 else ''
    text = f'CPU {cpu}: {deep[-1][1]}{more}'
    if may:
        command = 'ros2 run rt_robot_os robot --ros-args -p core.cpu_latency_us:=0'
        yield warn(text, Remedy((command,), 'or in your parameter file'), weight=60)
    else:
        yield warn(text, of_machine(system, f'echo 1 | sudo tee {files}',
                                    note=f'until the next boot; {_HOLD} would do it, see below'),
                   weight=60)


def dma_latency(system: System) -> Iterator[Finding]:
    """Report whether a program of this user may prevent deep sleep of the CPUs."""
    if not system.exists(DMA_LATENCY):
        yield absent(f'there is no {DMA_LATENCY} here')
    elif system.may(DMA_LATENCY, os.W_OK):
        yield ok(f'{DMA_LATENCY} can be written')
    elif not _idle_states(system, core_cpu(system) or 0)[0] and system.wanted.cpu_latency_us < 0:
        yield ok(f'{DMA_LATENCY} cannot be written, but there is no deep sleep to prevent')
    else:
        rule = 'KERNEL=="cpu_dma_latency", GROUP="realtime", MODE="0660"'
        yield warn(f'{DMA_LATENCY} cannot be written by this user', of_machine(
            system, f"echo '{rule}' |", '  sudo tee /etc/udev/rules.d/99-cpu-dma-latency.rules',
            'sudo groupadd -f realtime && sudo udevadm control --reload',
            'sudo udevadm trigger --name-match=cpu_dma_latency',
            note=f'then, as a member of that group, set {_HOLD}'), weight=10)


def siblings(system: System) -> Iterator[Finding]:
    """Look for a second logical CPU in the core's physical one."""
    cpu = core_cpu(system)
    if cpu is None:
        yield absent('the core is not pinned')
        return
    text = system.text(f'{CPU}/cpu{cpu}/topology/thread_siblings_list')
    others = [other for other in cpu_list(text) if other != cpu and other in online_cpus(system)]
    if not others:
        yield ok(f'CPU {cpu} has none')
        return
    note = ('until the next boot; as the host shows it, the truth may be different'
            if virtual_machine(system) else
            'until the next boot; for good: SMT (Hyper-Threading) off in the firmware')
    yield warn(f'CPU {cpu} shares its execution units with CPU {cpu_text(others)}', of_machine(
        system, *(f'echo 0 | sudo tee {CPU}/cpu{other}/online' for other in others), note=note),
        weight=30)


def temperature(system: System) -> Iterator[Finding]:
    """Look for a clock that is or will soon be lowered because of heat or a weak supply."""
    pi = system.read(_PI_THROTTLED)
    if re.fullmatch(r'[0-9a-fA-F]+', pi) and int(pi, 16) & 0xf:
        reasons = [name for bit, name in enumerate(
            ('supply voltage too low', 'frequency capped', 'throttled', 'too hot'))
            if int(pi, 16) >> bit & 1]
        yield warn(f'lowered now: {", ".join(reasons)}',
                   Remedy((), 'a better power supply or cooling'), weight=70)
        return
    hottest: tuple[float, str, float | None] | None = None
    for zone in system.glob('/sys/class/thermal/thermal_zone*'):
        degrees = system.read(f'{zone}/temp')
        if not degrees.lstrip('-').isdigit():
            continue
        value = int(degrees) / 1000
        limit = _passive_limit(system, zone)
        if limit is not None and value > limit - _HOT_MARGIN_C:
            yield warn(f'{system.read(f"{zone}/type")}: {value:.0f} C, lowered from {limit:.0f} C',
                       Remedy((), 'better cooling'), weight=50)
            return
        if hottest is None or value > hottest[0]:
            hottest = (value, system.read(f'{zone}/type'), limit)
    if hottest is None:
        yield absent('no thermometer can be read here')
        return
    yield ok(f'{hottest[0]:.0f} C at most ({hottest[1]})')


def _passive_limit(system: System, zone: str) -> float | None:
    for path in system.glob(f'{zone}/trip_point_*_type'):
        if system.read(path) == 'passive':
            text = system.read(path.replace('_type', '_temp'))
            # Some firmware leaves a zero or an impossible value.
            if text.isdigit() and int(text) > 30000:
                return int(text) / 1000
    return None


CHECKS = (
    Check('cpu.governor', 'frequency governor',
          'a clock that was lowered while idle rises only after the core has begun to work',
          governor),
    Check('cpu.turbo', 'turbo', 'the same job takes a different time at a different clock', turbo),
    Check('cpu.idle', 'idle states',
          'a CPU that sleeps deeply needs this long to wake up for the next release', idle),
    Check('cpu.dma_latency', 'idle by request',
          'core.cpu_latency_us keeps the CPUs awake through this device, just while the core runs',
          dma_latency),
    Check('cpu.siblings', 'SMT sibling',
          'what runs on the sibling slows the core down, real-time priority or not', siblings),
    Check('cpu.temperature', 'temperature',
          'a CPU that is too hot lowers its clock by half or more', temperature),
)
