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


"""The columns of each table, and which of them a narrow terminal shows."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.tools.top.rows import DeviceRow
from rt_robot_os.tools.top.rows import Row
from rt_robot_os.tools.top.rows import TaskRow
from rt_robot_os.tools.top.rows import TopicRow

# A piece of a line and how it is drawn: '', 'dim', 'head', 'good', 'warn' or 'bad'.
Span = tuple[str, str]
Line = tuple[Span, ...]
Value = float | int | str | None

_NAME_MINIMUM = 8
_NAME_MAXIMUM = 40
_LAST_MINIMUM = 10


@dataclass(frozen=True)
class Column:
    """
    One column.

    :ivar value: what it is sorted by.
    :ivar text: how that is written.
    :ivar rank: the larger, the sooner it goes when there is no room; 0 stays always.
    :ivar counter: key in ``Row.new`` that makes it stand out; the column's own when empty.
    :ivar fills: takes the rest of the line, and is cut to it.
    """

    key: str
    title: str
    value: Callable[[Any], Value]
    text: Callable[[Any], str]
    rank: int = 0
    counter: str = ''
    fills: bool = False
    style: Callable[[Any], str] | None = None


def number(value: float | None, digits: int = 1) -> str:
    """Write a number, or a dash."""
    return '-' if value is None else f'{value:.{digits}f}'


def rate(value: float | None) -> str:
    """Write a rate in four figures."""
    if value is None:
        return '-'
    digits = 0 if value >= 999.5 else 1 if value >= 9.95 else 2
    return f'{value:.{digits}f}'


def microseconds(value: float | None) -> str:
    """Write a duration in microseconds, whatever it is: those of a column can be compared."""
    if value is None:
        return '-'
    return f'{value:.1f}' if 0 < value < 99.95 else f'{value:.0f}'


def seconds(value: float | None) -> str:
    """Write an age in seconds, whatever it is."""
    if value is None:
        return '-'
    digits = 3 if value < 9.9995 else 1 if value < 99.95 else 0
    return f'{value:.{digits}f}'


def _late(row: TaskRow) -> str:
    if row.last_late_us is None:
        return ''
    others = ', '.join(row.ran_instead)
    return f'by {microseconds(row.last_late_us)}{f": {others}" if others else ""}'


def _column(key: str, title: str, write: Callable[[Any], str] = str, rank: int = 0, *,
            counter: str = '', fills: bool = False,
            style: Callable[[Any], str] | None = None) -> Column:
    def value(row: Any) -> Value:
        found = getattr(row, key)
        return found if isinstance(found, float | int | str) or found is None else str(found)

    return Column(key, title, value, lambda row: write(getattr(row, key)), rank,
                  counter or key, fills, style)


def _slow(row: TaskRow) -> str:
    """Mark what runs at less than nine tenths of its rate."""
    if row.rate_hz is not None and row.declared_hz and row.rate_hz < 0.9 * row.declared_hz:
        return 'warn'
    return ''


def _silent(row: TopicRow) -> str:
    """Mark a topic that was published and is not any more."""
    return 'warn' if row.published and row.rate_hz == 0.0 and row.declared_hz else ''


def _state(row: TaskRow | DeviceRow) -> str:
    if row.state == 'active':
        return 'good'
    return 'warn' if row.state in ('backoff', 'opening') else 'bad'


TASKS: tuple[Column, ...] = (
    _column('name', 'TASK'),
    _column('priority', 'PRI', rank=3),
    _column('rate_hz', 'Hz', rate, style=_slow),
    _column('declared_hz', 'of', lambda hz: rate(hz) if hz else '-', 2, style=lambda row: 'dim'),
    _column('latency_p50_us', 'LAT50', microseconds, 5),
    _column('latency_p99_us', 'LAT99', microseconds),
    _column('latency_max_us', 'LATMAX', microseconds, 1),
    _column('execution_p50_us', 'EXE50', microseconds, 4),
    _column('execution_p99_us', 'EXE99', microseconds, 10),
    _column('execution_max_us', 'EXEMAX', microseconds, 6),
    _column('cpu_percent', 'CPU%', number),
    _column('deadline_missed', 'LATE', rank=1),
    _column('missed', 'MISS', rank=2),
    _column('overruns', 'OVER', rank=8),
    _column('aborted', 'ABRT', rank=9),
    _column('failures', 'FAIL', rank=4),
    _column('blocked_us', 'BLOCKED', microseconds, 7),
    _column('state', 'STATE', style=_state),
    Column('last_late_us', 'LAST LATE: RAN INSTEAD', lambda row: row.last_late_us, _late, 11,
           fills=True),
)

TOPICS: tuple[Column, ...] = (
    _column('name', 'TOPIC'),
    _column('rate_hz', 'Hz', rate, style=_silent),
    _column('declared_hz', 'of', lambda hz: rate(hz) if hz else '-', style=lambda row: 'dim'),
    _column('age_s', 'AGE s', seconds),
    _column('slot_bytes', 'BYTES', rank=3),
    _column('depth', 'DEPTH', rank=4),
    _column('published', 'SENT', rank=5),
    _column('lost', 'LOST', counter='lost by '),
    Column('subscribers', 'READERS (LOST)', lambda row: len(row.subscribers),
           lambda row: ', '.join(f'{s["name"]} ({s["lost"]})' if s['lost'] else s['name']
                                 for s in row.subscribers), 1, fills=True),
)

DEVICES: tuple[Column, ...] = (
    _column('name', 'DEVICE'),
    _column('state', 'STATE', style=_state),
    _column('rate_hz', 'Hz', rate),
    _column('age_s', 'AGE s', seconds),
    _column('faults', 'FAULTS'),
    _column('opened', 'OPENED', rank=4),
    _column('lost_samples', 'LOST', rank=2),
    _column('rejected_bytes', 'REJECTED B', rank=3),
    _column('reason', 'REASON', rank=1, fills=True),
)

CLIENTS: tuple[Column, ...] = (
    _column('name', 'CLIENT'),
    _column('pid', 'PID', rank=2),
    _column('rate_hz', 'Hz', rate),
    _column('sent', 'SENT', rank=3),
    _column('full', 'FULL'),
    _column('lost', 'LOST'),
    _column('limited', 'LIMITED', rank=1),
    _column('skipped', 'SKIPPED', rank=4),
    _column('dropped', 'DROPPED', rank=5),
    _column('quiet_s', 'QUIET s', seconds),
)

TABLES: dict[str, tuple[Column, ...]] = {
    'tasks': TASKS, 'topics': TOPICS, 'devices': DEVICES, 'clients': CLIENTS}


def sort_keys() -> tuple[str, ...]:
    """Return the columns that rows can be sorted by."""
    return tuple(dict.fromkeys(c.key for table in TABLES.values() for c in table))


def sorted_rows(rows: Sequence[Row], columns: Sequence[Column], key: str,
                backwards: bool) -> list[Row]:
    """
    Sort, numbers falling and texts rising; what has no value comes last.

    :param key: '' for the order of the core: as configured, tasks by priority. So has a table
        that has no such column.
    """
    column = next((c for c in columns if c.key == key), None)
    if column is None:
        ordered = list(rows)
        if rows and isinstance(rows[0], TaskRow):
            ordered.sort(key=lambda row: -row.priority if isinstance(row, TaskRow) else 0)
        return ordered[::-1] if backwards and not key else ordered
    valued = [(column.value(row), row) for row in rows]
    known = [(value, row) for value, row in valued if value is not None]
    texts = bool(known) and isinstance(known[0][0], str)
    known.sort(key=lambda pair: pair[0], reverse=texts == backwards)
    return [row for _, row in known] + [row for value, row in valued if value is None]


def check_sort(key: str) -> None:
    """
    Refuse what nothing can be sorted by.

    :raises ConfigError: there is no such column.
    """
    if key and key not in sort_keys():
        raise ConfigError([f'--sort {key}: no such column; there are {", ".join(sort_keys())}'])


def table(columns: Sequence[Column], rows: Sequence[Row], width: int) -> list[Line]:
    """
    Lay out a table.

    :param width: columns of the terminal; those that matter least go when they do not fit.
    :return: the head and a line for each row.
    """
    widths = {c.key: max([len(c.title), *(len(c.text(row)) for row in rows)]) for c in columns}
    widths['name'] = min(max(widths['name'], _NAME_MINIMUM), _NAME_MAXIMUM, max(
        _NAME_MINIMUM, width // 4))
    shown = list(columns)
    for column in columns:
        if column.fills:
            widths[column.key] = min(widths[column.key], _LAST_MINIMUM)
    while _total(shown, widths) > width and any(c.rank for c in shown):
        shown.remove(max(shown, key=lambda c: c.rank))
    for column in shown:
        if column.fills:
            widths[column.key] += width - _total(shown, widths)
    head = tuple((_cell(c, c.title, widths[c.key]), 'head') for c in shown)
    return [_spaced(head), *(_spaced(tuple(
        (_cell(c, c.text(row), widths[c.key]), _style(c, row)) for c in shown)) for row in rows)]


def _total(columns: Sequence[Column], widths: dict[str, int]) -> int:
    return sum(widths[c.key] for c in columns) + len(columns) - 1


def _cell(column: Column, text: str, width: int) -> str:
    if len(text) > width:
        text = text[:max(0, width - 1)] + '…'
    left = column.fills or column.key in ('name', 'state')
    return f'{text:<{width}}' if left else f'{text:>{width}}'


def _style(column: Column, row: Row) -> str:
    if any(key == column.counter or column.counter[-1:] == ' ' and key.startswith(column.counter)
           for key in row.new):
        return 'bad'
    if column.style is not None:
        return column.style(row)
    return ''


def _spaced(cells: Line) -> Line:
    spans: list[Span] = []
    for cell in cells:
        if spans:
            spans.append((' ', 'head' if cell[1] == 'head' else ''))
        spans.append(cell)
    return tuple(spans)
