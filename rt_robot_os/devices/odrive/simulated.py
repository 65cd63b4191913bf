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

"""A simulated ODrive with two axes, and the robot that it drives."""

from __future__ import annotations

import math
import re
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.odrive import wire
from rt_robot_os.sim.motor_board import motor_simulation_settings
from rt_robot_os.sim.motor_board import SimulatedMotorBoard

_MOTOR_FAILED: Final = 0x40
_INVALID_STATE: Final = 0x1
_CURRENT_A: Final = 0.4
_LONGEST: Final = 256
# Characters after the checksum are ignored.
_DIGITS: Final = re.compile(rb'\s*(\d{1,9})').match
_MOST_OF_A_PROPERTY: Final = 9


class _Axis:
    """
    One axis.

    :ivar speed: commanded, in turns of the motor per second.
    :ivar ready: it is calibrated.
    """

    def __init__(self, ready: bool) -> None:
        self.ready = ready
        self.state = wire.IDLE
        self.error = 0
        self.speed = 0.0
        self.watched = False
        self.timeout_s = 0.0
        self.fed_ns = 0


class SimulatedOdrive(SimulatedMotorBoard):
    """
    An ODrive of firmware 0.5 or 0.6; its rate is that of checking its watchdogs.

    :ivar axes: by the number that the driver uses, left before right.
    """

    SETTINGS = motor_simulation_settings(100.0, 1000.0) + (
        Field('calibrated', bool, True,
              'Its motors and encoders are calibrated; otherwise no axis enters closed loop '
              'control.'),
    )
    BAUD = 115200
    TICKS = 1.0

    def prepare(self) -> None:
        """Switch it on."""
        super().prepare()
        self._turns_per_rad = self.device.get('gear_ratio', 1.0) / math.tau
        self._numbers = (self.device.get('left_axis', 0), self.device.get('right_axis', 1))
        self._off = False
        self._switch_on()

    def _switch_on(self) -> None:
        self.axes = tuple(_Axis(self.settings['calibrated']) for _ in self._numbers)
        self._zero = self.angles()
        self._pending = b''

    def pump(self, now_ns: int) -> None:
        """
        Do everything that is due by now; without power nothing.

        :raises DeviceError: the port cannot be made again after a fault.
        """
        off = self.has_fault('reset')
        if off or self._off:
            self._switch_on()
            self._drive()
        self._off = off
        super().pump(now_ns)

    @property
    def is_driving(self) -> bool:
        """Return whether a motor in closed loop control is commanded to turn."""
        return any(axis.speed and axis.state == wire.CLOSED_LOOP for axis in self.axes)

    def handle_command(self, data: bytes) -> None:
        """Execute lines; one with a wrong checksum is ignored."""
        if self._off:
            return
        *lines, self._pending = (self._pending + self.thinned(data)).split(b'\n')
        self._pending = self._pending[-_LONGEST:]
        for text in lines:
            command, star, given = text.strip().partition(b'*')
            digits = _DIGITS(given)
            if star and (digits is None or int(digits[1]) != wire.checksum(command)):
                continue
            answer = self._answer(command.decode('ascii', 'replace').split())
            if answer:
                said = answer.encode()
                check = b'*%d' % wire.checksum(said) if star else b''
                self.reply(self.thinned(said + check + b'\r\n'))
        self._drive()

    def sample(self, time_s: float) -> bytes:
        """Check the watchdogs; it sends nothing by itself."""
        for axis in self.axes:
            late = self._now_ns - axis.fed_ns > axis.timeout_s * NS_PER_S
            if axis.watched and late:
                self._fail(axis, wire.WATCHDOG_ERROR)
        if self.has_fault('overcurrent'):
            self._fail(self.axes[0], _MOTOR_FAILED)
        self._drive()
        return b''

    def _fail(self, axis: _Axis, error: int) -> None:
        axis.error |= error
        axis.state = wire.IDLE

    def _drive(self) -> None:
        """Drive the motors as their axes demand; both drive, or both coast."""
        if all(axis.state != wire.CLOSED_LOOP for axis in self.axes):
            self.duty(0.0, 0.0)
            return
        left, right = (axis.speed / self._turns_per_rad if axis.state == wire.CLOSED_LOOP else 0.0
                       for axis in self.axes)
        self.hold_speeds(left, right)

    # --- commands --------------------------------------------------------------------------------

    def _answer(self, words: list[str]) -> str:
        command, *rest = words or ['']
        if command == 'sc':
            for axis in self.axes:
                axis.error = 0
            return ''
        if command in ('r', 'w') and len(rest) == (1 if command == 'r' else 2):
            return self._read(rest[0]) if command == 'r' else self._write(*rest)
        if command not in ('v', 'f', 'u'):
            return '' if command[:1] == 's' else 'unknown command'
        number = _number(rest[0]) if rest else None
        if number is None:
            return 'invalid command format'
        if number not in self._numbers:
            return f'invalid motor {number:.0f}'
        side = self._numbers.index(number)
        axis = self.axes[side]
        if command == 'f':
            turned = (self.angles()[side] - self._zero[side]) * self._turns_per_rad
            return f'{turned:.6f} {self.speeds()[side] * self._turns_per_rad:.6f}'
        axis.fed_ns = self._now_ns
        if command == 'v':
            speed = _number(rest[1]) if len(rest) > 1 else None
            if speed is None:
                return 'invalid command format'
            axis.speed = speed
        return ''

    def _axis(self, name: str) -> tuple[_Axis | None, str]:
        owner, _, rest = name.partition('.')
        number = _number(owner.removeprefix('axis'))
        if owner.startswith('axis') and number in self._numbers:
            return self.axes[self._numbers.index(number)], rest
        return None, name

    def _read(self, name: str) -> str:
        axis, rest = self._axis(name)
        if axis is not None:
            known: dict[str, float] = {
                'current_state': axis.state, 'error': axis.error, 'active_errors': axis.error,
                'config.enable_watchdog': axis.watched}
            return f'{known[rest]:d}' if rest in known else 'invalid property'
        if name == 'vbus_voltage':
            return f'{self.settings["battery_v"]:.6f}'[:_MOST_OF_A_PROPERTY]
        if name == 'ibus':
            return f'{_CURRENT_A * sum(map(abs, self.speeds())):.6f}'[:_MOST_OF_A_PROPERTY]
        return 'invalid property'

    def _write(self, name: str, text: str) -> str:
        axis, rest = self._axis(name)
        value = _number(text)
        if axis is None or value is None:
            return 'invalid property'
        if rest == 'requested_state':
            self._request(axis, int(value))
        elif rest == 'config.enable_watchdog':
            axis.watched = value != 0
        elif rest == 'config.watchdog_timeout':
            axis.timeout_s = value
        else:
            return 'invalid property'
        return ''

    def _request(self, axis: _Axis, state: int) -> None:
        if state == wire.CLOSED_LOOP and not axis.ready:
            axis.error |= _INVALID_STATE
        elif state == wire.IDLE or (state == wire.CLOSED_LOOP and not axis.error):
            axis.state = state


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
