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

"""What this user may ask of Linux; the two that matter most are really tried, in a child."""

from __future__ import annotations

from collections.abc import Iterator
import os

from rt_robot_os.tools.doctor.facts import CAP_IPC_LOCK
from rt_robot_os.tools.doctor.facts import CAP_SYS_NICE
from rt_robot_os.tools.doctor.facts import container
from rt_robot_os.tools.doctor.facts import core_cpu
from rt_robot_os.tools.doctor.facts import has_capability
from rt_robot_os.tools.doctor.facts import kernel_config
from rt_robot_os.tools.doctor.facts import limit
from rt_robot_os.tools.doctor.facts import own_status
from rt_robot_os.tools.doctor.facts import try_scheduler
from rt_robot_os.tools.doctor.facts import UNLIMITED
from rt_robot_os.tools.doctor.finding import absent
from rt_robot_os.tools.doctor.finding import bad
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import unknown
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.remedies import of_machine
from rt_robot_os.tools.doctor.remedies import realtime_limits
from rt_robot_os.tools.doctor.system import System

# A core with NumPy and the message types maps about 300 MB; MCL_FUTURE counts all of it.
_MAPPED_BYTES = 1 << 30
_SPARE_SIGNALS = 64
_RT_GROUP_FILES = ('/sys/fs/cgroup/cpu', '/sys/fs/cgroup/cpu,cpuacct')


def _rt_group_runtime(system: System) -> tuple[str, int] | None:
    """Return the real-time budget of this cgroup, where the kernel has such budgets (v1 only)."""
    for line in system.read('/proc/self/cgroup').splitlines():
        words = line.split(':', 2)
        if len(words) != 3 or 'cpu' not in words[1].split(','):
            continue
        for mount in _RT_GROUP_FILES:
            for group in (words[2].rstrip('/'), ''):
                path = f'{mount}{group}/cpu.rt_runtime_us'
                text = system.read(path)
                if text.lstrip('-').isdigit():
                    return path, int(text)
    return None


def scheduler(system: System) -> Iterator[Finding]:
    """Try the scheduling class that the core requests."""
    priority = system.wanted.priority
    if not priority:
        yield absent('core.scheduler_priority is 0: the core stays an ordinary process')
        return
    cpu = core_cpu(system)
    answer = try_scheduler(system)
    pinned = '' if cpu is None or not answer['affinity_ok'] else f' on CPU {cpu}'
    if answer['fifo_ok']:
        yield ok(f'SCHED_FIFO {priority}{pinned}: granted (tried)')
        return
    yield _refused(system, priority, answer['fifo_reason'])


def _refused(system: System, priority: int, reason: str) -> Finding:
    text = f'SCHED_FIFO {priority}: {reason}'
    group = _rt_group_runtime(system)
    if group is not None and group[1] == 0:
        return warn(f'{text}, because cpu.rt_runtime_us of this cgroup is 0',
                    Remedy((f'echo 950000 | sudo tee {group[0]}',), 'in each cgroup above, too; '
                           'docker run --cpu-rt-runtime=950000' if container(system) else
                           'in each cgroup above, too'), weight=100)
    allowed = limit(system, 'Max realtime priority')
    if has_capability(system, CAP_SYS_NICE):
        return _refused_all_the_same(system, f'{text} in spite of CAP_SYS_NICE')
    if allowed is not None and allowed >= priority:
        return _refused_all_the_same(system, f'{text} in spite of RLIMIT_RTPRIO {allowed}')
    return warn(f'{text}: RLIMIT_RTPRIO is {"?" if allowed is None else allowed}, '
                'no CAP_SYS_NICE', realtime_limits(system), weight=100)


def _refused_all_the_same(system: System, text: str) -> Finding:
    """Look for what forbids it to a process that has the right."""
    if own_status(system).get('Seccomp', '0') != '0':
        return warn(f'{text}: a seccomp filter forbids it', Remedy(
            (), 'allow sched_setscheduler and sched_setaffinity in the seccomp profile of '
            'whatever started this (docker, systemd, snap)'), weight=100)
    if kernel_config(system).get('CONFIG_RT_GROUP_SCHED') == 'y':
        return warn(f'{text}: real time belongs to groups here (CONFIG_RT_GROUP_SCHED)', Remedy(
            ('echo $$ | sudo tee /sys/fs/cgroup/cgroup.procs',),
            'on the host, moves this shell to the group that has it; from Linux 6.15 on, boot '
            'with rt_group_sched=0'), weight=100)
    return warn(text, Remedy((), 'probably a user namespace (rootless container): start it from '
                             'an ordinary session'), weight=100)


