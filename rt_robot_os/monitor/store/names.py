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

"""The ids of robots, their starts, people and signs in the database."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any
from typing import Final

from rt_robot_os.monitor.store.tables import BOOTS
from rt_robot_os.monitor.store.tables import PEOPLE
from rt_robot_os.monitor.store.tables import ROBOT_PEOPLE
from rt_robot_os.monitor.store.tables import ROBOTS
from rt_robot_os.monitor.store.tables import SERIES
from sqlalchemy import Connection
from sqlalchemy import insert
from sqlalchemy import select
from sqlalchemy import Table
from sqlalchemy import update

#: Ids read from a table at the start; further ones are queried when they are needed.
_LEARNT: Final = 100_000


class NameTable:
    """
    Ids by names, created as needed; for the writer only, within a transaction.

    Ids created in a failed transaction do not exist: call :meth:`forget` then.
    """

    def __init__(self) -> None:
        self._robots: dict[str, int] = {}
        self._boots: dict[tuple[int, str], int] = {}
        self._people: dict[str, int] = {}
        self._series: dict[tuple[int, str], int] = {}
        self._lives: set[tuple[int, int]] = set()

    def forget(self) -> None:
        """Discard the cache: another process may have changed the tables."""
        self.__init__()  # type: ignore[misc]

    def learn(self, connection: Connection) -> None:
        """Read people and signs that are not known in one query; single queries are slow."""
        if self._people:
            return
        for number, person in connection.execute(select(PEOPLE.c.id, PEOPLE.c.person).limit(
                _LEARNT)):
            self._people[person] = number
        for number, owner, code in connection.execute(select(
                SERIES.c.id, SERIES.c.person_id, SERIES.c.code).limit(_LEARNT)):
            self._series[owner, code] = number
        for robot, number in connection.execute(select(
                ROBOT_PEOPLE.c.robot_id, ROBOT_PEOPLE.c.person_id).limit(_LEARNT)):
            self._lives.add((robot, number))

    def robot(self, connection: Connection, robot: str, now_ns: int) -> int:
        """Return the id of a robot."""
        if robot not in self._robots:
            self._robots[robot] = _number(connection, ROBOTS, {'robot': robot},
                                          {'first_ns': now_ns, 'last_ns': now_ns})
        return self._robots[robot]

    def boot(self, connection: Connection, robot: int, boot: str, now_ns: int) -> int:
        """Return the id of a robot's start."""
        key = robot, boot
        if key not in self._boots:
            self._boots[key] = _number(connection, BOOTS, {'robot_id': robot, 'boot': boot},
                                       {'first_ns': now_ns, 'last_ns': now_ns, 'blocks': 0})
        return self._boots[key]

    def person(self, connection: Connection, robot: int, person: str, now_ns: int) -> int:
        """
        Return the id of a person about whom this robot sends records.

        A record does not confirm the person as a resident; an administrator does that.
        """
        if person not in self._people:
            self._people[person] = _number(connection, PEOPLE, {'person': person},
                                           {'first_ns': now_ns})
        number = self._people[person]
        if (robot, number) not in self._lives:
            found = connection.execute(select(ROBOT_PEOPLE.c.robot_id).where(
                ROBOT_PEOPLE.c.robot_id == robot, ROBOT_PEOPLE.c.person_id == number)).first()
            if found is None:
                connection.execute(insert(ROBOT_PEOPLE), {'robot_id': robot, 'person_id': number})
            self._lives.add((robot, number))
        return number

    def series(self, connection: Connection, person: int, code: str) -> int:
        """Return the id of a person's sign."""
        key = person, code
        if key not in self._series:
            self._series[key] = _number(
                connection, SERIES, {'person_id': person, 'code': code}, {})
        return self._series[key]


def seen(connection: Connection, who: Iterable[tuple[int, int]], now_ns: int) -> None:
    """Update the time at which these robots and starts were last seen."""
    robots, boots = {robot for robot, _ in who}, {boot for _, boot in who}
    for table, numbers in ((ROBOTS, robots), (BOOTS, boots)):
        connection.execute(update(table).where(table.c.id.in_(sorted(numbers))),
                           {'last_ns': now_ns})


def _number(connection: Connection, table: Table, key: dict[str, Any],
            more: dict[str, Any]) -> int:
    found = connection.execute(select(table.c.id).where(
        *(table.c[name] == value for name, value in key.items()))).scalar()
    if found is None:
        found = connection.execute(insert(table).values({**key, **more}).returning(
            table.c.id)).scalar_one()
    return int(found)
