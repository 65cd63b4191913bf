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
InvenSense MPU-6050 inertial measurement unit on I2C, and its relatives MPU-6500 and MPU-9250.

The chip samples with its own clock into its FIFO, which is emptied with each poll, so late polls
neither lose nor double samples. The data have no checksum, so the driver checks the count of the
FIFO, the temperature in each frame, and once a second the chip id and the power register. A FIFO
that overflowed or lost alignment is emptied, and the loss counted.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2
from rt_robot_os.devices.calibration import axes_setting
from rt_robot_os.devices.calibration import from_settings
from rt_robot_os.devices.calibration import vector_settings
from rt_robot_os.devices.i2c.device import i2c_settings
from rt_robot_os.devices.i2c.device import I2cDevice
from rt_robot_os.devices.i2c.device import Transactions
from rt_robot_os.devices.mpu6050 import wire as chip

# The longest burst: 112 bytes take 2.6 ms at 400 kHz, during which the bus is busy.
_MAX_FRAMES: Final = 8
_CHECK_NS: Final = NS_PER_S
_COLDEST_C, _HOTTEST_C = -40.0, 105.0
# The data sheet specifies 1 degree.
_TEMPERATURE_VARIANCE: Final = 1.0


class Mpu6050(I2cDevice):
    """An MPU-6050, MPU-6500 or MPU-9250 (without its magnetometer)."""

    SETTINGS = (
        *i2c_settings(address=0x68, addresses=(0x68, 0x69), frame_id='imu_link',
                      topic='imu/data', rate_hz=100.0, maximum_hz=1000.0),
        Field('temperature_topic', str, 'imu/temperature', "Topic of the chip's temperature; "
              'empty publishes none.'),
        Field('gyro_range_deg_s', int, 500, 'Fastest rotation that it can measure.',
              unit='deg/s', choices=tuple(chip.GYRO_RANGES_DEG_S)),
        Field('accel_range_g', int, 4, 'Largest acceleration that it can measure.', unit='g',
              choices=tuple(chip.ACCEL_RANGES_G)),
        Field('bandwidth_hz', int, 42, 'Bandwidth of the low-pass filter in the chip: at most '
              'half of the rate of the samples.', unit='Hz', choices=tuple(chip.BANDWIDTHS_HZ)),
        Field('acceleration_stddev', float, 0.05, 'Standard deviation of each axis of the '
              'acceleration. The chip reports none: measure yours.', unit='m/s^2', minimum=0.0),
        Field('angular_velocity_stddev', float, 0.002, 'Standard deviation of each axis of the '
              'angular velocity. The chip reports none: measure yours.', unit='rad/s',
              minimum=0.0),
        axes_setting(),
        *vector_settings('acceleration', 'm/s^2'),
        *vector_settings('angular_velocity', 'rad/s'),
    )
    description = 'MPU-6050, MPU-6500 and MPU-9250 IMUs (I2C): acceleration, rate, temperature'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: the chip does not support this rate, or the calibration is invalid.
        """
        super().__init__(name, settings)
        self.divider = _divider(name, settings['output_rate_hz'])
        accel_range, gyro_range = settings['accel_range_g'], settings['gyro_range_deg_s']
        self._registers = (
            (chip.CONFIG, chip.BANDWIDTHS_HZ[settings['bandwidth_hz']]),
            (chip.RATE_DIVIDER, self.divider),
            (chip.GYRO_CONFIG, chip.GYRO_RANGES_DEG_S[gyro_range] << 3),
            (chip.ACCEL_CONFIG, chip.ACCEL_RANGES_G[accel_range] << 3),
        )
        self._accel = from_settings(name, settings, 'acceleration').folded(
            accel_range * STANDARD_GRAVITY_M_S2 / chip.FULL_SCALE)
        axes, factors, summands = from_settings(name, settings, 'angular_velocity').folded(
            math.radians(gyro_range) / chip.FULL_SCALE)
        # In a frame the angular velocity follows acceleration and temperature.
        self._gyro = ((axes[0] + 4, axes[1] + 4, axes[2] + 4), factors, summands)
        self._linear = _diagonal(settings['acceleration_stddev'])
        self._angular = _diagonal(settings['angular_velocity_stddev'])
        self._no_orientation = _diagonal(0.0)
        self._no_orientation[0] = -1.0
        self._with_temperature = bool(settings['temperature_topic'])
        self.model = chip.MODELS[0x68]
        self._id = 0
        self._stamp_ns = 0
        self._check_ns = 0

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications: Imu, and Temperature unless its topic is empty."""
        s = self.settings
        frame = {'header.frame_id': s['frame_id']}
        kinds = [(s['topic'], 'sensor_msgs/msg/Imu')]
        if s['temperature_topic']:
            kinds.append((s['temperature_topic'], 'sensor_msgs/msg/Temperature'))
        return tuple(TopicSpec(topic, message, frame, s['depth'], s['output_rate_hz'])
                     for topic, message in kinds)

    def identify(self) -> Transactions[None]:
        """
        Check the chip id, and reset the chip.

        :raises DeviceError: it is another chip, or the bus failed.
        """
        self._id = yield from self.expect_chip(
            chip.WHO_AM_I, tuple(chip.MODELS), 'an MPU-6050, MPU-6500 or MPU-9250')
        self.model = chip.MODELS[self._id]
        yield self.put(chip.POWER, chip.POWER_RESET)

    def begin(self, now_ns: int) -> int:
        """Wait until the chip is up."""
        return self.then(self._wake, now_ns + chip.RESET_NS)

    def _wake(self, now_ns: int) -> Transactions[int]:
        """Wake the chip from the sleep that follows a reset."""
        yield self.put(chip.POWER, chip.POWER_ON)
        return self.then(self._set_up, now_ns + chip.WAKE_NS)

    def _set_up(self, now_ns: int) -> Transactions[int]:
        """Write the settings and start the FIFO."""
        for register, value in self._registers:
            yield self.put(register, value)
        if self.model.accel_filter:
            yield self.put(chip.ACCEL_CONFIG_2, self._registers[0][1])
        yield self.put(chip.FIFO_ENABLE, chip.FIFO_ALL)
        self._check_ns = now_ns + _CHECK_NS
        return (yield from self._restart_fifo(now_ns))

    def _restart_fifo(self, now_ns: int) -> Transactions[int]:
        # The FIFO can be emptied only while it is off.
        yield self.put(chip.USER_CONTROL, chip.USER_FIFO_RESET)
        yield self.put(chip.USER_CONTROL, chip.USER_FIFO)
        self._stamp_ns = now_ns
        return self.then(self._drain, now_ns)

    def _drain(self, now_ns: int) -> Transactions[int]:
        """Fetch what the FIFO holds."""
        if now_ns >= self._check_ns:
            yield from self._check_chip(now_ns)
        count = int.from_bytes((yield self.fetch(chip.FIFO_COUNT, 2)), 'big')
        now_ns = self.clock_ns()  # the bus may have been busy for a while
        if count > self.model.fifo_size:
            return self.reject(f'its FIFO cannot hold the {count} bytes that it reports')
        if count > self.model.fifo_size - chip.FRAME_SIZE:
            # It overflowed: a frame in it is cut, and older than the lost ones.
            self._lost_samples += max(1, (now_ns - self._stamp_ns) // self.period_ns)
            return (yield from self._restart_fifo(now_ns))
        there = count // chip.FRAME_SIZE
        if not there:
            return 0
        taken = min(there, _MAX_FRAMES)
        data = yield self.fetch(chip.FIFO, taken * chip.FRAME_SIZE)
        self._bytes_read += len(data)
        samples = 0
        oldest_ns = now_ns - there * self.period_ns
        for frame in chip.frames(data):
            # Sampled between these two times; on the grid of the previous sample, if possible.
            stamp_ns = min(max(self._stamp_ns + self.period_ns, oldest_ns),
                           oldest_ns + self.period_ns)
            oldest_ns += self.period_ns
            if not self._use(frame, max(stamp_ns, self._stamp_ns)):
                self._lost_samples += there
                yield from self._restart_fifo(now_ns)
                self.reject('its FIFO contains impossible measurements')
                return samples
            samples += len(self._publishers)
        return samples

    def _use(self, frame: chip.Frame, stamp_ns: int) -> bool:
        """Publish a frame, unless its temperature is impossible."""
        model = self.model
        temperature_c = frame[3] / model.temperature_scale + model.temperature_zero_c
        if not _COLDEST_C <= temperature_c <= _HOTTEST_C:
            return False
        self._stamp_ns = stamp_ns
        self.accept(stamp_ns)
        publisher = self._publishers[0]
        msg = publisher.msg
        (a, b, c), (i, j, k), (p, q, r) = self._accel
        msg.linear_acceleration = (frame[a] * i + p, frame[b] * j + q, frame[c] * k + r)
        (a, b, c), (i, j, k), (p, q, r) = self._gyro
        msg.angular_velocity = (frame[a] * i + p, frame[b] * j + q, frame[c] * k + r)
        msg.orientation = (0.0, 0.0, 0.0, 1.0)
        msg.orientation_covariance[:] = self._no_orientation
        msg.angular_velocity_covariance[:] = self._angular
        msg.linear_acceleration_covariance[:] = self._linear
        publisher.publish(stamp_ns)
        if self._with_temperature:
            publisher = self._publishers[1]
            msg = publisher.msg
            msg.temperature = temperature_c
            msg.variance = _TEMPERATURE_VARIANCE
            publisher.publish(stamp_ns)
        return True

    def _check_chip(self, now_ns: int) -> Transactions[None]:
        """
        Check whether it is still the chip that was set up.

        :raises DeviceError: it is not.
        """
        self._check_ns = now_ns + _CHECK_NS
        found = (yield self.fetch(chip.WHO_AM_I, 1))[0]
        power = (yield self.fetch(chip.POWER, 1))[0]
        if found != self._id:
            raise DeviceError(f'{self.name}: {self.place}: the chip id was 0x{self._id:02x} and '
                              f'is 0x{found:02x} now: {self.IF_GARBAGE}')
        if power != chip.POWER_ON:
            raise DeviceError(f'{self.name}: {self.place}: it has lost its settings: did it lose '
                              'power? Check its supply; it will be set up again')


def _divider(name: str, rate_hz: float) -> int:
    """
    Return the divider of the base rate.

    :raises ConfigError: no divider gives this rate.
    """
    divider = round(chip.BASE_RATE_HZ / rate_hz) - 1
    nearest = chip.BASE_RATE_HZ / (min(max(divider, 0), chip.DIVIDER_MAXIMUM) + 1)
    if abs(nearest - rate_hz) > 0.01 * rate_hz:
        raise ConfigError([f'{name}: output_rate_hz {rate_hz:g} is not 1000 Hz divided by 1 to '
                           f'256: use {nearest:.6g}'])
    return divider


def _diagonal(stddev: float) -> npt.NDArray[np.float64]:
    """Return the nine numbers of a covariance with equal axes."""
    return np.diag((stddev * stddev,) * 3).reshape(9)
