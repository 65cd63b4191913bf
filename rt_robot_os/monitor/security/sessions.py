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
Sessions of users, stored by the server.

An idle session still shows alarms but loses permissions that change something, until the password
is typed again: a page left open on a ward must show the next alarm, and must not let a passer-by
drive the robot.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
import threading
from typing import Any
from typing import Final

from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.security.outage import Memory
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
from sqlalchemy import select

SECOND_NS: Final = 1_000_000_000
#: Most sessions of one user; another login ends the oldest.
MOST: Final = 20
#: Most sessions whose last use waits to be written.
TOUCHED_MOST: Final = 20_000
#: Shortest time between two writes of the last use.
_SEEN_EVERY_S: Final = 30


@dataclass(frozen=True)
class SessionLimits:
    """How long a session lasts, in seconds: while idle, and in total."""

    idle_s: float = 900.0
    absolute_s: float = 12 * 3600.0


@dataclass(frozen=True)
class Session:
    """
    A valid session, with what its user may do and see.

    :ivar permissions: of the role; fewer when it is locked.
    :ivar people: people the user may see, including emergencies; None means everybody.
    :ivar is_locked: it was idle for a while: only the password unlocks it.
    :ivar emergency: people it sees by an emergency; ``emergency_ends_ns`` is when that ends.
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


@dataclass(frozen=True)
class _Stored:
    """A session as stored in the database; :meth:`Sessions._judged` returns its current state."""

    id: str  # noqa: A003
    token: str
    user: str
    name: str
    role: Role
    people: frozenset[str] | None
    emergencies: tuple[tuple[str, int], ...]
    seen_ns: int
    expires_ns: int
    password: str


class Sessions:
    """The table of sessions; thread-safe."""

    def __init__(self, engine: Engine, limits: SessionLimits, now_ns: Callable[[], int]) -> None:
        self._engine = engine
        self._limits = limits
        self._now_ns = now_ns
        self._memory: Memory[_Stored] = Memory()
        self._lock = threading.Lock()
        #: Times of use that are not written to the database yet.
        self._touched: dict[str, int] = {}
        #: Those of them that were unlocked by the password.
        self._unlocked: set[str] = set()
        self._writer = ThreadPoolExecutor(1, 'touch')

    def begin(self, user: str, address: str, browser: str) -> tuple[str, str]:
        """
        Begin a session, always with a new id and a new secret.

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
        """Return the session of a cookie if it is valid."""
        if not 20 <= len(secret) <= 100:
            return None
        token = kept(secret)
        with reading(self._engine) as connection:
            found = self._read(connection, sessions.c.token == token)
        if found is None:
            self._memory.forget(lambda key, _: key == token)
            return None
        return self._judged(found)

    def remembered(self, secret: str) -> Session | None:
        """
        Return the session of a cookie from memory.

        It locks and expires as usual. Reads memory only: safe on an event loop.
        """
        found = self._memory.find(kept(secret))
        return None if found is None else self._judged(found)

    def touch(self, session: Session) -> None:
        """
        Update the time of last use; a locked session stays locked.

        It is effective immediately. A thread writes to the database, since a stop must not wait
        for the disk.
        """
        now = self._now_ns()
        if session.is_locked or now - session.seen_ns < _SEEN_EVERY_S * SECOND_NS:
            return
        with self._lock:
            if len(self._touched) < TOUCHED_MOST:
                self._touched[session.id] = now
        try:
            self._writer.submit(self.save_touched)
        except RuntimeError:
            pass  # Closed.

    def save_touched(self) -> None:
        """Write times of last use; they stay in memory while the database is unavailable."""
        with self._lock:
            touched, unlocked = dict(self._touched), set(self._unlocked)
        if not touched:
            return
        idle_ns = int(self._limits.idle_s * SECOND_NS)
        try:
            with writing(self._engine) as connection:
                for session, seen_ns in touched.items():
                    least_ns = 0 if session in unlocked else seen_ns - idle_ns
                    connection.execute(sessions.update().where(
                        sessions.c.id == session, sessions.c.seen_ns < seen_ns,
                        sessions.c.seen_ns > least_ns).values(seen_ns=seen_ns))
        except StoreError:
            return
        with self._lock:
            for session, seen_ns in touched.items():
                if self._touched.get(session) == seen_ns:
                    del self._touched[session]
                    self._unlocked.discard(session)

    def close(self) -> None:
        """Write the pending times, and end the thread."""
        self._writer.shutdown()

    def unlock(self, session: str) -> None:
        """
        Unlock a session after its user has typed the password.

        It is effective immediately, and written later if the database is unavailable.

        :raises StoreError: the database is unavailable.
        """
        now = self._now_ns()
        with self._lock:
            self._touched[session] = now
            self._unlocked.add(session)
        with writing(self._engine) as connection:
            connection.execute(sessions.update().where(sessions.c.id == session).values(
                seen_ns=now))

    def password_of(self, secret: str) -> str:
        """
        Return the password hash of the session's user from memory.

        :meth:`find` fills that memory. Safe on an event loop.

        :return: empty when the session is not known.
        """
        found = self._memory.find(kept(secret))
        return '' if found is None else found.password

    def get(self, ids: Iterable[str]) -> dict[str, Session]:
        """Return the current state of those of the given sessions that are still valid."""
        wanted = list(ids)
        with reading(self._engine) as connection:
            found = [self._read(connection, sessions.c.id == each) for each in wanted]
        good = {each.id: session for each in found
                if each is not None and (session := self._judged(each)) is not None}
        self._memory.forget(lambda _, each: each.id in wanted and each.id not in good)
        return good

    def of(self, user: str | None = None) -> list[dict[str, Any]]:
        """Return the sessions of one user or of all users, for display."""
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

        :param user: together with a session: only if it is theirs.
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
        # Immediately, and also when writing to the database fails, which raises an error.
        self._memory.forget(lambda _, each: each.id != but and session in (None, each.id)
                            and user in (None, each.user))
        with writing(self._engine) as connection:
            ids = list(connection.execute(select(sessions.c.id).where(*conditions)).scalars())
            connection.execute(sessions.delete().where(sessions.c.id.in_(ids)))
            connection.execute(emergencies.update().where(
                emergencies.c.session.in_(ids), emergencies.c.ends_ns > self._now_ns())
                .values(ends_ns=self._now_ns()))
        return ids

    def _read(self, connection: Connection, condition: Any) -> _Stored | None:
        now = self._now_ns()
        row = connection.execute(
            select(sessions, users.c.name, users.c.role, users.c.password)
            .join(users, users.c.id == sessions.c.user)
            .where(condition, sessions.c.expires_ns > now, users.c.disabled.is_(False))).first()
        if row is None:
            return None
        seen = connection.execute(select(emergencies.c.person, emergencies.c.ends_ns).where(
            emergencies.c.session == row.id, emergencies.c.ends_ns > now)).all()
        found = _Stored(row.id, row.token, row.user, row.name, Role(row.role),
                        people_of(connection, row.user),
                        tuple((each.person, each.ends_ns) for each in seen), row.seen_ns,
                        row.expires_ns, row.password)
        self._memory.store(found.token, found)
        return found

    def _judged(self, stored: _Stored) -> Session | None:
        now = self._now_ns()
        if stored.expires_ns <= now:
            return None
        seen_ns = max(stored.seen_ns, self._touched.get(stored.id, 0))
        permissions, people = PERMISSIONS[stored.role], stored.people
        is_locked = not permissions <= WHEN_IDLE and (
            now - seen_ns >= self._limits.idle_s * SECOND_NS)
        running = {} if is_locked else {person: ends_ns for person, ends_ns in stored.emergencies
                                        if ends_ns > now}
        if is_locked:
            permissions &= WHEN_IDLE
        if running:
            permissions |= {Permission.HEALTH}
            people = None if people is None or EVERYBODY in running else people | running.keys()
        return Session(stored.id, stored.user, stored.name, stored.role, permissions, people,
                       is_locked, frozenset(running), min(running.values(), default=0), seen_ns,
                       stored.expires_ns)
