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

"""
Chains of jobs in a dump: each job released the next, from one task to another.

A job was released by the job that had the CPU at that moment, if that one published something at
the same time: there is one CPU, and publications release tasks immediately. So the dump alone
shows the path of an alarm through a robot, without its configuration.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from rt_robot_os.base.errors import BlackBoxError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel.black_box import PUBLISH
from rt_robot_os.tools.black_box.history import History
from rt_robot_os.tools.black_box.history import Job
from rt_robot_os.tools.black_box.history import Outcome
from rt_robot_os.tools.black_box.text_report import duration

# A longer path is a cycle of tasks that release each other.
_MOST_STAGES: Final = 64
# Largest time between the record of a publication and the releases that it causes.
_NOTED_NS: Final = 5 * NS_PER_US


@dataclass(frozen=True)
class Chain:
    """
    Jobs, each of which released the next.

    :ivar jobs: in order.
    """

    jobs: tuple[Job, ...]

    @property
    def length_ns(self) -> int:
        """Return the time from the release of the first job to the end of the last."""
        return self.jobs[-1].end_ns - self.jobs[0].release_ns


def find_chains(history: History, names: Sequence[str]) -> tuple[Chain, ...]:
    """
    Find all chains from one task to another, in order of time.

    :param names: of the tasks on the path, two or more; others may be between them. The name of
        a device stands for any of its tasks.
    :raises BlackBoxError: a task is not in the dump.
    """
    for name in names:
        if not _tasks(history, name):
            known = ', '.join(task.name for task in history.tasks)
            raise BlackBoxError(f'there is no task {name!r} in this dump: there are {known}')
    firsts, lasts = _tasks(history, names[0]), _tasks(history, names[-1])
    between = [_tasks(history, name) for name in names[1:-1]]
    parents = _parents(history)
    found = []
    for job in history.jobs:
        if job.task in lasts and job.outcome is not Outcome.RUNNING:
            path = _path_to(job, firsts, parents)
            if path and _passes([each.task for each in path], between):
                found.append(Chain(tuple(path)))
    return tuple(found)


def chain_text(history: History, names: Sequence[str], last: int = 3) -> str:
    """
    Format the chains from one task to another: a summary, the longest, and the last ones.

    :param last: number of the last ones.
    :raises BlackBoxError: a task is not in the dump, or there is no such chain in it.
    """
    found = find_chains(history, names)
    if not found:
        raise BlackBoxError(f'no job of {names[-1]!r} in this dump was caused by one of '
                            f'{names[0]!r}' + (f' through {", ".join(names[1:-1])}'
                                               if names[2:] else ''))
    lengths = sorted(chain.length_ns for chain in found)
    lines = [f'{len(found)} chain{"s" if len(found) > 1 else ""} from {names[0]} to {names[-1]}: '
             f'{duration(lengths[0])} at least, {duration(lengths[len(lengths) // 2])} in the '
             f'middle, {duration(lengths[-1])} at most']
    longest = max(found, key=lambda chain: chain.length_ns)
    shown = [chain for chain in found[len(found) - last:] if chain is not longest] if last else []
    for title, chain in (('the longest', longest), *(('then', each) for each in shown)):
        lines += ['', *_lines(history, title, chain)]
    return '\n'.join(lines) + '\n'


def _lines(history: History, title: str, chain: Chain) -> list[str]:
    begin_ns = chain.jobs[0].release_ns
    names = [history.tasks[job.task].name for job in chain.jobs]
    width = max(map(len, names))
    lines = [f'{title}, {(begin_ns - history.to_ns) / NS_PER_MS:.3f} ms, '
             f'{duration(chain.length_ns)}:']
    for name, job in zip(names, chain.jobs):
        waits = ''.join(f', behind {history.tasks[task].name} {duration(time_ns)}'
                        for task, time_ns in history.who_ran(
                            job.release_ns, job.start_ns).most_common(2)
                        if time_ns > 0 and task != job.task and duration(time_ns) != '0 us')
        lines.append(
            f'  {(job.release_ns - begin_ns) / NS_PER_MS:9.3f} ms  {name:{width}}  starts after '
            f'{duration(job.latency_ns):>7}{waits}; ends at '
            f'{(job.end_ns - begin_ns) / NS_PER_MS:.3f} ms')
    return lines


def _tasks(history: History, name: str) -> frozenset[int]:
    wanted = (name, f'{name}/arrival')
    return frozenset(index for index, task in enumerate(history.tasks) if task.name in wanted)


def _parents(history: History) -> Mapping[int, Job]:
    """Return the job that released each job, by identity; without jobs released by timers."""
    runs = sorted((start_ns, end_ns, number) for number, job in enumerate(history.jobs)
                  for start_ns, end_ns in job.slices)
    starts = [run[0] for run in runs]
    published: dict[int, list[int]] = {}
    for moment in history.moments:
        if moment.kind == PUBLISH:
            published.setdefault(moment.task, []).append(moment.at_ns)
    found = {}
    for job in history.jobs:
        at = bisect_right(starts, job.release_ns) - 1
        if at >= 0 and history.jobs[runs[at][2]] is job:
            at -= 1  # it started immediately
        if at < 0 or runs[at][1] < job.release_ns:
            continue  # no job was running
        parent = history.jobs[runs[at][2]]
        times = published.get(parent.task, [])
        last = bisect_right(times, job.release_ns + _NOTED_NS) - 1
        if last >= 0 and times[last] >= job.release_ns - _NOTED_NS:
            found[id(job)] = parent
    return found


def _path_to(job: Job, firsts: frozenset[int], parents: Mapping[int, Job]) -> list[Job]:
    """Return the path to a job from the nearest of some tasks; empty when there is none."""
    path = [job]
    while len(path) < _MOST_STAGES:
        parent = parents.get(id(path[0]))
        if parent is None:
            return []
        path.insert(0, parent)
        if parent.task in firsts:
            return path
    return []


def _passes(tasks: Sequence[int], between: Sequence[frozenset[int]]) -> bool:
    left = iter(tasks)
    return all(any(task in wanted for task in left) for wanted in between)
