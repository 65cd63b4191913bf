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
Tele-operation: from the server's connection to the topic that the multiplexer of velocities hears.

Runs in the gateway's event loop. What may move the robot decides
:mod:`rt_robot_os.clients.gateway.pilot`; docs/teleoperation.md says what stops it when.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Mapping
import struct
import time
from typing import Any
from typing import Final

from rt_robot_os.clients.gateway.drive_limits import BEAT_HZ
from rt_robot_os.clients.gateway.drive_limits import CANCEL_TOPIC
from rt_robot_os.clients.gateway.drive_limits import Limits
from rt_robot_os.clients.gateway.drive_limits import TOPIC
from rt_robot_os.clients.gateway.pilot import Order
from rt_robot_os.clients.gateway.pilot import Pilot
from rt_robot_os.link.cdr import LITTLE_ENDIAN
from rt_robot_os.units import NS_PER_MS
from rt_robot_os.units import NS_PER_S

#: Publishes a sample at once: topic, CDR, stamp on CLOCK_MONOTONIC (0: now); False when it cannot.
Publish = Callable[[str, bytes, int], bool]
#: Sends a message to the server before all else; lost when there is no connection.
Send = Callable[[str, Mapping[str, Any]], object]
#: Returns the newest value of a signal; None without.
Last = Callable[[str], Any]

#: The kinds of messages that are for it.
KINDS: Final = frozenset({'drive_begin', 'drive', 'drive_end'})
_TWIST: Final = struct.Struct('<6d')
_TRUE: Final = LITTLE_ENDIAN + b'\x01'
_SHOWN: Final = ('speed', 'stop_reason', 'steering')


def twist(linear_m_s: float, angular_rad_s: float) -> bytes:
    """Write a ``geometry_msgs/msg/Twist`` of a robot on wheels."""
    return LITTLE_ENDIAN + _TWIST.pack(linear_m_s, 0.0, 0.0, 0.0, 0.0, angular_rad_s)


class Drive:
    """
    Let somebody drive from afar.

    All methods are for the event loop.

    :param publish: onto the core's bus.
    :param send: to the server.
    :param last: what the robot showed last.
    :param clock: CLOCK_MONOTONIC in ns, but for tests.
    :ivar pilot: decides.
    """

    def __init__(self, limits: Limits, publish: Publish, send: Send, last: Last = lambda _: None,
                 clock: Callable[[], int] = time.monotonic_ns) -> None:
        self.pilot = Pilot(limits)
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
        """Return the name of the one who drives, hand closed; empty when nobody does."""
        return self.pilot.driver if self._driven else ''

    def take(self, message: Mapping[str, Any]) -> None:
        """Do what a message of :data:`KINDS` says."""
        kind = message.get('kind')
        if kind == 'drive':
            now_ns = self._clock()
            order = self.pilot.take(message, now_ns)
            if order is not None:
                self._cancel_goal(message)
                self._carry_out(order)
            self._driven = message.get('grip') is True and self.pilot.is_armed
        elif kind == 'drive_begin':
            self._carry_out(self.pilot.begin(message))
            self.beat()  # the first ticket, at once
        elif kind == 'drive_end':
            self._end(message.get('lease'))

    def lost(self) -> None:
        """Take note that the server is gone: nobody drives."""
        self._end(None)

    def _end(self, lease: object) -> None:
        self._carry_out(self.pilot.end(lease))
        if not self.pilot.lease:
            self._driven = False

    async def run(self) -> None:
        """Give out tickets while somebody may drive; ended by cancelling, which stops the robot."""
        period_s = 1.0 / BEAT_HZ
        due_s = time.monotonic()
        try:
            while True:
                now_s = time.monotonic()
                # After a time without the processor: no beats to make up for.
                due_s = max(due_s + period_s, now_s)
                await asyncio.sleep(due_s - now_s)
                self.check_hold()
                self.beat()
        finally:
            self.lost()

    def beat(self) -> None:
        """Send a ticket, and what the robot does, when somebody may drive."""
        pilot = self.pilot
        if not pilot.lease or not self._limits.may_drive:
            return
        shown = {name: value for name in _SHOWN if (value := self._last(name)) is not None}
        self._send('beat', {
            'n': pilot.beat(self._clock()), 'utc_ns': time.time_ns(), 'lease': pilot.lease,
            'seq': pilot.seq, 'armed': pilot.is_armed, 'moves': pilot.moves,
            'rtt_ms': None if pilot.rtt_ms is None else round(pilot.rtt_ms, 1), **shown})

    def check_hold(self) -> None:
        """Tell the robot to stand when the last command no longer holds."""
        order = self.pilot.hold_ended(self._clock())
        if order is not None:
            self._carry_out(order)

    def statistics(self) -> dict[str, Any]:
        """Return who may drive, and what became of commands."""
        return {'driver': self.pilot.driver, 'unpublished': self.unpublished,
                **self.pilot.counters}

    def _cancel_goal(self, message: Mapping[str, Any]) -> None:
        """Have the robot give up its goal when a hand closes: it must not go on to it after."""
        if message.get('grip') is True and not self._driven:
            self._publish(CANCEL_TOPIC, _TRUE, 0)

    def _carry_out(self, order: Order | None) -> None:
        if order is None:
            return
        self.unpublished += not self._publish(
            TOPIC, twist(order.linear_m_s, order.angular_rad_s), order.stamp_ns)
        if self._end_of_hold is not None:
            self._end_of_hold.cancel()
            self._end_of_hold = None
        until_ns = self.pilot.until_ns
        if until_ns:
            loop = asyncio.get_running_loop()
            # A millisecond more, so that it is over when the timer says so.
            after_s = (until_ns - self._clock() + NS_PER_MS) / NS_PER_S
            self._end_of_hold = loop.call_later(max(0.0, after_s), self.check_hold)
