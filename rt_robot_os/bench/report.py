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

"""The whole report of one call as blocks: needs, verdicts, machine, method, cases."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any

from rt_robot_os.bench import drawing
from rt_robot_os.bench.blocks import Block
from rt_robot_os.bench.blocks import Bullets
from rt_robot_os.bench.blocks import Code
from rt_robot_os.bench.blocks import Grid
from rt_robot_os.bench.blocks import Heading
from rt_robot_os.bench.blocks import Paragraph
from rt_robot_os.bench.blocks import Picture
from rt_robot_os.bench.machine import summary
from rt_robot_os.bench.machine import warnings
from rt_robot_os.bench.method import method
from rt_robot_os.bench.method import PEERS
from rt_robot_os.bench.result import Aim
from rt_robot_os.bench.result import CaseResult
from rt_robot_os.bench.result import Metric
from rt_robot_os.bench.result import Need
from rt_robot_os.bench.result import Row
from rt_robot_os.bench.result import Status
from rt_robot_os.bench.result import Table
from rt_robot_os.bench.result import Verdict
from rt_robot_os.bench.text import number
from rt_robot_os.bench.text import SYSTEMS

OURS = 'rt_robot_os'
BEYOND = (
    'Services, actions, tf2, parameters of other nodes, anything without a deadline: rclpy. The '
    'node of this package is an rclpy node, and mirrors what the core publishes.',
    'Below 10 us, or without Python: C or C++ under PREEMPT_RT, or a microcontroller; the rows '
    'clock_nanosleep and cyclictest say what this machine gives to any program.',
    'Long native calls (large NumPy operations, JSON, images): another process, or another '
    'thread of it. No system here preempts them; the case preemption shows it.')
_KINDS = {Verdict.REACHED: 'reached', Verdict.MISSED: 'missed', Verdict.UNKNOWN: 'absent'}


def report(content: Mapping[str, Any], results: Sequence[CaseResult]) -> Iterator[Block]:
    """
    Put the report together.

    :param content: from :func:`rt_robot_os.bench.document.document`.
    """
    yield Heading('Benchmarks of rt_robot_os', 1)
    yield Paragraph(f'Measured from {_moment(content["started"])} to {_moment(content["ended"])} '
                    'UTC, all systems in turns on one machine.'
                    + (' Interrupted: cases are missing.' if content['interrupted'] else ''))
    yield Bullets([*summary(content['machine']), *warnings(content['machine'])])
    yield from _needs(results)
    yield from _verdicts(results)
    yield Heading('Cases', 2)
    if not drawing.available():
        yield Paragraph(drawing.REMEDY + '; then `bench --page FOLDER` draws them.')
    for result in results:
        yield from _case(result)
    yield Heading('Method', 2)
    yield Bullets(method(content['machine'], content, content['options']))
    yield Heading('How each system is run', 2)
    yield Bullets(PEERS)
    yield from _machine(content)
    yield Heading('Repeat it', 2)
    yield Code(content['command'])


def _moment(text: str) -> str:
    return text[:16].replace('T', ' ')


def _needs(results: Sequence[CaseResult]) -> Iterator[Block]:
    needs = [need for result in results for need in result.needs if need.known]
    if not needs:
        return
    yield Heading('Which system for which need', 2)
    yield Paragraph('A system fits when what was measured here is at least as good as the need '
                    'says. Figures are medians of the repeats.')
    systems = [name for name in SYSTEMS
               if any(need.systems.get(name) is not None for need in needs)]
    yield Grid(('need', *systems, 'use'), [
        (need.text, *(_fits(need, name) for name in systems), _use(need)) for need in needs],
        [''] * len(needs))
    yield Bullets(BEYOND)


def _fits(need: Need, system: str) -> str:
    metric = need.systems.get(system)
    if metric is None:
        return '-'
    return f'{"yes" if need.gives(system) else "no"}, {number(metric.median)} {need.unit}'.strip()


def _use(need: Need) -> str:
    fitting = [name for name in SYSTEMS if need.gives(name)]
    if len(fitting) == len([name for name in SYSTEMS if need.gives(name) is not None]) > 1:
        return 'any'
    return ', '.join(fitting) or 'none of these'


def _verdicts(results: Sequence[CaseResult]) -> Iterator[Block]:
    aims = [(result.name, aim) for result in results for aim in result.aims]
    if not aims:
        return
    yield Heading('Aims and verdicts', 2)
    rows = [_verdict(name, aim) for name, aim in aims]
    headings: tuple[str, ...] = ('aim', 'case', 'limit', 'measured', 'range', 'paper', 'verdict')
    if not any(row[4] for row in rows):  # there was one repeat
        headings, rows = headings[:4] + headings[5:], [row[:4] + row[5:] for row in rows]
    yield Grid(headings, rows, [_KINDS[aim.verdict] for _, aim in aims], 2)
    reasons: dict[str, list[str]] = {}
    for name, aim in aims:
        if aim.reason:
            reasons.setdefault(aim.reason, []).append(f'{aim.text} ({name})')
    if reasons:
        yield Paragraph('Missed, and the reason as far as the samples tell it:')
        yield Bullets([f'{"; ".join(texts)}: {reason}.' for reason, texts in reasons.items()])


def _verdict(name: str, aim: Aim) -> tuple[str, ...]:
    unit = f' {aim.unit}' if aim.unit else ''
    relation = '≤' if aim.at_most else '≥'
    measured = '-' if aim.measured is None else f'{number(aim.measured.median)}{unit}'
    return (aim.text, name, f'{relation} {aim.limit:g}{unit}', measured, spread(aim.measured),
            aim.paper or '-', aim.verdict.value)


def spread(metric: Metric | None) -> str:
    """Write the lowest and the highest of the repeats."""
    if metric is None or len(metric.values) < 2:
        return ''
    return f'{number(metric.lowest)}..{number(metric.highest)}'


def _case(result: CaseResult) -> Iterator[Block]:
    yield Heading(f'{result.name}: {result.title}', 3)
    if drawing.available():
        for plot in result.plots:
            if any(series.x for series in plot.series):
                yield Picture(plot, f'{result.name}-{plot.name}')
    for table in result.tables:
        if table.title:
            yield Heading(table.title, 4)
        yield _grid(table)
        if table.notes:
            yield Paragraph(' '.join(table.notes))


def _grid(table: Table) -> Grid:
    columns = [column for column in table.columns
               if not column.spread or any(spread(row.metrics.get(column.key))
                                           for row in table.rows)]
    headings = []
    for column in columns:
        unit = f', {column.unit}' if column.unit else ''
        headings.append(f'{column.group} {column.title}{unit}'.strip())
    rows: list[Sequence[str]] = []
    kinds: list[str] = []
    for row in table.rows:
        if row.status is Status.OK:
            rows.append((row.label, *(
                spread(row.metrics.get(c.key)) if c.spread else _cell(row.metrics.get(c.key))
                for c in columns)))
        else:
            what = 'not available' if row.status is Status.MISSING else 'failed'
            rows.append((row.label, f'{what}: {row.reason}'))
        kinds.append(_kind(row))
    return Grid(('', *headings), rows, kinds)


def _cell(metric: Metric | None) -> str:
    return '-' if metric is None else number(metric.median)


def _kind(row: Row) -> str:
    if row.quoted:
        return 'quoted'
    if row.status is not Status.OK:
        return 'absent'
    return 'ours' if OURS in row.label else ''


def _machine(content: Mapping[str, Any]) -> Iterator[Block]:
    machine = content['machine']
    yield Heading('The machine', 2)
    rows = [(key.replace('_', ' '), _plain(value)) for key, value in machine.items()
            if value not in ('', [], {})]
    rows += [(step, state) for step, state in content['realtime'].items()]
    yield Grid(('', ''), rows, [''] * len(rows), 2)


def _plain(value: Any) -> str:
    if isinstance(value, Mapping):
        return ', '.join(f'{key} {one}' for key, one in value.items())
    if isinstance(value, list | tuple):
        return ', '.join(_plain(one) for one in value)
    return f'{value:.2f}' if isinstance(value, float) else str(value)
