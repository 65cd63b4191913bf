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

"""The targets of all cases with their verdicts, and why those that were missed were missed."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence

from rt_robot_os.tools.bench.blocks import Block
from rt_robot_os.tools.bench.blocks import Bullets
from rt_robot_os.tools.bench.blocks import Heading
from rt_robot_os.tools.bench.blocks import Paragraph
from rt_robot_os.tools.bench.blocks import TableBlock
from rt_robot_os.tools.bench.machine_state import NOTHING
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Target
from rt_robot_os.tools.bench.result import TargetVerdict
from rt_robot_os.tools.bench.text_report import spread
from rt_robot_os.tools.bench.text_report import target_cells
from rt_robot_os.tools.bench.text_report import verdict_line

_KINDS = {TargetVerdict.REACHED: 'reached', TargetVerdict.MISSED: 'missed',
          TargetVerdict.UNKNOWN: 'absent'}


def verdicts(results: Sequence[CaseResult]) -> Iterator[Block]:
    """Show every target, missed ones as clearly as those that were reached."""
    targets = [(result.name, target) for result in results for target in result.targets]
    if not targets:
        return
    yield Heading('Targets and verdicts', 2)
    yield Paragraph(
        'A target is a limit that rt_robot_os set itself before it was measured. What a machine, '
        'or the host of a virtual one, decides is judged as a ratio to a floor of the same run: a '
        'bare loop, a plain loop of calls, a bare signal handler. The verdict goes '
        'by the median of the repeats; where the range reaches over the limit, another run may '
        'say otherwise. Not measured: something that it needs is not there, or there are too few '
        'samples for it, of which a longer run has more. "a / b" is a ratio of two figures of '
        'this run, and has no unit. Paper: what the publication reports for the same. '
        + verdict_line(results).capitalize() + '.')
    rows = [_row(name, target) for name, target in targets]
    headings: tuple[str, ...] = (
        'target', 'case', 'limit', 'measured', 'range', 'paper', 'verdict')
    if not any(row[4] for row in rows):  # there was one repeat
        headings, rows = headings[:4] + headings[5:], [row[:4] + row[5:] for row in rows]
    yield TableBlock(headings, rows, [_KINDS[target.verdict] for _, target in targets], 2)
    yield from _missed(targets)


def _row(name: str, target: Target) -> tuple[str, ...]:
    limit, measured = target_cells(target)
    return (target.text, name, limit, measured, spread(target.measured), target.paper or '-',
            target.verdict.value)


def _missed(targets: Sequence[tuple[str, Target]]) -> Iterator[Block]:
    reasons: dict[str, list[str]] = {}
    for name, target in targets:
        if target.reason:
            limit, measured = target_cells(target)
            reasons.setdefault(target.reason, []).append(
                f'{target.text} (case {name}): {measured}, the target is {limit}')
    if not reasons:
        return
    yield Heading('Why targets were missed, as far as the samples show', 4)
    # What is not explained comes last.
    for reason in sorted(reasons, key=lambda one: one == NOTHING):
        yield Paragraph(f'{reason[0].upper()}{reason[1:]}:')
        yield Bullets(reasons[reason])
