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
Teleoperation of one robot: the open pages, the one that drives, the messages to the robot.

A client is one open connection of a page that may drive; a user with two windows has two. All of
it is for the event loop.
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
from rt_robot_os.monitor.live.send_queue import SendQueue

#: Sends a message to a robot before all others; False when it is not connected.
Forward = Callable[[str, UplinkMessage], bool]


class TeleopClient:
    """
    One connection of a page that may drive.

    :param name: of the user.
    :param queue: the sending side.
    :ivar driven: commands with a pressed dead-man switch that were sent to the robot.
    :ivar ended: why it lost the right to drive before it was closed; otherwise empty.
    """

    def __init__(self, name: str, session: str, queue: SendQueue) -> None:
        self.name = name
        self.session = session
        self.queue = queue
        self.driven = 0
        self.seq = 0
        self.ended = ''
        self._beat: str | None = None

    def tell(self, kind: str, **content: Any) -> None:
        """Send a message that must not be dropped."""
        self.queue.send(encode(kind, content))

    def show(self, beat: str) -> None:
        """Send the newest heartbeat; one that is still queued is dropped."""
        self._beat = beat
        self.queue.offer(self._newest)

    def _newest(self) -> str | None:
        beat, self._beat = self._beat, None
        return beat


class TeleopSession:
    """
    The pages that may drive one robot.

    :param forward: sends a message to the robot.
    :ivar refused: commands that were malformed, or of a page that does not drive.
    :ivar lost: commands while the robot was not connected.
    """

    def __init__(self, robot: str, forward: Forward) -> None:
        self.robot = robot
        self.clients: dict[TeleopClient, None] = {}
        self.lease: Lease[TeleopClient] = Lease()
        self.connected = False
        self.limits = DriveLimits()
        self.refused = self.lost = 0
        self._forward = forward

    def enter(self, client: TeleopClient) -> None:
        """Add a page; it does not get the right to drive."""
        self.clients[client] = None
        client.tell('seat', **self._state(client))

    def leave(self, client: TeleopClient, why: str) -> bool:
        """Remove a page; return whether it had the right to drive, which ends."""
        had = self.give(client, why)
        self.clients.pop(client, None)
        return had

    def take(self, client: TeleopClient, over: bool) -> TeleopClient | None:
        """
        Give a page the right to drive; the robot stops, and the previous driver is notified.

        :return: the page that drove before.
        :raises HeldByAnotherError: another page drives, and ``over`` is false.
        """
        former = self.lease.holder
        before = self.lease.key
        taken_from = self.lease.take(client, over)
        if former is client:
            return None
        if taken_from is not None:
            self._forward(self.robot, DriveEnd(before, client.name, 'taken over'))
            taken_from.tell('lost', by=client.name, why='taken')
        client.seq = client.driven = 0
        self._begin()
        self._tell_all()
        return taken_from

    def give(self, client: TeleopClient, why: str) -> bool:
        """End the right to drive; the robot stops. Return whether this page had it."""
        key = self.lease.give(client)
        if not key:
            return False
        self._forward(self.robot, DriveEnd(key, client.name, why))
        self._tell_all()
        return True

    def drive(self, client: TeleopClient, message: Mapping[str, Any]) -> bool:
        """Forward a command, limited to the robot's limits; return whether it was sent."""
        try:
            command = DriveCommand.from_json(message)
        except ValueError:
            command = None
        if self.lease.holder is not client or command is None or command.seq <= client.seq:
            self.refused += 1
            return False
        client.seq = command.seq
        linear, angular = bounded(command.linear_m_s, command.angular_rad_s,
                                  self.limits.linear_m_s, self.limits.angular_rad_s)
        went = self._forward(self.robot, replace(
            command, linear_m_s=linear, angular_rad_s=angular, lease=self.lease.key,
            by=client.name))
        self.lost += not went
        client.driven += went and command.grip
        return went

    def beat(self, message: DriveBeat) -> None:
        """Forward a heartbeat of the robot to the driver whose lease it belongs to."""
        holder = self.lease.holder
        if holder is not None and message.lease == self.lease.key:
            beat = message.for_page()
            if (codes := codes_of(beat, ('stop_reason', 'steering'))):
                beat['codes'] = codes
            holder.show(encode('beat', beat))

    def robot_is(self, connected: bool, limits: DriveLimits) -> None:
        """Note that the robot has connected or disconnected."""
        self.connected, self.limits = connected, limits
        if connected and self.lease.holder is not None:
            self._begin()
        self._tell_all()

    def _begin(self) -> None:
        holder = self.lease.holder
        if holder is not None:
            self._forward(self.robot, DriveBegin(self.lease.key, holder.name))

    def _tell_all(self) -> None:
        for client in self.clients:
            client.tell('seat', **self._state(client))

    def _state(self, client: TeleopClient) -> dict[str, Any]:
        holder = self.lease.holder
        state = 'free' if holder is None else 'yours' if holder is client else 'other'
        return {'state': state, 'by': holder.name if holder is not None else '',
                'connected': self.connected,
                'limits': {'linear_m_s': self.limits.linear_m_s,
                           'angular_rad_s': self.limits.angular_rad_s}}


__all__ = ['TeleopSession', 'Forward', 'HeldByAnotherError', 'TeleopClient']
