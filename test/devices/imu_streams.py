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

"""Streams of WitMotion frames for tests, and what becomes of them."""

from __future__ import annotations

import csv
import math
from typing import Any

from driver_fakes import data_file
import numpy as np
from rt_robot_os.devices.witmotion import wire

GRAVITY = 9.80665
ACC, GYRO, ANGLE, MAG, QUAT = 0x51, 0x52, 0x53, 0x54, 0x59
MAG_SCALE_T = 1.5e-7
# Half of a count.
ACC_HALF = 8 / 32768 * GRAVITY
GYRO_HALF = math.radians(1000) / 32768


def instant(number: int, kinds: tuple[int, ...] = (ACC, GYRO, ANGLE, MAG, QUAT)) -> list[bytes]:
    """Make the frames of one instant, with its number in every one of them."""
    return [wire.frame(k, number, 2 * number, 3 * number, 20000) for k in kinds]


def vectors(publisher: Any, name: str) -> Any:
    """Give the named vector of each sample, one a row."""
    return np.array([tuple(vars(getattr(s, name)).values()) for s in publisher.samples])


def numbers(publisher: Any) -> list[int]:
    """Read the numbers back from the Imu samples, checking that the parts agree."""
    found = []
    for sample in publisher.samples:
        of_sample = set()
        if sample.linear_acceleration_covariance[0] >= 0:
            of_sample.add(round(sample.linear_acceleration.x / (2 * ACC_HALF)))
        if sample.angular_velocity_covariance[0] >= 0:
            of_sample.add(round(sample.angular_velocity.x / (2 * GYRO_HALF)))
        if sample.orientation_covariance[0] >= 0 and sample.orientation.w:
            q = sample.orientation
            of_sample.add(_number_of(q))
        assert len(of_sample) == 1, of_sample
        found.append(of_sample.pop())
    return found


def _number_of(q: Any) -> int:
    # The quaternion of instant n has w : z = n : 20000; that of its angles, roll n half counts.
    if abs(q.z) > 0.5:
        return round(q.w / q.z * 20000)
    roll = math.atan2(2 * (q.w * q.x + q.y * q.z), 1 - 2 * (q.x * q.x + q.y * q.y))
    return round(roll / math.pi * 32768)


def recorded_motion() -> list[tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]]:
    """Give rad/s, m/s^2 and tesla of each row."""
    with open(data_file('imu/xio_sensor_data.csv'), encoding='ascii', newline='') as file:
        rows = [[float(v) for v in row] for row in list(csv.reader(file))[1:]]
    return [(tuple(math.radians(v) for v in row[1:4]), tuple(v * GRAVITY for v in row[4:7]),
             tuple(v * 1e-6 for v in row[7:10])) for row in rows]


def row_frames(row: Any) -> list[bytes]:
    gyro, acceleration, magnetic = row
    return [wire.acceleration_frame(*acceleration), wire.angular_velocity_frame(*gyro),
            wire.magnetic_field_frame(*magnetic, MAG_SCALE_T)]
