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

"""Queries for alarms."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
import json
from typing import Any

from rt_robot_os.messages.alarm_event import AlarmEvent
from rt_robot_os.messages.alarm_state import AlarmEventKind
from rt_robot_os.monitor.store.tables import ALARM_EVENTS
from rt_robot_os.monitor.store.tables import ALARM_NOTES
from rt_robot_os.monitor.store.tables import ALARMS
from rt_robot_os.monitor.store.tables import MEDIA
from rt_robot_os.monitor.store.tables import PEOPLE
from rt_robot_os.monitor.store.tables import ROBOT_PEOPLE
from rt_robot_os.monitor.store.tables import ROBOTS
from sqlalchemy import ColumnElement
from sqlalchemy import Connection
from sqlalchemy import insert
from sqlalchemy import not_
from sqlalchemy import or_
from sqlalchemy import select

#: Most alarms in one answer.
ALARMS_MOST = 1000
EVENTS_MOST = 2000
_COLUMNS = ('state', 'level', 'subject', 'text', 'by', 'why', 'node', 'x', 'y', 'opened_ns',
            't_ns', 'raised_ns', 'acknowledged_ns', 'acknowledged_by', 'is_open')


def alarms(connection: Connection, people: frozenset[str] | None, robot: str | None,
           is_open: bool | None, since_ns: int, limit: int) -> list[dict[str, Any]]:
    """Return alarms, the most recently changed first."""
    statement = select(ALARMS, ROBOTS.c.robot).join(ROBOTS, ROBOTS.c.id == ALARMS.c.robot_id)
    if people is not None:
        statement = statement.where(_visible(people))
    if robot is not None:
        statement = statement.where(ROBOTS.c.robot == robot)
    if is_open is not None:
        statement = statement.where(ALARMS.c.is_open == is_open)
    if since_ns:
        statement = statement.where(ALARMS.c.t_ns >= since_ns)
    statement = statement.order_by(ALARMS.c.t_ns.desc(), ALARMS.c.id.desc())
    found = connection.execute(statement.limit(max(0, min(limit, ALARMS_MOST)))).mappings()
    return [_alarm(row) for row in found]


def _visible(people: frozenset[str]) -> ColumnElement[bool]:
    """
    Return the condition for visible alarms.

    These are alarms about granted people, and about rooms and devices where they live.

    Alarms of a robot without residents are visible to accounts that may see everybody.

    An alarm about a known person who is not granted is not visible.
    """
    theirs = select(ROBOT_PEOPLE.c.robot_id).join(
        PEOPLE, PEOPLE.c.id == ROBOT_PEOPLE.c.person_id).where(
            PEOPLE.c.person.in_(people), ROBOT_PEOPLE.c.lives)
    others = select(PEOPLE.c.person).where(PEOPLE.c.person.not_in(people))
    return or_(ALARMS.c.subject.in_(people),
               ALARMS.c.robot_id.in_(theirs) & not_(ALARMS.c.subject.in_(others)))


def alarms_within(connection: Connection, person: str, start_ns: int, end_ns: int
                  ) -> list[dict[str, Any]]:
    """Return the alarms about a person that were open in a time range, the oldest first."""
    found = connection.execute(select(ALARMS, ROBOTS.c.robot).join(
        ROBOTS, ROBOTS.c.id == ALARMS.c.robot_id).where(
            ALARMS.c.subject == person, ALARMS.c.opened_ns < end_ns,
            or_(ALARMS.c.is_open, ALARMS.c.t_ns >= start_ns)).order_by(
                ALARMS.c.opened_ns, ALARMS.c.id).limit(ALARMS_MOST)).mappings()
    return [_alarm(row) for row in found]


def alarm(connection: Connection, robot: str, name: str) -> dict[str, Any] | None:
    """Return an alarm with its events, notes and media; None when it does not exist."""
    row = connection.execute(select(ALARMS, ROBOTS.c.robot).join(
        ROBOTS, ROBOTS.c.id == ALARMS.c.robot_id).where(
            ROBOTS.c.robot == robot, ALARMS.c.alarm == name)).mappings().first()
    if row is None:
        return None
    found = _alarm(row)
    events = connection.execute(select(ALARM_EVENTS).where(
        ALARM_EVENTS.c.alarm_id == row['id']).order_by(
            ALARM_EVENTS.c.event_seq.desc(), ALARM_EVENTS.c.id.desc()).limit(EVENTS_MOST)
    ).mappings().all()
    found['events'] = [{**json.loads(each['content']), 't_ns': each['t_ns'],
                        'seq': each['event_seq'], 'arrived_ns': each['arrived_ns']}
                       for each in reversed(events)]
    found['told'], found['failed'] = _delivered(
        AlarmEvent.from_dict({**each, 'alarm': name}) for each in found['events'])
    found['notes'] = [
        {'id': each['id'], 'by': each['by'], 'text': each['text'], 't_ns': each['t_ns']}
        for each in connection.execute(select(ALARM_NOTES).where(
            ALARM_NOTES.c.alarm_id == row['id']).order_by(ALARM_NOTES.c.id)).mappings()]
    found['media'] = media_of(connection, robot, name)
    return found


def _delivered(events: Iterable[AlarmEvent]) -> tuple[list[str], list[str]]:
    """Return the channels that delivered, and those that failed and have not delivered since."""
    last: dict[str, bool] = {}
    for each in events:
        if each.event in (AlarmEventKind.DELIVERED.value, AlarmEventKind.FAILED.value):
            channel = (each.why or each.text).split(':')[0].split(' ')[0]
            last[channel] = each.event == AlarmEventKind.DELIVERED.value
    return [name for name, ok in last.items() if ok], [name for name, ok in last.items() if not ok]


def add_note(connection: Connection, robot: str, name: str, by: str, text: str,
             now_ns: int) -> int | None:
    """Add a note to an alarm; return its number, or None when there is no such alarm."""
    number = connection.execute(select(ALARMS.c.id).join(
        ROBOTS, ROBOTS.c.id == ALARMS.c.robot_id).where(
            ROBOTS.c.robot == robot, ALARMS.c.alarm == name)).scalar()
    if number is None:
        return None
    return connection.execute(insert(ALARM_NOTES).returning(ALARM_NOTES.c.id), {
        'alarm_id': number, 't_ns': now_ns, 'by': by, 'text': text}).scalar()


def withdraw_note(connection: Connection, note: int, robot: str, name: str, by: str,
                  since_ns: int) -> str | None:
    """
    Delete a note of an alarm that its author wrote recently.

    :param since_ns: the earliest time at which the note may have been written, UTC.
    :return: its text, or None when there is no such note.
    """
    alarms = select(ALARMS.c.id).join(ROBOTS, ROBOTS.c.id == ALARMS.c.robot_id).where(
        ROBOTS.c.robot == robot, ALARMS.c.alarm == name)
    wanted = (ALARM_NOTES.c.id == note, ALARM_NOTES.c.alarm_id.in_(alarms),
              ALARM_NOTES.c.by == by, ALARM_NOTES.c.t_ns >= since_ns)
    text: str | None = connection.execute(select(ALARM_NOTES.c.text).where(*wanted)).scalar()
    if text is not None:
        connection.execute(ALARM_NOTES.delete().where(ALARM_NOTES.c.id == note))
    return text


def media_of(connection: Connection, robot: str, name: str) -> list[dict[str, Any]]:
    """Return the pictures, clips and sounds of an alarm, the oldest first."""
    return [media_row(row) for row in connection.execute(_media().where(
        ROBOTS.c.robot == robot, MEDIA.c.alarm == name).order_by(
            MEDIA.c.t_ns, MEDIA.c.id).limit(EVENTS_MOST)).mappings()]


def media_list(connection: Connection, robot: str | None, alarm: str | None, limit: int
               ) -> list[dict[str, Any]]:
    """Return pictures, clips and sounds, the newest first; of a robot and an alarm, or all."""
    wanted = _media()
    if robot is not None:
        wanted = wanted.where(ROBOTS.c.robot == robot)
    if alarm is not None:
        wanted = wanted.where(MEDIA.c.alarm == alarm)
    return [media_row(row) for row in connection.execute(wanted.order_by(
        MEDIA.c.t_ns.desc(), MEDIA.c.id.desc()).limit(limit)).mappings()]


def media(connection: Connection, number: int) -> dict[str, Any] | None:
    """Return a picture, clip or sound by its number; None when it does not exist."""
    row = connection.execute(_media().where(MEDIA.c.id == number)).mappings().first()
    return None if row is None else media_row(row)


def media_by_name(connection: Connection, robot: str, name: str) -> dict[str, Any] | None:
    """Return one by the name that its robot gave it; None when it has not been announced."""
    row = connection.execute(_media().where(
        ROBOTS.c.robot == robot, MEDIA.c.media == name)).mappings().first()
    return None if row is None else media_row(row)


def _media() -> Any:
    return select(MEDIA, ROBOTS.c.robot, ALARMS.c.subject).join(
        ROBOTS, ROBOTS.c.id == MEDIA.c.robot_id).outerjoin(
            ALARMS, (ALARMS.c.robot_id == MEDIA.c.robot_id) & (ALARMS.c.alarm == MEDIA.c.alarm))


def media_row(row: Mapping[Any, Any]) -> dict[str, Any]:
    """Return its JSON form; ``subject`` is that of its alarm."""
    return {'subject': row['subject'] or '', **{name: row[name] for name in (
        'id', 'robot', 'media', 'alarm', 'kind', 'file', 'sha256', 'size', 'width', 'height',
        't_ns', 'arrived_ns', 'path', 'stored_ns')}}


def _alarm(row: Mapping[Any, Any]) -> dict[str, Any]:
    return {'robot': row['robot'], 'id': row['alarm'], 'kinds': json.loads(row['kinds']),
            'utc_ns': row['t_ns'], 'seq': row['last_seq'],
            **{name: row[name] for name in _COLUMNS}}
