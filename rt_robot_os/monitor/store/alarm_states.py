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
The state of an alarm, computed from its events in any order of arrival.

The event with the highest journal number determines the state. Each other column comes from the
newest event that has a value for it. So events may be late, repeated or out of order.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import json
import math
from typing import Any
from typing import Final

from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.alarm_state import AlarmEventKind
from rt_robot_os.messages.alarm_state import RAISING_EVENTS
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

_PART: Final = 200
_STATE: Final = tuple(column.name for column in ALARMS.c
                      if column.name not in ('id', 'robot_id', 'alarm'))


def follow(connection: Connection, rows: Sequence[dict[str, Any]]) -> None:
    """
    Write events of alarms, and update the states of these alarms.

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
    Return the state of an alarm after one more event; the order of events does not matter.

    :param state: the state before, columns of ``alarms``; None for a new alarm.
    """
    event = _event(row)
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
            level=row['level'], is_open=event.is_open, kinds=json.dumps(event.kinds),
            text=event.text, by=event.by, why=event.why)
    if seq > made['place_seq'] and (event.node or math.isfinite(event.x)):
        made.update(place_seq=seq, node=event.node[:120], x=_known(event.x), y=_known(event.y))
    if event.event in RAISING_EVENTS and not event.restored:
        made['raised_ns'] = min(made['raised_ns'] or t_ns, t_ns)
    if event.event == AlarmEventKind.ACKNOWLEDGED.value and seq > made['acknowledged_seq']:
        made.update(acknowledged_seq=seq, acknowledged_ns=t_ns,
                    acknowledged_by=event.by)
    return made


def _is_another(connection: Connection, state: Mapping[str, Any], row: Mapping[str, Any]) -> bool:
    if row['event_seq'] > state['last_seq']:
        return False
    newest = connection.execute(select(func.max(ALARM_EVENTS.c.boot_id)).where(
        ALARM_EVENTS.c.alarm_id == state['id'])).scalar()
    return is_reused(_event(row), row['event_seq'], row['t_ns'], state['last_seq'], state['t_ns'],
                     later_start=newest is not None and row['boot_id'] > newest)


def _put_away(connection: Connection, key: tuple[int, str], number: int) -> None:
    """Rename the older of two alarms with the same name."""
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


def _event(row: Mapping[str, Any]) -> AlarmEvent:
    return AlarmEvent.from_dict({**json.loads(row['content']), 'alarm': row['alarm'],
                                 'event': row['event'], 'state': row['state']})


def _known(number: float) -> float | None:
    return number if math.isfinite(number) else None
