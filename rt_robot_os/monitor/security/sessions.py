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
Sessions of users, kept by the server.

A session that nobody has touched for a while keeps alarms in sight and loses what changes
something, until the password is typed again: a page that stands open on a ward must show the next
alarm, and must not let who passes by drive the robot.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any
from typing import Final

from rt_robot_os.monitor.security.roles import EVERYBODY
from rt_robot_os.monitor.security.roles import Permission
from rt_robot_os.monitor.security.roles import PERMISSIONS
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.security.roles import WHEN_IDLE
from rt_robot_os.monitor.security.tables import emergencies
from rt_robot_os.monitor.security.tables import sessions
from rt_robot_os.monitor.security.tables import users
from rt_robot_os.monitor.security.tokens import kept
from rt_robot_os.monitor.security.tokens import new_id
from rt_robot_os.monitor.security.tokens import new_secret
from rt_robot_os.monitor.security.users import people_of
from rt_robot_os.monitor.store.engine import reading
from rt_robot_os.monitor.store.engine import writing
from sqlalchemy import Connection
from sqlalchemy import Engine
from sqlalchemy import Row
from sqlalchemy import select

SECOND_NS: Final = 1_000_000_000
#: Of one user; who logs in once more ends the oldest.
MOST: Final = 20
#: When it was used is written no more often than this.
_SEEN_EVERY_S: Final = 30


@dataclass(frozen=True)
class Limits:
    """How long a session lasts, in seconds: untouched, and altogether."""

    idle_s: float = 900.0
    absolute_s: float = 12 * 3600.0


@dataclass(frozen=True)
class Session:
    """
    A session that is good now, with what its user may do and see.

    :ivar permissions: of the role; fewer when it is locked.
    :ivar people: whom the user may see, emergencies included; None is everybody.
    :ivar is_locked: nobody has touched it for a while: only the password opens it again.
    :ivar emergency: it sees somebody by an emergency; ``emergency_ends_ns`` is when that ends.
    """

    id: str  # noqa: A003
    user: str
    name: str
    role: Role
    permissions: frozenset[Permission]
    people: frozenset[str] | None
    is_locked: bool
    emergency: frozenset[str]
    emergency_ends_ns: int
    seen_ns: int
    expires_ns: int


class Sessions:
    """The table of sessions; safe for several threads."""

    def __init__(self, engine: Engine, limits: Limits, now_ns: Callable[[], int]) -> None:
        self._engine = engine
        self._limits = limits
        self._now_ns = now_ns

    def begin(self, user: str, address: str, browser: str) -> tuple[str, str]:
        """
        Begin a session: always with a new id and a new secret.

        :return: the id, and the secret for the cookie.
        """
        now = self._now_ns()
        secret, session = new_secret(), new_id()
        with writing(self._engine) as connection:
            connection.execute(sessions.delete().where(sessions.c.expires_ns <= now))
            old = connection.execute(select(sessions.c.id).where(sessions.c.user == user)
                                     .order_by(sessions.c.seen_ns.desc()).offset(MOST - 1)
                                     ).scalars().all()
            connection.execute(sessions.delete().where(sessions.c.id.in_(old)))
            connection.execute(sessions.insert().values(
                id=session, token=kept(secret), user=user, created_ns=now, seen_ns=now,
                expires_ns=now + int(self._limits.absolute_s * SECOND_NS), address=address[:64],
                browser=browser[:200]))
        return session, secret

    def find(self, secret: str) -> Session | None:
        """Return the session of a cookie, if there is one and it is good."""
        if not 20 <= len(secret) <= 100:
            return None
        with reading(self._engine) as connection:
            return self._find(connection, sessions.c.token == kept(secret))

    def touch(self, session: Session) -> None:
        """Note that somebody used it, now and then; a locked one stays locked."""
        now = self._now_ns()
        if session.is_locked or now - session.seen_ns < _SEEN_EVERY_S * SECOND_NS:
            return
        with writing(self._engine) as connection:
            connection.execute(sessions.update().where(
                sessions.c.id == session.id,
                sessions.c.seen_ns > now - int(self._limits.idle_s * SECOND_NS))
                .values(seen_ns=now))

    def unlock(self, session: str) -> None:
        """Open a locked session again; its user has just typed the password."""
        with writing(self._engine) as connection:
            connection.execute(sessions.update().where(sessions.c.id == session).values(
                seen_ns=self._now_ns()))

    def get(self, ids: Iterable[str]) -> dict[str, Session]:
        """Return those of some sessions that are still good, as they are now."""
        with reading(self._engine) as connection:
            found = ((each, self._find(connection, sessions.c.id == each)) for each in ids)
            return {each: session for each, session in found if session is not None}

    def of(self, user: str | None = None) -> list[dict[str, Any]]:
        """Return the sessions of a user or of all, as they may be shown."""
        now = self._now_ns()
        query = select(sessions, users.c.name).join(users, users.c.id == sessions.c.user).where(
            sessions.c.expires_ns > now).order_by(sessions.c.seen_ns.desc())
        if user is not None:
            query = query.where(sessions.c.user == user)
        with reading(self._engine) as connection:
            rows = connection.execute(query).all()
        return [{'id': row.id, 'user': row.user, 'name': row.name, 'created_ns': row.created_ns,
                 'seen_ns': row.seen_ns, 'expires_ns': row.expires_ns, 'address': row.address,
                 'browser': row.browser} for row in rows]

    def end(self, session: str | None = None, user: str | None = None,
            but: str = '') -> list[str]:
        """
        End a session, or all of a user.

        :param user: with a session, only if it is theirs.
        :param but: all but this one.
        :return: the ids of those that ended.
        """
        if session is None and user is None:
            raise ValueError('neither a session nor a user')
        conditions = [sessions.c.id != but]
        if session is not None:
            conditions.append(sessions.c.id == session)
        if user is not None:
            conditions.append(sessions.c.user == user)
        with writing(self._engine) as connection:
            ids = list(connection.execute(select(sessions.c.id).where(*conditions)).scalars())
            connection.execute(sessions.delete().where(sessions.c.id.in_(ids)))
            connection.execute(emergencies.update().where(
                emergencies.c.session.in_(ids), emergencies.c.ends_ns > self._now_ns())
                .values(ends_ns=self._now_ns()))
        return ids

    def _find(self, connection: Connection, condition: Any) -> Session | None:
        now = self._now_ns()
        row = connection.execute(
            select(sessions, users.c.name, users.c.role).join(users, users.c.id == sessions.c.user)
            .where(condition, sessions.c.expires_ns > now, users.c.disabled.is_(False))).first()
        if row is None:
            return None
        return self._session(connection, row, now)

    def _session(self, connection: Connection, row: Row[Any], now: int) -> Session:
        role = Role(row.role)
        permissions = PERMISSIONS[role]
        people = people_of(connection, row.user)
        is_locked = not permissions <= WHEN_IDLE and (
            now - row.seen_ns >= self._limits.idle_s * SECOND_NS)
        seen: frozenset[str] = frozenset()
        ends = 0
        if is_locked:
            permissions &= WHEN_IDLE
        else:
            rows = connection.execute(select(emergencies.c.person, emergencies.c.ends_ns).where(
                emergencies.c.session == row.id, emergencies.c.ends_ns > now)).all()
            seen = frozenset(each.person for each in rows)
            ends = min((each.ends_ns for each in rows), default=0)
        if seen:
            permissions |= {Permission.HEALTH}
            people = None if people is None or EVERYBODY in seen else people | seen
        return Session(row.id, row.user, row.name, role, permissions, people, is_locked, seen,
                       ends, row.seen_ns, row.expires_ns)
