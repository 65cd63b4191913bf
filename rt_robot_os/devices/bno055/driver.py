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
The Bosch BNO055 over its UART: a unit with internal fusion that answers requests.

One ``sensor_msgs/msg/Imu`` for each answer, and magnetic field and temperature on their own
topics. The driver sets the device up at each opening (chip id, configuration mode, units, power,
mode) and then requests all registers together, ``output_rate_hz`` times a second; at most one
request is in flight. After a bus overrun, which the device reports for a request at a bad moment,
the request is repeated.

The stamp is the arrival of the answer, 4.5 ms after the request at 115200 baud.

Orientation is the quaternion of the device: its yaw is that of its compass in mode ``ndof``, and
relative to the start in mode ``imu``. While the device reports that it is not calibrated (system
status 0, ``ndof``) the standard deviation of yaw is pi: heading unknown.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import period_from_rate
from rt_robot_os.devices.bno055 import wire
from rt_robot_os.devices.bno055.wire import Bno055Decoder
from rt_robot_os.devices.bno055.wire import Bno055Frame
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.imu import imu_publications
from rt_robot_os.devices.imu import imu_settings
from rt_robot_os.devices.imu import ImuFiller
from rt_robot_os.devices.serial.device import serial_settings
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.serial.handshake import Handshake
from rt_robot_os.devices.serial.handshake import HandshakeStep

_READ, _WRITE = 0, 1
# A wrong chip id is accepted only if it is read twice: once may be noise.
_SURE: Final = 2
_MODES: Final = {'ndof': wire.MODE_NDOF, 'imu': wire.MODE_IMU}
# The data sheet's times for changing the mode, with a margin.
_TO_CONFIG_NS: Final = 30 * NS_PER_MS
_FROM_CONFIG_NS: Final = 20 * NS_PER_MS
# An answer takes 4.5 ms; after this time it is missing.
_TIMEOUT_NS: Final = 50 * NS_PER_MS
_REQUEST: Final = wire.read_request(wire.BLOCK_FIRST, wire.BLOCK_SIZE)
_REMEDY: Final = ('check both wires (TX to RX, RX to TX) and that PS1 is high and PS0 low, which '
                  'selects its UART')

_ACCELERATION_SCALE: Final = 1 / wire.ACCELERATION_LSB
_FIELD_SCALE: Final = 1 / wire.FIELD_LSB_PER_T
_RATE_SCALE: Final = math.radians(1 / wire.RATE_LSB_PER_DEG)
_YAW_UNKNOWN: Final = math.pi * math.pi
# It gives whole degrees.
_TEMPERATURE_VARIANCE: Final = 1.0


