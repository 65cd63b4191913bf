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
What each route answers, for ``/api/openapi.json`` and the types of the page.

Fields stand in the order in which they are sent. A field with a default is missing where there is
nothing to say: routes with such models leave out what is not set.
"""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel
from pydantic import ConfigDict

#: An integer stays an integer.
Number = int | float
Codes = dict[str, Any]


class Lenient(BaseModel):
    """An answer with parts that robots write: what this release does not know is passed on."""

    model_config = ConfigDict(extra='allow')


# ---- robots ------------------------------------------------------------------------------------

class ShownNode(BaseModel):
    """Where a node of the sensor network is, in m on the map."""

    id: int  # noqa: A003
    name: str
    x: Number
    y: Number
    z: Number
    person: str


class ShownLimits(BaseModel):
    """How fast a robot may be driven; empty where it may not."""

    linear_m_s: Number = 0.0
    angular_rad_s: Number = 0.0


class ShownCall(BaseModel):
    """Who talks with a robot, and since when."""

    by: str
    since_ns: int


class ShownStory(BaseModel):
    """What will happen in a demonstration."""

    what: str
    person: str
    at_ns: int


class ShownRobot(Lenient):
    """A robot; what it has not said is missing."""

    id: str  # noqa: A003
    name: str
    connected: bool
    silent: bool
    retired: bool
    last_seen_ns: int
    people: list[str]
    clock_offset_s: Number
    cameras: list[str] = []
    capabilities: list[str] = []
    nodes: list[ShownNode] = []
    map: str = ''  # noqa: A003
    limits: ShownLimits = ShownLimits()
    version: int = 0
    call: ShownCall | None = None
    story: ShownStory | None = None


class ShownPerson(BaseModel):
    """A person, and the robots they live with."""

    person: str
    robots: list[str]


class ShownMap(BaseModel):
    """The map of a robot; ``cells`` are Base64 of zlib."""

    sha256: str
    width: int
    height: int
    resolution_m: Number
    origin: list[Number]
    cells: str


# ---- alarms ------------------------------------------------------------------------------------

class ShownAlarm(Lenient):
    """An alarm."""

    robot: str
    id: str  # noqa: A003
    kinds: list[str]
    utc_ns: int
    seq: int
    state: str
    level: str
    subject: str
    text: str
    by: str
    why: str
    node: str
    x: Number | None
    y: Number | None
    opened_ns: int
    t_ns: int
    raised_ns: int | None
    acknowledged_ns: int | None
    acknowledged_by: str
    is_open: bool


class CodedAlarm(ShownAlarm):
    """An alarm in a list; ``codes`` are those of its texts."""

    codes: Codes


class ShownAlarmEvent(Lenient):
    """An event of an alarm, as its robot reported it."""

    t_ns: int
    seq: int
    arrived_ns: int
    codes: Codes


class ShownNote(BaseModel):
    """A note about an alarm."""

    id: int  # noqa: A003
    by: str
    text: str
    t_ns: int


class StoredMedia(BaseModel):
    """A picture, clip or sound of an alarm, as its robot announced it."""

    subject: str
    id: int  # noqa: A003
    robot: str
    media: str
    alarm: str
    kind: str
    file: str
    sha256: str
    size: int
    width: int
    height: int
    t_ns: int
    arrived_ns: int
    path: str | None
    stored_ns: int | None


class AlarmDetails(ShownAlarm):
    """An alarm with its history; ``told`` and ``failed`` are channels of notifications."""

    events: list[ShownAlarmEvent]
    told: list[str]
    failed: list[str]
    notes: list[ShownNote]
    media: list[StoredMedia]
    codes: Codes


class NoteAdded(BaseModel):
    """A note is stored."""

    ok: bool
    id: int  # noqa: A003


class Done(BaseModel):
    """It is done."""

    ok: bool


class ShownMedia(BaseModel):
    """A picture, clip or sound in a list; ``here``: the server has its bytes."""

    id: int  # noqa: A003
    robot: str
    alarm: str
    subject: str
    kind: str
    size: int
    width: int
    height: int
    t_ns: int
    here: bool


# ---- people ------------------------------------------------------------------------------------

class ShownObservation(BaseModel):
    """A value of a sign."""

    id: int  # noqa: A003
    robot: str
    boot: str
    seq: int
    person: str
    code: str
    value: Number | None
    unit: str
    quality: str
    source: str
    t_ns: int
    arrived_ns: int


class BadStretch(BaseModel):
    """A time without good values; ``to_ns`` is null while it lasts."""

    from_ns: int
    to_ns: int | None
    quality: str


class ShownChart(BaseModel):
    """A chart of a sign: parallel lists, an entry for each span that has values."""

    person: str
    sign: str
    unit: str
    start_ns: int
    end_ns: int
    level: str
    width_ns: int
    t_ns: list[int]
    low: list[Number]
    mean: list[Number]
    high: list[Number]
    count: list[int]
    limits: list[Any]
    alarms: list[CodedAlarm]
    bucket_ns: int
    bad: list[BadStretch]


class ShownHousehold(BaseModel):
    """Who lives with a robot; ``people`` is null until they are confirmed once."""

    id: str  # noqa: A003
    name: str
    people: list[str] | None
    suggested: list[str]


class ConfirmedPeople(BaseModel):
    """Who lives with a robot now."""

    people: list[str]


# ---- accounts ----------------------------------------------------------------------------------

class ShownSession(BaseModel):
    """The session of the page; ``people`` is ``["*"]`` for everybody."""

    id: str  # noqa: A003
    user: str
    role: str
    permissions: list[str]
    role_permissions: list[str]
    people: list[str]
    csrf: str
    locked: bool
    emergency: list[str]
    emergency_ends_ns: int
    expires_ns: int


class ListedSession(BaseModel):
    """A session in the list of an administrator."""

    id: str  # noqa: A003
    user: str
    name: str
    created_ns: int
    seen_ns: int
    expires_ns: int
    address: str
    browser: str


class OwnSession(ListedSession):
    """A session of one's own; ``is_this``: the one that asks."""

    is_this: bool


