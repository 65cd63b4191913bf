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
Teleoperation: from the server's connection to the topic that the velocity multiplexer reads.

:class:`TeleopPart` is the gateway's part; :class:`Teleoperation`, which knows no gateway, does the
    work, in the gateway's event loop. :mod:`rt_robot_os.gateway.teleop_controller` decides what
    may move the robot; docs/teleoperation.md lists what stops it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from functools import partial
import struct
import time
from typing import Any
from typing import Final

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.gateway.convert import value_of
from rt_robot_os.gateway.drive_limits import BEAT_HZ
from rt_robot_os.gateway.drive_limits import CANCEL_TOPIC
from rt_robot_os.gateway.drive_limits import TeleopLimits
from rt_robot_os.gateway.drive_limits import TOPIC
from rt_robot_os.gateway.part import GatewayContext
from rt_robot_os.gateway.part import Greeting
from rt_robot_os.gateway.part import Part
from rt_robot_os.gateway.reading import Reads
from rt_robot_os.gateway.reading import Sample
from rt_robot_os.gateway.teleop_controller import Order
from rt_robot_os.gateway.teleop_controller import TeleopController
from rt_robot_os.messages.cdr import LITTLE_ENDIAN
from rt_robot_os.messages.uplink.driving import DriveBeat
from rt_robot_os.messages.uplink.driving import DriveBegin
from rt_robot_os.messages.uplink.driving import DriveCommand
from rt_robot_os.messages.uplink.driving import DriveEnd
from rt_robot_os.messages.uplink.greeting import DriveLimits
from rt_robot_os.messages.uplink.messages import UplinkMessage

#: Publishes a sample immediately: topic, CDR, stamp on CLOCK_MONOTONIC (0: now); False: failed.
Publish = Callable[[str, bytes, int], bool]
#: Sends a message to the server before all others; it is lost without a connection.
Send = Callable[[UplinkMessage], object]
#: Returns the newest value of a signal; None without.
Last = Callable[[str], Any]

_TWIST: Final = struct.Struct('<6d')
_TRUE: Final = LITTLE_ENDIAN + b'\x01'
#: Values that are sent with a heartbeat, and their topics.
_SHOWN: Final = {'speed': 'odom', 'stop_reason': 'stop_reason', 'steering': 'steering'}
_RUNS: Final = 'runs'
_SHOWN_HZ: Final = 20.0


def twist(linear_m_s: float, angular_rad_s: float) -> bytes:
    """Write a ``geometry_msgs/msg/Twist`` of a robot on wheels."""
    return LITTLE_ENDIAN + _TWIST.pack(linear_m_s, 0.0, 0.0, 0.0, 0.0, angular_rad_s)