class Bno055(SerialDevice[Bno055Frame]):
    """A BNO055 on a serial port."""

    SETTINGS = serial_settings(
        baud=115200, frame_id='imu_link', topic='imu/data', rate_hz=100.0,
    ) + imu_settings(
        acceleration=0.03, angular_velocity=0.005, roll_pitch=0.02, yaw=0.05, mag_t=1e-6,
    ) + (
        Field('temperature_topic', str, 'imu/temperature',
              'Topic of the temperature; empty publishes none.'),
        Field('mode', str, 'ndof', 'Fusion: ndof with magnetometer, imu without.',
              choices=tuple(_MODES)),
        Field('external_crystal', bool, False,
              'Use the crystal of the board, if it has one; it is more exact than the internal '
              'clock.'),
    )
    description = 'Bosch BNO055 over UART: acceleration, rate, attitude, field, temperature'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """Store the settings; nothing is opened."""
        super().__init__(name, settings, Bno055Decoder())
        self._filler = ImuFiller(settings)
        self._period_ns = period_from_rate(settings['output_rate_hz'])
        self._field_at = 1 if settings['mag_topic'] else 0
        self._temperature_at = 1 + self._field_at if settings['temperature_topic'] else 0
        self._fuses_field = settings['mode'] == 'ndof'
        self._setup = Handshake(name, (), _REMEDY)
        self._asked_ns = 0
        self._due_ns = 0
        self._again = False
        self._chip_id = self._wrong_ids = 0
        self._lost = 0
        self._refused = 0

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications: Imu, and MagneticField and Temperature with a topic."""
        settings = self.settings
        found = imu_publications(settings)
        if settings['temperature_topic']:
            found += (TopicSpec(
                settings['temperature_topic'], 'sensor_msgs/msg/Temperature', found[0].fixed,
                settings['depth'], settings['output_rate_hz']),)
        return found

    def restart(self) -> None:
        """Start the set-up."""
        def setting(name: str, register: int, value: int, pause_ns: int = 0) -> HandshakeStep:
            return HandshakeStep(name, wire.write_request(register, bytes((value,))), _WRITE,
                                 pause_ns)

        crystal = wire.EXTERNAL_CRYSTAL if self.settings['external_crystal'] else 0
        self._setup = Handshake(self.name, (
            HandshakeStep('the request for its chip id',
                          wire.read_request(wire.REGISTER_CHIP_ID, 1), _READ),
            setting('configuration mode', wire.REGISTER_MODE, wire.MODE_CONFIG, _TO_CONFIG_NS),
            setting('page 0', wire.REGISTER_PAGE, 0),
            setting('units', wire.REGISTER_UNITS, wire.UNITS_SI),
            setting('normal power', wire.REGISTER_POWER, 0),
            setting('clock', wire.REGISTER_TRIGGER, crystal, _TO_CONFIG_NS),
            setting('fusion mode', wire.REGISTER_MODE, _MODES[self.settings['mode']],
                    _FROM_CONFIG_NS),
        ), _REMEDY)
        self._asked_ns = self._due_ns = 0
        self._again = False
        self._wrong_ids = 0

    def is_set_up(self) -> bool:
        """Return whether the set-up is done."""
        return self._setup.done

    def write(self, now_ns: int) -> None:
        """
        Send a step of the set-up, or the request for the next sample, if due.

        :raises DeviceError: the port is gone, or the device does not answer or is not a BNO055.
        """
        if self._wrong_ids >= _SURE:
            raise DeviceError(
                f'{self.name}: chip id 0x{self._chip_id:02x} is not that of a BNO055 '
                f'(0x{wire.CHIP_ID:02x}): check what is connected')
        if not self._setup.ready(now_ns):
            data = self._setup.due(now_ns)
            if data is not None:
                self.send(data)
            return
        if self._asked_ns:
            if now_ns - self._asked_ns < _TIMEOUT_NS:
                return
            self._lost += 1
            self._asked_ns = 0
        if self._again or now_ns >= self._due_ns:
            self.send(_REQUEST)
            self._asked_ns = now_ns
            if self._again:
                self._again = False
            elif self._due_ns:
                # On its grid, but without a burst for missed samples.
                self._due_ns += ((now_ns - self._due_ns) // self._period_ns + 1) * self._period_ns
            else:
                self._due_ns = now_ns + self._period_ns

    def idle(self, now_ns: int) -> int:
        """
        Send the next request right after an answer: the next ``write`` may be late for the grid.

        :raises DeviceError: the port is gone.
        """
        if self._setup.done:
            self.write(now_ns)
        return 0

    def handle(self, frame: Bno055Frame, arrival_ns: int) -> int:
        """Handle one answer; in the loop."""
        step = self._setup.step
        if step is not None:
            self._go_on(step, frame, arrival_ns)
        elif frame.status == wire.OVERRUN:
            self._asked_ns = 0
            self._again = True
        elif frame.status:
            self._refused += 1
            self._asked_ns = 0
        elif len(frame.data) == wire.BLOCK_SIZE:
            self._asked_ns = 0
            return self._publish(frame.data, arrival_ns)
        else:
            self._ignored_frames += 1
        return 0

    def statistics(self) -> DeviceStatistics:
        """Return the current counters; lost samples are requests without an answer."""
        return self._counters(lost_samples=self._lost, contradicted=self._refused)

    def _go_on(self, step: HandshakeStep, frame: Bno055Frame, arrival_ns: int) -> None:
        if step.key == _READ and len(frame.data) == 1:
            self._chip_id = frame.data[0]
            if self._chip_id == wire.CHIP_ID:
                self._setup.acknowledged(arrival_ns)
            else:
                self._wrong_ids += 1
        elif step.key == _WRITE and frame.status == wire.WRITE_SUCCESS:
            self._setup.acknowledged(arrival_ns)
        elif frame.status > wire.WRITE_SUCCESS:
            self._setup.again(arrival_ns, f'{wire.STATUSES[frame.status]}, 0x{frame.status:02x}')
        else:
            self._ignored_frames += 1

    def _publish(self, data: bytes, arrival_ns: int) -> int:
        (ax, ay, az, mx, my, mz, gx, gy, gz, _, _, _, qw, qx, qy, qz, _, _, _, _, _, _,
         celsius, calibration) = wire.BLOCK.unpack(data)
        length = math.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
        publisher = self._publishers[0]
        msg = publisher.msg
        scale, turn = _ACCELERATION_SCALE, _RATE_SCALE
        self._filler.fill(
            msg, (ax * scale, ay * scale, az * scale), (gx * turn, gy * turn, gz * turn),
            (qx / length, qy / length, qz / length, qw / length) if length else None)
        if length and self._fuses_field and not calibration >> 6:
            msg.orientation_covariance[8] = _YAW_UNKNOWN
        publisher.publish(arrival_ns)
        if self._field_at:
            publisher = self._publishers[self._field_at]
            scale = _FIELD_SCALE
            self._filler.fill_field(publisher.msg, (mx * scale, my * scale, mz * scale))
            publisher.publish(arrival_ns)
        if self._temperature_at:
            publisher = self._publishers[self._temperature_at]
            publisher.msg.temperature = float(celsius)
            publisher.msg.variance = _TEMPERATURE_VARIANCE
            publisher.publish(arrival_ns)
        return len(self._publishers)
