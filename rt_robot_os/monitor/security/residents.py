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
The residents of each robot, as confirmed by an administrator.

A robot's hello names the people it looks after. That is a suggestion: records about a person are
filed only after an administrator has confirmed that the person lives with the robot. Otherwise the
token of any robot would allow writing records about everybody.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Collection
from collections.abc import Iterable
from collections.abc import Mapping
import json
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.monitor.security.tables import robot_accounts
from rt_robot_os.monitor.security.users import AccountError
from rt_robot_os.monitor.store.engine import reading
from rt_robot_os.monitor.store.engine import writing
from rt_robot_os.monitor.store.tables import NAME
from rt_robot_os.monitor.store.tables import PEOPLE
from rt_robot_os.monitor.store.tables import ROBOT_PEOPLE
from rt_robot_os.monitor.store.tables import ROBOTS
from sqlalchemy import Connection
from sqlalchemy import Engine
from sqlalchemy import insert
from sqlalchemy import select
from sqlalchemy import update

#: Most residents of one robot.
MOST: Final = 64
#: Values of ``robots.residents``; '' means never confirmed.
CONFIRMED: Final = 'confirmed'
FIRST_HELLO: Final = 'first_hello'


class Household(NamedTuple):
    """
    The residents of a robot.

    :ivar people: confirmed residents; None: never confirmed.
    :ivar ever: these, and people about whom the robot has sent records earlier.
    """

    people: frozenset[str] | None
    ever: frozenset[str]


