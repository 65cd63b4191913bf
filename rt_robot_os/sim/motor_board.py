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
What simulated motor boards have in common: the robot that they move, and its encoders.

The robot is that of the world; without a world it is a separate one, on an unbounded floor.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.faults import MOTOR_FAULTS
from rt_robot_os.sim.world.drive_base import DriveBase

_LOSS: Final = 0.02
# Keeps an integer count from being rounded down.
_EDGE: Final = 1e-9
_ENCODER_FAULTS: Final = ('left_encoder', 'right_encoder')
Pair = tuple[float, float]


def motor_simulation_settings(rate_hz: float, maximum_hz: float) -> tuple[Field, ...]:
    """
    Declare the settings that every simulated motor board has.

    :param rate_hz: default of the rate.
    """
    return common_settings(rate_hz, maximum_hz, MOTOR_FAULTS) + (
        Field('battery_v', float, 12.3, 'Voltage of its battery.', 'V', 0.0, 1000.0),
    )


class SimulatedMotorBoard(SimulatedDevice):
    """
    A board that drives two wheels.

    Wheels, gears and wiring are those of its device: a wheel that is swapped or inverted there is
    wired so here. All commands and answers are by the board's own channels, left before right.

    :cvar TICKS: counts for one turn, unless the device has a setting.
    :ivar base: the robot.
    """

    KNOWN_FAULTS: ClassVar[Mapping[str, str]] = MOTOR_FAULTS
    TICKS: ClassVar[float] = 1440.0

    def prepare(self) -> None:
        """Get the robot of the world, or make one."""
        device: Mapping[str, Any] = self.device
        size = (device.get('wheel_radius_m', 0.0325), device.get('wheel_separation_m', 0.2))
        if self.world is not None:
            self.base = self.world.base
            self.base.fit(*size)
        else:
            self.base = DriveBase(wheel_radius_m=size[0], wheel_separation_m=size[1])
        self._counts_per_rad = device.get('ticks_per_revolution', self.TICKS) / math.tau
        self.encoder_signs = (-1.0 if device.get('inverted_left') else 1.0,
                              -1.0 if device.get('inverted_right') else 1.0)
        self._swapped = bool(device.get('swapped'))
        self._seen: Pair = (0.0, 0.0)
        self._missed: Pair = (0.0, 0.0)

    def check_speed(self) -> None:
        """Do nothing: it only answers requests."""

    def pump(self, now_ns: int) -> None:
        """
        Advance the robot to now, and do everything that is due.

        :raises DeviceError: the port cannot be made again after a fault.
        """
        if self.world is None:
            self.base.advance(now_ns)
        super().pump(now_ns)

    def duty(self, left: float, right: float) -> None:
        """Apply a share of the voltage to both motors, from -1 to 1; with 0 they coast."""
        if left == 0.0 and right == 0.0:
            self.base.coast()
        else:
            self.base.set_duty(*self._of_wheels(left, right))

    def hold_speeds(self, left_rad_s: float, right_rad_s: float) -> None:
        """Control both wheels to a speed."""
        self.base.set_wheel_speeds(*self._of_wheels(left_rad_s, right_rad_s))

    def angles(self) -> Pair:
        """Return the angles of both encoders, in rad from the start; a broken one stands still."""
        turned, seen, missed = self.base.wheel_angles, self._seen, self._missed
        left, right = (
            missed[side] + (turned[side] - seen[side] if self.has_fault(fault) else 0.0)
            for side, fault in enumerate(_ENCODER_FAULTS))
        self._missed, self._seen = (left, right), turned
        return self._of_channels(turned[0] - left, turned[1] - right)

    def counts(self) -> tuple[int, int]:
        """Return the counts of both encoders, from the start."""
        left, right = self.angles()
        return (math.floor(left * self._counts_per_rad + _EDGE),
                math.floor(right * self._counts_per_rad + _EDGE))

    def speeds(self) -> Pair:
        """Return the true speeds of both wheels in rad/s."""
        return self._of_channels(*self.base.wheel_speeds)

    def thinned(self, data: bytes) -> bytes:
        """Return the bytes, without those lost while the fault loss is active."""
        if not data or not self.has_fault('loss'):
            return data
        chance = self.random.random
        return bytes(byte for byte in data if chance() >= _LOSS)

    def _of_wheels(self, left: float, right: float) -> Pair:
        """Convert values of channels to those of wheels."""
        if self._swapped:
            left, right = right, left
        return left * self.encoder_signs[0], right * self.encoder_signs[1]

    def _of_channels(self, left: float, right: float) -> Pair:
        """Convert values of wheels to those of channels."""
        left, right = left * self.encoder_signs[0], right * self.encoder_signs[1]
        return (right, left) if self._swapped else (left, right)
