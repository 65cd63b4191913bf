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

"""Memory and disk."""

from __future__ import annotations

from collections.abc import Iterator
import os
import re
import shlex

from rt_robot_os.tools.doctor.facts import key_values
from rt_robot_os.tools.doctor.facts import try_scheduler
from rt_robot_os.tools.doctor.finding import absent
from rt_robot_os.tools.doctor.finding import bad
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import unknown
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.remedies import at_each_boot
from rt_robot_os.tools.doctor.remedies import of_machine
from rt_robot_os.tools.doctor.system import System

# Node, core and simulator take about 250 MB together.
_NEEDED_MB = 256
_DISK_WARN_MB = 1024
_DISK_BAD_MB = 16
_HUGE = '/sys/kernel/mm/transparent_hugepage/enabled'


def _megabytes(values: dict[str, str], key: str) -> int | None:
    match = re.match(r'(\d+) kB', values.get(key, ''))
    return int(match[1]) // 1024 if match else None


def free(system: System) -> Iterator[Finding]:
    """Look how much memory is left."""
    values = key_values(system.text('/proc/meminfo'))
    available, total = _megabytes(values, 'MemAvailable'), _megabytes(values, 'MemTotal')
    if available is None:
        yield unknown('/proc/meminfo has no MemAvailable')
    elif available < _NEEDED_MB:
        yield warn(f'{available} of {total} MB available', Remedy(
            ('ps -eo pid,rss,comm --sort=-rss | head',), 'end what takes most'), weight=70)
    else:
        yield ok(f'{available} of {total} MB available')


def swap(system: System) -> Iterator[Finding]:
    """Look whether memory is swapped out."""
    values = key_values(system.text('/proc/meminfo'))
    total, left = _megabytes(values, 'SwapTotal'), _megabytes(values, 'SwapFree')
    if total is None or left is None:
        yield unknown('/proc/meminfo has no SwapTotal')
        return
    if not total:
        yield ok('there is none')
        return
    text = f'{total - left} of {total} MB in use'
    locked = system.wanted.lock_memory and try_scheduler(system)['lock_ok']
    if locked:
        yield ok(f'{text}; the core locks its memory')
    else:
        yield warn(f'{text}, and the core cannot lock its memory', of_machine(
            system, 'sudo swapoff -a', note='until the next boot'), weight=40)


def huge_pages(system: System) -> Iterator[Finding]:
    """Look whether Linux makes huge pages unasked."""
    match = re.search(r'\[(\w+)\]', system.text(_HUGE))
    if not match:
        yield unknown(f'{_HUGE} does not tell')
    elif match[1] == 'always':
        yield warn('always', at_each_boot(system, _HUGE, 'madvise', 'hugepages'), weight=25)
    else:
        yield ok(match[1])


def overcommit(system: System) -> Iterator[Finding]:
    """Look whether Linux counts address space as memory."""
    mode = system.text('/proc/sys/vm/overcommit_memory')
    if mode == '2':
        yield warn('never (2): each address space counts in full', of_machine(
            system, "echo 'vm.overcommit_memory = 0' |",
            '  sudo tee /etc/sysctl.d/60-overcommit.conf && sudo sysctl --system'), weight=20)
    else:
        yield ok({'0': 'heuristic (0)', '1': 'always (1)'}.get(mode, mode))


def _log_folder(system: System) -> str:
    environ = system.environ
    if environ.get('ROS_LOG_DIR'):
        return os.path.expanduser(environ['ROS_LOG_DIR'])
    home = environ.get('ROS_HOME') or os.path.join(environ.get('HOME', ''), '.ros')
    return os.path.join(home, 'log')


def disk(system: System) -> Iterator[Finding]:
    """Look whether the folders of the logs and of the black box can be written and have room."""
    folders = [_log_folder(system), *filter(None, (system.wanted.black_box_folder,))]
    for folder in dict.fromkeys(folders):
        if folder.startswith('/'):
            yield _room(system, folder)
        else:
            yield unknown('neither ROS_LOG_DIR, ROS_HOME nor HOME is set')


