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
What has become of an alarm: folded from its events, in whatever order they arrive.

The event with the highest number of its robot says the state; each other column is that of the
newest event that says something about it. So events may be late, repeated or in any order.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import json
from typing import Any
from typing import Final

from rt_robot_os.monitor.store.alarm_reuse import is_reused
from rt_robot_os.monitor.store.tables import ALARM_EVENTS
from rt_robot_os.monitor.store.tables import ALARMS
from rt_robot_os.monitor.store.tables import MEDIA
from sqlalchemy import bindparam
from sqlalchemy import Connection
from sqlalchemy import func
from sqlalchemy import insert
from sqlalchemy import select
from sqlalchemy import tuple_
from sqlalchemy import update

CLOSED: Final = frozenset({'resolved', 'cancelled'})
_PART: Final = 200
_STATE: Final = tuple(column.name for column in ALARMS.c
                      if column.name not in ('id', 'robot_id', 'alarm'))


def follow(connection: Connection, rows: Sequence[dict[str, Any]]) -> None:
    """
    Write events of alarms, and what becomes of these.

    :param rows: of ``alarm_events``, with ``robot_id``, ``alarm``, ``state`` and ``level``.
    """
    keys = list(dict.fromkeys((row['robot_id'], row['alarm']) for row in rows))
    states = _load(connection, keys)
    known = set(states)
    for row in rows:
        key = row['robot_id'], row['alarm']
        state = states.get(key)
        if state is not None and key in known and _is_another(connection, state, row):
            _put_away(connection, key, state['id'])
            known.discard(key)
            state = None
        states[key] = folded(state, row)
    ids = _save(connection, states, known)
    connection.execute(insert(ALARM_EVENTS), [
        {'alarm_id': ids[row['robot_id'], row['alarm']], **{
            name: row[name] for name in ('boot_id', 'seq', 't_ns', 'arrived_ns', 'event_seq',
                                         'event', 'content')}} for row in rows])


def folded(state: Mapping[str, Any] | None, row: Mapping[str, Any]) -> dict[str, Any]:
    """
    Return what is known of an alarm after one more event; the order of events does not matter.

    :param state: what was known, columns of ``alarms``; None: nothing.
    """
    content = json.loads(row['content'])
    seq, t_ns = row['event_seq'], row['t_ns']
    made: dict[str, Any] = dict(state) if state is not None else {
        'subject': '', 'state': '', 'level': '', 'kinds': '[]', 'text': '', 'by': '', 'why': '',
        'node': '', 'x': None, 'y': None, 'opened_ns': t_ns, 't_ns': t_ns, 'raised_ns': None,
        'acknowledged_ns': None, 'acknowledged_by': '', 'is_open': False, 'last_seq': -1,
        'place_seq': -1, 'acknowledged_seq': -1}
    made['opened_ns'] = min(made['opened_ns'], t_ns)
    if seq > made['last_seq']:
        made.update(
            last_seq=seq, t_ns=t_ns, subject=row['subject'], state=row['state'],
            level=row['level'], is_open=row['state'] not in CLOSED,
            kinds=json.dumps(_texts(content.get('kinds'))), text=_string(content, 'text'),
            by=_string(content, 'by'), why=_string(content, 'why'))
    if seq > made['place_seq'] and (_string(content, 'node') or _number(content, 'x') is not None):
        made.update(place_seq=seq, node=_string(content, 'node')[:120], x=_number(content, 'x'),
                    y=_number(content, 'y'))
    if row['event'] in ('raised', 'confirmed') and not content.get('restored'):
        made['raised_ns'] = min(made['raised_ns'] or t_ns, t_ns)
    if row['event'] == 'acknowledged' and seq > made['acknowledged_seq']:
        made.update(acknowledged_seq=seq, acknowledged_ns=t_ns,
                    acknowledged_by=_string(content, 'by'))
    return made


def _is_another(connection: Connection, state: Mapping[str, Any], row: Mapping[str, Any]) -> bool:
    if row['event_seq'] > state['last_seq']:
        return False
    newest = connection.execute(select(func.max(ALARM_EVENTS.c.boot_id)).where(
        ALARM_EVENTS.c.alarm_id == state['id'])).scalar()
    return is_reused({**json.loads(row['content']), 'event': row['event']}, row['event_seq'],
                     row['t_ns'], state['last_seq'], state['t_ns'],
                     later_start=newest is not None and row['boot_id'] > newest)


def _put_away(connection: Connection, key: tuple[int, str], number: int) -> None:
    """Give the older alarm of a name another one."""
    robot, alarm = key
    older = f'{alarm[:90]}~{number}'
    connection.execute(update(ALARMS).where(ALARMS.c.id == number), {'alarm': older})
    connection.execute(update(MEDIA).where(
        MEDIA.c.robot_id == robot, MEDIA.c.alarm == alarm), {'alarm': older})


def _load(connection: Connection, keys: Sequence[tuple[int, str]]
          ) -> dict[tuple[int, str], dict[str, Any]]:
    found = {}
    for begin in range(0, len(keys), _PART):
        for row in connection.execute(select(ALARMS).where(tuple_(
                ALARMS.c.robot_id, ALARMS.c.alarm).in_(keys[begin:begin + _PART]))).mappings():
            found[row['robot_id'], row['alarm']] = dict(row)
    return found


def _save(connection: Connection, states: Mapping[tuple[int, str], dict[str, Any]],
          known: set[tuple[int, str]]) -> dict[tuple[int, str], int]:
    fresh = [{'robot_id': robot, 'alarm': alarm, **state}
             for (robot, alarm), state in states.items() if (robot, alarm) not in known]
    if fresh:
        connection.execute(insert(ALARMS), fresh)
    if known:
        statement = update(ALARMS).where(ALARMS.c.id == bindparam('an_id')).values(
            {name: bindparam(name) for name in _STATE})
        connection.execute(statement, [
            {'an_id': states[key]['id'], **{name: states[key][name] for name in _STATE}}
            for key in sorted(known)])
    loaded = _load(connection, list(states)) if fresh else states
    return {key: state['id'] for key, state in loaded.items()}


def _string(content: Mapping[str, Any], name: str) -> str:
    value = content.get(name)
    return value if isinstance(value, str) else ''


def _texts(found: object) -> list[str]:
    return [each for each in found if isinstance(each, str)] if isinstance(found, list) else []


def _number(content: Mapping[str, Any], name: str) -> float | None:
    value = content.get(name)
    good = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if good and -1e9 < value < 1e9 else None  # type: ignore[arg-type,operator]
