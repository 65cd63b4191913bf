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
WitMotion serial inertial measurement units: WT901, JY901, WT61, WT31N and their relatives.

One ``sensor_msgs/msg/Imu`` per instant, in SI units and along the axes printed on the device; the
rules that group frames to an instant are in ``instants.py``. Orientation is that of the quaternion
frame 0x59, otherwise of the angle frame 0x53 (in the order yaw, pitch, roll); it is relative to
the device's own east-north-up (with magnetometer) or start-up frame. Quantities that the device
does not send have covariance[0] = -1. A magnetic field is published on arrival, with the stamp of
its instant.

The stamp is the arrival of the first frame of the instant, not of the last: at 9600 baud five
frames take 57 ms, and the first is nearest to the measurement.

The axes are not rotated: the mounting belongs in the robot's description (tf), see REP 145.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.imu import imu_publications
from rt_robot_os.devices.imu import imu_settings
from rt_robot_os.devices.imu import ImuFiller
from rt_robot_os.devices.serial.device import BITS_PER_BYTE
from rt_robot_os.devices.serial.device import serial_settings
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.witmotion import wire
from rt_robot_os.devices.witmotion.instants import ImuSet
from rt_robot_os.devices.witmotion.instants import ImuSetAssembler
from rt_robot_os.devices.witmotion.wire import command
from rt_robot_os.devices.witmotion.wire import output_mask
from rt_robot_os.devices.witmotion.wire import RATES_HZ
from rt_robot_os.devices.witmotion.wire import REGISTER_OUTPUTS
from rt_robot_os.devices.witmotion.wire import REGISTER_RATE
from rt_robot_os.devices.witmotion.wire import UNLOCK
from rt_robot_os.devices.witmotion.wire import WitMotionDecoder
from rt_robot_os.devices.witmotion.wire import WitMotionFrame

ACCELERATION_SCALE: Final = wire.ACCELERATION_RANGE_G * STANDARD_GRAVITY_M_S2 / wire.FULL_SCALE
ANGULAR_VELOCITY_SCALE: Final = math.radians(wire.ANGULAR_VELOCITY_RANGE_DEG_S) / wire.FULL_SCALE
ANGLE_SCALE: Final = math.radians(wire.ANGLE_RANGE_DEG) / wire.FULL_SCALE

# The frames that the driver enables with `configure`: all that it uses.
_OUTPUTS: Final = (wire.ACCELERATION, wire.ANGULAR_VELOCITY, wire.ANGLE, wire.MAGNETIC_FIELD,
                   wire.QUATERNION)
_USED: Final = frozenset(_OUTPUTS)
# The device needs a while to execute a command before it accepts the next.
_COMMAND_SPACING_NS: Final = 100 * NS_PER_MS
# A quaternion has the length of 2^15 counts; one below half of that is an empty frame.
_SHORTEST_QUATERNION: Final = wire.FULL_SCALE / 2


