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

"""How alarms and their events are shown: tables and lines for people, values for JSON."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence
from datetime import datetime
from typing import Any
from typing import Final

from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.diagnostic_array import DiagnosticStatus

_HEADS: Final = ('ID', 'LEVEL', 'STATE', 'OPEN FOR', 'WHO', 'WHAT', 'TOLD')
_CHARACTERS: Final = 100
_UNITS: Final = ((86_400, 'd'), (3_600, 'h'), (60, 'min'))


def alarm_rows(statuses: Iterable[DiagnosticStatus]) -> list[dict[str, Any]]:
    """Return the open alarms of a list, with the values of each."""
    return [{**each.values, 'message': each.message, 'severity': each.level}
            for each in statuses if each.values.get('id')]


def notes_of(statuses: Iterable[DiagnosticStatus]) -> list[str]:
    """Return the messages of a list that are not alarms."""
    return [safe_line(each.message) for each in statuses
            if not each.values.get('id') and each.message]


def duration(seconds: str) -> str:
    """Return a duration for people: ``40 s``, ``12 min``, ``3 h``."""
    try:
        left = max(0, round(float(seconds)))
    except (ValueError, OverflowError):
        return '?'
    for size, unit in _UNITS:
        if left >= 2 * size:
            return f'{left // size} {unit}'
    return f'{left} s'


def table(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return alarms as a table, with a header line."""
    cells = [_HEADS, *(_cells(row) for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells)]
    return ['  '.join(f'{cell:{width}}' for cell, width in zip(line, widths)).rstrip()
            for line in cells]


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    def text(key: str) -> str:
        return safe_line(str(row.get(key, '')), _CHARACTERS)

    state = text('state')
    if row.get('by'):
        state += f' by {text("by")}'
    told = text('told').replace(' ', ', ')
    if row.get('failed'):
        told += f' (not {text("failed").replace(" ", ", ")})'
    return (text('id'), text('level'), state, duration(str(row.get('age_s', ''))),
            text('subject'), text('kinds').replace(' ', ', '), told.strip())


def event_line(event: AlarmEvent, behind_ns: int) -> str:
    """
    Return an event of an alarm as a line.

    :param behind_ns: how far the clock of the core is behind the time since 1970.
    """
    def shown(text: str) -> str:
        return safe_line(text, _CHARACTERS)

    at = ''
    if 0 < event.t_ns < 1 << 62:
        at = f'{datetime.fromtimestamp((event.t_ns + behind_ns) / NS_PER_S):%H:%M:%S.%f}'[:-3]
    by = f' by {shown(event.by)}' if event.by else ''
    why = f' ({shown(event.why)})' if event.why else ''
    return (f'{at:12}  {shown(event.alarm):>4}  {shown(event.level):9}  {shown(event.event):14}  '
            f'{shown(event.subject)}: {", ".join(map(safe_line, event.kinds))}{by}{why}').rstrip()