def memory_lock(system: System) -> Iterator[Finding]:
    """Try to lock memory as the core does."""
    if not system.wanted.lock_memory:
        yield absent('core.lock_memory is false')
        return
    answer = try_scheduler(system)
    allowed = limit(system, 'Max locked memory')
    capable = has_capability(system, CAP_IPC_LOCK)
    text = ('unlimited' if allowed == UNLIMITED else '?' if allowed is None
            else f'{allowed >> 20} MB')
    remedy = realtime_limits(system)
    if not answer['lock_ok']:
        yield warn(f'refused: RLIMIT_MEMLOCK is {text}, no CAP_IPC_LOCK'
                   if not capable else f'refused: {answer["lock_reason"]}', remedy, weight=70)
    elif not capable and allowed is not None and allowed < _MAPPED_BYTES:
        yield warn(f'granted to a small process, but RLIMIT_MEMLOCK is only {text}', remedy,
                   weight=70)
    else:
        yield ok('granted (tried): ' + ('CAP_IPC_LOCK' if capable else f'RLIMIT_MEMLOCK {text}'))


def signals(system: System) -> Iterator[Finding]:
    """Look whether a timer and its signals find room."""
    allowed = limit(system, 'Max pending signals')
    used_text = own_status(system).get('SigQ', '').partition('/')[0]
    if allowed is None or not used_text.isdigit():
        yield unknown('/proc/self/limits does not list it')
        return
    used = int(used_text)
    text = f'{used} of {"unlimited" if allowed == UNLIMITED else allowed} in use'
    if allowed - used >= _SPARE_SIGNALS:
        yield ok(text)
        return
    state = bad if allowed <= used else warn
    more = max(4096, 2 * allowed)
    yield state(text, Remedy((), f'start the container with --ulimit sigpending={more}')
                if container(system) else Remedy(
        (f"echo '* - sigpending {more}' |",
         '  sudo tee /etc/security/limits.d/91-sigpending.conf'),
        'then log out of all sessions and in again'), weight=80)


def watchdog(system: System) -> Iterator[Finding]:
    """Look whether the configured watchdog of the machine can be fed."""
    device = system.wanted.watchdog
    if not device:
        yield absent('watchdog.device is not configured')
    elif not system.exists(device):
        yield warn(f'{device} is not there', Remedy(
            ('sudo modprobe softdog',), 'the watchdog of Linux itself, where the machine has '
            'none; in a container: --device ' + device), weight=60)
    elif system.may(device, os.W_OK):
        yield ok(f'{device} can be written')
    else:
        rule = f'KERNEL=="{os.path.basename(device)}", GROUP="realtime", MODE="0660"'
        yield warn(f'{device} cannot be written by this user', of_machine(
            system, f"echo '{rule}' |", '  sudo tee /etc/udev/rules.d/99-watchdog.rules',
            'sudo groupadd -f realtime && sudo udevadm control --reload',
            f'sudo udevadm trigger --name-match={os.path.basename(device)}'), weight=60)


def critical(system: System) -> Iterator[Finding]:
    """Check that a watchdog monitors the tasks that are declared critical."""
    if system.wanted.unwatched:
        yield warn(system.wanted.unwatched, weight=60)
    else:
        yield ok('no critical task is without a watchdog')


CHECKS = (
    Check('limits.scheduler', 'SCHED_FIFO',
          'without it any other program on the CPU can delay the core by milliseconds', scheduler),
    Check('limits.memory_lock', 'locked memory',
          'a page that was swapped out or is not yet there costs the core milliseconds',
          memory_lock),
    Check('limits.signals', 'pending signals',
          "the kernel's timer needs one entry of the user's signal queue", signals),
    Check('limits.critical', 'critical tasks',
          'without a watchdog nothing ends a job that blocks a critical task', critical),
    Check('limits.watchdog', 'watchdog',
          'a machine that hangs is restarted only by a watchdog that a program feeds', watchdog),
)
