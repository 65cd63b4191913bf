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

"""Linux itself: how it is preempted, and what it does with a real-time task that never sleeps."""

from __future__ import annotations

from collections.abc import Iterator
import re

from rt_robot_os.tools.doctor.facts import command_line
from rt_robot_os.tools.doctor.facts import container
from rt_robot_os.tools.doctor.facts import core_cpu
from rt_robot_os.tools.doctor.facts import distribution
from rt_robot_os.tools.doctor.facts import is_wsl
from rt_robot_os.tools.doctor.facts import kernel_config
from rt_robot_os.tools.doctor.facts import kernel_release
from rt_robot_os.tools.doctor.finding import absent
from rt_robot_os.tools.doctor.finding import bad
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import unknown
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.remedies import boot_parameters
from rt_robot_os.tools.doctor.remedies import of_machine
from rt_robot_os.tools.doctor.system import System

PREEMPT_FILE = '/sys/kernel/debug/sched/preempt'
FAIR_SERVER = '/sys/kernel/debug/sched/fair_server'
FAIR_SERVER_SINCE = (6, 12)
# Modes in which a real-time task preempts code of the kernel. "lazy" delays ordinary tasks only.
_PREEMPTIBLE = ('full', 'lazy')
_CHOICES = (('CONFIG_PREEMPT_LAZY', 'lazy'), ('CONFIG_PREEMPT_VOLUNTARY', 'voluntary'),
            ('CONFIG_PREEMPT_NONE', 'none'), ('CONFIG_PREEMPT', 'full'))


def _configured_mode(system: System) -> tuple[str, str]:
    """Find the mode without debugfs: the kernel's command line, else its built-in choice."""
    chosen = command_line(system).get('preempt')
    if chosen:
        return chosen, 'its command line'
    config = kernel_config(system)
    for key, mode in _CHOICES:
        if config.get(key) == 'y':
            return mode, 'its configuration'
    return '', ''


def _mode(system: System) -> tuple[str, str]:
    listed = re.search(r'\((\w+)\)', system.read(PREEMPT_FILE))
    return (listed[1], PREEMPT_FILE) if listed else _configured_mode(system)


def _realtime_kernel(system: System) -> Remedy:
    if is_wsl(system):
        return Remedy((), 'WSL2 runs the kernel of Windows: use a real Linux for real time')
    if container(system):
        return Remedy((), 'a PREEMPT_RT kernel on the host')
    pi = system.exists('/boot/firmware/config.txt')
    kind = distribution(system)
    if kind == 'ubuntu':
        variant = ' --variant=raspi' if pi else ''
        return Remedy(('sudo pro attach', f'sudo pro enable realtime-kernel{variant}',
                       'sudo reboot'), 'the kernel with PREEMPT_RT of Ubuntu Pro')
    if kind == 'raspbian' or (kind == 'debian' and pi):
        return Remedy(('sudo apt install linux-image-rpi-v8-rt',
                       "echo 'kernel=kernel8_rt.img' | sudo tee -a /boot/firmware/config.txt",
                       'sudo reboot'), 'the kernel with PREEMPT_RT of Raspberry Pi OS; how its '
                      'image is called: ls /boot/firmware/kernel*rt*')
    if kind == 'debian':
        return Remedy(('sudo apt install linux-image-rt-$(dpkg --print-architecture)',
                       'sudo reboot'), 'the kernel with PREEMPT_RT of Debian')
    return Remedy((), 'install a kernel with PREEMPT_RT of your distribution')


def preemption(system: System) -> Iterator[Finding]:
    """Find how the kernel is preempted."""
    if system.read('/sys/kernel/realtime') == '1' or re.search(r'\bPREEMPT_RT\b', system.version):
        yield ok('PREEMPT_RT')
        return
    better = _realtime_kernel(system)
    if re.search(r'\bPREEMPT_DYNAMIC\b', system.version):
        mode, source = _mode(system)
        if not mode:
            yield unknown('PREEMPT_DYNAMIC, its mode cannot be read by this user',
                          Remedy((f'sudo cat {PREEMPT_FILE}',), 'full or lazy is right'))
            return
        text = f'PREEMPT_DYNAMIC, mode {mode} (from {source})'
        if mode in _PREEMPTIBLE:
            yield ok(text, better)
            return
        yield warn(text, boot_parameters(system, 'preempt=full'), weight=75)
        return
    if re.search(r'\bPREEMPT\b', system.version):
        yield ok('PREEMPT (full)', better)
        return
    mode, source = _configured_mode(system)
    text = f'mode {mode} (from {source})' if mode else 'voluntary or none'
    yield warn(f'not preemptible: {text}', better, weight=75)


def throttling(system: System) -> Iterator[Finding]:
    """Look at the share of the CPU that real-time tasks may take."""
    runtime = int(system.text('/proc/sys/kernel/sched_rt_runtime_us'))
    period = int(system.text('/proc/sys/kernel/sched_rt_period_us'))
    default = of_machine(
        system, "echo 'kernel.sched_rt_runtime_us = 950000' |",
        '  sudo tee /etc/sysctl.d/60-rt-runtime.conf && sudo sysctl --system')
    text = f'{runtime} of {period} us'
    if runtime < 0:
        yield ok('off (-1): a core that hangs keeps its CPU for ever')
    elif runtime == 0:
        yield bad(f'{text}: no real-time task may run', default, weight=95)
    elif runtime * 10 < period * 9:
        yield warn(f'{text}: the core is stopped when it needs more', default, weight=60)
    else:
        share = 100 * runtime / period
        yield ok(f'{text}: room for a core that is busy up to {share:.0f} % of the time')


def fair_server(system: System) -> Iterator[Finding]:
    """Look at the reservation for ordinary tasks that newer kernels make on each CPU."""
    if kernel_release(system) < FAIR_SERVER_SINCE:
        yield absent(f'Linux {system.release} has none (new in 6.12)')
        return
    cpu = core_cpu(system) or 0
    folder = f'{FAIR_SERVER}/cpu{cpu}'
    runtime = system.read(f'{folder}/runtime')
    if runtime.isdigit():
        milliseconds = int(runtime) / 1e6
        period = int(system.read(f'{folder}/period') or 1000000000) / 1e6
        if milliseconds * 10 > period:
            yield warn(f'CPU {cpu}: {milliseconds:g} of {period:g} ms for others', of_machine(
                system, f'echo 50000000 | sudo tee {folder}/runtime'), weight=40)
            return
        yield ok(f'CPU {cpu}: {milliseconds:g} of {period:g} ms for others, if they starve')
        return
    where = ('debugfs is not there' if not system.exists('/sys/kernel/debug/sched')
             else 'only root may read it')
    remedy = None
    if not container(system) and system.exists('/sys/kernel/debug'):
        mount = ('sudo mount -t debugfs none /sys/kernel/debug',) * where.startswith('debugfs')
        remedy = Remedy((*mount, f'sudo cat {folder}/runtime'))
    yield unknown(f'{where}; the usual value is 50 of 1000 ms', remedy)


CHECKS = (
    Check('kernel.preemption', 'preemption model',
          'a system call of another program holds up the core until it ends, where the kernel is '
          'not preemptible', preemption),
    Check('kernel.throttling', 'real-time share',
          'Linux stops a SCHED_FIFO task that takes more than its share, in the middle of '
          'whatever it does', throttling),
    Check('kernel.fair_server', 'fair server',
          'a core that leaves ordinary tasks no time is interrupted for this long', fair_server),
)