class Ended(BaseModel):
    """How many have ended."""

    ended: int


class Revocation(BaseModel):
    """How many were revoked."""

    revoked: int


class SetUpNeeded(BaseModel):
    """Whether there is no account yet."""

    needed: bool


class Invited(BaseModel):
    """What a one-time link is for; ``first``: for the first account."""

    first: bool
    name: str
    role: str
    expires_ns: int


class EmergencyBegun(BaseModel):
    """Until when the access in an emergency lasts."""

    ends_ns: int


class ShownEmergency(BaseModel):
    """An access in an emergency."""

    id: int | str  # noqa: A003
    user: str
    name: str
    person: str
    reason: str
    begins_ns: int
    ends_ns: int
    is_open: bool


class ShownUser(BaseModel):
    """An account; ``people`` is ``["*"]`` for everybody."""

    id: str  # noqa: A003
    name: str
    role: str
    people: list[str]
    disabled: bool
    has_password: bool
    created_ns: int


class AddedUser(ShownUser):
    """A new account; ``token`` is that of its one-time link."""

    token: str


class InvitationToken(BaseModel):
    """The token of a new one-time link."""

    token: str


class ShownToken(BaseModel):
    """A robot that was let in; ``revoked_ns`` is null while it may connect."""

    id: str  # noqa: A003
    name: str
    created_ns: int
    revoked_ns: int | None


class AddedRobot(BaseModel):
    """A new robot; its token is shown once."""

    id: str  # noqa: A003
    name: str
    token: str


class AuditRow(BaseModel):
    """A row of the audit."""

    model_config = ConfigDict(extra='allow')

    seq: int
    t_ns: int
    actor: str
    name: str
    role: str
    address: str
    action: str
    object: str  # noqa: A003
    details: dict[str, Any]


class AuditRows(BaseModel):
    """Rows of the audit, the newest first; how many wait for the disk, and how many were lost."""

    rows: list[AuditRow]
    waiting: int
    lost: int


class AuditVerdict(BaseModel):
    """What a check of the audit's chain found."""

    rows: int
    head: str
    whole: bool
    problems: list[str]
    codes: list[Codes | None]


# ---- the server --------------------------------------------------------------------------------

class ServerHealth(BaseModel):
    """Whether the server runs, and can store records."""

    ok: bool
    storing: bool


class StoringStatus(BaseModel):
    """How records are stored."""

    ok: bool
    text: str
    waiting: int
    commits: int
    failures: int
    records: dict[str, int]


class RobotStatus(BaseModel):
    """What was counted of a robot."""

    id: str  # noqa: A003
    name: str
    connected: bool
    lost: dict[str, int]
    counts: dict[str, int]


class ServerStatus(BaseModel):
    """How the server does."""

    utc_ns: int
    started_ns: int
    connections: dict[str, int]
    clients: dict[str, int]
    storing: StoringStatus
    media: dict[str, int]
    robots: list[RobotStatus]


class ShownProblem(BaseModel):
    """Why a request was refused; ``reason``: what the page does about it."""

    model_config = ConfigDict(extra='allow')

    text: str
    remedy: str
    reason: str = ''
    codes: Codes


class ErrorAnswer(BaseModel):
    """The answer to a request that was refused."""

    detail: ShownProblem
