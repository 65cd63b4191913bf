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

"""All parts of authentication in one object that the server passes to its other parts."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
import logging
import os
from pathlib import Path
import secrets
import threading
import time
from typing import Any
from typing import Final
from typing import Literal

from argon2 import PasswordHasher
from rt_robot_os.base.errors import StartError
from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.security.audit import Audit
from rt_robot_os.monitor.security.connections import Connected
from rt_robot_os.monitor.security.devices import Devices
from rt_robot_os.monitor.security.emergencies import EmergencyAccess
from rt_robot_os.monitor.security.invitations import Invitations
from rt_robot_os.monitor.security.limits import LockOut
from rt_robot_os.monitor.security.login_history import restore_limits
from rt_robot_os.monitor.security.outage import Questions
from rt_robot_os.monitor.security.passwords import Passwords
from rt_robot_os.monitor.security.residents import Residents
from rt_robot_os.monitor.security.robots import RobotAccount
from rt_robot_os.monitor.security.robots import Robots
from rt_robot_os.monitor.security.sessions import Session
from rt_robot_os.monitor.security.sessions import SessionLimits
from rt_robot_os.monitor.security.sessions import Sessions
from rt_robot_os.monitor.security.users import Users
from sqlalchemy import Engine

_LOG: Final = logging.getLogger(__name__)
ENDED: Final = 4401
CHANGED: Final = 4403
#: Period at which the server checks for changes by other processes.
WATCH_S: Final = 1.0
_KEY: Final = 'audit.key'
_KEY_BYTES: Final = 32
#: Most sessions and robots with connections; more than the server accepts.
_FOLLOWED: Final = 20_000


@dataclass(frozen=True)
class Revoked:
    """
    A session or a robot whose connections must end now.

    :ivar code: close code of the WebSocket: 4401 it ended, 4403 its rights changed (the page
        reconnects with its new rights).
    """

    kind: Literal['session', 'robot']
    id: str  # noqa: A003
    code: int
    text: str


Callback = Callable[[Revoked], object]


class Accounts:
    """Users, sessions, invitations, robots, emergencies and the audit; safe for threads."""

    def __init__(self, engine: Engine, key: bytes, *, hasher: PasswordHasher | None = None,
                 limits: SessionLimits | None = None,
                 now_ns: Callable[[], int] = time.time_ns) -> None:
        """
        Make it.

        :param key: the key of the audit.
        :param hasher: tests use a faster one.
        :param now_ns: the clock, UTC.
        """
        self.now_ns = now_ns
        self.audit = Audit(engine, key, now_ns)
        self.users = Users(engine, now_ns)
        self.sessions = Sessions(engine, limits or SessionLimits(), now_ns)
        self.invitations = Invitations(engine, self.users, now_ns)
        self.robots = Robots(engine, now_ns)
        self.residents = Residents(engine, now_ns)
        self.emergencies = EmergencyAccess(engine, now_ns)
        self.passwords = Passwords(hasher)
        self.connected = Connected()
        self.lock_out = LockOut()
        self.devices = Devices(key)
        self._engine = engine
        self.questions = Questions()
        self._fault = ''
        self._lock = threading.Lock()
        self._callbacks: list[Callback] = []
        self._loop: asyncio.AbstractEventLoop | None = None
        #: The rights of each connected session, and the token hash of each connected robot.
        self._sessions: dict[str, tuple[Any, ...]] = {}
        self._robots: dict[str, str] = {}

    @classmethod
    def open(cls, engine: Engine, folder: Path, **options: Any) -> Accounts:  # noqa: A003
        """
        Make it with the key of the audit from a folder; the key is created when missing.

        :param options: of the constructor.
        :raises StartError: the key cannot be read or created, or belongs to another audit.
        """
        accounts = cls(engine, audit_key(folder), **options)
        if not accounts.audit.is_ours():
            accounts.close()
            raise StartError(f'the key of the audit, {folder / _KEY}, is not the one with which '
                             'the audit of this database was written: give the folder of its '
                             'server with --folder, or restore the key from the backup')
        return accounts

    def restore_limits(self) -> None:
        """
        Restore the limits of wrong passwords from before the restart of the server.

        :raises StoreError: the database cannot be read.
        """
        restore_limits(self._engine, self.lock_out, self.now_ns())

    def setup_link(self, base_url: str) -> str | None:
        """
        Make the link for the first account.

        :param base_url: such as ``https://monitor.local:8443``.
        :return: None when there is an administrator.
        """
        if not self.users.is_empty():
            return None
        return link_of(base_url, self.invitations.make(None))

    def on_revoked(self, callback: Callback) -> None:
        """Register a callback that runs on the event loop when a session or a robot is revoked."""
        self._callbacks.append(callback)

    def follow(self, session: Session) -> bool:
        """
        Watch a session that holds a connection open, until :meth:`unfollow`.

        :return: False when the session or its user has as many connections as they may have.
        """
        if not self.connected.add(session):
            return False
        with self._lock:
            if len(self._sessions) < _FOLLOWED:
                self._sessions.setdefault(session.id, _rights(session))
        return True

    def unfollow(self, session: Session) -> None:
        """Register the end of a connection; a session without connections is not watched."""
        if self.connected.remove(session):
            with self._lock:
                self._sessions.pop(session.id, None)

    def follow_robot(self, robot: str, kept_token: str) -> None:
        """Watch a robot that holds a connection open."""
        with self._lock:
            if len(self._robots) < _FOLLOWED:
                self._robots[robot] = kept_token

    async def session_of(self, secret: str) -> Session | None:
        """
        Return the valid session of a cookie; from memory while the database is unavailable.

        :raises StoreError: the database is unavailable, and this session is not in memory.
        """
        return await self.questions.ask(lambda: self.sessions.find(secret),
                                        lambda: self.sessions.remembered(secret))

    async def robot_of(self, token: str) -> RobotAccount | None:
        """
        Return the robot of a token; from memory while the database is unavailable.

        :raises StoreError: the database is unavailable, and this token is not in memory.
        """
        return await self.questions.ask(lambda: self.robots.find(token),
                                        lambda: self.robots.remembered(token))

    def alive(self, session: str) -> bool:
        """Return whether a connected session has not ended; reads memory only."""
        with self._lock:
            return session in self._sessions

    def end_sessions(self, session: str | None = None, user: str | None = None,
                     but: str = '') -> int:
        """
        End sessions, with their connections; see :meth:`Sessions.end`.

        :return: how many.
        """
        ended = self.sessions.end(session, user, but)
        for each in ended:
            self._tell(Revoked('session', each, ENDED, 'the session has ended'))
        return len(ended)

    def rights_changed(self, session: str) -> None:
        """Notify the connections of a session that its rights have changed."""
        self._tell(Revoked('session', session, CHANGED, 'what you may see has changed'))

    def revoke_robot(self, name_or_id: str) -> str:
        """
        Revoke a robot's token, and end its connection.

        :return: its name.
        :raises AccountError: there is no such robot.
        """
        robot = self.robots.revoke(name_or_id)
        self._tell(Revoked('robot', robot.id, ENDED, 'the token of this robot was revoked'))
        return robot.name

    async def watch(self) -> None:
        """Check each second for sessions and robots that have ended, until cancelled."""
        self._loop = asyncio.get_running_loop()
        try:
            while True:
                await asyncio.sleep(WATCH_S)
                fault = ''
                try:
                    await asyncio.to_thread(self.look)
                except StoreError as error:
                    fault = str(error)
                if fault and not self._fault:
                    _LOG.warning('sessions and robots are checked from memory: %s', fault)
                self._fault = fault
        finally:
            self._loop = None

    def look(self) -> None:
        """Check once: end the connections of invalid sessions and robots."""
        with self._lock:
            followed, robots = dict(self._sessions), dict(self._robots)
        if followed:
            now = self.sessions.get(followed)
            for each, rights in followed.items():
                if each not in now:
                    self._tell(Revoked('session', each, ENDED, 'the session has ended'))
                elif _rights(now[each]) != rights:
                    self.rights_changed(each)
        tokens = self.robots.tokens()  # also for robots that connect during an outage
        for each, token in robots.items():
            if tokens.get(each) != token:
                self._tell(Revoked('robot', each, ENDED, 'the token of this robot was revoked'))
        self.sessions.save_touched()
        self.audit.save_waiting()

    def soon(self, work: Callable[..., object], *arguments: object) -> None:
        """Run work on the event loop of the server; immediately if there is no loop."""
        loop = self._loop
        if loop is None:
            work(*arguments)
        else:
            loop.call_soon_threadsafe(work, *arguments)

    def close(self) -> None:
        """End the threads after their pending writes."""
        self.questions.close()
        self.passwords.close()
        self.sessions.close()
        self.audit.close()

    def _tell(self, revoked: Revoked) -> None:
        with self._lock:
            (self._sessions if revoked.kind == 'session' else self._robots).pop(revoked.id, None)
        for callback in list(self._callbacks):
            self.soon(callback, revoked)


def link_of(base_url: str, secret: str) -> str:
    """Return a one-time link. Browsers do not send the part after ``#``, so it is in no log."""
    return f'{base_url.rstrip("/")}/#/setup/{secret}'


def audit_key(folder: Path) -> bytes:
    """
    Read the key of the audit; it is created when missing.

    :raises StartError: it cannot be read or created, or is not valid.
    """
    path = folder / _KEY
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        # Written completely before it gets its name: two servers that start together use the same
        # key.
        fresh = folder / f'.{_KEY}.{os.getpid()}.{secrets.token_hex(4)}'
        if not path.exists():
            with open(os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), 'w') as file:
                file.write(secrets.token_hex(_KEY_BYTES) + '\n')
                file.flush()
                os.fsync(file.fileno())
            try:
                os.link(fresh, path)
            except FileExistsError:
                pass
            finally:
                fresh.unlink()
        key = bytes.fromhex(path.read_text().strip())
    except (OSError, ValueError) as error:
        raise StartError(f'the key of the audit, {path}: {error}; restore it from the backup of '
                         'the folder') from error
    if len(key) < _KEY_BYTES:
        raise StartError(f'the key of the audit, {path}, is too short: restore it from the '
                         'backup of the folder')
    return key


def _rights(session: Session) -> tuple[Any, ...]:
    return session.permissions, session.people, session.role
