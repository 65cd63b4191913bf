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

"""Queries for robots, people and their observations."""

from __future__ import annotations

from collections.abc import Mapping
import json
from typing import Any

from rt_robot_os.monitor.store.codes import unit_of
from rt_robot_os.monitor.store.records import QUALITIES
from rt_robot_os.monitor.store.tables import BOOTS
from rt_robot_os.monitor.store.tables import EVENTS
from rt_robot_os.monitor.store.tables import NODES
from rt_robot_os.monitor.store.tables import OBSERVATIONS
from rt_robot_os.monitor.store.tables import PEOPLE
from rt_robot_os.monitor.store.tables import PLACES
from rt_robot_os.monitor.store.tables import ROBOT_PEOPLE
from rt_robot_os.monitor.store.tables import ROBOTS
from rt_robot_os.monitor.store.tables import SERIES
from rt_robot_os.monitor.store.tables import UNKNOWN
from sqlalchemy import and_
from sqlalchemy import Connection
from sqlalchemy import func
from sqlalchemy import or_
from sqlalchemy import select

#: Most rows in one answer.
ROWS_MOST = 10_000


def robots(connection: Connection) -> list[dict[str, Any]]:
    """Return all robots, with the content of their last hello in ``details``."""
    lives = _lives(connection)
    return [{'id': row.robot, 'name': row.name, 'first_ns': row.first_ns,
             'last_seen_ns': row.last_ns, 'people': lives.get(row.robot, []),
             'details': json.loads(row.details or '{}')}
            for row in connection.execute(select(ROBOTS).order_by(ROBOTS.c.id))]


def people(connection: Connection) -> list[dict[str, Any]]:
    """Return all people, with the ids of their robots and their signs."""
    signs: dict[str, list[str]] = {}
    for person, code in connection.execute(select(PEOPLE.c.person, SERIES.c.code).join(
            SERIES, SERIES.c.person_id == PEOPLE.c.id).order_by(SERIES.c.id)):
        signs.setdefault(person, []).append(code)
    robots_of: dict[str, list[str]] = {}
    for robot, names in _lives(connection).items():
        for name in names:
            robots_of.setdefault(name, []).append(robot)
    return [{'person': row.person, 'first_ns': row.first_ns,
             'robots': robots_of.get(row.person, []), 'signs': signs.get(row.person, [])}
            for row in connection.execute(select(PEOPLE).order_by(PEOPLE.c.person))]


def _lives(connection: Connection) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for robot, person in connection.execute(select(ROBOTS.c.robot, PEOPLE.c.person).select_from(
            ROBOT_PEOPLE.join(ROBOTS).join(PEOPLE)).where(ROBOT_PEOPLE.c.lives).order_by(
                PEOPLE.c.person)):
        found.setdefault(robot, []).append(person)
    return found


def observations(connection: Connection, person: str, sign: str | None, start_ns: int | None,
                 end_ns: int | None, limit: int, after: tuple[int, int] | None
                 ) -> list[dict[str, Any]]:
    """Return observations in order of time; ``after`` is (t_ns, id) of the last known one."""
    statement = _observations().where(PEOPLE.c.person == person)
    if sign is not None:
        statement = statement.where(SERIES.c.code == sign)
    if start_ns is not None:
        statement = statement.where(OBSERVATIONS.c.t_ns >= start_ns)
    if end_ns is not None:
        statement = statement.where(OBSERVATIONS.c.t_ns < end_ns)
    if after is not None:
        t_ns, number = after
        statement = statement.where(or_(OBSERVATIONS.c.t_ns > t_ns, and_(
            OBSERVATIONS.c.t_ns == t_ns, OBSERVATIONS.c.id > number)))
    statement = statement.order_by(OBSERVATIONS.c.t_ns, OBSERVATIONS.c.id)
    return [_observation(row) for row in connection.execute(
        statement.limit(max(0, min(limit, ROWS_MOST)))).mappings()]


def latest(connection: Connection, who: frozenset[str] | None) -> list[dict[str, Any]]:
    """Return the newest observation of each sign of people; None for all people."""
    newest = select(OBSERVATIONS.c.id).where(
        OBSERVATIONS.c.series_id == SERIES.c.id).order_by(
            OBSERVATIONS.c.series_id.desc(), OBSERVATIONS.c.t_ns.desc()).limit(1).correlate(
                SERIES).scalar_subquery()
    statement = select(newest).select_from(SERIES.join(PEOPLE))
    if who is not None:
        statement = statement.where(PEOPLE.c.person.in_(who))
    numbers = [each for each in connection.execute(statement).scalars() if each is not None]
    found: list[dict[str, Any]] = []
    for begin in range(0, len(numbers), 500):
        found += [_observation(row) for row in connection.execute(_observations().where(
            OBSERVATIONS.c.id.in_(numbers[begin:begin + 500]))).mappings()]
    return sorted(found, key=lambda each: (each['person'], each['code']))


