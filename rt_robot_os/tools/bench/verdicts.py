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

"""The aims of all cases with their verdicts, and why those that were missed were missed."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence

from rt_robot_os.tools.bench.blocks import Block
from rt_robot_os.tools.bench.blocks import Bullets
from rt_robot_os.tools.bench.blocks import Grid
from rt_robot_os.tools.bench.blocks import Heading
from rt_robot_os.tools.bench.blocks import Paragraph
from rt_robot_os.tools.bench.result import Aim
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Verdict
from rt_robot_os.tools.bench.surroundings import NOTHING
from rt_robot_os.tools.bench.text_report import aim_cells
from rt_robot_os.tools.bench.text_report import spread
from rt_robot_os.tools.bench.text_report import verdict_line

_KINDS = {Verdict.REACHED: 'reached', Verdict.MISSED: 'missed', Verdict.UNKNOWN: 'absent'}


def verdicts(results: Sequence[CaseResult]) -> Iterator[Block]:
    """Show every aim, missed ones as clearly as those that were reached."""
    aims = [(result.name, aim) for result in results for aim in result.aims]
    if not aims:
        return
    yield Heading('Aims and verdicts', 2)
    yield Paragraph(
        'An aim is a limit that rt_robot_os set itself before it was measured. What a machine, or '
        'the host of a virtual one, decides is judged as a ratio to a floor of the same run: a '
        'bare loop, a plain loop of calls, a bare signal handler. The verdict goes '
        'by the median of the repeats; where the range reaches over the limit, another run may '
        'say otherwise. Not measured: something that it needs is not there, or there are too few '
        'samples for it, of which a longer run has more. "a / b" is a ratio of two figures of '
        'this run, and has no unit. Paper: what the publication reports for the same. '
        + verdict_line(results).capitalize() + '.')
    rows = [_row(name, aim) for name, aim in aims]
    headings: tuple[str, ...] = ('aim', 'case', 'limit', 'measured', 'range', 'paper', 'verdict')
    if not any(row[4] for row in rows):  # there was one repeat
        headings, rows = headings[:4] + headings[5:], [row[:4] + row[5:] for row in rows]
    yield Grid(headings, rows, [_KINDS[aim.verdict] for _, aim in aims], 2)
    yield from _missed(aims)


def _row(name: str, aim: Aim) -> tuple[str, ...]:
    limit, measured = aim_cells(aim)
    return (aim.text, name, limit, measured, spread(aim.measured), aim.paper or '-',
            aim.verdict.value)


def _missed(aims: Sequence[tuple[str, Aim]]) -> Iterator[Block]:
    reasons: dict[str, list[str]] = {}
    for name, aim in aims:
        if aim.reason:
            limit, measured = aim_cells(aim)
            reasons.setdefault(aim.reason, []).append(
                f'{aim.text} (case {name}): {measured}, the aim is {limit}')
    if not reasons:
        return
    yield Heading('Why aims were missed, as far as the samples tell', 4)
    # What is not explained comes last.
    for reason in sorted(reasons, key=lambda one: one == NOTHING):
        yield Paragraph(f'{reason[0].upper()}{reason[1:]}:')
        yield Bullets(reasons[reason])