class Residents:
    """The confirmed residents of all robots; thread-safe."""

    def __init__(self, engine: Engine, now_ns: Callable[[], int]) -> None:
        self._engine = engine
        self._now_ns = now_ns

    def all(self) -> dict[str, Household]:  # noqa: A003
        """
        Return the household of each known robot, by the robot's id.

        :raises StoreError: the database is unavailable.
        """
        with reading(self._engine) as connection:
            return _households(connection)

    def table(self, robots: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """
        Return id, name, ``people`` and ``suggested`` of each robot, for an administrator.

        :param robots: with ``id`` and ``name``.
        :return: ``people`` is None until they are confirmed once; ``suggested`` are the people
            that the robot named when it connected last.
        """
        with reading(self._engine) as connection:
            confirmed = _households(connection)
            hellos = {row.robot: json.loads(row.details or '{}').get('people')
                      for row in connection.execute(select(ROBOTS.c.robot, ROBOTS.c.details))}
        found = []
        for each in robots:
            people = confirmed[each['id']].people if each['id'] in confirmed else None
            hello = hellos.get(each['id'])
            found.append({'id': each['id'], 'name': each['name'],
                          'people': None if people is None else sorted(people),
                          'suggested': [name for name in hello if isinstance(name, str)]
                          if isinstance(hello, list) else []})
        return found

    def confirm(self, robot: str, people: Collection[str], by: str) -> Household:
        """
        Set the residents of a robot; they replace the previous ones.

        :param robot: its id or its name.
        :param people: an empty collection confirms that there are none.
        :raises AccountError: there is no such robot, or a name is not valid.
        """
        names = _checked(people)
        with writing(self._engine) as connection:
            found, name = _robot(connection, robot)
            _set(connection, found, name, names, by, self._now_ns())
            return _households(connection)[found]

    def accept_first_hello(self, robot: str) -> None:
        """
        Let the next hello of a robot confirm its residents, unless they are confirmed already.

        For a robot whose token never leaves this machine, because the server starts its gateway.
        """
        with writing(self._engine) as connection:
            found, name = _robot(connection, robot)
            number = _number(connection, found, name)
            connection.execute(update(ROBOTS).where(
                ROBOTS.c.id == number, ROBOTS.c.residents == '').values(residents=FIRST_HELLO))

    def greet(self, robot: str, suggested: Collection[str]) -> Household:
        """
        Return the household of a robot that sends a hello; its first hello may confirm it.

        :raises StoreError: the database is unavailable.
        """
        with reading(self._engine) as connection:
            how = connection.execute(select(ROBOTS.c.residents).where(
                ROBOTS.c.robot == robot)).scalar()
            if how != FIRST_HELLO or not suggested:
                return _households(connection).get(robot, Household(None, frozenset()))
        return self.confirm(robot, suggested, 'first hello')


def _robot(connection: Connection, robot: str) -> tuple[str, str]:
    """Return id and name of a robot that has an account."""
    row = connection.execute(select(robot_accounts.c.id, robot_accounts.c.name).where(
        (robot_accounts.c.id == robot) | (robot_accounts.c.name == robot))).first()
    if row is None:
        raise AccountError(f'there is no robot {robot[:64]!a}', 'monitor robot list shows them')
    return row.id, row.name


def _number(connection: Connection, robot: str, name: str) -> int:
    found = connection.execute(select(ROBOTS.c.id).where(ROBOTS.c.robot == robot)).scalar()
    if found is None:  # the robot has never connected
        found = connection.execute(insert(ROBOTS).values(
            robot=robot, name=name, first_ns=0, last_ns=0).returning(ROBOTS.c.id)).scalar_one()
    return int(found)


def _set(connection: Connection, robot: str, name: str, people: Collection[str], by: str,
         now_ns: int) -> None:
    number = _number(connection, robot, name)
    connection.execute(update(ROBOTS).where(ROBOTS.c.id == number).values(residents=CONFIRMED))
    before = {row.person: row for row in connection.execute(select(
        PEOPLE.c.person, PEOPLE.c.id, ROBOT_PEOPLE.c.lives).join(
            ROBOT_PEOPLE, ROBOT_PEOPLE.c.person_id == PEOPLE.c.id).where(
                ROBOT_PEOPLE.c.robot_id == number))}
    for person in sorted(before.keys() | set(people)):
        lives = person in people
        values: dict[str, Any] = {'lives': lives, 'set_ns': now_ns, 'set_by': by[:64]}
        if person not in before:
            connection.execute(insert(ROBOT_PEOPLE).values(
                robot_id=number, person_id=_person(connection, person, now_ns), **values))
        elif before[person].lives != lives:
            connection.execute(update(ROBOT_PEOPLE).where(
                ROBOT_PEOPLE.c.robot_id == number,
                ROBOT_PEOPLE.c.person_id == before[person].id).values(**values))


def _person(connection: Connection, person: str, now_ns: int) -> int:
    found = connection.execute(select(PEOPLE.c.id).where(PEOPLE.c.person == person)).scalar()
    if found is None:
        found = connection.execute(insert(PEOPLE).values(
            person=person, first_ns=now_ns).returning(PEOPLE.c.id)).scalar_one()
    return int(found)


def _households(connection: Connection) -> dict[str, Household]:
    rows = connection.execute(select(
        ROBOTS.c.robot, ROBOTS.c.residents, PEOPLE.c.person, ROBOT_PEOPLE.c.lives).select_from(
            ROBOTS.outerjoin(ROBOT_PEOPLE, ROBOT_PEOPLE.c.robot_id == ROBOTS.c.id).outerjoin(
                PEOPLE, PEOPLE.c.id == ROBOT_PEOPLE.c.person_id))).all()
    lives: dict[str, set[str]] = {}
    ever: dict[str, set[str]] = {}
    confirmed = {row.robot for row in rows if row.residents == CONFIRMED}
    for row in rows:
        known = ever.setdefault(row.robot, set())
        if row.person is not None:
            known.add(row.person)
            if row.lives:
                lives.setdefault(row.robot, set()).add(row.person)
    return {robot: Household(frozenset(lives.get(robot, ())) if robot in confirmed else None,
                             frozenset(people)) for robot, people in ever.items()}


def _checked(people: Collection[str]) -> frozenset[str]:
    names = frozenset(people)
    if len(names) > MOST:
        raise AccountError(f'{len(names)} people', f'at most {MOST} live with one robot')
    for person in names:
        if not 1 <= len(person) <= NAME or not person.isprintable() or '*' in person:
            shown = person[:64].encode('ascii', 'backslashreplace').decode()
            raise AccountError(f"the person '{shown}'", 'give the name by which the robot knows '
                               f'them: 1 to {NAME} printable characters without *')
    return names
