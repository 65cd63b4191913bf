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

"""One-time links for the first account, further accounts, and forgotten passwords."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from rt_robot_os.monitor.security.roles import EVERYBODY
from rt_robot_os.monitor.security.roles import Role
from rt_robot_os.monitor.security.tables import invitations
from rt_robot_os.monitor.security.tables import users
from rt_robot_os.monitor.security.tokens import kept
from rt_robot_os.monitor.security.tokens import new_secret
from rt_robot_os.monitor.security.users import AccountError
from rt_robot_os.monitor.security.users import admins
from rt_robot_os.monitor.security.users import set_password
from rt_robot_os.monitor.security.users import User
from rt_robot_os.monitor.security.users import Users
from rt_robot_os.monitor.store.engine import reading
from rt_robot_os.monitor.store.engine import writing
from sqlalchemy import Connection
from sqlalchemy import Engine
from sqlalchemy import select

SECOND_NS: Final = 1_000_000_000
FIRST_S: Final = 24 * 3600
OTHERS_S: Final = 72 * 3600


@dataclass(frozen=True)
class Invitation:
    """
    A valid one-time link.

    :ivar user: its user; None for the first account, whose name is chosen on use.
    """

    user: User | None
    expires_ns: int


class Invitations:
    """The table of one-time links; it stores only their hashes."""

    def __init__(self, engine: Engine, users_: Users, now_ns: Callable[[], int]) -> None:
        self._engine = engine
        self._users = users_
        self._now_ns = now_ns

    def make(self, user: str | None) -> str:
        """
        Make a link; it replaces an earlier one for the same account.

        :param user: the user's id; None for the first account.
        :return: the secret of the link.
        """
        now = self._now_ns()
        secret = new_secret()
        lasts = (FIRST_S if user is None else OTHERS_S) * SECOND_NS
        with writing(self._engine) as connection:
            connection.execute(invitations.delete().where(invitations.c.expires_ns <= now))
            connection.execute(invitations.delete().where(
                invitations.c.user.is_(None) if user is None else invitations.c.user == user))
            connection.execute(invitations.insert().values(
                token=kept(secret), user=user, created_ns=now, expires_ns=now + lasts))
        return secret

    def find(self, secret: str) -> Invitation | None:
        """Return the purpose of a link, or None when it is used, expired or unknown."""
        with reading(self._engine) as connection:
            row = connection.execute(select(invitations).where(
                invitations.c.token == kept(secret),
                invitations.c.expires_ns > self._now_ns())).first()
            if row is not None and row.user is None and admins(connection):
                return None  # the first account was created by other means meanwhile
        if row is None:
            return None
        user = self._users.get(row.user) if row.user is not None else None
        if row.user is not None and (user is None or user.is_disabled):
            return None
        return Invitation(user, row.expires_ns)

    def use(self, secret: str, name: str, password: str, role: Role) -> User | None:
        """
        Use a link; of concurrent requests only one succeeds.

        :param name: of the first account, like ``role``; otherwise both stay unchanged.
        :param password: its hash.
        :return: the user; None when the link is no longer valid.
        :raises AccountError: the name is not valid or taken; the link stays valid.
        """
        with writing(self._engine) as connection:
            row = connection.execute(select(invitations).where(
                invitations.c.token == kept(secret),
                invitations.c.expires_ns > self._now_ns())).first()
            if row is None or connection.execute(invitations.delete().where(
                    invitations.c.token == row.token)).rowcount != 1:
                return None
            if row.user is None:
                return None if admins(connection) else self._first(connection, name, password,
                                                                   role)
            if connection.execute(select(users.c.disabled).where(users.c.id == row.user)
                                  ).scalar_one():
                return None
            set_password(connection, row.user, password, self._now_ns())
        return self._users.get(row.user)

    def withdraw(self, user: str) -> None:
        """Revoke the link of a user."""
        with writing(self._engine) as connection:
            connection.execute(invitations.delete().where(invitations.c.user == user))

    def _first(self, connection: Connection, name: str, password: str, role: Role) -> User:
        if role not in (Role.OWNER, Role.ADMIN):
            raise AccountError(f'the first account cannot be {role.value}',
                               'owner or admin: one has to admit the others')
        people = (EVERYBODY,) if role is Role.OWNER else ()
        return self._users.add_in(connection, name, role, people, 'set-up', password)
