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


"""Lay a snapshot out as lines for a terminal of some size; nothing here draws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import fnmatch

from rt_robot_os.link.core_statistics import SHIPPED_IN_USE
from rt_robot_os.tools.top.columns import Line
from rt_robot_os.tools.top.columns import microseconds
from rt_robot_os.tools.top.columns import number
from rt_robot_os.tools.top.columns import rate
from rt_robot_os.tools.top.columns import sorted_rows
from rt_robot_os.tools.top.columns import Span
from rt_robot_os.tools.top.columns import table
from rt_robot_os.tools.top.columns import TABLES
from rt_robot_os.tools.top.rows import KernelRow
from rt_robot_os.tools.top.rows import Row
from rt_robot_os.tools.top.rows import Snapshot

PARTS = ('all', *TABLES, 'log')
_SEVERITY_STYLES = ((40, 'bad'), (30, 'warn'), (20, ''), (0, 'dim'))
_LOG_LINES = 3


@dataclass
class Choices:
    """
    What the user chose to see.

    :ivar part: one of ``PARTS``.
    :ivar sort: key of a column; '' for the order of the core.
    :ivar pattern: rows whose name contains it, or matches it as a file's name does.
    :ivar first: rows of a single part that have been scrolled past.
    """

    part: str = 'all'
    sort: str = ''
    backwards: bool = False
    pattern: str = ''
    first: int = 0
    paused: bool = False

    def wanted(self, row: Row) -> bool:
        """Whether a row passes the filter."""
        if not self.pattern:
            return True
        if any(sign in self.pattern for sign in '*?['):
            return fnmatch.fnmatchcase(row.name, self.pattern)
        return self.pattern in row.name


def rows_of(snapshot: Snapshot, part: str, choices: Choices) -> list[Row]:
    """Return the rows of a part as they were chosen and sorted."""
    rows = [row for row in getattr(snapshot, part) if choices.wanted(row)]
    return sorted_rows(rows, TABLES[part], choices.sort, choices.backwards)


def head(snapshot: Snapshot, choices: Choices, width: int) -> list[Line]:
    """Return the lines about the core as a whole."""
    kernel = snapshot.kernel
    interval = f'over {snapshot.interval_s:.1f} s' if snapshot.interval_s else 'first sample'
    first: list[Span] = [
        (snapshot.robot, 'head'),
        (f'  pid {kernel.pid}  up {_duration(kernel.uptime_s)}  {snapshot.at[11:19]}  {interval}',
         ''), ('  times in us', 'dim')]
    if choices.pattern:
        first.append((f'  only {choices.pattern!r}', 'warn'))
    if choices.paused:
        first.append(('  PAUSED', 'warn'))
    lines = [first, _simulation(kernel), _load(kernel), _health(kernel), _blame(snapshot)]
    return [cut(tuple(line), width) for line in lines if line]


def _duration(uptime_s: float) -> str:
    minutes, whole = divmod(int(uptime_s), 60)
    hours, minutes = divmod(minutes, 60)
    return f'{hours}:{minutes:02}:{whole:02}'


def _blame(snapshot: Snapshot) -> list[Span]:
    """Return which tasks delayed others, and which were late just now and why."""
    spans: list[Span] = []
    late = [row for row in snapshot.tasks if 'deadline_missed' in row.new]
    if late:
        row = max(late, key=lambda each: each.last_late_us or 0.0)
        others = f' ({", ".join(row.ran_instead)})' if row.ran_instead else ''
        more = f' and {len(late) - 1} more' if len(late) > 1 else ''
        spans.append((f'late now: {row.name} by {microseconds(row.last_late_us)}{others}'
                      f'{more}  ', 'bad'))
    worst = max(snapshot.tasks, key=lambda row: row.blocked_us, default=None)
    if worst is not None and worst.blocked_us:
        spans.append((f'longest native call: {worst.name} {microseconds(worst.blocked_us)}  ', ''))
    kernel = snapshot.kernel
    if kernel.stolen:
        spans.append((f'taken by Linux: {kernel.stolen} x, at most '
                      f'{microseconds(kernel.stolen_maximum_us)}',
                      'warn' if 'stolen' in kernel.new else ''))
    return spans


def _simulation(kernel: KernelRow) -> list[Span]:
    if not kernel.simulated:
        return []
    why = '' if kernel.simulation_asked else f': {SHIPPED_IN_USE}'
    return [(f'simulated: {", ".join(kernel.simulated)}{why}', '' if not why else 'warn')]


def _load(kernel: KernelRow) -> list[Span]:
    memory = f'  memory {kernel.memory_mb:.0f} MB' if kernel.memory_mb is not None else ''
    process = kernel.process_cpu_percent
    spans = [(f'CPU {number(process if process is not None else kernel.cpu_percent)}%', ''),
             (f' (tasks {number(kernel.cpu_percent)}%, kernel {number(kernel.kernel_percent)}%)'
              if process is not None else ' (tasks alone)', 'dim'),
             (f'  wake-ups {rate(kernel.wakeups_hz)}/s{memory}', ''),
             (f'  failures {kernel.failures}', 'bad' if 'failures' in kernel.new else '')]
    if kernel.clients_refused:
        spans.append((f'  clients refused {kernel.clients_refused}', 'warn'))
    return spans


def _health(kernel: KernelRow) -> list[Span]:
    refused = [step['step'] for step in kernel.realtime if not step['ok']]
    healthy = kernel.watchdog in ('off', 'healthy')
    box = kernel.black_box
    spans: list[Span] = [
        (f'watchdog {kernel.watchdog}', '' if healthy else 'bad'),
        (f'  black box {box.get("saved", 0)} saved', 'warn' if 'saved' in kernel.new else '')]
    if box.get('lost'):
        spans.append((f', {box["lost"]} lost', 'bad'))
    total = len(kernel.realtime)
    spans.append((f'  real time {total - len(refused)} of {total} steps', ''))
    if refused:
        spans.append((f', refused: {", ".join(refused)}', 'warn'))
    return spans


def body(snapshot: Snapshot, choices: Choices, width: int, height: int,
         log: Sequence[tuple[int, str, str]] = ()) -> list[Line]:
    """Return the lines below the head: as many as fit, and how many do not."""
    if choices.part == 'log':
        return _log(log, width, height)
    if choices.part != 'all':
        return _single(snapshot, choices, width, height)
    tables = {part: rows_of(snapshot, part, choices) for part in TABLES}
    heights = _shares({part: len(rows) for part, rows in tables.items() if rows}, height)
    lines: list[Line] = []
    roomy = height > sum(heights.values()) + len(heights)
    for part, share in heights.items():
        rows = tables[part]
        if roomy and lines:
            lines.append(((' ', ''),))
        shown = rows if len(rows) + 1 <= share else rows[:max(0, share - 2)]
        lines += table(TABLES[part], shown, width)
        if len(shown) < len(rows):
            key = PARTS.index(part) + 1
            lines.append(((f'… {len(rows) - len(shown)} more {part}: key {key}', 'dim'),))
    if not lines:
        lines = [((f'nothing has a name with {choices.pattern!r} in it', 'warn'),)]
    room = height - len(lines) - 1
    if log and room > 0:
        lines.append(((' ', ''),))
        lines += _log(log, width, min(room, _LOG_LINES))
    return lines[:height]


def _shares(wanted: dict[str, int], height: int) -> dict[str, int]:
    """Give each table a head and, in turn, lines for its rows; the tasks get every second one."""
    shares = {part: min(3, 1 + count) for part, count in wanted.items()}
    left = height - sum(shares.values())
    turns = [part for other in wanted for part in dict.fromkeys(('tasks', other))
             if part in wanted]
    while left > 0 and any(shares[part] <= wanted[part] for part in wanted):
        for part in turns:
            if left > 0 and shares[part] <= wanted[part]:
                shares[part] += 1
                left -= 1
    return shares


def _single(snapshot: Snapshot, choices: Choices, width: int, height: int) -> list[Line]:
    rows = rows_of(snapshot, choices.part, choices)
    room = max(1, height - 1)
    choices.first = max(0, min(choices.first, len(rows) - room))
    lines = table(TABLES[choices.part], rows[choices.first:choices.first + room], width)
    below = len(rows) - choices.first - room
    if below > 0:
        lines[-1] = ((f'… {below + 1} more below: arrow keys', 'dim'),)
    return lines


def _log(log: Sequence[tuple[int, str, str]], width: int, height: int) -> list[Line]:
    if not log:
        return [(('the core has said nothing', 'dim'),)]
    lines: list[Line] = []
    for severity, source, text in list(log)[-height:]:
        style = next(style for least, style in _SEVERITY_STYLES if severity >= least)
        lines.append(cut(((f'{source}: {text.splitlines()[0] if text else ""}', style),), width))
    return lines


def cut(line: Line, width: int) -> Line:
    """Cut a line to the width of the terminal."""
    spans: list[Span] = []
    left = width
    for text, style in line:
        if len(text) > left:
            spans.append((text[:max(0, left - 1)] + '…', style))
            break
        spans.append((text, style))
        left -= len(text)
    return tuple(spans)


def plain(lines: Sequence[Line]) -> str:
    """Write lines without any drawing."""
    return '\n'.join(''.join(text for text, _ in line).rstrip() for line in lines)
