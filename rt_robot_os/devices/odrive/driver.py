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
ODrive motor controllers, by their ASCII protocol, as motor boards.

One controller with two axes, whose motors turn the wheels, directly or through a gear. Speeds are
commanded in closed loop control. Each poll requests the positions of both motors; states and
errors of the axes are requested a few times a second, voltage and current once a second.

Answers to one group of requests are used when all have arrived, because an answer does not
identify its request; each line has a checksum. When one is missing nothing is requested for a
moment, so that a late answer is discarded.

At opening errors are cleared and the watchdog of both axes is set, which switches off the motors
when the computer stops sending. The axes enter closed loop control with the first command.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from functools import partial
import math
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import period_from_rate
from rt_robot_os.devices.device import Value
from rt_robot_os.devices.motor_board import MotorBoard
from rt_robot_os.devices.motor_faults import MotorFault
from rt_robot_os.devices.motor_settings import motor_settings
from rt_robot_os.devices.odrive import wire
from rt_robot_os.devices.odrive.wire import OdriveDecoder
from rt_robot_os.devices.odrive.wire import OdriveReply

_REPLY_NS: Final = 80 * NS_PER_MS
_QUIET_NS: Final = 50 * NS_PER_MS
_STATES_NS: Final = 200 * NS_PER_MS
_BATTERY_NS: Final = NS_PER_S
_REPEAT_NS: Final = 100 * NS_PER_MS
_MOST_REFUSALS: Final = 5
_ARM_NS: Final = 250 * NS_PER_MS
_ARM_PATIENCE_NS: Final = 1500 * NS_PER_MS
# Noise of an encoder at standstill, in turns of the motor.
_NOISE_TURNS: Final = 0.003
# Bits of the board in motor_faults; shifted by one for the right axis.
_ERROR: Final = 1
_OPEN_LOOP: Final = 4
_SIDES: Final = ('left', 'right')
_ERROR_PROPERTY: Final = {'0.5': 'error', '0.6': 'active_errors'}


class OdriveQuery(NamedTuple):
    """
    One request, and the handler of its answer.

    :ivar numbers: how many the answer has.
    :ivar use: receives the numbers and their arrival, and returns the number of samples published.
    """

    text: bytes
    numbers: int
    use: Callable[[tuple[float, ...], int], int]


