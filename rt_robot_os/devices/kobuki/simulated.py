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

"""A simulated Kobuki base."""

from __future__ import annotations

import math
import struct
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.kobuki import wire
from rt_robot_os.devices.kobuki.wire import CoreSensors
from rt_robot_os.devices.kobuki.wire import KobukiDecoder
from rt_robot_os.motion.differential import wheel_speeds
from rt_robot_os.sim.motor_board import motor_simulation_settings
from rt_robot_os.sim.motor_board import SimulatedMotorBoard

_AUTO_STOP_NS: Final = round(wire.SILENCE_S * NS_PER_S)
# The part of the robot's outline that each of the three bumpers covers; 0 is ahead.
_CENTRE_RAD: Final = math.radians(30)
_SIDE_RAD: Final = math.radians(90)
# It must retreat by this distance to be released.
_PRESSED_M: Final = 0.005
_FASTEST_M_S: Final = 0.7
_GYRO_NOISE_RAD_S: Final = 0.002
_UNIQUE_ID: Final = struct.pack('<3I', 0x32373334, 0x47083234, 0x002F0040)


class SimulatedKobuki(SimulatedMotorBoard):
    """
    A base; it executes the driver's commands, and stops when none arrive.

    :ivar told: last commanded linear and angular velocity, or 0 after its own stop.
    :ivar commanded_ns: time of the last command.
    :ivar count_offsets: values of the wheels' counters at which it counts zero.
    :ivar outputs: the switched outputs.
    :ivar lifted: it is lifted: its wheels have dropped, its cliff sensors see no floor.
    """

    SETTINGS = tuple(each for each in motor_simulation_settings(wire.PACKET_HZ, wire.PACKET_HZ)
                     if each.name != 'battery_v') + (
        Field('battery_v', float, 16.4, 'Voltage of its battery.', 'V', 0.0, 25.5),
        Field('charger', int, 0, 'State of its charger.', choices=(0, 2, 6, 18, 22)),
    )
    BAUD = 115200
    TICKS = wire.TICKS_PER_TURN

    def prepare(self) -> None:
        """
        Start in the state after power-on.

        :raises ConfigError: a setting is wrong.
        """
        super().prepare()
        self.base.fit(wire.WHEEL_RADIUS_M, wire.SEPARATION_M)
        self.lifted = False
        self._has_power = True
        self._power_on()

    def _power_on(self) -> None:
        self.told = (0.0, 0.0)
        self.outputs = 0x00F0
        self._decoder = KobukiDecoder()
        self.commanded_ns = self._power_ns = self._now_ns
        self.count_offsets = self.counts()
        self._extra = False
        self._gyro_number = 0

    def pump(self, now_ns: int) -> None:
        """
        Do everything that is due by now; without power nothing.

        :raises DeviceError: the port cannot be made again after a fault.
        """
        has_power = not self.has_fault('reset')
        if not has_power:
            self.base.coast()
        elif not self._has_power:
            self._power_on()
        self._has_power = has_power
        super().pump(now_ns)

    def handle_command(self, data: bytes) -> None:
        """Do what it is told."""
        if not self._has_power:
            return
        for frame in self._decoder.feed(self.thinned(data)):
            order = frame.parts.get(wire.BASE_CONTROL, b'')
            if len(order) == 4:
                self.told = wire.velocity_of(*struct.unpack('<hh', order))
                self.commanded_ns = self._now_ns
                self._turn()
            switched = frame.parts.get(wire.OUTPUTS, b'')
            if len(switched) == 2:
                self.outputs, = struct.unpack('<H', switched)
            self._extra |= wire.REQUEST_EXTRA in frame.parts

    def _turn(self) -> None:
        left, right = (
            min(max(speed, -_FASTEST_M_S), _FASTEST_M_S) / wire.WHEEL_RADIUS_M
            for speed in wheel_speeds(*self.told, wire.SEPARATION_M))
        self.hold_speeds(left, right)

    def sample(self, time_s: float) -> bytes:
        """Return one packet."""
        if not self._has_power:
            return b''
        if self._now_ns - self.commanded_ns > _AUTO_STOP_NS and any(self.told):
            self.told = (0.0, 0.0)
            self._turn()
        _, _, heading = self.base.pose
        rate = self.base.velocity[1]
        parts = [wire.core(self.core_sensors()), (wire.DOCK, bytes(3)),
                 wire.inertia(heading, rate),
                 (wire.CLIFF, struct.pack('<3H', *(3 * (0 if self.lifted else 2000,)))),
                 (wire.CURRENT, bytes(2)), self._gyro(rate), (wire.PINS, bytes(16))]
        if self._extra:
            self._extra = False
            parts += [(wire.HARDWARE, b'\x04\x00\x01\x00'), (wire.FIRMWARE, b'\x00\x02\x01\x00'),
                      (wire.UNIQUE_ID, _UNIQUE_ID)]
        return self.thinned(wire.packet(parts))

    def core_sensors(self) -> CoreSensors:
        time_ms = (self._now_ns - self._power_ns) // (NS_PER_S // 1000)
        left, right = (
            count - zero & 0xFFFF for count, zero in zip(self.counts(), self.count_offsets))
        drops = 3 if self.lifted else 0
        return CoreSensors(
            time_ms & 0xFFFF, self._bumper(), drops, 7 if self.lifted else 0, left, right, 0, 0, 0,
            self.settings['charger'], round(self.settings['battery_v'] / wire.BATTERY_V),
            3 if self.has_fault('overcurrent') else 0)

    def _bumper(self) -> int:
        """Return which bumpers are pressed, also of a base that stands."""
        pressed = 0
        for direction in self.base.touched(_PRESSED_M):
            if abs(direction) <= _CENTRE_RAD:
                pressed |= 2
            elif abs(direction) <= _SIDE_RAD:  # there is no bumper at the rear
                pressed |= 4 if direction > 0 else 1
        return pressed

    def _gyro(self, rate_rad_s: float) -> tuple[int, bytes]:
        noise = self.random.gauss
        self._gyro_number = self._gyro_number + 2 & 0xFF
        return wire.gyro(self._gyro_number, [
            (noise(0.0, _GYRO_NOISE_RAD_S), noise(0.0, _GYRO_NOISE_RAD_S),
             rate_rad_s + noise(0.0, _GYRO_NOISE_RAD_S)) for _ in range(2)])