def _nearest(system: System, folder: str) -> str:
    """Return the folder, or that above it which is there."""
    while folder != '/' and not system.exists(folder):
        folder = os.path.dirname(folder)
    return folder


def _room(system: System, folder: str) -> Finding:
    nearest = _nearest(system, folder)
    elsewhere = Remedy(('export ROS_LOG_DIR=/tmp/ros_log',), 'or any folder of your own')
    if not system.may(nearest, os.W_OK):
        return bad(f'{folder} cannot be written or made', elsewhere, subject=folder, weight=90)
    megabytes = system.free_bytes(nearest) >> 20
    text = f'{megabytes} MB free for {folder}'
    if megabytes >= _DISK_WARN_MB:
        return ok(text, subject=folder)
    quoted = shlex.quote(folder)
    state = bad if megabytes < _DISK_BAD_MB else warn
    return state(text, Remedy((f'du -sh {quoted} && ls -t {quoted} | tail',
                               'export ROS_LOG_DIR=/mnt/larger/ros_log'),
                              'delete old logs, or write them elsewhere'), subject=folder,
                 weight=50)


def journal(system: System) -> Iterator[Finding]:
    """Look whether journals of alarms can be written, and can keep room for a full disk."""
    if not system.wanted.journals:
        yield absent('no journal of alarms is configured')
    for folder, size_bytes in system.wanted.journals:
        yield _journal(system, folder, size_bytes)


def _journal(system: System, folder: str, size_bytes: int) -> Finding:
    nearest = _nearest(system, folder)
    elsewhere = Remedy((), 'make it writable for this user, or name another folder with the key '
                       'port of the journal')
    if not system.may(nearest, os.W_OK):
        return bad(f'{folder} cannot be written or made', elsewhere, subject=folder, weight=90)
    room = system.probe('room', nearest, size_bytes)
    text = f'{size_bytes >> 10} KiB'
    if not room['tried']:
        return unknown(f'{folder}: no file can be tried there: {room["reason"]}', subject=folder)
    if room['full']:
        return bad(f'no {text} are free for {folder}', Remedy(
            (f'df -h {shlex.quote(nearest)}',), 'make room on that disk'), subject=folder,
            weight=80)
    if room['reason']:
        return warn(f'the file system of {folder} cannot keep room free: {room["reason"]}', Remedy(
            (), 'name a folder on ext4, xfs or btrfs with the key port of the journal'),
            subject=folder, weight=30)
    return ok(f'{text} can be kept free for {folder}', subject=folder)


def shared(system: System) -> Iterator[Finding]:
    """Look whether there is room for the shared memory of DDS."""
    if not system.exists('/dev/shm'):
        yield absent('there is no /dev/shm')
        return
    megabytes = system.free_bytes('/dev/shm') >> 20
    if megabytes >= 16:
        yield ok(f'{megabytes} MB free in /dev/shm')
    else:
        yield warn(f'{megabytes} MB free in /dev/shm', Remedy(
            ('ls -lS /dev/shm | head',), 'delete what no program uses; in a container: '
            '--shm-size=256m or --ipc=host'), weight=30)


CHECKS = (
    Check('memory.free', 'free memory',
          'when memory runs out Linux stops all programs while it searches for more', free),
    Check('memory.swap', 'swap', 'a page that was swapped out takes milliseconds to come back',
          swap),
    Check('memory.huge_pages', 'huge pages',
          'making a huge page stops the process while two megabytes are cleared or copied',
          huge_pages),
    Check('memory.overcommit', 'overcommit',
          'a core that maps more than it uses is refused memory', overcommit),
    Check('memory.disk', 'log folder', 'the node does not start without a place for its log',
          disk),
    Check('memory.journal', 'journal of alarms',
          'alarms that cannot be stored are forgotten by a crash', journal),
    Check('memory.shared', 'shared memory', 'Fast DDS sends to the same machine through it',
          shared),
)
