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
Xsens (Movella) MTi motion trackers with MTData2 output: MTi-1 to 3, 10 to 30, 100 to 300, 600.

One ``sensor_msgs/msg/Imu`` for each MTData2 message, in SI units and along the axes of the device;
orientation is relative to east, north, up, whether the device is set to ENU, NED or NWU. It has
covariance[0] = -1 while the device reports that its filter is not valid. A magnetic field is
published on its own topic: the device sends multiples of the field at its place of calibration,
which ``mag_unit_t`` converts to tesla.

With ``configure`` the device is set up each time it is opened: GoToConfig,
SetOutputConfiguration, GoToMeasurement, each acknowledged before the next. Nothing else is ever
sent, and a device that is not set up works as well, with the items that it sends.

The packet counter shows how many messages are lost. The stamp is the arrival of the message; its
transport takes 10 bits per byte (8 ms for 92 bytes at 115200 baud), so choose a fast line.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.imu import imu_publications
from rt_robot_os.devices.imu import imu_settings
from rt_robot_os.devices.imu import ImuFiller
from rt_robot_os.devices.serial.device import BITS_PER_BYTE
from rt_robot_os.devices.serial.device import serial_settings
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.serial.handshake import Handshake
from rt_robot_os.devices.serial.handshake import HandshakeStep
from rt_robot_os.devices.xsens import mtdata2
from rt_robot_os.devices.xsens import wire
from rt_robot_os.devices.xsens.mtdata2 import MtData2Parser
from rt_robot_os.devices.xsens.mtdata2 import MtSample
from rt_robot_os.devices.xsens.wire import XbusDecoder
from rt_robot_os.devices.xsens.wire import XbusFrame

# Tolerance of the length of a quaternion.
_LENGTH_TOLERANCE: Final = 0.1
# A counter that jumps further than this was restarted.
_LARGEST_GAP: Final = 1000
_REMEDY: Final = ('check the wire to its receive pin, or set configure: false and set it up with '
                  "the maker's MT Manager")
_NAMES: Final = {mtdata2.QUATERNION: 'orientation', mtdata2.ACCELERATION: 'acceleration',
                 mtdata2.RATE_OF_TURN: 'rate of turn', mtdata2.MAGNETIC_FIELD: 'magnetic field'}
_SIZES: Final = {mtdata2.PACKET_COUNTER: 2, mtdata2.SAMPLE_TIME_FINE: 4, mtdata2.QUATERNION: 16,
                 mtdata2.ACCELERATION: 12, mtdata2.RATE_OF_TURN: 12, mtdata2.MAGNETIC_FIELD: 12,
                 mtdata2.STATUS_WORD: 4}
_ITEM_HEADER: Final = 3
_MESSAGE_OVERHEAD: Final = 5


