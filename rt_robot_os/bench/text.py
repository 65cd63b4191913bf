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

"""Tables for a terminal of 100 columns."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
from itertools import groupby
import textwrap

from rt_robot_os.bench.result import Aim
from rt_robot_os.bench.result import CaseResult
from rt_robot_os.bench.result import Column
from rt_robot_os.bench.result import Metric
from rt_robot_os.bench.result import Need
from rt_robot_os.bench.result import Row
from rt_robot_os.bench.result import Status
from rt_robot_os.bench.result import Table
from rt_robot_os.bench.result import Verdict

WIDTH = 100
# The systems that a need is compared for, in the order of the columns.
SYSTEMS = ('rt_robot_os', 'best rclpy', 'HORUS', 'threads')
_GAP = '  '
_DIGITS = 3


def number(value: float) -> str:
    """Write a number with three significant digits, never in powers of ten."""
    size = abs(value)
    decimals = 0 if size >= 100 else 1 if size >= 10 else 2 if size >= 1 else _DIGITS
    text = f'{value:.{decimals}f}'
    return text.lstrip('-') if float(text) == 0 else text


def _cell(metric: Metric | None, column: Column) -> str:
    if metric is None:
        return '-'
    if column.spread:
        return _range(metric)
    return number(metric.median)


def _range(metric: Metric) -> str:
    return f'{number(metric.lowest)}..{number(metric.highest)}' if len(metric.values) > 1 else ''


def table_lines(table: Table) -> Iterator[str]:
    """Write a table: headings, rows, and how it was measured."""
    repeated = any(len(metric.values) > 1 for row in table.rows
                   for metric in row.metrics.values() if metric is not None)
    columns = [column for column in table.columns if repeated or not column.spread]
    cells = [[_cell(row.metrics.get(column.key), column) for column in columns]
             for row in table.rows]
    widths = [max([len(column.title)] + [len(line[i]) for row, line in zip(table.rows, cells)
                                         if row.status is Status.OK])
              for i, column in enumerate(columns)]
    groups = _groups(columns, widths)
    label_width = max([len(row.label) for row in table.rows], default=0)
    if table.title:
        yield table.title
    yield ' ' * label_width + groups
    yield _join(' ' * label_width, [column.title for column in columns], widths)
    told: set[str] = set()
    for row, line_cells in zip(table.rows, cells):
        if row.status is Status.OK:
            yield _join(row.label.ljust(label_width), line_cells, widths)
        else:
            yield from _not_measured(row, label_width, told)
    if table.notes:
        yield ''
        yield from table.notes


def _groups(columns: Sequence[Column], widths: list[int]) -> str:
    """Write the line of group headings; widens columns that are narrower than theirs."""
    line = ''
    for _, members in groupby(range(len(columns)), lambda i: (columns[i].group, columns[i].unit)):
        of = list(members)
        column = columns[of[0]]
        text = f'{column.group}, {column.unit}' if column.unit else column.group
        span = sum(widths[i] for i in of) + len(_GAP) * (len(of) - 1)
        if len(text) > span:
            widths[of[-1]] += len(text) - span
            span = len(text)
        filled = text if len(of) == 1 else f' {text} '.center(span, '-')
        line += _GAP + filled.rjust(span)
    return line.rstrip()


def _join(label: str, cells: Sequence[str], widths: Sequence[int]) -> str:
    return (label + ''.join(_GAP + cell.rjust(width)
                            for cell, width in zip(cells, widths))).rstrip()


def _not_measured(row: Row, label_width: int, told: set[str]) -> Iterator[str]:
    what = 'not available' if row.status is Status.MISSING else 'failed'
    text = f'{what}, as above' if row.reason in told else f'{what}: {row.reason}'
    told.add(row.reason)
    room = max(20, WIDTH - label_width - len(_GAP))
    for i, line in enumerate(textwrap.wrap(text, room)[:3]):
        yield (row.label if i == 0 else '').ljust(label_width) + _GAP + line


def aim_lines(aims: Sequence[Aim]) -> Iterator[str]:
    """Write what was promised, what was measured, and the verdict."""
    width = max(len(aim.text) for aim in aims)
    repeated = any(aim.measured and len(aim.measured.values) > 1 for aim in aims)
    yield (f'{"aim".ljust(width)}  {"limit":>9}  {"measured":>9}  {"verdict":<12}'
           f'{"  range" if repeated else ""}').rstrip()
    told: set[str] = set()
    for aim in aims:
        unit = f' {aim.unit}' if aim.unit else ''
        limit = f'{"<=" if aim.at_most else ">="} {aim.limit:g}{unit}'
        measured = '-' if aim.measured is None else f'{number(aim.measured.median)}{unit}'
        spread = '' if aim.measured is None else _range(aim.measured)
        yield (f'{aim.text.ljust(width)}  {limit:>9}  {measured:>9}  '
               f'{aim.verdict.value:<12}  {spread}').rstrip()
        if aim.reason:
            yield from _wrapped('reason: ' + ('as above' if aim.reason in told else aim.reason),
                                '    ')
            told.add(aim.reason)
        yield from _wrapped(f'paper: {aim.paper}' if aim.paper else '', '    ')


def _wrapped(text: str, indent: str) -> Sequence[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent + '  ')


def case_lines(result: CaseResult) -> Iterator[str]:
    """Write all of a case."""
    yield f'== {result.name}: {result.title} '.ljust(WIDTH, '=')
    for table in result.tables:
        yield ''
        yield from table_lines(table)
    if result.aims:
        yield ''
        yield from aim_lines(result.aims)


def closing_lines(results: Sequence[CaseResult]) -> Iterator[str]:
    """Write what all cases together say: which system for which need, and the verdicts."""
    yield from need_lines([need for result in results for need in result.needs if need.known])
    yield verdict_line(results)


def need_lines(needs: Sequence[Need]) -> Iterator[str]:
    """Write which systems give what somebody may need."""
    systems = [name for name in SYSTEMS if any(need.systems.get(name) for need in needs)]
    if not systems:
        return
    width = max(len(need.text) for need in needs)
    yield 'which system for which need'.ljust(width) + ''.join(
        f'  {name:>11}' for name in systems)
    for need in needs:
        cells = [f'  {_fit(need, name):>11}' for name in systems]
        yield (need.text.ljust(width) + ''.join(cells)).rstrip()
    yield ''


def _fit(need: Need, system: str) -> str:
    metric = need.systems.get(system)
    if metric is None:
        return '-'
    return f'{number(metric.median)} {"yes" if need.gives(system) else "no ":<3}'


def verdict_line(results: Sequence[CaseResult]) -> str:
    """Count the verdicts of all cases in one line."""
    aims = [aim for result in results for aim in result.aims]
    counts = {verdict: sum(aim.verdict is verdict for aim in aims) for verdict in Verdict}
    return (f'aims: {counts[Verdict.REACHED]} of {len(aims)} reached, {counts[Verdict.MISSED]} '
            f'missed, {counts[Verdict.UNKNOWN]} not measured')
