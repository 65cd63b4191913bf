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

"""A simulated RoboClaw with the wheels of a robot on its motors."""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.roboclaw import wire
from rt_robot_os.devices.roboclaw.simulated_unit import SimulatedUnit
from rt_robot_os.sim.motor_board import motor_simulation_settings
from rt_robot_os.sim.motor_board import SimulatedMotorBoard

_OVERCURRENT: Final = 0x1_0000
# Currents of a motor that turns, and of one that is blocked.
_CURRENT_A: Final = 1.2
_OVERCURRENT_A: Final = 31.0
_ENCODERS: Final = ('left_encoder', 'right_encoder')
_ALL_RAD_S: Final = 1e6


class SimulatedRoboClaw(SimulatedMotorBoard):
    """
    A unit; it executes requests, with its watchdog and its limit of 10 ms between bytes.

    :ivar unit: its state and protocol.
    """

    SETTINGS = motor_simulation_settings(50.0, 1000.0) + (
        Field('address', int, wire.FIRST_ADDRESS,
              'Its address; that of the driver, if known.',
              '', wire.FIRST_ADDRESS, wire.LAST_ADDRESS),
        Field('version', str, 'USB Roboclaw 2x15a v4.2.4', 'Its version string.'),
        Field('old_status', bool, False, 'Its status has 16 bits, as in firmware of 2018.'),
    )
    BAUD = 38400

    def prepare(self) -> None:
        """
        Start in the state after power-on.

        :raises ConfigError: a setting is wrong.
        """
        super().prepare()
        settings, device = self.settings, self.device
        address = int(device.get('address', settings['address']))
        self.unit = SimulatedUnit(address, settings['version'], settings['old_status'])
        self.unit.battery_v = settings['battery_v']
        self._pulse_rad = math.tau / float(device.get('ticks_per_revolution', self.TICKS))
        # Current speeds on their ramp to the commanded ones, in pulses per second.
        self._speeds = (0.0, 0.0)
        self._moved_ns = 0
        self._has_power = True
        self._zero = self.counts()

    def pump(self, now_ns: int) -> None:
        """
        Do everything that is due by now; without power nothing.

        :raises DeviceError: the port cannot be made again after a fault.
        """
        has_power = not self.has_fault('reset')
        if not has_power:
            self.base.coast()
        elif not self._has_power:
            self.unit.power_on()
            self._zero = self.counts()
        self._has_power = has_power
        if has_power:
            self.unit.watch(now_ns)
            self._turn(now_ns)
        super().pump(now_ns)

    def sample(self, time_s: float) -> bytes:
        """Return nothing: it only answers requests."""
        return b''

    def handle_command(self, data: bytes) -> None:
        """Execute requests, and answer."""
        if not self._has_power:
            return
        unit = self.unit
        has_overcurrent = self.has_fault('overcurrent')
        first, second = self.counts()
        unit.counts = first - self._zero[0], second - self._zero[1]
        unit.status = _OVERCURRENT if has_overcurrent else 0
        turning = _CURRENT_A if unit.drive.moves else 0.0
        unit.currents_a = (_OVERCURRENT_A if has_overcurrent else turning, turning)
        answers = self.thinned(unit.handle_command(self.thinned(data), self._now_ns))
        self._turn(self._now_ns)
        if answers:
            self.reply(answers)

    def _turn(self, now_ns: int) -> None:
        """Drive the motors by the last command; a duty of 0 brakes them."""
        took_s, self._moved_ns = (now_ns - self._moved_ns) / NS_PER_S, now_ns
        drive = self.unit.drive
        if not drive.closed and drive.moves:
            self.duty(drive.first / wire.FULL_DUTY, drive.second / wire.FULL_DUTY)
            return
        most = drive.acceleration * took_s if drive.acceleration else math.inf
        first, second = (speed + min(max(wanted - speed, -most), most)
                         for speed, wanted in zip(self._speeds, (drive.first, drive.second)))
        self._speeds = first, second
        self.hold_speeds(self._seen_speed(0, first), self._seen_speed(1, second))

    def _seen_speed(self, channel: int, pulses_s: float) -> float:
        """Return the wheel speed for a command in pulses per second; full speed without counts."""
        if pulses_s and self.has_fault(_ENCODERS[channel]):
            return math.copysign(_ALL_RAD_S, pulses_s)
        return pulses_s * self._pulse_rad
