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

"""What else runs now: load, and other real-time tasks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import PurePath

from rt_robot_os.tools.doctor.facts import core_cpu
from rt_robot_os.tools.doctor.facts import cpu_list
from rt_robot_os.tools.doctor.facts import key_values
from rt_robot_os.tools.doctor.facts import online_cpus
from rt_robot_os.tools.doctor.finding import absent
from rt_robot_os.tools.doctor.finding import Check
from rt_robot_os.tools.doctor.finding import Finding
from rt_robot_os.tools.doctor.finding import ok
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import warn
from rt_robot_os.tools.doctor.system import System

_POLICIES = {1: 'FIFO', 2: 'RR', 6: 'DEADLINE'}
_PF_KTHREAD = 0x00200000
_SHOWN = 3
_CORE_MODULE = 'rt_robot_os.core.program'


def average(system: System) -> Iterator[Finding]:
    """Compare the load with the number of CPUs."""
    words = system.text('/proc/loadavg').split()
    load, cpus = float(words[0]), max(1, len(online_cpus(system)))
    text = f'{words[0]} in the last minute, {cpus} CPU{"s" if cpus > 1 else ""}'
    if load > cpus:
        yield warn(text, Remedy(('top -b -n 1 | head -15',), 'end what is not needed; what runs '
                                'under SCHED_FIFO does not wait for it'), weight=25)
    else:
        yield ok(text)


@dataclass(frozen=True)
class _Task:
    pid: int
    name: str
    policy: str
    priority: int
    robot: str | None


def _tasks(system: System) -> Iterator[_Task]:
    """Yield the real-time threads of programs, not those of the kernel itself."""
    own = system.own_pids
    for pid in system.names('/proc'):
        if not pid.isdigit() or int(pid) in own:
            continue
        for thread in system.names(f'/proc/{pid}/task'):
            line = system.read(f'/proc/{pid}/task/{thread}/stat')
            name = line[line.find('(') + 1:line.rfind(')')]
            fields = line[line.rfind(')') + 1:].split()
            if len(fields) < 39 or int(fields[6]) & _PF_KTHREAD:
                continue
            policy = _POLICIES.get(int(fields[38]))
            if policy:
                yield _Task(int(thread), name, policy, int(fields[37]), _robot(system, pid))


def _robot(system: System, pid: str) -> str | None:
    """Return the name of the robot whose core a process is; empty when it is not stated."""
    words = system.read(f'/proc/{pid}/cmdline').split('\0')
    program = [PurePath(word) for word in words[:3]]
    if _CORE_MODULE not in words[:4] and not any(
            word.name == 'core' and 'rt_robot_os' in word.parts for word in program):
        return None
    for word, following in zip(words, words[1:]):
        if word == '--socket':
            return PurePath(following).stem
    return ''


def rivals(system: System) -> Iterator[Finding]:
    """Look for tasks that the core would have to wait for."""
    wanted, chosen = system.wanted.priority, core_cpu(system)
    if not wanted:
        yield absent('the core would be an ordinary process')
        return
    rivals = []
    others = 0
    for task in _tasks(system):
        status = key_values(system.read(f'/proc/{task.pid}/status'))
        cpus = cpu_list(status.get('Cpus_allowed_list', ''))
        above = task.policy == 'DEADLINE' or task.priority >= wanted
        if above and (chosen is None or not cpus or chosen in cpus):
            rivals.append(task)
        else:
            others += 1
    cores = {task.pid: task.robot for task in rivals if task.robot is not None}
    if len(cores) == 1:  # this robot runs: it does not wait for itself
        rivals = [task for task in rivals if task.robot is None]
    if not rivals:
        notes = [f'{others} below it or on other CPUs'] if others else []
        notes += [f'the core of {name or "this robot"} runs, pid {pid}'
                  for pid, name in cores.items()]
        yield ok('none at or above the core' + (f' ({"; ".join(notes)})' if notes else ''))
        return
    if 1 < len(cores) == len(rivals):
        yield _cores_together(system, rivals, chosen)
        return
    text = ', '.join(f'{task.name} ({task.policy} {task.priority}, pid {task.pid})'
                     for task in rivals[:_SHOWN])
    more = f' and {len(rivals) - _SHOWN} more' if len(rivals) > _SHOWN else ''
    below = max(1, wanted - 10)
    movable = [task for task in rivals if task.policy != 'DEADLINE']
    yield warn(f'at or above {wanted}: {text}{more}', Remedy(
        tuple(f'sudo chrt --fifo --pid {below} {task.pid}' for task in movable[:_SHOWN]),
        'or keep them off the CPU of the core: sudo taskset -cp 0 PID'), weight=60)


def _cores_together(system: System, cores: list[_Task], chosen: int | None) -> Finding:
    """Say that several robots share a CPU."""
    text = ', '.join(f'{task.robot or "a robot"} (pid {task.pid})' for task in cores[:_SHOWN])
    more = f' and {len(cores) - _SHOWN} more' if len(cores) > _SHOWN else ''
    free = [cpu for cpu in online_cpus(system) if cpu != chosen]
    where = f'CPU {chosen}' if chosen is not None else 'the same CPUs'
    return warn(f'{len(cores)} robots have their cores on {where}: {text}{more}', Remedy(
        (f'ros2 run rt_robot_os robot --ros-args -p core.cpu:={free[-1]}',) if free else (),
        'each robot a CPU of its own' if free else 'a machine with more CPUs'), weight=60)


CHECKS = (
    Check('load.average', 'load', 'other programs evict the caches of the core', average),
    Check('load.rivals', 'real-time tasks',
          'the core waits for every task of its own priority or a higher one', rivals),
)
