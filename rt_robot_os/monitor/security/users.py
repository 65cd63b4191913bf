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

"""Users: their names, roles, passwords and the people that each may see."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any
from typing import Final
import unicodedata

from rt_robot_os.monitor.security.roles import EVERYBODY
from rt_robot_os.monitor.security.roles import Permission
from rt_robot_os.monitor.security.roles import PERMISSIONS
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.security.tables import grants
from rt_robot_os.monitor.security.tables import users
from rt_robot_os.monitor.security.tokens import new_id
from rt_robot_os.monitor.store.engine import reading
from rt_robot_os.monitor.store.engine import writing
from sqlalchemy import Connection
from sqlalchemy import Engine
from sqlalchemy import func
from sqlalchemy import Row
from sqlalchemy import select

#: Most users, enough for a hospital; the list is sent whole.
MOST: Final = 1000
MOST_PEOPLE: Final = 500
_LONGEST: Final = 64
_ADMINS: Final = tuple(role.value for role in Role if Permission.ADMIN in PERMISSIONS[role])


class AccountError(ValueError):
    """
    A requested action on an account is not possible.

    :ivar remedy: advice for the user.
    """

    def __init__(self, text: str, remedy: str = '') -> None:
        self.text = text
        self.remedy = remedy
        super().__init__(f'{text}: {remedy}' if remedy else text)


@dataclass(frozen=True)
class User:
    """
    A user.

    :ivar password: its hash; empty until there is one.
    :ivar people: people they may see; None means everybody.
    """

    id: str  # noqa: A003
    name: str
    role: Role
    password: str
    is_disabled: bool
    created_ns: int
    password_ns: int
    people: frozenset[str] | None

    def as_dict(self) -> dict[str, Any]:
        """Return the data that may be shown."""
        return {'id': self.id, 'name': self.name, 'role': self.role.value,
                'people': shown_people(self.people), 'disabled': self.is_disabled,
                'has_password': bool(self.password), 'created_ns': self.created_ns}


def shown_people(people: frozenset[str] | None) -> list[str]:
    """Return the people a user may see as a list."""
    return [EVERYBODY] if people is None else sorted(people)


def key_of(name: str) -> str:
    """Return the normalised name: names that look alike are equal."""
    return ' '.join(unicodedata.normalize('NFKC', name).casefold().split())[:128]


class Users:
    """The table of users; thread-safe."""

    def __init__(self, engine: Engine, now_ns: Callable[[], int]) -> None:
        self._engine = engine
        self._now_ns = now_ns

    def add(self, name: str, role: Role, people: Iterable[str], by: str,
            password: str = '') -> User:
        """
        Add a user.

        :param people: people they may see; ``*`` means everybody.
        :param by: the actor who adds it.
        :param password: its hash, if it is set already.
        :raises AccountError: the name is taken or not valid, or a person's name is not valid.
        """
        with writing(self._engine) as connection:
            return self.add_in(connection, name, role, people, by, password)

    def add_in(self, connection: Connection, name: str, role: Role, people: Iterable[str],
               by: str, password: str) -> User:
        """Add a user like :meth:`add`, within a transaction."""
        name = _check_name(name)
        if connection.execute(select(users.c.id).where(users.c.key == key_of(name))).first():
            raise AccountError(f'a user {name} exists', 'take another name')
        if connection.execute(select(func.count()).select_from(users)).scalar_one() >= MOST:
            raise AccountError(f'there are {MOST} users', 'that is the most')
        now = self._now_ns()
        found = new_id()
        connection.execute(users.insert().values(
            id=found, name=name, key=key_of(name), role=role.value, password=password,
            disabled=False, created_ns=now, password_ns=now if password else 0))
        self._grant(connection, found, people, by)
        return _one(connection, users.c.id == found)

    def find(self, name: str) -> User | None:
        """Return a user by name."""
        with reading(self._engine) as connection:
            return _first(connection, users.c.key == key_of(name))

    def get(self, user: str) -> User | None:
        """Return a user by id."""
        with reading(self._engine) as connection:
            return _first(connection, users.c.id == user)

    def all(self) -> list[User]:  # noqa: A003
        """Return all users, sorted by name."""
        with reading(self._engine) as connection:
            rows = connection.execute(select(users).order_by(users.c.key)).all()
            people: dict[str, set[str]] = {}
            for row in connection.execute(select(grants.c.user, grants.c.person)):
                people.setdefault(row.user, set()).add(row.person)
        return [_user(row, people.get(row.id, set())) for row in rows]

    def is_empty(self) -> bool:
        """Return whether no user can log in and administer."""
        with reading(self._engine) as connection:
            return admins(connection) == 0

    def set_password(self, user: str, password: str) -> None:
        """
        Set the hash of a password.

        :raises AccountError: there is no such user.
        """
        with writing(self._engine) as connection:
            set_password(connection, user, password, self._now_ns())

    def rehash(self, user: str, old: str, password: str) -> None:
        """Store a new hash of the same password, unless the password was changed meanwhile."""
        with writing(self._engine) as connection:
            connection.execute(users.update().where(users.c.id == user, users.c.password == old)
                               .values(password=password))

    def change(self, user: str, by: str, *, role: Role | None = None,
               people: Iterable[str] | None = None, is_disabled: bool | None = None) -> User:
        """
        Change the given attributes.

        :raises AccountError: there is no such user, or no admin would be left.
        """
        with writing(self._engine) as connection:
            before = _first(connection, users.c.id == user)
            if before is None:
                raise AccountError('there is no such user', 'the list shows who there is')
            changes: dict[str, Any] = {}
            if role is not None:
                changes['role'] = role.value
            if is_disabled is not None:
                changes['disabled'] = is_disabled
            if changes:
                connection.execute(users.update().where(users.c.id == user).values(**changes))
            if people is not None:
                connection.execute(grants.delete().where(grants.c.user == user))
                self._grant(connection, user, people, by)
            if before.role.value in _ADMINS and changes and admins(connection) == 0:
                raise AccountError('no administrator of the monitor would be left',
                                   'make another user an admin first')
            return _one(connection, users.c.id == user)

    def _grant(self, connection: Connection, user: str, people: Iterable[str], by: str) -> None:
        names = sorted({_check_person(person) for person in people})
        if len(names) > MOST_PEOPLE:
            raise AccountError(f'{len(names)} people', f"at most {MOST_PEOPLE}, or '*' for all")
        if EVERYBODY in names:
            names = [EVERYBODY]
        now = self._now_ns()
        for person in names:
            connection.execute(grants.insert().values(user=user, person=person, granted_ns=now,
                                                      granted_by=by[:_LONGEST]))


def set_password(connection: Connection, user: str, password: str, now_ns: int) -> None:
    """Set the hash of a password, within a transaction."""
    done = connection.execute(users.update().where(users.c.id == user).values(
        password=password, password_ns=now_ns))
    if done.rowcount != 1:
        raise AccountError('there is no such user', 'the list shows who there is')


def people_of(connection: Connection, user: str) -> frozenset[str] | None:
    """Return the people a user may see."""
    return _people(connection.execute(select(grants.c.person).where(grants.c.user == user)
                                      ).scalars())


def _people(names: Iterable[str]) -> frozenset[str] | None:
    found = frozenset(names)
    return None if EVERYBODY in found else found


def _user(row: Row[Any], people: Iterable[str]) -> User:
    return User(row.id, row.name, Role(row.role), row.password, row.disabled, row.created_ns,
                row.password_ns, _people(people))


def _first(connection: Connection, condition: Any) -> User | None:
    row = connection.execute(select(users).where(condition)).first()
    if row is None:
        return None
    people = connection.execute(select(grants.c.person).where(grants.c.user == row.id)).scalars()
    return _user(row, people)


def _one(connection: Connection, condition: Any) -> User:
    found = _first(connection, condition)
    assert found is not None
    return found


def admins(connection: Connection) -> int:
    """Return the number of administrators who can log in."""
    return int(connection.execute(select(func.count()).select_from(users).where(
        users.c.role.in_(_ADMINS), users.c.disabled.is_(False), users.c.password != '')
        ).scalar_one())


def _check_name(name: str) -> str:
    name = ' '.join(unicodedata.normalize('NFKC', name).split())
    if not 1 <= len(name) <= _LONGEST or not name.isprintable() or not all(
            letter.isalnum() or letter in ' ._@-' for letter in name):
        raise AccountError(f"the name '{_shown(name)}'", f'1 to {_LONGEST} letters, digits, '
                           'spaces and . _ @ -')
    return name


def _check_person(person: str) -> str:
    if person == EVERYBODY:
        return person
    if not 1 <= len(person) <= 128 or not person.isprintable() or '*' in person:
        raise AccountError(f"the person '{_shown(person)}'", 'the name by which the robot knows '
                           "them, or '*' alone for everybody")
    return person


def _shown(name: str) -> str:
    return name[:_LONGEST].encode('ascii', 'backslashreplace').decode()
