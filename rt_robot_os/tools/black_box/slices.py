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
The slices in which each job had the CPU, from the starts and ends of jobs on one CPU.

There is one stack, so a job whose start and end are inside another job preempted it. The slices of
a job are its interval without the intervals of the jobs inside it. The kernel's own time between
two jobs is attributed to the job below them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

Slices = list[list[tuple[int, int]]]


class Span(NamedTuple):
    """The start and end of a job."""

    start_ns: int
    end_ns: int


def slices(spans: Sequence[Span], from_ns: int | None = None) -> tuple[Slices, list[int]]:
    """
    Divide jobs into the slices in which they had the CPU.

    Slices never overlap. If the jobs are properly nested, the slices cover all of their time.
    A job without a duration has no slice.

    :param spans: in order of their ends.
    :param from_ns: slices before it are omitted, because the records before it are incomplete.
    :return: the slices of each job in order of time, and the number of preempted jobs below it.
    """
    found: Slices = [[] for _ in spans]
    depths = [0] * len(spans)
    stack: list[int] = []
    cursor_ns = min((span.start_ns for span in spans), default=0)
    if from_ns is not None:
        cursor_ns = max(cursor_ns, from_ns)

    def run(index: int, until_ns: int) -> None:
        nonlocal cursor_ns
        if until_ns > cursor_ns:
            found[index].append((cursor_ns, until_ns))
            cursor_ns = until_ns

    # Of jobs that started at the same time, the one that ended last is the outer one.
    for index in sorted(range(len(spans)), key=lambda i: (spans[i].start_ns, -i)):
        start_ns = spans[index].start_ns
        while stack and spans[stack[-1]].end_ns <= start_ns:
            ended = stack.pop()
            run(ended, spans[ended].end_ns)
        if stack:
            run(stack[-1], start_ns)
        cursor_ns = max(cursor_ns, start_ns)
        depths[index] = len(stack)
        stack.append(index)
    while stack:
        index = stack.pop()
        run(index, spans[index].end_ns)
    return found, depths
