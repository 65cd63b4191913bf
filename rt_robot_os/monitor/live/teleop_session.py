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
The driver's cab of each robot: who sits in it, who may drive, and what goes to the robot.

A seat is one open connection that may drive; the same person in two windows has two. All of it is
for the event loop.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from rt_robot_os.messages.texts.coded import codes_of
from rt_robot_os.messages.uplink.driving import DriveBeat
from rt_robot_os.messages.uplink.driving import DriveBegin
from rt_robot_os.messages.uplink.driving import DriveCommand
from rt_robot_os.messages.uplink.driving import DriveEnd
from rt_robot_os.messages.uplink.greeting import DriveLimits
from rt_robot_os.messages.uplink.messages import encode
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.messages.uplink.speed_limit import bounded
from rt_robot_os.monitor.live.lease import HeldByAnotherError
from rt_robot_os.monitor.live.lease import Lease
from rt_robot_os.monitor.live.outlet import Outlet

#: Sends a message to a robot before all others; False when it is not connected.
Forward = Callable[[str, UplinkMessage], bool]


class Seat:
    """
    One connection from which somebody may drive.

    :param name: of the one who sits there.
    :param outlet: the sending side.
    :ivar driven: commands with the hand closed that went to the robot.
    :ivar ended: why they lost the wheel before they got up; empty when they did not.
    """

    def __init__(self, name: str, session: str, outlet: Outlet) -> None:
        self.name = name
        self.session = session
        self.outlet = outlet
        self.driven = 0
        self.seq = 0
        self.ended = ''
        self._beat: str | None = None

    def tell(self, kind: str, **content: Any) -> None:
        """Tell something that must arrive."""
        self.outlet.say(encode(kind, content))

    def show(self, beat: str) -> None:
        """Show the newest beat when its turn comes; an older one that waits is left out."""
        self._beat = beat
        self.outlet.offer(self._newest)

    def _newest(self) -> str | None:
        beat, self._beat = self._beat, None
        return beat


class Cab:
    """
    The cab of one robot.

    :param forward: to the robot.
    :ivar refused: commands of somebody who may not drive, or that were none.
    :ivar lost: commands while the robot was not connected.
    """

    def __init__(self, robot: str, forward: Forward) -> None:
        self.robot = robot
        self.seats: dict[Seat, None] = {}
        self.lease: Lease[Seat] = Lease()
        self.connected = False
        self.limits = DriveLimits()
        self.refused = self.lost = 0
        self._forward = forward

    def enter(self, seat: Seat) -> None:
        """Sit down; that moves nothing."""
        self.seats[seat] = None
        seat.tell('seat', **self._state(seat))

    def leave(self, seat: Seat, why: str) -> bool:
        """Get up; return whether they had the right to drive, which ends."""
        had = self.give(seat, why)
        self.seats.pop(seat, None)
        return had

    def take(self, seat: Seat, over: bool) -> Seat | None:
        """
        Let somebody drive; whoever could stands, and is told.

        :return: from whom it was taken.
        :raises HeldByAnotherError: somebody else has it, and ``over`` is not said.
        """
        former = self.lease.holder
        before = self.lease.key
        taken_from = self.lease.take(seat, over)
        if former is seat:
            return None
        if taken_from is not None:
            self._forward(self.robot, DriveEnd(before, seat.name, 'taken over'))
            taken_from.tell('lost', by=seat.name, why='taken')
        seat.seq = seat.driven = 0
        self._begin()
        self._tell_all()
        return taken_from

    def give(self, seat: Seat, why: str) -> bool:
        """Give it back; the robot stands. Return whether it was theirs."""
        key = self.lease.give(seat)
        if not key:
            return False
        self._forward(self.robot, DriveEnd(key, seat.name, why))
        self._tell_all()
        return True

    def drive(self, seat: Seat, message: Mapping[str, Any]) -> bool:
        """Hand a command on, within the robot's limits; return whether that went."""
        try:
            command = DriveCommand.from_json(message)
        except ValueError:
            command = None
        if self.lease.holder is not seat or command is None or command.seq <= seat.seq:
            self.refused += 1
            return False
        seat.seq = command.seq
        linear, angular = bounded(command.linear_m_s, command.angular_rad_s,
                                  self.limits.linear_m_s, self.limits.angular_rad_s)
        went = self._forward(self.robot, replace(
            command, linear_m_s=linear, angular_rad_s=angular, lease=self.lease.key,
            by=seat.name))
        self.lost += not went
        seat.driven += went and command.grip
        return went

    def beat(self, message: DriveBeat) -> None:
        """Show a heart-beat of the robot to the driver whose lease it is for."""
        holder = self.lease.holder
        if holder is not None and message.lease == self.lease.key:
            beat = message.for_page()
            if (codes := codes_of(beat, ('stop_reason', 'steering'))):
                beat['codes'] = codes
            holder.show(encode('beat', beat))

    def robot_is(self, connected: bool, limits: DriveLimits) -> None:
        """Take note that the robot came, or went."""
        self.connected, self.limits = connected, limits
        if connected and self.lease.holder is not None:
            self._begin()
        self._tell_all()

    def _begin(self) -> None:
        holder = self.lease.holder
        if holder is not None:
            self._forward(self.robot, DriveBegin(self.lease.key, holder.name))

    def _tell_all(self) -> None:
        for seat in self.seats:
            seat.tell('seat', **self._state(seat))

    def _state(self, seat: Seat) -> dict[str, Any]:
        holder = self.lease.holder
        state = 'free' if holder is None else 'yours' if holder is seat else 'other'
        return {'state': state, 'by': holder.name if holder is not None else '',
                'connected': self.connected,
                'limits': {'linear_m_s': self.limits.linear_m_s,
                           'angular_rad_s': self.limits.angular_rad_s}}


__all__ = ['Cab', 'Forward', 'HeldByAnotherError', 'Seat']
