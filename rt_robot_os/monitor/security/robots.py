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
The robots that may connect, each with a token that its gateway sends as ``Authorization: Bearer``.

Client certificates are not used: the web server would request one from every browser as well, and
does not pass it to the application.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import re
from typing import Any
from typing import Final

from rt_robot_os.monitor.security.outage import Memory
from rt_robot_os.monitor.security.tables import robot_accounts
from rt_robot_os.monitor.security.tokens import kept
from rt_robot_os.monitor.security.tokens import new_id
from rt_robot_os.monitor.security.tokens import new_secret
from rt_robot_os.monitor.security.users import AccountError
from rt_robot_os.monitor.store.engine import reading
from rt_robot_os.monitor.store.engine import writing
from sqlalchemy import Engine
from sqlalchemy import func
from sqlalchemy import select

MOST: Final = 10_000
_NAME: Final = re.compile(r'[A-Za-z0-9][A-Za-z0-9_.-]{0,63}', re.ASCII)


@dataclass(frozen=True)
class RobotAccount:
    """A robot authenticated by its token."""

    id: str  # noqa: A003
    name: str


class Robots:
    """The table of robots' tokens; thread-safe."""

    def __init__(self, engine: Engine, now_ns: Callable[[], int]) -> None:
        self._engine = engine
        self._now_ns = now_ns
        self._memory: Memory[RobotAccount] = Memory(most=MOST)

    def add(self, name: str) -> tuple[RobotAccount, str]:
        """
        Add a robot; a revoked one becomes the same robot again, with a new token.

        :return: the robot, and its token, which is not stored and cannot be shown again.
        :raises AccountError: it has a token already, or the name is not valid.
        """
        if not _NAME.fullmatch(name):
            raise AccountError(f"the robot '{name[:64]!a}'", '1 to 64 letters, digits, _ . -')
        now = self._now_ns()
        token = new_secret()
        with writing(self._engine) as connection:
            row = connection.execute(select(robot_accounts).where(
                robot_accounts.c.name == name)).first()
            if row is not None and row.revoked_ns is None:
                raise AccountError(f'the robot {name} has a token', 'revoke it first')
            if row is not None:
                connection.execute(robot_accounts.update().where(
                    robot_accounts.c.id == row.id).values(token=kept(token), revoked_ns=None,
                                                          created_ns=now))
                return RobotAccount(row.id, name), token
            if connection.execute(select(func.count()).select_from(robot_accounts)
                                  ).scalar_one() >= MOST:
                raise AccountError(f'there are {MOST} robots', 'that is the most')
            robot = RobotAccount(new_id(), name)
            connection.execute(robot_accounts.insert().values(
                id=robot.id, name=name, token=kept(token), created_ns=now))
        return robot, token

    def find(self, token: str) -> RobotAccount | None:
        """Return the robot of a token if the token is valid."""
        if not 20 <= len(token) <= 100:
            return None
        with reading(self._engine) as connection:
            row = connection.execute(select(robot_accounts).where(
                robot_accounts.c.token == kept(token),
                robot_accounts.c.revoked_ns.is_(None))).first()
        if row is None:
            self._memory.forget(lambda key, _: key == kept(token))
            return None
        found = RobotAccount(row.id, row.name)
        self._memory.store(row.token, found)
        return found

    def remembered(self, token: str) -> RobotAccount | None:
        """Return the robot of a token from memory; safe on an event loop."""
        return self._memory.find(kept(token))

    def tokens(self) -> dict[str, str]:
        """Return the hash of the token of each robot that may connect, by its id."""
        with reading(self._engine) as connection:
            rows = connection.execute(select(robot_accounts).where(
                robot_accounts.c.revoked_ns.is_(None))).all()
        good = {row.token: RobotAccount(row.id, row.name) for row in rows}
        self._memory.forget(lambda key, _: key not in good)
        for token, robot in good.items():
            self._memory.store(token, robot)
        return {robot.id: token for token, robot in good.items()}

    def all(self) -> list[dict[str, Any]]:  # noqa: A003
        """Return all robots, including revoked ones, sorted by name."""
        with reading(self._engine) as connection:
            rows = connection.execute(select(robot_accounts).order_by(robot_accounts.c.name)
                                      ).all()
        return [{'id': row.id, 'name': row.name, 'created_ns': row.created_ns,
                 'revoked_ns': row.revoked_ns} for row in rows]

    def revoke(self, name_or_id: str) -> RobotAccount:
        """
        Revoke the token of a robot.

        :raises AccountError: no such robot has a token.
        """
        self._memory.forget(lambda _, robot: name_or_id in (robot.id, robot.name))
        with writing(self._engine) as connection:
            row = connection.execute(select(robot_accounts).where(
                (robot_accounts.c.name == name_or_id) | (robot_accounts.c.id == name_or_id),
                robot_accounts.c.revoked_ns.is_(None))).first()
            if row is None:
                raise AccountError(f'no robot {name_or_id[:64]!a} has a token',
                                   'monitor robot list shows which have')
            connection.execute(robot_accounts.update().where(robot_accounts.c.id == row.id)
                               .values(revoked_ns=self._now_ns()))
        return RobotAccount(row.id, row.name)
