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

"""Driving a robot remotely: leases, commands with tickets, and the robot's heart-beats."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.messages.uplink.fields import count_in
from rt_robot_os.messages.uplink.fields import cut_text_in
from rt_robot_os.messages.uplink.fields import number_in
from rt_robot_os.messages.uplink.fields import text_in
from rt_robot_os.messages.uplink.fields import wrong
from rt_robot_os.messages.uplink.messages import UplinkMessage

LEASE_CHARACTERS: Final = 64
DRIVER_CHARACTERS: Final = 80
#: JavaScript holds integers below this exactly.
NUMBER_END: Final = 1 << 53


@dataclass(frozen=True)
class DriveBegin(UplinkMessage):
    """
    A driver may drive from now on.

    :ivar lease: names the time for which they may; another with each time.
    """

    KIND: ClassVar[str] = 'drive_begin'

    lease: str
    by: str

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'lease': self.lease, 'by': self.by}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> DriveBegin:
        """
        Read it.

        :raises ValueError: it has no lease, or does not name the driver.
        """
        by = message.get('by')
        if not isinstance(by, str):
            raise wrong('by', by, 'a string')
        return cls(text_in(message, 'lease', LEASE_CHARACTERS), by[:DRIVER_CHARACTERS])


@dataclass(frozen=True)
class DriveCommand(UplinkMessage):
    """
    A command of the driver; a page sends it without ``lease`` and ``by``.

    :ivar seq: counts the commands of a lease.
    :ivar beat: the ticket: the number of the newest heart-beat that the page has received.
    :ivar held_ms: how long the page had that ticket.
    :ivar grip: the driver holds the dead-man switch.
    """

    KIND: ClassVar[str] = 'drive'

    seq: int
    beat: int
    grip: bool = False
    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0
    held_ms: float = 0.0
    lease: str = ''
    by: str = ''

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'seq': self.seq, 'beat': self.beat, 'grip': self.grip,
                'linear_m_s': self.linear_m_s, 'angular_rad_s': self.angular_rad_s,
                'held_ms': self.held_ms, 'lease': self.lease, 'by': self.by}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> DriveCommand:
        """
        Read it.

        :raises ValueError: a number is missing or malformed.
        """
        return cls(count_in(message, 'seq', end=NUMBER_END),
                   count_in(message, 'beat', end=NUMBER_END), message.get('grip') is True,
                   number_in(message, 'linear_m_s', 0.0), number_in(message, 'angular_rad_s', 0.0),
                   number_in(message, 'held_ms', 0.0),
                   cut_text_in(message, 'lease', LEASE_CHARACTERS),
                   cut_text_in(message, 'by', DRIVER_CHARACTERS))


@dataclass(frozen=True)
class DriveEnd(UplinkMessage):
    """
    A driver may no longer drive.

    :ivar lease: that ends; None: any.
    """

    KIND: ClassVar[str] = 'drive_end'

    lease: str | None
    by: str = ''
    why: str = ''

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'lease': self.lease, 'by': self.by, 'why': self.why}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> DriveEnd:
        """
        Read it.

        :raises ValueError: its lease is not a string.
        """
        lease = message.get('lease')
        if lease is not None and not isinstance(lease, str):
            raise wrong('lease', lease, 'a string')
        return cls(lease, cut_text_in(message, 'by', DRIVER_CHARACTERS),
                   cut_text_in(message, 'why', DRIVER_CHARACTERS))


@dataclass(frozen=True)
class DriveBeat(UplinkMessage):
    """
    A heart-beat of a robot that may be driven: a ticket, and what the robot does.

    :ivar n: the ticket that the next command must carry.
    :ivar lease: empty of none.
    :ivar seq: of the last command that the robot has accepted.
    :ivar armed: the dead-man switch was seen released, so that pressing it counts.
    :ivar rtt_ms: from the robot to the page and back; None while it is unknown.
    :ivar speed: as the signal of this name, and likewise ``stop_reason`` and ``steering``; None
        while the robot does not have it.
    :ivar runs: the robot's core runs; None of a robot that does not tell.
    """

    KIND: ClassVar[str] = 'beat'

    n: int
    utc_ns: int = 0
    lease: str = ''
    seq: int = 0
    armed: bool = False
    moves: bool = False
    rtt_ms: float | None = None
    speed: Any = None
    stop_reason: Any = None
    steering: Any = None
    runs: bool | None = None

    def content(self) -> dict[str, Any]:
        """Return the fields on the wire."""
        return {'n': self.n, 'utc_ns': self.utc_ns, 'lease': self.lease, **self._state()}

    def for_page(self) -> dict[str, Any]:
        """Return what a page gets of it."""
        return {'n': self.n, 'utc_ns': self.utc_ns, **self._state()}

    def _state(self) -> dict[str, Any]:
        shown = {'speed': self.speed, 'stop_reason': self.stop_reason, 'steering': self.steering,
                 'runs': self.runs}
        return {'seq': self.seq, 'armed': self.armed, 'moves': self.moves, 'rtt_ms': self.rtt_ms,
                **{name: value for name, value in shown.items() if value is not None}}

    @classmethod
    def from_json(cls, message: Mapping[str, Any]) -> DriveBeat:
        """
        Read it.

        :raises ValueError: a number is missing or malformed.
        """
        rtt_ms = None if message.get('rtt_ms') is None else number_in(message, 'rtt_ms')
        runs = message.get('runs')
        return cls(count_in(message, 'n', end=NUMBER_END), count_in(message, 'utc_ns', 0),
                   cut_text_in(message, 'lease', LEASE_CHARACTERS), count_in(message, 'seq', 0),
                   message.get('armed') is True, message.get('moves') is True, rtt_ms,
                   message.get('speed'), message.get('stop_reason'), message.get('steering'),
                   None if runs is None else runs is True)