class WitMotion(SerialDevice[WitMotionFrame]):
    """A WitMotion inertial measurement unit."""

    SETTINGS = serial_settings(
        baud=115200, frame_id='imu_link', topic='imu/data', rate_hz=100.0,
        rates_hz=tuple(RATES_HZ),
    ) + imu_settings(
        acceleration=0.02, angular_velocity=0.002, roll_pitch=0.01, yaw=0.05, mag_t=5e-7,
    ) + (
        Field('mag_scale_t', float, 1.5e-7,
              'Magnetic field of one count. The frame gives raw counts whose size depends on the '
              'magnetometer built in: 1.5e-7 is an AK8963 at 16 bit, a QMC5883L at 8 gauss has '
              '3.3e-8; compare the length of the vector with the local field.',
              unit='T', minimum=1e-10, maximum=1e-4),
        Field('quaternion_order', str, 'wxyz',
              'Order of the four numbers in frame 0x59. By the manuals wxyz; check yours.',
              choices=('wxyz', 'xyzw')),
        Field('configure', bool, False,
              'Set the output rate and the frames at opening (not saved in the device). Off: the '
              'device is not changed; its factory settings are 9600 baud and 10 Hz.'),
    )
    description = 'WitMotion serial IMU (WT901, JY901, WT61, ...): acceleration, rate, attitude'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: ``configure`` is on and the line is too slow for the rate.
        """
        super().__init__(name, settings, WitMotionDecoder())
        self._sets = ImuSetAssembler()
        self._commands: list[bytes] = []
        self._next_command_ns = 0
        self._quaternion_first = settings['quaternion_order'] == 'wxyz'
        self._mag_scale_t: float = settings['mag_scale_t']
        self._filler = ImuFiller(settings)
        self._check_speed()

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications: Imu, and MagneticField unless its topic is empty."""
        return imu_publications(self.settings)

    def restart(self) -> None:
        """Reset the learned set of frames, and queue the commands of the set-up if configured."""
        self._sets.restart()
        self._commands = self._setup() if self.settings['configure'] else []
        self._next_command_ns = 0

    def write(self, now_ns: int) -> None:
        """
        Send the next command of the set-up, if any; one per call.

        :raises DeviceError: the port is gone.
        """
        if self._commands and now_ns >= self._next_command_ns:
            self.send(self._commands.pop(0))
            self._next_command_ns = now_ns + _COMMAND_SPACING_NS

    def handle(self, frame: WitMotionFrame, arrival_ns: int) -> int:
        """Handle one frame; in the loop."""
        samples = 0
        for complete in self._sets.add(frame, arrival_ns, self._previous_read_ns):
            self._publish_imu(complete)
            samples += 1
        if frame.kind == wire.MAGNETIC_FIELD and len(self._publishers) > 1:
            # After a gap this frame may not belong to the current instant.
            self._publish_field(
                frame.values, arrival_ns if self._sets.broken else self._sets.stamp_ns)
            samples += 1
        elif frame.kind == wire.MAGNETIC_FIELD or frame.kind not in _USED:
            self._ignored_frames += 1
        return samples

    def statistics(self) -> DeviceStatistics:
        """Return the current counters."""
        return self._counters(lost_samples=self._sets.lost)

    def _publish_imu(self, complete: ImuSet) -> None:
        publisher = self._publishers[0]
        parts = complete.parts
        self._filler.fill(
            publisher.msg, _scaled(parts.get(wire.ACCELERATION), ACCELERATION_SCALE),
            _scaled(parts.get(wire.ANGULAR_VELOCITY), ANGULAR_VELOCITY_SCALE),
            self._orientation(parts))
        publisher.publish(complete.stamp_ns)

    def _publish_field(self, values: tuple[int, int, int, int], stamp_ns: int) -> None:
        publisher = self._publishers[1]
        scale = self._mag_scale_t
        x, y, z, _ = values
        self._filler.fill_field(publisher.msg, (x * scale, y * scale, z * scale))
        publisher.publish(stamp_ns)

    def _orientation(
        self, parts: Mapping[int, tuple[int, int, int, int]],
    ) -> tuple[float, float, float, float] | None:
        """Return x, y, z, w; None if the device sent no orientation."""
        raw = parts.get(wire.QUATERNION)
        if raw is not None:
            length = math.hypot(*raw)
            if length > _SHORTEST_QUATERNION:
                first, second, third, fourth = (v / length for v in raw)
                if self._quaternion_first:
                    return second, third, fourth, first
                return first, second, third, fourth
        angles = parts.get(wire.ANGLE)
        return None if angles is None else quaternion_from_angles(
            *(v * ANGLE_SCALE for v in angles[:3]))

    def _setup(self) -> list[bytes]:
        rate = RATES_HZ[self.settings['output_rate_hz']]
        return [UNLOCK, command(REGISTER_OUTPUTS, output_mask(_OUTPUTS)),
                command(REGISTER_RATE, rate)]

    def _check_speed(self) -> None:
        settings = self.settings
        rate_hz: float = settings['output_rate_hz']
        needed = len(_OUTPUTS) * wire.FRAME_SIZE * BITS_PER_BYTE * rate_hz
        if settings['configure'] and 0 < settings['baud'] < needed:
            raise ConfigError([
                f'{self.name}: output_rate_hz {rate_hz:g} needs {needed:.0f} baud and the line '
                f'has {settings["baud"]}: lower output_rate_hz or raise baud'])


def quaternion_from_angles(
    roll: float, pitch: float, yaw: float,
) -> tuple[float, float, float, float]:
    """
    Convert angles in rad, in the order yaw, pitch, roll.

    :return: x, y, z, w.
    """
    sr, cr = math.sin(roll / 2), math.cos(roll / 2)
    sp, cp = math.sin(pitch / 2), math.cos(pitch / 2)
    sy, cy = math.sin(yaw / 2), math.cos(yaw / 2)
    return (sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy)


def _scaled(
    raw: tuple[int, int, int, int] | None, scale: float,
) -> tuple[float, float, float] | None:
    return None if raw is None else (raw[0] * scale, raw[1] * scale, raw[2] * scale)
