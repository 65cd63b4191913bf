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

"""Clocks: what the timers are made of, what reading one costs, what sets the time of day."""

from __future__ import annotations

from collections.abc import Iterator

from rt_robot_os.tools.doctor.facts import container
from rt_robot_os.tools.doctor.facts import is_wsl
from rt_robot_os.tools.doctor.facts import running
from rt_robot_os.tools.doctor.facts import virtual_machine
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import unknown
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.remedies import boot_parameters
from rt_robot_os.tools.doctor.remedies import of_machine
from rt_robot_os.tools.doctor.system import System

_FOLDER = '/sys/devices/system/clocksource/clocksource0'
# Sources that a program reads without a system call.
_FAST = ('tsc', 'arch_sys_counter', 'kvm-clock', 'hyperv_clocksource_tsc_page',
         'riscv_clocksource', 'stp', 'timebase')
# A read without a system call takes 20..80 ns and Python adds as much; with one, 300 ns and more.
_SLOW_READ_NS = 300
_DAEMONS = ('chronyd', 'systemd-timesyncd', 'ntpd', 'ntpsec', 'ptp4l', 'phc2sys')
_STA_UNSYNC = 0x40


def source(system: System) -> Iterator[Finding]:
    """Look at the counter behind all clocks."""
    current = system.text(f'{_FOLDER}/current_clocksource')
    others = system.read(f'{_FOLDER}/available_clocksource').split()
    if current in _FAST:
        yield ok(current)
        return
    better = next((name for name in _FAST if name in others), '')
    if better:
        remedy = of_machine(
            system, f'echo {better} | sudo tee {_FOLDER}/current_clocksource',
            note='until the next boot; Linux may have had a reason: sudo dmesg | grep -i tsc')
    elif virtual_machine(system):
        remedy = Remedy((), 'on the host, let the virtual machine see an invariant TSC')
    else:
        remedy = boot_parameters(system, 'tsc=reliable')
    yield warn(f'{current}' + (f', though {better} is there' if better else ''), remedy, weight=55)


def resolution(system: System) -> Iterator[Finding]:
    """Look whether timers have nanoseconds or ticks."""
    answer = system.probe('clock')
    step = answer['resolution_ns']
    if step <= 1000:
        yield ok(f'high-resolution timers: {step} ns')
    else:
        yield warn(f'{step / 1e6:g} ms: timers fire at ticks only', Remedy(
            ('grep -o "highres=[a-z]*" /proc/cmdline',),
            'boot without highres=off; the kernel needs CONFIG_HIGH_RES_TIMERS=y'), weight=90)


def read_cost(system: System) -> Iterator[Finding]:
    """Measure what reading the clock costs."""
    cost = system.probe('clock')['read_ns']
    text = f'{cost} ns for time.monotonic_ns() (measured)'
    yield (ok(text) if cost <= _SLOW_READ_NS else
           warn(f'{text}: a system call, or a slow CPU', Remedy((), 'see the clock source'),
                weight=20))


def discipline(system: System) -> Iterator[Finding]:
    """Find out which program synchronises the time of day."""
    status = system.probe('clock').get('adjtimex')
    daemon = running(system, *_DAEMONS)
    if status is None:
        yield unknown('adjtimex is refused here')
        return
    synchronised = not status['status'] & _STA_UNSYNC
    error_ms = status['max_error_us'] / 1000
    if synchronised:
        source = f' by {daemon}' if daemon else ' (by which program cannot be seen from here)'
        yield ok(f'synchronised{source}, to {error_ms:.3g} ms at most')
        return
    text = f'{daemon} runs, but has not set it yet' if daemon else 'not synchronised'
    if container(system):
        remedy = Remedy((), 'on the host, not in this container: sudo apt install chrony')
    elif is_wsl(system):
        remedy = Remedy((), 'WSL2 takes it from Windows now and then, and steps it')
    else:
        remedy = Remedy(('chronyc tracking || timedatectl timesync-status',) if daemon
                        else ('sudo apt install chrony',))
    yield warn(text, remedy, weight=15)


CHECKS = (
    Check('clock.source', 'clock source',
          'each reading of a slow source is a system call, and the core reads it at every release',
          source),
    Check('clock.resolution', 'timer resolution',
          'without high-resolution timers nothing happens between two ticks', resolution),
    Check('clock.read_cost', 'reading the clock',
          'the core reads the clock some times in each job', read_cost),
    Check('clock.discipline', 'time of day',
          'stamps of several machines do not fit together (no release depends on it)', discipline),
)
