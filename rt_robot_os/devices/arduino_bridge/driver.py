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
Arduinos with the firmware ros_arduino_bridge (and its descendants) as motor boards.

Each poll requests the counts of the encoders and repeats the active speeds; the battery, if it is
on an analogue pin, is requested once a second. Each answer gives a ``sensor_msgs/msg/JointState``.

An answer does not identify its request, so one lost byte could shift all later answers by one. The
driver knows the order of its requests and the form of each answer; when one does not match, or is
missing, it requests the speed of the line (``b``) and accepts only ``57600`` as an answer until it
arrives. The wheels continue meanwhile, for 0.3 s at most.

A board is reset when its port is opened; until its boot loader has finished only stops are sent.
The firmware itself stops the wheels 2 s after the last command. No command changes that time:
``auto_stop_s`` is the value that it was built with.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from enum import Enum
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import period_from_rate
from rt_robot_os.devices.arduino_bridge import wire
from rt_robot_os.devices.arduino_bridge.wire import BridgeReply
from rt_robot_os.devices.arduino_bridge.wire import ReplyDecoder
from rt_robot_os.devices.device import Value
from rt_robot_os.devices.motor_board import MotorBoard
from rt_robot_os.devices.motor_settings import motor_settings

# The board answers within some milliseconds; a ping of its sonar, which is never requested here,
# would take 0.7 s.
_REPLY_NS: Final = 100 * NS_PER_MS
_ASK_BAUD_NS: Final = 100 * NS_PER_MS
_HOLD_NS: Final = 300 * NS_PER_MS
_GIVE_UP_NS: Final = 3 * NS_PER_S
_BATTERY_NS: Final = NS_PER_S
# The active command is repeated, in case it was lost.
_REPEAT_NS: Final = 100 * NS_PER_MS
# Its buffer holds 64 bytes: limits of the requests in flight, and of stops.
_MOST_WAITING: Final = 6
_MOST_STOPS: Final = 32
# Refusals without one answer of the encoders.
_SURE: Final = 10
_FIRMWARE_GAINS: Final = (20, 12, 0, 50)
_HIGHEST_ANALOG: Final = 1023


class ExpectedAnswer(Enum):
    """The request whose answer is expected."""

    COUNTS = 'e'
    DONE = 'm'
    BAUD = 'b'
    ANALOG = 'a'


