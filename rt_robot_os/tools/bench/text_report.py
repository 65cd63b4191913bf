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

"""Tables for a terminal: of 100 columns, or what it has."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
from itertools import groupby
import shutil
import sys
import textwrap

from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Column
from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import Requirement
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.result import Table
from rt_robot_os.tools.bench.result import Target
from rt_robot_os.tools.bench.result import TargetVerdict

WIDTH = 100
# The systems that are compared, in the order of the columns.
SYSTEMS = ('rt_robot_os', 'best rclpy', 'HORUS', 'threads')
_GAP = '  '
_DIGITS = 3
_NARROWEST = 60
_INDENT = '    '


def terminal_width() -> int:
    """Return how long lines may be: those of the terminal, at most 100."""
    if not sys.stdout.isatty():
        return WIDTH
    return max(_NARROWEST, min(WIDTH, shutil.get_terminal_size((WIDTH, 0)).columns))


def number(value: float) -> str:
    """Write a number with three significant digits, never in powers of ten; 0 as such."""
    if value == 0:
        return '0'
    size = abs(float(f'{value:.{_DIGITS}g}'))  # 9.996 has as many digits as 10.0
    decimals = 0 if size >= 100 else 1 if size >= 10 else 2 if size >= 1 else _DIGITS
    text = f'{value:.{decimals}f}'
    return text.lstrip('-') if float(text) == 0 else text


def spread(metric: Metric | None) -> str:
    """Write the lowest and the highest of the repeats; empty when there was one."""
    if metric is None or len(metric.values) < 2:
        return ''
    return f'{number(metric.lowest)}..{number(metric.highest)}'


def cell(metric: Metric | None, column: Column) -> str:
    """Write what a column shows of a metric."""
    if metric is None:
        return '-'
    if column.spread:
        return spread(metric)
    # A number of things has no decimals.
    return number(metric.median) if column.unit or metric.median % 1 else f'{metric.median:.0f}'


def table_lines(table: Table, width: int = WIDTH) -> Iterator[str]:
    """Write a table, in parts where it is wider than the terminal, and how it was measured."""
    repeated = any(len(metric.values) > 1 for row in table.rows
                   for metric in row.metrics.values() if metric is not None)
    columns = [column for column in table.columns if repeated or not column.spread]
    if table.title:
        yield table.title
    label_width = max([len(row.label) for row in table.rows], default=0)
    while columns:
        # As many columns as fit, one at least.
        for count in range(len(columns), 0, -1):
            lines = list(_part_lines(table.rows, columns[:count], label_width, width))
            if count == 1 or max(len(line) for line in lines) <= width:
                break
        yield from lines
        columns = columns[count:]
        if columns:
            yield ''
    if table.notes:
        yield ''
        yield from textwrap.wrap(' '.join(table.notes), width)


def _part_lines(rows: Sequence[Row], columns: Sequence[Column], label_width: int, width: int
                ) -> Iterator[str]:
    cells = [[cell(row.metrics.get(column.key), column) for column in columns] for row in rows]
    widths = [max([len(column.title)] + [len(line[i]) for row, line in zip(rows, cells)
                                         if row.status is RunStatus.OK])
              for i, column in enumerate(columns)]
    groups = _groups(columns, widths)
    yield ' ' * label_width + groups
    yield _join(' ' * label_width, [column.title for column in columns], widths)
    given: set[str] = set()
    for row, line_cells in zip(rows, cells):
        if row.status is RunStatus.OK:
            yield _join(row.label.ljust(label_width), line_cells, widths)
        else:
            yield from _not_measured(row, label_width, given, width)


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


def absence(row: Row, given: set[str]) -> str:
    """
    Write why a row has no figures.

    :param given: reasons that the table has given already; they are not repeated.
    """
    what = 'not available' if row.status is RunStatus.MISSING else 'failed'
    known = row.reason in given
    given.add(row.reason)
    return f'{what}, as above' if known else f'{what}: {row.reason}'


def _not_measured(row: Row, label_width: int, given: set[str], width: int) -> Iterator[str]:
    text = absence(row, given)
    room = max(20, width - label_width - len(_GAP))
    for i, line in enumerate(textwrap.wrap(text, room)[:3]):
        yield (row.label if i == 0 else '').ljust(label_width) + _GAP + line


def target_cells(target: Target) -> tuple[str, str]:
    """Write limit and measured value, the latter as exactly as the limit at least."""
    unit = f' {target.unit}' if target.unit else ''
    limit = f'{target.limit:g}'
    if target.measured is None:
        measured = '-'
    else:
        value, decimals = target.measured.median, len(limit.partition('.')[2])
        measured = f'{value:.0f}' if not unit and value % 1 == 0 else max(
            number(value), f'{value:.{decimals}f}', key=len)
        measured += unit
    return f'{"≤" if target.at_most else "≥"} {limit}{unit}', measured


def target_lines(targets: Sequence[Target], width: int = WIDTH) -> Iterator[str]:
    """Write what was promised, what was measured, and the verdict."""
    rows = [('target', 'limit', 'measured', 'verdict', 'range')]
    for target in targets:
        limit, measured = target_cells(target)
        # Not every terminal has the signs of the page.
        rows.append((target.text, limit.replace('≤', '<=').replace('≥', '>='), measured,
                     target.verdict.value, spread(target.measured)))
    widths = [max(len(row[i]) for row in rows) for i in range(5)]
    if not any(row[4] for row in rows[1:]) or sum(widths) + 4 * len(_GAP) > width:
        rows = [(*row[:4], '') for row in rows]  # there was one repeat, or there is no room
    reasons = ['', *(_reasons(targets))]
    for row, about, reason in zip(rows, (None, *targets), reasons):
        yield (f'{row[0]:<{widths[0]}}  {row[1]:>{widths[1]}}  {row[2]:>{widths[2]}}  '
               f'{row[3]:<{widths[3]}}  {row[4]}').rstrip()
        if about is not None:
            yield from _wrapped(reason and f'reason: {reason}', width)
            yield from _wrapped(about.paper and f'paper: {about.paper}', width)


def _reasons(targets: Sequence[Target]) -> Iterator[str]:
    given: set[str] = set()
    for target in targets:
        yield 'as above' if target.reason and target.reason in given else target.reason
        given.add(target.reason)


def _wrapped(text: str, width: int) -> Sequence[str]:
    return textwrap.wrap(text, width, initial_indent=_INDENT, subsequent_indent=_INDENT + '  ')


def case_lines(result: CaseResult, width: int = WIDTH) -> Iterator[str]:
    """Write all of a case."""
    yield f'== {result.name}: {result.title} '.ljust(width, '=')
    for table in result.tables:
        yield ''
        yield from table_lines(table, width)
    if result.targets:
        yield ''
        yield from target_lines(result.targets, width)


def closing_lines(results: Sequence[CaseResult], width: int = WIDTH) -> Iterator[str]:
    """Write which systems meet which requirements, and the verdicts of all cases."""
    known = [each for result in results for each in result.requirements if each.known]
    yield from requirement_lines(known, width)
    yield from textwrap.wrap(verdict_line(results), width)


def requirement_lines(requirements: Sequence[Requirement], width: int = WIDTH) -> Iterator[str]:
    """Write which systems meet each requirement."""
    if not any(each.known for each in requirements):
        return
    yield from textwrap.wrap('== which system meets which requirement? "(?)": the median of the '
                             'repeats says so, but not each of them', width)
    systems = [name for name in SYSTEMS if any(each.systems.get(name) for each in requirements)]
    cells = [[f'{name} {text}' if (text := fit(each, name)) else '' for name in systems]
             for each in requirements]
    widths = [max(map(len, column)) for column in zip(*cells)]
    beside = len(_INDENT) + sum(widths) + len(_GAP) * (len(systems) - 1) <= width
    for each, texts in zip(requirements, cells):
        yield from textwrap.wrap(f'{each.text} (case {each.case}):', width)
        if beside:
            yield (_INDENT + _GAP.join(map(str.ljust, texts, widths))).rstrip()
        else:
            yield from (_INDENT + text for text in texts if text)
    yield ''


def fit(each: Requirement, system: str) -> str:
    """Write whether a system gives what is needed, and its figure; empty when it is not known."""
    metric = each.systems.get(system)
    if metric is None:
        return ''
    sure = '' if each.agrees(system) else ' (?)'
    return (f'{"yes" if each.meets(system) else "no"}{sure}, {number(metric.median)} '
            f'{each.unit}').strip()


def verdict_line(results: Sequence[CaseResult]) -> str:
    """Count the verdicts of all cases in one line."""
    targets = [target for result in results for target in result.targets]
    reached, missed, unknown = (sum(target.verdict is each for target in targets) for each in (
        TargetVerdict.REACHED, TargetVerdict.MISSED, TargetVerdict.UNKNOWN))
    return (f'targets: {reached} of {len(targets)} reached, {missed} missed, {unknown} not '
            'measured')
