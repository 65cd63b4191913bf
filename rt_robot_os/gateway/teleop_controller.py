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
Decides which remote driver has the lease, and which commands are recent and still active.

It makes pure decisions with a clock as an argument; :mod:`rt_robot_os.gateway.drive` connects
them. A command that moves the robot must pass these checks in this order: it belongs to the
present lease; its number increases; its ticket is at most ``ticket_s`` old; the dead-man switch
was seen released since the lease began, and since the last gap. Then it is active for ``hold_s``,
but never longer than ``ticket_s`` after its ticket was issued.
"""

from __future__ import annotations

from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.gateway.drive_limits import TeleopLimits
from rt_robot_os.gateway.tickets import Tickets
from rt_robot_os.messages.uplink.driving import DriveBegin
from rt_robot_os.messages.uplink.driving import DriveCommand

#: Reasons to refuse a command, each with its counter.
FOREIGN: Final = 'foreign'
DISORDERED: Final = 'disordered'
STALE: Final = 'stale'
MALFORMED: Final = 'malformed'
NOT_ARMED: Final = 'not_armed'
_TAKEN: Final = 'taken'


class Order(NamedTuple):
    """
    A command for the robot.

    :ivar stamp_ns: start of its age, on CLOCK_MONOTONIC.
    """

    linear_m_s: float
    angular_rad_s: float
    stamp_ns: int


class TeleopController:
    """
    The decisions about commands of the driver.

    :param now_ns: on CLOCK_MONOTONIC.
    :ivar lease: of the driver; empty without one.
    :ivar driver: name of the driver.
    :ivar is_armed: the dead-man switch was seen released, so that pressing it counts.
    :ivar deadman_pressed: the dead-man switch is pressed, and counts.
    :ivar moves: the last command was to move.
    :ivar rtt_ms: round-trip time by the last command, without the time its ticket was held by the
        sender; None before.
    :ivar seq: of that command.
    :ivar counters: commands by result.
    """

    def __init__(self, limits: TeleopLimits) -> None:
        self.limits = limits
        self.tickets = Tickets()
        self.lease = self.driver = ''
        self.seq = 0
        self.is_armed = self.deadman_pressed = self.moves = False
        self.rtt_ms: float | None = None
        self.counters = {name: 0 for name in (
            _TAKEN, FOREIGN, DISORDERED, STALE, MALFORMED, NOT_ARMED, 'leases', 'holds_ended')}
        self._until_ns = 0
        self._gap_ns = 0

    def begin(self, message: DriveBegin) -> Order | None:
        """Begin a driver's lease; the robot stops for the previous one."""
        if message.lease == self.lease:
            return None  # sent again, after the server was away for a moment
        order = self.stop()
        self.tickets.forget()
        self.lease, self.driver = message.lease, message.by
        self.seq = 0
        self.is_armed = False
        self.rtt_ms = None
        self.counters['leases'] += self.limits.may_drive
        return order

    def end(self, lease: str | None = None) -> Order | None:
        """
        End the lease.

        :param lease: the lease that ends; None for any.
        """
        if lease is not None and lease != self.lease:
            return None
        self.lease = self.driver = ''
        self.is_armed = False
        self.tickets.forget()
        return self.stop()

    def stop(self) -> Order | None:
        """Return the command to stop if the robot moves; the dead-man switch no longer counts."""
        self.deadman_pressed = False
        if not self.moves:
            return None
        self.moves = False
        return Order(0.0, 0.0, 0)

    def beat(self, now_ns: int) -> int:
        """Return a new ticket."""
        return self.tickets.give(now_ns)

    def reject(self) -> None:
        """Count a malformed message."""
        self.counters[MALFORMED] += 1

    def take(self, command: DriveCommand, now_ns: int) -> Order | None:
        """Return the resulting command for the robot; None when it changes nothing."""
        try:
            order = self._take(command, now_ns)
        except _NotTaken as error:
            self.counters[str(error)] += 1
            return None
        self.counters[_TAKEN] += 1
        return order

    def hold_ended(self, now_ns: int) -> Order | None:
        """Return the command to stop if the last command is no longer active."""
        if not self.moves or now_ns < self._until_ns:
            return None
        self.counters['holds_ended'] += 1
        return self.stop()

    @property
    def until_ns(self) -> int:
        """Return how long the last command is active; 0 when it does not move the robot."""
        return self._until_ns if self.moves else 0

    def _take(self, command: DriveCommand, now_ns: int) -> Order | None:
        if not self.lease or command.lease != self.lease or not self.limits.may_drive:
            raise _NotTaken(FOREIGN)
        if command.seq <= self.seq:
            raise _NotTaken(DISORDERED)
        self.seq = command.seq
        given_ns = self.tickets.given_ns(command.beat)
        if given_ns is None:
            raise _NotTaken(STALE)
        age_ms = (now_ns - given_ns) / NS_PER_MS
        self.rtt_ms = age_ms - min(max(command.held_ms, 0.0), age_ms)
        if now_ns - given_ns > self.limits.ticket_ns:
            raise _NotTaken(STALE)
        return self._hold(command, given_ns, now_ns)

    def _hold(self, command: DriveCommand, given_ns: int, now_ns: int) -> Order | None:
        if not command.grip:
            self.is_armed = True
            self._gap_ns = 0
            return self.stop()
        if self._gap_ns and now_ns - self._gap_ns > self.limits.ticket_ns:
            # It has stopped meanwhile, and must not start when the driver does not expect it.
            self.is_armed = False
        if not self.is_armed:
            raise _NotTaken(NOT_ARMED)
        self._gap_ns = now_ns
        self.deadman_pressed = True
        linear, angular = self.limits.bounded(command.linear_m_s, command.angular_rad_s)
        self._until_ns = min(now_ns + self.limits.hold_ns, given_ns + self.limits.ticket_ns)
        if not linear and not angular:
            # It is active like any other: a stick held in its centre is a command, too.
            self.moves = False
            return Order(0.0, 0.0, now_ns)
        self.moves = True
        # A hold that the ticket shortens has an older stamp, by which the core ends it earlier.
        return Order(linear, angular, self._until_ns - self.limits.hold_ns)


class _NotTaken(Exception):  # noqa: N818 - it is an answer
    """A command that changes nothing; its text is the counter's name."""
