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
Which job had the CPU when: slices of one CPU from the starts and ends of jobs.

There is one stack, so a job whose start and end lie inside another's preempted it. What is left
of a job when those inside it are cut out are the slices in which it ran itself. The kernel's own
time between two jobs counts to the job below them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

Slices = list[list[tuple[int, int]]]


class Span(NamedTuple):
    """When a job began and ended."""

    start_ns: int
    end_ns: int


def slices(spans: Sequence[Span], from_ns: int | None = None) -> tuple[Slices, list[int]]:
    """
    Cut jobs into the slices in which they had the CPU.

    Slices never overlap, whatever the jobs are; when they are nested, nothing is lost either. A
    job of no length has no slice.

    :param spans: in the order of their ends.
    :param from_ns: slices before it are left out, since it is not known what ran then.
    :return: the slices of each job in order of time, and how many jobs lay preempted below it.
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

    # Of those that began together the one that ended last is the outer one.
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