class Odrive(MotorBoard[OdriveReply]):
    """An ODrive with two axes."""

    ANSWERS = True
    COUNTER_BITS = 0
    COUNTS_SURVIVE = True
    IF_SILENT = ('check its power, its cable, and that the ASCII protocol is on at this port; '
                 'a firmware without checksums needs checksums: false')
    IF_SLOW = 'lower watchdog_s or maximum_wheel_speed_m_s'
    SETTINGS = motor_settings(baud=115200, rate_hz=50.0, ticks_per_revolution=None) + (
        Field('gear_ratio', float, 1.0, 'Turns of the motor for one turn of the wheel.', '', 0.01,
              1000.0),
        Field('left_axis', int, 0, 'Axis of the left wheel.', minimum=0, maximum=7),
        Field('right_axis', int, 1, 'Axis of the right wheel.', minimum=0, maximum=7),
        Field('firmware', str, '0.5', 'Its version, for the names of its errors.',
              choices=tuple(_ERROR_PROPERTY)),
        Field('checksums', bool, True, 'Send a checksum with each line, and require one.'),
        Field('watchdog_s', float, 0.3,
              'An axis that receives nothing for this time switches off its motor.',
              's', 0.05, 60.0),
    )
    description = 'ODrive motor controller, ASCII protocol, two axes'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: both wheels are on one axis.
        """
        super().__init__(name, settings, OdriveDecoder(settings['checksums']))
        self._axes: tuple[int, int] = settings['left_axis'], settings['right_axis']
        if self._axes[0] == self._axes[1]:
            raise ConfigError([f'{name}: left_axis and right_axis are both {self._axes[0]}: each '
                               'wheel has an axis of its own'])
        self._error_property = _ERROR_PROPERTY[settings['firmware']]
        self._turns_per_rad = settings['gear_ratio'] / math.tau
        self._period_ns = period_from_rate(settings['output_rate_hz'])
        # So that a poll at about the same rate is not missed.
        self._early_ns = self._period_ns // 4
        self._feed_ns = round(settings['watchdog_s'] * NS_PER_S / 5)
        self._forget()

    def _forget(self) -> None:
        self._asked: tuple[OdriveQuery, ...] = ()
        self._answers: list[tuple[tuple[float, ...], int]] = []
        self._asked_ns = self._quiet_until_ns = 0
        self._watched = [False, False]
        self._was_set_up = False
        self._refusals = 0
        self._problem = ''
        self._left_turns = 0.0
        self._speeds = 0.0, 0.0
        self._states = [wire.IDLE, wire.IDLE]
        self._errors = [0, 0]
        self._has_current = True
        self._current_a = math.nan
        self._counts_due_ns = self._states_due_ns = 0
        self._battery_due_ns = self._current_due_ns = 0
        self._fed_ns = self._told_speeds_ns = self._arm_due_ns = self._arming_ns = 0

    def counts_per_revolution(self) -> float:
        """Return the turns of the motor for one turn of the wheel."""
        return float(self.settings['gear_ratio'])

    def noise_counts(self) -> float:
        """Return the noise of an encoder at standstill, in turns of the motor."""
        return _NOISE_TURNS

    # --- commands --------------------------------------------------------------------------------

    def accepts_commands(self, now_ns: int) -> bool:
        """Bring both axes to closed loop control; stop if that fails."""
        if self._is_closed():
            return True
        if not self._arming_ns:
            self._arming_ns = self._arm_due_ns = now_ns
        if now_ns - self._arming_ns > _ARM_PATIENCE_NS:
            side = 0 if self._states[0] != wire.CLOSED_LOOP else 1
            self.stop_for(MotorFault(0), self._why(side) or (
                f'axis{self._axes[side]} ({_SIDES[side]} wheel) does not enter closed loop '
                f'control, it is in state {self._states[side]}: calibrate motor and encoder'))
        elif now_ns >= self._arm_due_ns:
            self._arm_due_ns = now_ns + _ARM_NS
            self._states_due_ns = 0
            if any(self._errors):
                self._tell(wire.CLEAR_ERRORS)
            self._tell(*(wire.write(f'axis{axis}.requested_state', wire.CLOSED_LOOP)
                         for axis in self._axes))
        return False

    def drive(self, left_rad_s: float, right_rad_s: float) -> None:
        """Send both axes their speeds."""
        now_ns = self.clock_ns()
        wanted = left_rad_s * self._turns_per_rad, right_rad_s * self._turns_per_rad
        if wanted != self._speeds or now_ns - self._told_speeds_ns >= _REPEAT_NS:
            self._tell_speeds(wanted, now_ns)

    def halt(self) -> None:
        """Send speed 0 to both axes; an axis in closed loop control brakes and holds."""
        self._arming_ns = 0
        self._tell_speeds((0.0, 0.0), self.clock_ns())

    def _tell_speeds(self, speeds: tuple[float, float], now_ns: int) -> None:
        self._speeds, self._told_speeds_ns = speeds, now_ns
        self._tell(wire.velocity(self._axes[0], speeds[0]),
                   wire.velocity(self._axes[1], speeds[1]))

    def _tell(self, *texts: bytes) -> None:
        checked = self.settings['checksums']
        self.send(b''.join(wire.line(text, checked) for text in texts))

    def _is_closed(self) -> bool:
        return self._states == [wire.CLOSED_LOOP, wire.CLOSED_LOOP]

    # --- the protocol ----------------------------------------------------------------------------

    def restart(self) -> None:
        """Reset the state: the settings of the axes are unknown."""
        super().restart()
        self._forget()

    @classmethod
    def silence_s(cls, settings: Mapping[str, Any]) -> float:
        """Return the time of the watchdogs, which are set at each start."""
        return float(settings['watchdog_s'])

    def is_set_up(self) -> bool:
        """Return whether the watchdogs of both axes are set."""
        return self._watched == [True, True]

    def write(self, now_ns: int) -> None:
        """
        Feed the watchdogs, repeat a stop, and send the requests that are due.

        :raises DeviceError: the port is gone, or the controller does not match the settings.
        """
        if self._problem:
            raise DeviceError(f'{self.name}: {self._problem}')
        if self._asked and now_ns - self._asked_ns > _REPLY_NS:
            self._lose_answers(now_ns)
        if self._was_set_up and now_ns - self._fed_ns >= self._feed_ns:
            self._fed_ns = now_ns
            self._tell(*map(wire.feed, self._axes))
        if not self.is_driving and now_ns - self._told_speeds_ns >= _REPEAT_NS:
            self._tell_speeds((0.0, 0.0), now_ns)
        if not self._asked and now_ns >= self._quiet_until_ns:
            self._ask(self._due(now_ns), now_ns)

    def handle(self, frame: OdriveReply, arrival_ns: int) -> int:
        """Store one answer, and use all when complete: a lost one would shift the others."""
        if frame.refusal:
            self._refused(frame.refusal, arrival_ns)
            return 0
        if not self._asked:
            self._ignored_frames += 1
            return 0
        self._answers.append((frame.numbers, arrival_ns))
        if len(self._answers) < len(self._asked):
            return 0
        asked, answers = self._asked, self._answers
        self._asked, self._answers, self._refusals = (), [], 0
        if any(len(numbers) != each.numbers for (numbers, _), each in zip(answers, asked)):
            self._lose_answers(arrival_ns)
            return 0
        return sum(each.use(numbers, at_ns) for (numbers, at_ns), each in zip(answers, asked))

    def motor_counters(self) -> dict[str, Value]:
        """Add the states and errors of the axes."""
        return {**super().motor_counters(),
                'left_state': self._states[0], 'right_state': self._states[1],
                'left_error': f'0x{self._errors[0]:x}', 'right_error': f'0x{self._errors[1]:x}'}

    def _ask(self, questions: tuple[OdriveQuery, ...], now_ns: int) -> None:
        if questions:
            self._asked, self._asked_ns = questions, now_ns
            self._tell(*(each.text for each in questions))

    def _lose_answers(self, now_ns: int) -> None:
        """Wait until no answer can be in flight any more."""
        self.line_failed(now_ns)
        self._asked, self._answers = (), []
        self._quiet_until_ns = now_ns + _QUIET_NS

    def _refused(self, why: bytes, now_ns: int) -> None:
        """Fail when it refuses repeatedly; a single refusal may be due to a lost byte."""
        if [each.text for each in self._asked] == [wire.read('ibus')]:
            self._has_current = False
            self._asked = ()
            return
        self._lose_answers(now_ns)
        self._refusals += 1
        if self._refusals >= _MOST_REFUSALS:
            self._problem = (f'it refuses requests ({why.decode()}): check firmware, left_axis '
                             'and right_axis')

    # --- requests --------------------------------------------------------------------------------

    def _due(self, now_ns: int) -> tuple[OdriveQuery, ...]:
        """Return the group of requests that is due."""
        left, right = self._axes
        if not self.is_set_up():
            return self._set_up()
        if self._has_current and now_ns >= self._current_due_ns:
            # Separate: not every firmware supports it.
            self._current_due_ns = now_ns + _BATTERY_NS
            return (OdriveQuery(wire.read('ibus'), 1, self._take_current),)
        found: list[OdriveQuery] = []
        if now_ns + self._early_ns >= self._counts_due_ns:
            self._counts_due_ns = max(self._counts_due_ns + self._period_ns, now_ns)
            found += (OdriveQuery(wire.feedback(left), 2, self._take_left),
                      OdriveQuery(wire.feedback(right), 2, self._take_right))
        if now_ns >= self._states_due_ns:
            self._states_due_ns = now_ns + _STATES_NS
            for side, axis in enumerate(self._axes):
                found += (OdriveQuery(wire.read(f'axis{axis}.{self._error_property}'), 1,
                                      partial(self._take_error, side)),
                          OdriveQuery(wire.read(f'axis{axis}.current_state'), 1,
                                      partial(self._take_state, side)))
        elif now_ns >= self._battery_due_ns:
            self._battery_due_ns = now_ns + _BATTERY_NS
            found += (OdriveQuery(wire.read('vbus_voltage'), 1, self._take_voltage),
                      *self._watchdogs())
        return tuple(found)

    def _set_up(self) -> tuple[OdriveQuery, ...]:
        """Set the watchdogs, and read them back."""
        if not self._was_set_up:
            self._tell(wire.CLEAR_ERRORS)
        for axis in self._axes:
            self._tell(wire.write(f'axis{axis}.config.watchdog_timeout',
                                  self.settings['watchdog_s']),
                       wire.feed(axis), wire.write(f'axis{axis}.config.enable_watchdog', 1))
        return self._watchdogs()

    def _watchdogs(self) -> tuple[OdriveQuery, ...]:
        return tuple(OdriveQuery(wire.read(f'axis{axis}.config.enable_watchdog'), 1,
                                 partial(self._take_watchdog, side))
                     for side, axis in enumerate(self._axes))

    def _take_watchdog(self, side: int, numbers: tuple[float, ...], now_ns: int) -> int:
        self._watched[side] = numbers[0] == 1
        self._was_set_up = self._was_set_up or self.is_set_up()
        return 0

    def _take_left(self, numbers: tuple[float, ...], now_ns: int) -> int:
        self._left_turns = numbers[0]
        return 0

    def _take_right(self, numbers: tuple[float, ...], now_ns: int) -> int:
        return self.update_counts(self._left_turns, numbers[0], now_ns)

    def _take_voltage(self, numbers: tuple[float, ...], now_ns: int) -> int:
        return self.report_battery(numbers[0], now_ns, current_a=self._current_a)

    def _take_current(self, numbers: tuple[float, ...], now_ns: int) -> int:
        self._current_a = -numbers[0]
        return 0

    # --- states and errors -----------------------------------------------------------------------

    def _take_error(self, side: int, numbers: tuple[float, ...], now_ns: int) -> int:
        before = self._errors[side]
        error = self._errors[side] = int(numbers[0]) if math.isfinite(numbers[0]) else 0
        self._tell_faults()
        stopped = self.faults.is_latched and error != before
        if error and (stopped or (self.is_driving and not self._arming_ns)):
            self.stop_for(MotorFault(0), self._why(side))
        return 0

    def _take_state(self, side: int, numbers: tuple[float, ...], now_ns: int) -> int:
        self._states[side] = int(numbers[0]) if math.isfinite(numbers[0]) else wire.IDLE
        self._tell_faults()
        if self._is_closed():
            self._arming_ns = 0
        elif self.is_driving and not self._arming_ns:
            self._states_due_ns = 0  # the error may have occurred after it was requested
            self.stop_for(MotorFault(0), self._why(side) or (
                f'axis{self._axes[side]} ({_SIDES[side]} wheel) left closed loop control, it is '
                f'in state {self._states[side]}'))
        return 0

    def _tell_faults(self) -> None:
        bits = 0
        for side in (0, 1):
            if self._errors[side]:
                bits |= _ERROR << side
            if self.is_commanded and self._states[side] != wire.CLOSED_LOOP:
                bits |= _OPEN_LOOP << side
        self.report_faults(bits)

    def _why(self, side: int) -> str:
        """Return what is wrong with an axis; empty when it has no error."""
        error = self._errors[side]
        if not error:
            return ''
        names = '' if self.settings['firmware'] != '0.5' else ', '.join(
            text for bit, text in wire.ERRORS.items() if error & bit)
        return (f'axis{self._axes[side]} ({_SIDES[side]} wheel) has error 0x{error:x}'
                f'{f" ({names})" if names else ""}: see dump_errors() of odrivetool')