def _observations() -> Any:
    return select(OBSERVATIONS, PEOPLE.c.person, SERIES.c.code, ROBOTS.c.robot,
                  BOOTS.c.boot).select_from(
        OBSERVATIONS.join(SERIES).join(PEOPLE).join(BOOTS).join(ROBOTS))


def _observation(row: Mapping[Any, Any]) -> dict[str, Any]:
    return {'id': row['id'], 'robot': row['robot'], 'boot': row['boot'], 'seq': row['seq'],
            'person': row['person'], 'code': row['code'], 'value': row['value'],
            'unit': unit_of(row['code']), 'quality': QUALITIES[row['quality']],
            'source': row['source'], 't_ns': row['t_ns'], 'arrived_ns': row['arrived_ns']}


def places(connection: Connection, person: str, start_ns: int, end_ns: int, limit: int
           ) -> list[dict[str, Any]]:
    """Return the places of a person, the newest last."""
    rows = connection.execute(select(PLACES, ROBOTS.c.robot).select_from(
        PLACES.join(PEOPLE).join(BOOTS).join(ROBOTS)).where(
            PEOPLE.c.person == person, PLACES.c.t_ns >= start_ns, PLACES.c.t_ns < end_ns
    ).order_by(PLACES.c.t_ns.desc(), PLACES.c.id.desc()).limit(
        max(0, min(limit, ROWS_MOST)))).mappings().all()
    return [{name: row[name] for name in ('robot', 'x', 'y', 'room', 't_ns')}
            for row in reversed(rows)]


def events(connection: Connection, robot: str, start_ns: int, end_ns: int, limit: int
           ) -> list[dict[str, Any]]:
    """Return actions of a robot's agent and operators, the newest last."""
    rows = connection.execute(select(EVENTS, ROBOTS.c.robot).join(ROBOTS).where(
        ROBOTS.c.robot == robot, EVENTS.c.t_ns >= start_ns, EVENTS.c.t_ns < end_ns).order_by(
            EVENTS.c.t_ns.desc(), EVENTS.c.id.desc()).limit(
                max(0, min(limit, ROWS_MOST)))).mappings().all()
    return [{'robot': row['robot'], 'type': row['type'], 't_ns': row['t_ns'],
             'content': json.loads(row['content'])} for row in reversed(rows)]


def nodes(connection: Connection, robot: str) -> list[dict[str, Any]]:
    """Return the last record about each node of a robot's network."""
    last = select(NODES.c.robot_id, NODES.c.node, func.max(NODES.c.t_ns).label('t_ns')).join(
        ROBOTS).where(ROBOTS.c.robot == robot).group_by(
            NODES.c.robot_id, NODES.c.node).subquery()
    found = {}
    for row in connection.execute(select(NODES).join(last, and_(
            NODES.c.robot_id == last.c.robot_id, NODES.c.node == last.c.node,
            NODES.c.t_ns == last.c.t_ns)).order_by(NODES.c.id)).mappings():
        found[row['node']] = {'node': row['node'], 't_ns': row['t_ns'],
                              'content': json.loads(row['content'])}
    return list(found.values())


def unknown(connection: Connection, limit: int) -> list[dict[str, Any]]:
    """Return records stored aside, the newest first."""
    return [dict(row) for row in connection.execute(select(
        ROBOTS.c.robot, BOOTS.c.boot, UNKNOWN.c.seq, UNKNOWN.c.arrived_ns, UNKNOWN.c.type,
        UNKNOWN.c.why, UNKNOWN.c.content).select_from(UNKNOWN.join(BOOTS).join(ROBOTS)).order_by(
            UNKNOWN.c.id.desc()).limit(max(0, min(limit, ROWS_MOST)))).mappings()]


def limits(connection: Connection, person: str, sign: str) -> list[Any]:
    """Return the limits of a person's sign that their robots sent when they last connected."""
    found: list[Any] = []
    for details in connection.execute(select(ROBOTS.c.details).select_from(
            ROBOT_PEOPLE.join(ROBOTS).join(PEOPLE)).where(
                PEOPLE.c.person == person, ROBOT_PEOPLE.c.lives)).scalars():
        said = json.loads(details or '{}').get('limits')
        of_person = said.get(person) if isinstance(said, dict) else None
        of_sign = of_person.get(sign) if isinstance(of_person, dict) else of_person
        found += [each for each in (of_sign if isinstance(of_sign, list) else [])
                  if not isinstance(each, str) or each.split(' ', 1)[0] == sign]
    return found