class Xsens(SerialDevice[XbusFrame]):
    """An Xsens motion tracker."""

    IF_UNUSED = ('its messages contain no acceleration, rate of turn, orientation or magnetic '
                 'field: '
                 "set configure: true, or set it up with the maker's MT Manager")

    SETTINGS = serial_settings(
        baud=115200, frame_id='imu_link', topic='imu/data', rate_hz=100.0,
    ) + imu_settings(
        acceleration=0.012, angular_velocity=0.001, roll_pitch=0.005, yaw=0.02, mag_t=2e-7,
    ) + (
        Field('mag_unit_t', float, 4.9e-5,
              'Magnetic field of the value 1: that at its place of calibration (4.9e-5 is that of '
              'Enschede, where it is made).', unit='T', minimum=1e-6, maximum=1e-3),
        Field('configure', bool, False,
              'Set items and rate at opening. Off: the device is not changed.'),
        Field('orientation', bool, True,
              'With configure: enable the orientation, which an MTi-1, 10 or 100 does not have.'),
    )
    description = 'Xsens MTi motion tracker, MTData2: acceleration, rate, attitude, field'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: ``configure`` is on, and rate and line do not go together.
        """
        super().__init__(name, settings, XbusDecoder())
        self._parser = MtData2Parser()
        self._filler = ImuFiller(settings)
        self._mag_unit_t: float = settings['mag_unit_t']
        self._outputs = self._wanted() if settings['configure'] else ()
        self._setup = Handshake(name, (), _REMEDY)
        self._problem = ''
        self._counter: int | None = None
        self._lost = 0

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications: Imu, and MagneticField unless its topic is empty."""
        return imu_publications(self.settings)

    def restart(self) -> None:
        """Reset the counter, and start the set-up if it is configured."""
        self._counter = None
        self._problem = ''
        steps = [
            HandshakeStep('GoToConfig', wire.message(wire.GO_TO_CONFIG), wire.GO_TO_CONFIG),
            HandshakeStep('SetOutputConfiguration', wire.message(
                wire.SET_OUTPUT_CONFIGURATION, wire.output_configuration(self._outputs)),
                wire.SET_OUTPUT_CONFIGURATION),
            HandshakeStep('GoToMeasurement', wire.message(wire.GO_TO_MEASUREMENT),
                          wire.GO_TO_MEASUREMENT),
        ] if self._outputs else []
        self._setup = Handshake(self.name, steps, _REMEDY)

    def is_set_up(self) -> bool:
        """Return whether the set-up is done."""
        return self._setup.done

    def write(self, now_ns: int) -> None:
        """
        Send the next command of the set-up, if due.

        :raises DeviceError: the port is gone, or the device does not answer or refuses.
        """
        if self._problem:
            raise DeviceError(f'{self.name}: {self._problem}')
        data = self._setup.due(now_ns)
        if data is not None:
            self.send(data)

    def handle(self, frame: XbusFrame, arrival_ns: int) -> int:
        """Handle one message; in the loop."""
        if frame.mid == mtdata2.MTDATA2:
            sample = self._parser.parse(frame.payload)
            # Messages before the end of the set-up may have other items and rates.
            if sample is not None and self._setup.done:
                return self._publish(sample, arrival_ns)
        step = self._setup.step
        if step is not None and frame.mid == step.key + 1:
            if step.key == wire.SET_OUTPUT_CONFIGURATION:
                self._problem = self._difference(frame.payload)
            if not self._problem:
                self._setup.acknowledged(arrival_ns)
        elif step is not None and frame.mid == wire.ERROR:
            code = frame.payload[0] if frame.payload else 0
            self._problem = (
                f'it refuses {step.name} with error 0x{code:02x} '
                f'({wire.ERRORS.get(code, "see its manual")}): check output_rate_hz, and '
                'orientation, or set configure: false')
        else:
            self._ignored_frames += 1
        return 0

    def statistics(self) -> DeviceStatistics:
        """Return the current counters; contradictions are messages with broken items."""
        return self._counters(lost_samples=self._lost, contradicted=self._parser.malformed)

    def _publish(self, sample: MtSample, arrival_ns: int) -> int:
        if sample.counter is not None:
            self._count_lost(sample.counter)
        samples = 0
        acceleration, rate = _finite(sample.acceleration), _finite(sample.rate)
        orientation = _rotation(sample)
        if acceleration or rate or orientation:
            publisher = self._publishers[0]
            self._filler.fill(publisher.msg, acceleration, rate, orientation)
            publisher.publish(arrival_ns)
            samples = 1
        field = _finite(sample.field)
        if field and len(self._publishers) > 1:
            publisher = self._publishers[1]
            unit = self._mag_unit_t
            x, y, z = field
            self._filler.fill_field(publisher.msg, (x * unit, y * unit, z * unit))
            publisher.publish(arrival_ns)
            samples += 1
        if not samples:
            self._ignored_frames += 1
        return samples

    def _count_lost(self, counter: int) -> None:
        before, self._counter = self._counter, counter
        if before is not None:
            gap = (counter - before - 1) & 0xFFFF
            if gap <= _LARGEST_GAP:
                self._lost += gap

    def _difference(self, payload: bytes) -> str:
        """Return how the accepted outputs of the device differ from the requested ones."""
        answer = dict(wire.read_output_configuration(payload))
        if not answer:
            return ''
        for identifier, rate in self._outputs:
            given = answer.get(identifier, 0)
            if given == rate or identifier not in _NAMES:
                continue
            what = _NAMES[identifier]
            if identifier == mtdata2.QUATERNION and not given:
                return 'this product has no orientation: set orientation: false'
            remedy = f'set output_rate_hz: {given}' if given else 'choose another product'
            return f'of {what} at {rate} Hz it sends {given} Hz: {remedy}'
        return ''

    def _wanted(self) -> tuple[tuple[int, int], ...]:
        """Return identifiers and rates, after a check of rate and line."""
        settings = self.settings
        rate_hz: float = settings['output_rate_hz']
        if rate_hz != round(rate_hz) or not 1 <= rate_hz <= 2000:
            raise ConfigError([f'{self.name}: output_rate_hz {rate_hz:g} cannot be configured: '
                               'it must be an integer from 1 to 2000 that divides 2000'])
        measured = [mtdata2.ACCELERATION, mtdata2.RATE_OF_TURN]
        if settings['orientation']:
            measured.insert(0, mtdata2.QUATERNION)
        if settings['mag_topic']:
            measured.append(mtdata2.MAGNETIC_FIELD)
        always = (mtdata2.PACKET_COUNTER, mtdata2.SAMPLE_TIME_FINE, mtdata2.STATUS_WORD)
        size = _MESSAGE_OVERHEAD + sum(
            _ITEM_HEADER + _SIZES[identifier] for identifier in (*always, *measured))
        needed = size * BITS_PER_BYTE * rate_hz
        if 0 < settings['baud'] < needed:
            raise ConfigError([
                f'{self.name}: output_rate_hz {rate_hz:g} needs {needed:.0f} baud and the line '
                f'has {settings["baud"]}: lower output_rate_hz or raise baud'])
        return (*((identifier, wire.EVERY_MESSAGE) for identifier in always),
                *((identifier, round(rate_hz)) for identifier in measured))


def _finite(numbers: tuple[float, ...] | None) -> tuple[float, ...] | None:
    """Return the numbers; None if there are none or one of them is not finite."""
    return numbers if numbers is not None and math.isfinite(sum(numbers)) else None


def _rotation(sample: MtSample) -> tuple[float, float, float, float] | None:
    """Return the orientation as x, y, z, w; None if there is no valid one."""
    q = sample.quaternion
    if q is None or (sample.status is not None and not sample.status & mtdata2.FILTER_VALID):
        return None
    w, x, y, z = q
    length = math.sqrt(w * w + x * x + y * y + z * z)
    if not abs(length - 1.0) < _LENGTH_TOLERANCE:  # also false for NaN
        return None
    return x / length, y / length, z / length, w / length
