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

"""Stand-ins in memory for parts that are not there yet; they let everybody in, on loopback."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from fastapi import WebSocket


class Permission(Enum):
    """What somebody may do."""

    SEE = 'see'
    HEALTH = 'health'
    CAMERA = 'camera'
    ACKNOWLEDGE = 'acknowledge'
    TALK = 'talk'
    DRIVE = 'drive'
    ADMIN = 'admin'
    AUDIT = 'audit'


@dataclass(frozen=True)
class Actor:
    """Who asks."""

    id: str = 'demo'  # noqa: A003
    name: str = 'demo'
    role: str = 'operator'
    permissions: frozenset[Permission] = frozenset(Permission)
    people: frozenset[str] | None = None
    session: str = ''
    address: str = ''

    def may(self, permission: Permission) -> bool:
        """Return whether they may do that."""
        return permission in self.permissions

    def may_see(self, person: str) -> bool:
        """Return whether they may see data of a person."""
        return self.people is None or person in self.people


@dataclass(frozen=True)
class Robot:
    """A robot that has shown its token."""

    id: str  # noqa: A003
    name: str


def allowed(permission: Permission) -> Callable[[], Actor]:
    """Return a dependency that gives the actor."""
    return Actor


async def websocket_actor(websocket: WebSocket, permission: Permission) -> Actor | None:
    """Return who has opened it."""
    return Actor()


async def robot_of(websocket: WebSocket) -> Robot | None:
    """Return which robot has opened it."""
    token = websocket.headers.get('authorization', '').removeprefix('Bearer ') or 'robot'
    return Robot(token, token)


class Accounts:
    """Nobody is ever revoked."""

    def on_revoked(self, callback: Callable[[str], object]) -> None:
        """Call back with a session that has been revoked."""


class Audit:
    """Keeps what was noted."""

    def __init__(self) -> None:
        self.rows: list[tuple[str, str, str, Mapping[str, Any]]] = []

    def note(self, actor: Actor, action: str, what: str, **details: Any) -> None:
        """Note what somebody did."""
        self.rows.append((actor.name, action, what, details))

    def read(self, actor: Actor, action: str, what: str, **details: Any) -> None:
        """Note what somebody has read."""
        self.note(actor, action, what, **details)
