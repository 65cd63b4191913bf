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

"""The roles of users and their permissions, defined only here."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Final


class Permission(str, Enum):
    """A permission that an endpoint requires."""

    #: Overview, alarms, positions.
    SEE = 'see'
    #: Vital signs, their history and their export.
    HEALTH = 'health'
    CAMERA = 'camera'
    #: Answering alarms, and stopping a robot.
    ACKNOWLEDGE = 'acknowledge'
    TALK = 'talk'
    DRIVE = 'drive'
    #: Users, robots, invitations, other people's sessions.
    ADMIN = 'admin'
    AUDIT = 'audit'


class Role(str, Enum):
    """The role of a user; each has one."""

    VIEWER = 'viewer'
    CARER = 'carer'
    OPERATOR = 'operator'
    ADMIN = 'admin'
    #: Operator and admin in one, for a household or a trial with a single account.
    OWNER = 'owner'


_VIEWER: Final = frozenset({Permission.SEE, Permission.HEALTH})
_CARER: Final = _VIEWER | {Permission.CAMERA, Permission.ACKNOWLEDGE, Permission.TALK}
_OPERATOR: Final = _CARER | {Permission.DRIVE}
_ADMIN: Final = frozenset({Permission.SEE, Permission.ADMIN, Permission.AUDIT})

PERMISSIONS: Final[Mapping[Role, frozenset[Permission]]] = {
    Role.VIEWER: _VIEWER, Role.CARER: _CARER, Role.OPERATOR: _OPERATOR, Role.ADMIN: _ADMIN,
    Role.OWNER: _OPERATOR | _ADMIN}
#: Permissions of a session that was idle for a while: alarms stay visible.
WHEN_IDLE: Final = _VIEWER
#: Roles with emergency access, with a reason, to health data of other people.
MAY_BREAK_GLASS: Final = frozenset({Role.CARER, Role.OPERATOR, Role.ADMIN, Role.OWNER})
#: Means all people in a list of people.
EVERYBODY: Final = '*'


def role_of(text: str) -> Role:
    """
    Parse a role.

    :raises ValueError: there is no such role.
    """
    try:
        return Role(text)
    except ValueError:
        raise ValueError(f"role '{text[:40]}': must be one of {', '.join(Role)}") from None
