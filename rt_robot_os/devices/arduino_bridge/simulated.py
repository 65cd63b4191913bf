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

"""A simulated Arduino with ros_arduino_bridge, its motors and its encoders."""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.arduino_bridge import wire
from rt_robot_os.devices.arduino_bridge.simulated_firmware import Gains
from rt_robot_os.devices.arduino_bridge.simulated_firmware import MOST_PWM
from rt_robot_os.devices.arduino_bridge.simulated_firmware import number
from rt_robot_os.devices.arduino_bridge.simulated_firmware import Parser
from rt_robot_os.devices.arduino_bridge.simulated_firmware import WheelLoop
from rt_robot_os.sim.motor_board import motor_simulation_settings
from rt_robot_os.sim.motor_board import SimulatedMotorBoard

# AUTO_STOP_INTERVAL of the original firmware.
_AUTO_STOP_S: Final = 2.0
# A sonar without an echo blocks the firmware.
_PING_NS: Final = 693 * NS_PER_MS
_UART_BUFFER: Final = 64
_LINE_END: Final = b'\r\n'
# Rounds that a blocked loop catches up without delay.
_MOST_MISSED: Final = 1000
_HIGHEST_ANALOG: Final = 1023


class SimulatedArduinoBridge(SimulatedMotorBoard):
    """
    A board with ros_arduino_bridge; its rate is that of its control loop.

    :ivar moving: its loop is closed and drives.
    :ivar pwm: outputs to its motors, -255 to 255.
    """

    SETTINGS = motor_simulation_settings(wire.PID_RATE_HZ, 200.0) + (
        Field('boot_s', float, 0.5, 'Time of its boot loader, after a reset.', 's', 0.0, 10.0),
    )
    BAUD = 57600

    def prepare(self) -> None:
        """Switch it on."""
        super().prepare()
        self.count_offsets = 0, 0
        self._auto_stop_ns = round(self.device.get('auto_stop_s', _AUTO_STOP_S) * NS_PER_S)
        self._boot_until_ns = 0
        self._off = False
        self._boot()

    def _boot(self) -> None:
        self._parser = Parser()
        self._loops = WheelLoop(), WheelLoop()
        self.gains = Gains()
        self._busy_until_ns = 0
        self._buffer = b''
        self._missed_rounds = 0
        self._commanded_ns = 0
        self.moving = False
        self.pwm = 0, 0
        self.count_offsets = self.counts()

    def pump(self, now_ns: int) -> None:
        """
        Do everything that is due by now; without power nothing.

        :raises DeviceError: the port cannot be made again after a fault.
        """
        off = self.has_fault('reset')
        if off and not self._off:
            self._boot()
            self.duty(0.0, 0.0)
        if off or self._off:
            self._boot_until_ns = now_ns + round(self.settings['boot_s'] * NS_PER_S)
        if now_ns <= self._boot_until_ns:
            self.count_offsets = self.counts()
        self._off = off
        if now_ns - self._commanded_ns > self._auto_stop_ns and now_ns >= self._busy_until_ns:
            self._set_pwm(0, 0)
            self.moving = False
        super().pump(now_ns)

    @property
    def ticks(self) -> tuple[int, int]:
        """Return its counts since power-on, or since a command to reset them."""
        left, right = self.counts()
        return left - self.count_offsets[0], right - self.count_offsets[1]

    def handle_command(self, data: bytes) -> None:
        """Execute commands; while a sonar blocks it they wait."""
        if self._is_down():
            return
        data = self.thinned(data)
        if self._now_ns < self._busy_until_ns:
            self._buffer = (self._buffer + data)[:_UART_BUFFER]
        else:
            self._run(data, self._now_ns)

    def sample(self, time_s: float) -> bytes:
        """Run one round of the control loop; it sends nothing by itself."""
        now_ns = self.start_ns + round(time_s * NS_PER_S)
        if self._is_down():
            return b''
        if now_ns < self._busy_until_ns:
            self._missed_rounds = min(self._missed_rounds + 1, _MOST_MISSED)
            return b''
        if self._busy_until_ns:
            waited, self._buffer = self._buffer, b''
            until_ns, self._busy_until_ns = self._busy_until_ns, 0
            self._run(waited, until_ns)
        rounds, self._missed_rounds = 1 + self._missed_rounds, 0
        for _ in range(rounds):
            self._round()
        return b''

    # --- commands --------------------------------------------------------------------------------

    def _run(self, data: bytes, now_ns: int) -> None:
        for command, first, second in self._parser.take(data):
            answer = self._answer(command, first, second, now_ns)
            self._line.push(self.thinned(answer + _LINE_END), max(now_ns, self._busy_until_ns))

    def _answer(self, command: str, first: bytes, second: bytes, now_ns: int) -> bytes:
        if command == 'e':
            return b'%d %d' % self.ticks
        if command in 'mo':
            self._commanded_ns = now_ns
            self._drive(command, number(first), number(second))
        elif command == 'r':
            self.count_offsets = self.counts()
            self._reset_loops()
        elif command == 'u':
            p, d, i, scale, *_ = [*map(number, first.split(b':')), 0, 0, 0, 0]
            self.gains = Gains(p, d, i, scale or 1)
        elif command == 'b':
            return b'57600'
        elif command == 'p':
            self._busy_until_ns = now_ns + _PING_NS
            return b'0'
        elif command == 'a':
            return b'%d' % self._analog(number(first))
        elif command in 'dt':
            return b'0'
        elif command not in 'xwcs':
            return wire.INVALID
        return wire.DONE

    def _drive(self, command: str, left: int, right: int) -> None:
        if command == 'o' or (left, right) == (0, 0):
            self._reset_loops()
            self._set_pwm(left, right)
            self.moving = False
            return
        self.moving = True
        self._loops[0].target, self._loops[1].target = left, right

    def _analog(self, pin: int) -> int:
        if pin != self.device.get('battery_pin', -1):
            return 0
        volts: float = self.settings['battery_v'] / self.device['battery_volts_per_count']
        return min(round(volts), _HIGHEST_ANALOG)

    # --- the control loop ------------------------------------------------------------------------

    def _round(self) -> None:
        """
        Run one round.

        A loop that does not drive resets its state once; counts made while the wheels coast remain
        in it, and the next command starts with them.
        """
        ticks = self.ticks
        if self.moving:
            left, right = (loop.step(count, self.gains)
                           for loop, count in zip(self._loops, ticks))
            self._set_pwm(left, right)
        elif any(loop.input for loop in self._loops):
            self._reset_loops()

    def _reset_loops(self) -> None:
        for loop, count in zip(self._loops, self.ticks):
            loop.reset(count)

    def _set_pwm(self, left: int, right: int) -> None:
        self.pwm = (max(-MOST_PWM, min(left, MOST_PWM)), max(-MOST_PWM, min(right, MOST_PWM)))
        self.duty(self.pwm[0] / MOST_PWM, self.pwm[1] / MOST_PWM)

    def _is_down(self) -> bool:
        return self.has_fault('reset') or self._now_ns < self._boot_until_ns
