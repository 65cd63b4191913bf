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

"""What earlier runs left behind, and what still runs."""

from __future__ import annotations

from collections.abc import Iterator
import os
import re
import shlex

from rt_robot_os.linux.folders import runtime_path
from rt_robot_os.tools.doctor.facts import Process
from rt_robot_os.tools.doctor.facts import processes
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import unknown
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.system import System

_MODULES = {'rt_robot_os.recording.record_program': 'record',
            'rt_robot_os.recording.replay_program': 'replay',
            'rt_robot_os.ros.program': 'robot',
            'rt_robot_os.core.program': 'core',
            'rt_robot_os.core.simulator_process': 'simulator',
            'rt_robot_os.sim.player_program': 'player',
            'rt_robot_os.core.simulator_program': 'simulator',
            'rt_robot_os.tools.bench.child': 'bench',
            'rt_robot_os.tools.bench.program': 'bench',
            'rt_robot_os.tools.doctor.wakeup_child': 'doctor'}
_PROGRAM = re.compile(r'/rt_robot_os/(core|robot|simulator|player|bench|record|replay|monitor)$')
_SHOWN = 4
# So many files of Fast DDS belong to some thirty participants.
_SHARED_FILES = 200


def _role(process: Process) -> str:
    """Return which of our programs a process is; empty for none."""
    for word in process.arguments[:6]:
        match = _PROGRAM.search(word)
        if word in _MODULES or match:
            return _MODULES.get(word) or (match[1] if match else '')
    return ''


def programs(system: System) -> Iterator[Finding]:
    """Look for programs of this package that run."""
    found = [(role, process.pid) for process in processes(system) if (role := _role(process))]
    if not found:
        yield ok('none')
        return
    text = ', '.join(f'{role} (pid {pid})' for role, pid in found[:_SHOWN])
    more = f' and {len(found) - _SHOWN} more' if len(found) > _SHOWN else ''
    yield warn(f'{text}{more}', Remedy(
        (f'kill {" ".join(str(pid) for _, pid in found)}',), 'unless they are meant to run'),
        weight=30)


def _alive(system: System) -> set[str]:
    """Return the paths of all Unix sockets that a process has open."""
    return {words[7] for line in system.text('/proc/net/unix').splitlines()[1:]
            if len(words := line.split(maxsplit=7)) == 8}


def sockets(system: System) -> Iterator[Finding]:
    """Look for sockets and simulated ports of cores that are gone."""
    folder = str(runtime_path(system.environ, system.uid))
    if not system.exists(folder):
        yield ok(f'none ({folder} is not there)')
        return
    if not system.may(folder, os.R_OK):
        yield unknown(f'{folder} cannot be read by this user')
        return
    alive = _alive(system)
    names = system.names(folder)
    live = [name for name in names if f'{folder}/{name}' in alive]
    ports = {name.removesuffix('.sock') for name in live}
    dead = [name for name in names if name.endswith('.sock') and name not in live]
    dead += [name for name in names if '.' not in name and name not in ports
             and system.names(f'{folder}/{name}')]
    if dead:
        text = ', '.join(dead[:_SHOWN]) + (' ...' if len(dead) > _SHOWN else '')
        yield warn(f'of cores that are gone, in {folder}: {text}', Remedy(
            tuple(f'rm -r {shlex.quote(f"{folder}/{name}")}' for name in dead[:_SHOWN]),
            'a core that starts removes its own'), weight=5)
    else:
        yield ok(f'{len(live)} in use' if live else f'none in {folder}')


def shared_memory(system: System) -> Iterator[Finding]:
    """Count the files that Fast DDS has in shared memory."""
    files = [name for name in system.names('/dev/shm') if 'fastrtps' in name or 'fastdds' in name]
    if len(files) > _SHARED_FILES:
        yield warn(f'{len(files)} of Fast DDS in /dev/shm', Remedy(
            ('fastdds shm clean',), 'removes those that no process uses; without that tool, stop '
            'all of ROS, then: rm -f /dev/shm/*fastrtps* /dev/shm/*fastdds*'), weight=10)
    else:
        yield ok(f'{len(files)} of Fast DDS in /dev/shm')


CHECKS = (
    Check('leftovers.programs', 'leftover programs',
          'a second core on the same CPU disturbs the first, and this measurement', programs),
    Check('leftovers.sockets', 'sockets',
          'a client that finds a dead socket waits in vain', sockets),
    Check('leftovers.shared_memory', 'memory files',
          'nodes that were killed leave theirs, and memory fills up', shared_memory),
)
