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


"""A simulated Xsens motion tracker on the robot or turned by hand."""

from __future__ import annotations

import struct
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.devices.xsens import mtdata2
from rt_robot_os.devices.xsens import wire
from rt_robot_os.devices.xsens.wire import XbusDecoder
from rt_robot_os.sim import world
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.world.inertial import inertial
from rt_robot_os.sim.world.inertial import ON_SETTING

MAG_UNIT_T: Final = 4.9e-5

_ACCELERATION_NOISE: Final = 0.012
_RATE_NOISE: Final = 0.001
_FIELD_NOISE: Final = 0.004
_INVALID_PARAMETER: Final = 0x21
_ALWAYS: Final = (mtdata2.PACKET_COUNTER, mtdata2.SAMPLE_TIME_FINE, mtdata2.STATUS_WORD)
_MEASURED: Final = (
    mtdata2.QUATERNION, mtdata2.ACCELERATION, mtdata2.RATE_OF_TURN, mtdata2.MAGNETIC_FIELD)
_FINE_HZ: Final = 10_000


class SimulatedXsens(SimulatedDevice):
    """A motion tracker; it executes GoToConfig, SetOutputConfiguration and GoToMeasurement."""

    SETTINGS = common_settings(100.0, 2000.0) + (
        world.NOISE_SETTING,
        ON_SETTING,
        Field('product', str, 'MTi-300',
              'Its model: an MTi-100 has no orientation, an MTi-3 at most 100 Hz.',
              choices=('MTi-3', 'MTi-100', 'MTi-300')),
        Field('settling_s', float, 0.0, 'Time until its filter is valid.', unit='s', minimum=0.0,
              maximum=1e6),
    )
    BAUD = 115200

    def prepare(self) -> None:
        """Start in the state after power-on."""
        self._inertial = inertial(self.site, self.settings)
        self._product: str = self.settings['product']
        self._outputs = tuple(
            i for i in (*_ALWAYS, *_MEASURED) if self._can(i))
        self._measuring = True
        self._counter = 0
        self._decoder = XbusDecoder()

    def sample(self, time_s: float) -> bytes:
        """Return one message, nothing while the device is being configured."""
        if not self._measuring:
            return b''
        self._counter = (self._counter + 1) & 0xFFFF
        return wire.mtdata2(
            (identifier, self._item(identifier, time_s)) for identifier in self._outputs)

    def handle_command(self, data: bytes) -> None:
        """Execute commands and acknowledge them."""
        for frame in self._decoder.feed(data):
            answer = b''
            if frame.mid == wire.GO_TO_CONFIG:
                self._measuring = False
            elif frame.mid == wire.GO_TO_MEASUREMENT:
                self._measuring = True
            elif frame.mid == wire.SET_OUTPUT_CONFIGURATION and not self._measuring:
                answer = self._configure(frame.payload)
            else:
                self.reply(wire.message(wire.ERROR, bytes((_INVALID_PARAMETER,))))
                continue
            self.reply(wire.message(frame.mid + 1, answer))

    def _configure(self, payload: bytes) -> bytes:
        """Set the outputs that this product supports, at its rates."""
        limit = 100 if self._product == 'MTi-3' else 2000
        given = [(identifier, rate if rate == wire.EVERY_MESSAGE else min(rate, limit))
                 for identifier, rate in wire.read_output_configuration(payload)
                 if self._can(identifier)]
        self._outputs = tuple(identifier for identifier, _ in given)
        rates = [rate for _, rate in given if 0 < rate != wire.EVERY_MESSAGE]
        if rates:
            self.set_rate(float(max(rates)))
        return wire.output_configuration(given)

    def _can(self, identifier: int) -> bool:
        if identifier == mtdata2.QUATERNION:
            return self._product != 'MTi-100'
        return identifier in _ALWAYS or identifier in _MEASURED

    def _item(self, identifier: int, time_s: float) -> bytes:
        if identifier == mtdata2.PACKET_COUNTER:
            return struct.pack('>H', self._counter)
        if identifier == mtdata2.SAMPLE_TIME_FINE:
            return struct.pack('>I', round(time_s * _FINE_HZ) & 0xFFFFFFFF)
        if identifier == mtdata2.STATUS_WORD:
            valid = mtdata2.FILTER_VALID if time_s >= self.settings['settling_s'] else 0
            return struct.pack('>I', mtdata2.SELF_TEST_OK | valid)
        if identifier == mtdata2.QUATERNION:
            return wire.reals(self._inertial.quaternion(time_s))
        if identifier == mtdata2.ACCELERATION:
            measured = self._inertial.force(time_s)
            deviation = _ACCELERATION_NOISE
        elif identifier == mtdata2.RATE_OF_TURN:
            measured, deviation = self._inertial.angular_velocity(time_s), _RATE_NOISE
        else:
            east, north, up = self._inertial.field(time_s)
            measured = (east / MAG_UNIT_T, north / MAG_UNIT_T, up / MAG_UNIT_T)
            deviation = _FIELD_NOISE
        return wire.reals(world.noisy(measured, deviation * self.settings['noise'], self.random))
