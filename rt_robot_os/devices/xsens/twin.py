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


"""A simulated Xsens motion tracker that is turned by hand, as the WitMotion unit is."""

from __future__ import annotations

from collections.abc import Mapping
import struct
from typing import Any
from typing import Final

from rt_robot_os.devices.nmea import wire as nmea
from rt_robot_os.devices.witmotion.twin import angular_velocity
from rt_robot_os.devices.witmotion.twin import body_vector
from rt_robot_os.devices.witmotion.twin import EARTH_FIELD_T
from rt_robot_os.devices.witmotion.twin import quaternion
from rt_robot_os.devices.witmotion.twin import Vector
from rt_robot_os.devices.xsens import mtdata2
from rt_robot_os.devices.xsens import wire
from rt_robot_os.devices.xsens.wire import XbusDecoder
from rt_robot_os.schema import Field
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.units import STANDARD_GRAVITY_M_S2

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
    """A motion tracker; it obeys GoToConfig, SetOutputConfiguration and GoToMeasurement."""

    SETTINGS = common_settings(100.0, 2000.0) + (
        Field('noise', float, 1.0, 'Noise, as a multiple of what is usual.', minimum=0.0,
              maximum=1000.0),
        Field('product', str, 'MTi-300', 'What it is: an MTi-100 gives no orientation, an MTi-3 '
              'at most 100 Hz.', choices=('MTi-3', 'MTi-100', 'MTi-300')),
        Field('settling_s', float, 0.0, 'Time until its filter is valid.', unit='s', minimum=0.0,
              maximum=1e6),
    )
    BAUD = 115200

    def __init__(
        self, name: str, settings: Mapping[str, Any], port: PtyPort, baud: int | None = None,
    ) -> None:
        """
        Check the settings; nothing is plugged in yet.

        :raises ConfigError: a setting is wrong.
        """
        super().__init__(name, settings, port, baud)
        self._noise: float = self.settings['noise']
        self._product: str = self.settings['product']
        self._outputs = tuple(
            i for i in (*_ALWAYS, *_MEASURED) if self._can(i))
        self._measuring = True
        self._counter = 0
        self._decoder = XbusDecoder()

    def sample(self, time_s: float) -> bytes:
        """Give one message, nothing while the device is being configured."""
        if not self._measuring:
            return b''
        self._counter = (self._counter + 1) & 0xFFFF
        return wire.mtdata2(
            (identifier, self._item(identifier, time_s)) for identifier in self._outputs)

    def foreign(self) -> bytes:
        """Give what a satellite receiver sends."""
        return nmea.sentence('GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,')

    def obey(self, data: bytes) -> None:
        """Take commands and acknowledge them."""
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
        """Take the outputs that this product has, at the rates that it has."""
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
            return wire.reals(quaternion(time_s))
        if identifier == mtdata2.ACCELERATION:
            return wire.reals(self._noisy(
                body_vector(time_s, (0.0, 0.0, STANDARD_GRAVITY_M_S2)), _ACCELERATION_NOISE))
        if identifier == mtdata2.RATE_OF_TURN:
            return wire.reals(self._noisy(angular_velocity(time_s), _RATE_NOISE))
        east, north, up = (b / MAG_UNIT_T for b in body_vector(time_s, EARTH_FIELD_T))
        return wire.reals(self._noisy((east, north, up), _FIELD_NOISE))

    def _noisy(self, vector: Vector, deviation: float) -> Vector:
        x, y, z = vector
        spread = deviation * self._noise
        gauss = self.random.gauss
        return x + gauss(0.0, spread), y + gauss(0.0, spread), z + gauss(0.0, spread)