class Teleoperation:
    """
    Let a driver drive remotely.

    All methods are for the event loop.

    :param publish: publishes on the core's bus.
    :param send: sends to the server.
    :param last: returns the newest value of a signal.
    :param clock: CLOCK_MONOTONIC in ns; replaced in tests.
    :ivar controller: makes the decisions.
    """

    def __init__(self, limits: TeleopLimits, publish: Publish, send: Send,
                 last: Last = lambda _: None,
                 clock: Callable[[], int] = time.monotonic_ns) -> None:
        self.controller = TeleopController(limits)
        self.unpublished = 0
        self._limits = limits
        self._publish = publish
        self._send = send
        self._last = last
        self._clock = clock
        self._end_of_hold: asyncio.TimerHandle | None = None
        self._driven = False

    @property
    def driver(self) -> str:
        """Return the name of the driver whose dead-man switch is pressed; empty without one."""
        return self.controller.driver if self._driven else ''

    def receive(self, message: UplinkMessage) -> None:
        """Process a message of the driver."""
        if isinstance(message, DriveCommand):
            self._carry_out(self.controller.take(message, self._clock()))
        elif isinstance(message, DriveBegin):
            self._carry_out(self.controller.begin(message))
            self.beat()  # the first ticket, without delay
        elif isinstance(message, DriveEnd):
            self._carry_out(self.controller.end(message.lease))

    def lost(self) -> None:
        """Stop the robot: the connection to the server is lost."""
        self._carry_out(self.controller.end())

    async def run(self) -> None:
        """Issue tickets while a driver has the lease; cancelling it stops the robot."""
        period_s = 1.0 / BEAT_HZ
        due_s = time.monotonic()
        try:
            while True:
                now_s = time.monotonic()
                # After a time without the CPU missed heartbeats are not made up for.
                due_s = max(due_s + period_s, now_s)
                await asyncio.sleep(due_s - now_s)
                self.check_hold()
                self.beat()
        finally:
            self.lost()

    def beat(self) -> None:
        """Send a ticket and the robot's state while a driver has the lease."""
        controller = self.controller
        if not controller.lease or not self._limits.may_drive:
            return
        self._send(DriveBeat(
            controller.beat(self._clock()), time.time_ns(), controller.lease, controller.seq,
            controller.is_armed, controller.moves,
            None if controller.rtt_ms is None else round(controller.rtt_ms, 1),
            **{name: self._last(name) for name in (*_SHOWN, _RUNS)}))

    def check_hold(self) -> None:
        """Stop the robot when the last command is no longer active."""
        self._carry_out(self.controller.hold_ended(self._clock()))

    def statistics(self) -> dict[str, Any]:
        """Return the driver, and the counters of commands."""
        return {'driver': self.controller.driver, 'unpublished': self.unpublished,
                **self.controller.counters}

    def _carry_out(self, order: Order | None) -> None:
        if order is not None:
            self.unpublished += not self._publish(
                TOPIC, twist(order.linear_m_s, order.angular_rad_s), order.stamp_ns)
            self._set_timer()
        if self.controller.deadman_pressed != self._driven:
            # Pressing the dead-man switch cancels the goal, so that the robot does not go on to it
            # on release; releasing it cancels once more: another client may have set a goal.
            self._driven = self.controller.deadman_pressed
            self._publish(CANCEL_TOPIC, _TRUE, 0)

    def _set_timer(self) -> None:
        """Wake up when the hold time ends."""
        if self._end_of_hold is not None:
            self._end_of_hold.cancel()
            self._end_of_hold = None
        until_ns = self.controller.until_ns
        if until_ns:
            # A millisecond more, so that the hold has ended when the timer fires.
            after_s = (until_ns - self._clock() + NS_PER_MS) / NS_PER_S
            self._end_of_hold = asyncio.get_running_loop().call_later(
                max(0.0, after_s), self.check_hold)


class TeleopPart(Part):
    """The part of the gateway for remote driving."""

    receives = (DriveBegin, DriveCommand, DriveEnd)

    def __init__(self, context: GatewayContext) -> None:
        super().__init__(context)
        settings = context.settings
        self._limits = TeleopLimits(settings.drive_linear_m_s, settings.drive_angular_rad_s,
                                    settings.drive_hold_s)
        self.drive = Teleoperation(self._limits, self._publish, context.server.send_newest,
                                   self._last)
        # By signal; written by the link's thread, read by the loop.
        self._shown: dict[str, tuple[str, bytes]] = {}

    def reads(self) -> Sequence[Reads]:
        """Read what the driver needs to see without delay."""
        return [Reads(topic, partial(self._take, signal), rate_hz=_SHOWN_HZ)
                for signal, topic in _SHOWN.items()]

    def publishes(self) -> Sequence[str]:
        """Publish commands and the cancellation of goals."""
        return (TOPIC, CANCEL_TOPIC)

    def hello(self) -> Greeting:
        """Announce the speed limits of remote driving."""
        if not self._limits.may_drive:
            return Greeting()
        return Greeting(('drive',), limits=DriveLimits(self._limits.linear_m_s,
                                                       self._limits.angular_rad_s))

    def receive(self, message: UplinkMessage) -> None:
        """Receive a message of the driver."""
        self.drive.receive(message)

    def reject(self, kind: str) -> None:
        """Count a malformed message of the driver."""
        self.drive.controller.reject()

    def lost_server(self) -> None:
        """End the lease."""
        self.drive.lost()

    async def run(self) -> None:
        """Issue tickets."""
        await self.drive.run()

    def statistics(self) -> Mapping[str, Any]:
        """Return the counters."""
        return {'drive': self.drive.statistics()}

    def _take(self, signal: str, sample: Sample) -> None:
        self._shown[signal] = sample.type, bytes(sample.cdr)

    def _last(self, signal: str) -> Any:
        found = self._shown.get(signal)
        if signal == _RUNS or found is None:
            return self.context.robot.has(TOPIC) if signal == _RUNS else None
        try:
            return value_of(_SHOWN[signal], *found)
        except (LayoutError, ValueError):
            return None

    def _publish(self, topic: str, cdr: bytes, stamp_ns: int) -> bool:
        try:
            self.context.robot.publish(topic, cdr, stamp_ns)
        except LinkError:
            return False
        return True