class ArduinoBridge(MotorBoard[BridgeReply]):
    """A board with ros_arduino_bridge."""

    ANSWERS = True
    COUNTER_BITS = 32
    IF_SILENT = ('check its cable, that the firmware ros_arduino_bridge is on it, and baud (57600 '
                 'unless it was built otherwise)')
    IF_UNUSED = ('it answers, but not with the counts of its encoders: build the firmware with '
                 'USE_BASE and with its kind of encoders')
    IF_SLOW = ('build the firmware with #define AUTO_STOP_INTERVAL 500 and set auto_stop_s: 0.5; '
               'or lower maximum_wheel_speed_m_s')
    # Slow: the original firmware drives on for 2 s.
    SETTINGS = motor_settings(baud=57600, rate_hz=30.0, maximum_wheel_speed_m_s=0.2) + (
        Field('auto_stop_s', float, 2.0,
              'AUTO_STOP_INTERVAL of its firmware: how long it drives on when this computer stops '
              'sending. The original firmware has 2000 ms.', 's', 0.3, 60.0),
        Field('pid_rate_hz', float, wire.PID_RATE_HZ,
              'Rounds of its control loop in a second: 1000 divided by the whole milliseconds of '
              'PID_INTERVAL.', 'Hz', 1.0, 1000.0),
        Field('pid_gains', list, (), 'Kp, Kd, Ki, Ko of its control loop, in this order; empty '
              'leaves those of the firmware (20, 12, 0, 50).', item=int, minimum=0,
              maximum=32767),
        Field('reset_wait_s', float, 1.0, 'Time for its boot loader after the port was opened.',
              's', 0.0, 10.0),
        Field('battery_pin', int, -1,
              'Analogue pin with the voltage of the battery behind a divider; -1: none.',
              minimum=-1, maximum=69),
        Field('battery_volts_per_count', float, 5.0 / 1023 * 3.0, 'Voltage of the battery for '
              'each count of that pin: 5 V / 1023 times the divider.', 'V', 1e-6, 1.0),
    )
    description = 'Arduino with the firmware ros_arduino_bridge, two wheels with encoders'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: the gains are not four, or the last is 0.
        """
        pid = list(settings['pid_gains'])
        if pid and (len(pid) != len(_FIRMWARE_GAINS) or not pid[-1]):
            raise ConfigError([f'{name}: pid_gains {pid}: give four, Kp, Kd, Ki, Ko, and Ko '
                               'above 0; or none'])
        super().__init__(name, settings, ReplyDecoder())
        self._gains = wire.gains(*pid) if pid else b''
        self._ticks_s = settings['ticks_per_revolution'] / math.tau / settings['pid_rate_hz']
        self._period_ns = period_from_rate(settings['output_rate_hz'])
        # So that a poll at about the same rate is not missed.
        self._early_ns = self._period_ns // 4
        self._boot_ns = round(settings['reset_wait_s'] * NS_PER_S)
        self._waiting: deque[tuple[ExpectedAnswer, int]] = deque(maxlen=_MOST_STOPS)
        self._speeds = 0, 0
        self._opened_ns = self._lost_ns = self._asked_baud_ns = 0
        self._counts_due_ns = self._battery_due_ns = self._repeat_ns = 0
        self._was_answered = self._in_step = False
        self._refused = self._shifts = self._unknown = 0

    def opening_s(self) -> float:
        """Return how long it may send nothing after it was opened: the time of its boot loader."""
        return float(self.settings['reset_wait_s']) + 2.0 * _GIVE_UP_NS / NS_PER_S

    def connected(self, attribute: str) -> bool:
        """Return whether a message is published: the battery only if it is on a pin."""
        return attribute != 'battery' or self.settings['battery_pin'] >= 0

    @classmethod
    def silence_s(cls, settings: Mapping[str, Any]) -> float:
        """Return the auto-stop of the firmware, and one round of its control loop."""
        return float(settings['auto_stop_s']) + 1.0 / float(settings['pid_rate_hz'])

    def slowest_watched_rad_s(self) -> float:
        """Return the slowest command that its loop does not round to zero."""
        p, _, i, scale = self.settings['pid_gains'] or _FIRMWARE_GAINS
        ignored = 0 if i else scale // max(p, 1)
        ticks_s: float = (ignored + 1.5) * self.settings['pid_rate_hz']
        return max(super().slowest_watched_rad_s(),
                   ticks_s * math.tau / self.counts_per_revolution())

    # --- commands --------------------------------------------------------------------------------

    def drive(self, left_rad_s: float, right_rad_s: float) -> None:
        """Send the speeds, in ticks for each round of its loop."""
        if len(self._waiting) >= _MOST_WAITING:
            return  # the next poll tries again
        wanted = round(left_rad_s * self._ticks_s), round(right_rad_s * self._ticks_s)
        now_ns = self.clock_ns()
        if wanted == self._speeds and now_ns < self._repeat_ns:
            return
        self._repeat_ns = now_ns + _REPEAT_NS
        if wanted == (0, 0):
            self.halt()
            return
        if self._speeds == (0, 0):
            # The loop keeps counts from before the wheels coasted to rest, and would begin with a
            # jerk in the other direction; this resets it.
            self._ask(wire.HALT, ExpectedAnswer.DONE)
        self._speeds = wanted
        self._ask(wire.speeds(*wanted), ExpectedAnswer.DONE)

    def halt(self) -> None:
        """Send the command to stop; the wheels coast."""
        self._speeds = 0, 0
        self._ask(wire.HALT, ExpectedAnswer.DONE)

    # --- the protocol ----------------------------------------------------------------------------

    def restart(self) -> None:
        """Wait until the board has started, then find the order of its answers."""
        super().restart()
        self._waiting.clear()
        self._speeds = 0, 0
        self._opened_ns = self._lost_ns = self.clock_ns()
        self._asked_baud_ns = 0
        self._was_answered = self._in_step = False
        self._unknown = 0

    def is_set_up(self) -> bool:
        """Return whether it has answered."""
        return self._was_answered

    def accepts_commands(self, now_ns: int) -> bool:
        """Return whether the order of its answers is known."""
        return self._in_step

    def write(self, now_ns: int) -> None:
        """
        Send the requests that are due.

        :raises DeviceError: the port is gone, or the board does not answer, or refuses the
            requests.
        """
        if self._unknown >= _SURE:
            raise DeviceError(f'{self.name}: {self.IF_UNUSED}')
        if not self._in_step:
            self._find_order(now_ns)
            return
        if self._waiting and now_ns - self._waiting[0][1] > _REPLY_NS:
            self.counters.expect_reset()  # it may have been reset
            self._lose_order(now_ns)
            return
        if len(self._waiting) >= _MOST_WAITING:
            return
        if not self.is_driving and self.counters.velocity_rad_s != (0.0, 0.0):
            self._ask(wire.HALT, ExpectedAnswer.DONE)  # in case the previous one was lost
        if now_ns + self._early_ns >= self._counts_due_ns:
            self._counts_due_ns = max(self._counts_due_ns + self._period_ns, now_ns)
            self._ask(wire.ENCODERS, ExpectedAnswer.COUNTS)
        pin = self.settings['battery_pin']
        if pin >= 0 and now_ns >= self._battery_due_ns:
            self._battery_due_ns = now_ns + _BATTERY_NS
            self._ask(wire.analog(pin), ExpectedAnswer.ANALOG)

    def handle(self, frame: BridgeReply, arrival_ns: int) -> int:
        """Handle one answer; in the loop."""
        if not self._in_step:
            return self._listen(frame)
        if self._waiting and _fits(frame, self._waiting[0][0]):
            asked = self._waiting.popleft()[0]
            if asked is ExpectedAnswer.COUNTS:
                self._unknown = 0
                left, right = frame.numbers
                return self.update_counts(left, right, arrival_ns)
            if asked is ExpectedAnswer.ANALOG:
                volts = frame.numbers[0] * self.settings['battery_volts_per_count']
                return self.report_battery(volts, arrival_ns)
            return 0
        if frame.text == wire.INVALID:
            self._refused += 1
            self._unknown += 1
        self._shifts += 1
        self._lose_order(arrival_ns)
        return 0

    def motor_counters(self) -> dict[str, Value]:
        """Add the counters of the protocol: answers out of order, and refused commands."""
        return {**super().motor_counters(), 'shifted_replies': self._shifts,
                'invalid_commands': self._refused}

    def _ask(self, data: bytes, asked: ExpectedAnswer) -> None:
        self.send(data)
        self._waiting.append((asked, self.clock_ns()))

    def _lose_order(self, now_ns: int) -> None:
        self.line_failed(now_ns)
        self._in_step = False
        self._lost_ns = now_ns
        self._ask_baud(now_ns)

    def _ask_baud(self, now_ns: int) -> None:
        self._asked_baud_ns = now_ns
        self._waiting.clear()
        self._ask(wire.BAUD, ExpectedAnswer.BAUD)

    def _find_order(self, now_ns: int) -> None:
        """Request the speed of the line until it arrives."""
        if not self._was_answered and now_ns - self._opened_ns < self._boot_ns:
            return
        lost_ns = self._lost_ns if self._was_answered else self._opened_ns + self._boot_ns
        if now_ns - lost_ns > _GIVE_UP_NS:
            raise DeviceError(f'{self.name}: it does not answer b: {self.IF_SILENT}')
        if now_ns - self._asked_baud_ns >= _ASK_BAUD_NS:
            if now_ns - lost_ns >= _HOLD_NS:
                self.safe_state()
            self._ask_baud(now_ns)

    def _listen(self, reply: BridgeReply) -> int:
        """Accept only the speed of the line; then all earlier requests have been answered."""
        if not _fits(reply, ExpectedAnswer.BAUD):
            return 0
        while self._waiting and self._waiting.popleft()[0] is not ExpectedAnswer.BAUD:
            pass
        self._in_step = self._was_answered = True
        if self._gains:
            self._ask(self._gains, ExpectedAnswer.DONE)
        # Before any command to drive: if it was reset, its counts are still near zero.
        self._ask(wire.ENCODERS, ExpectedAnswer.COUNTS)
        self._repeat_ns = 0
        return 0


def _fits(reply: BridgeReply, asked: ExpectedAnswer) -> bool:
    """Return whether a reply looks like an answer."""
    numbers = reply.numbers
    if asked is ExpectedAnswer.DONE:
        return reply.text == wire.DONE
    if asked is ExpectedAnswer.COUNTS:
        return len(numbers) == 2
    if len(numbers) != 1:
        return False
    if asked is ExpectedAnswer.ANALOG:
        return 0 <= numbers[0] <= _HIGHEST_ANALOG
    return numbers[0] > _HIGHEST_ANALOG
