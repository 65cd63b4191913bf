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


"""Count a job that has ended: how long it took, waited, and how regularly it began."""

from __future__ import annotations

from rt_robot_os.kernel.consequences import Consequences
from rt_robot_os.kernel.task import CARRY
from rt_robot_os.kernel.task import EXECUTION
from rt_robot_os.kernel.task import JITTER
from rt_robot_os.kernel.task import KINDS
from rt_robot_os.kernel.task import Task


def count(task: Task, release_ns: int, start_ns: int, previous_ns: int, end_ns: int,
          stolen_ns: int, consequences: Consequences) -> None:
    """
    Count it; called locked.

    A call for each histogram would cost as much again: the arithmetic is that of
    :func:`rt_robot_os.kernel.histogram.bucket`, written out.

    :param previous_ns: when the job before it began; -1 without one.
    :param stolen_ns: how much of its time others computed.
    :param consequences: what is asked where a time is longer than any so far.
    """
    counts = task.counts
    execution_ns = end_ns - start_ns - stolen_ns
    task.runs += 1
    task.execution_total_ns += execution_ns
    if execution_ns > task.execution_limit_ns:
        execution_ns = consequences.long_execution(task, execution_ns)
    shift = execution_ns.bit_length() - 4
    place = KINDS * (
        execution_ns if shift <= 0 else (shift << 3) + (execution_ns >> shift)) + EXECUTION
    number = counts[place] + 1
    counts[place] = number
    if number == CARRY:
        task.carry(place)
    latency_ns = start_ns - release_ns
    shift = latency_ns.bit_length() - 4
    place = KINDS * (latency_ns if shift <= 0 else (shift << 3) + (latency_ns >> shift))
    number = counts[place] + 1
    counts[place] = number
    if number == CARRY:
        task.carry(place)
    if latency_ns > task.latency_maximum_ns:
        task.latency_maximum_ns = latency_ns
    if end_ns - release_ns > task.response_limit_ns:
        consequences.long_response(task, release_ns, end_ns)
    if previous_ns >= 0:
        jitter_ns = start_ns - previous_ns
        if jitter_ns > task.gap_maximum_ns:
            task.gap_maximum_ns = jitter_ns
        if task.period_ns:
            jitter_ns -= task.interval_ns
            if jitter_ns < 0:
                jitter_ns = -jitter_ns
            shift = jitter_ns.bit_length() - 4
            place = KINDS * (
                jitter_ns if shift <= 0 else (shift << 3) + (jitter_ns >> shift)) + JITTER
            number = counts[place] + 1
            counts[place] = number
            if number == CARRY:
                task.carry(place)
            if jitter_ns > task.jitter_maximum_ns:
                task.jitter_maximum_ns = jitter_ns
