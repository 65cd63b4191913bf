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


"""Fakes and helpers for the tests of drivers and simulated devices."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.devices.device import Device
from rt_robot_os.testing.fakes import opened
from rt_robot_os.testing.fakes import read_all  # noqa: F401
from rt_robot_os.testing.fakes import read_until  # noqa: F401
from rt_robot_os.testing.fakes import scripted_settings
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.fakes import wait_for_device_error  # noqa: F401
from rt_robot_os.testing.fakes import wait_readable  # noqa: F401

DATA = Path(os.environ.get('RT_ROBOT_OS_DATA',
                           Path(__file__).parents[3] / 'shared' / 'data'))

_VECTOR = ('x', 'y', 'z')
_FIELDS: dict[str, dict[str, Any]] = {
    'sensor_msgs/msg/Imu': {
        'orientation': (*_VECTOR, 'w'), 'orientation_covariance': 9,
        'angular_velocity': _VECTOR, 'angular_velocity_covariance': 9,
        'linear_acceleration': _VECTOR, 'linear_acceleration_covariance': 9,
    },
    'sensor_msgs/msg/MagneticField': {'magnetic_field': _VECTOR, 'magnetic_field_covariance': 9},
    'sensor_msgs/msg/LaserScan': dict.fromkeys((
        'angle_min', 'angle_max', 'angle_increment', 'time_increment', 'scan_time', 'range_min',
        'range_max')),
    'sensor_msgs/msg/Range': dict.fromkeys((
        'radiation_type', 'field_of_view', 'min_range', 'max_range', 'range', 'variance')),
    'sensor_msgs/msg/NavSatFix': {
        'status': ('status', 'service'), 'latitude': None, 'longitude': None, 'altitude': None,
        'position_covariance': 9, 'position_covariance_type': None,
    },
    'sensor_msgs/msg/FluidPressure': {'fluid_pressure': None, 'variance': None},
    'sensor_msgs/msg/Temperature': {'temperature': None, 'variance': None},
    'geometry_msgs/msg/PoseWithCovarianceStamped': {'pose': {
        'pose': {'position': _VECTOR, 'orientation': (*_VECTOR, 'w')}, 'covariance': 36}},
    'sensor_msgs/msg/TimeReference': {'time_ref': ('sec', 'nanosec')},
    'geometry_msgs/msg/TwistWithCovarianceStamped': {
        'twist': {'twist': {'linear': _VECTOR, 'angular': _VECTOR}, 'covariance': 36}},
}


class FakeMessage:
    """A message view: known names only, nested numbers at once, arrays in place."""

    def __init__(self, fields: dict[str, Any]) -> None:
        values: dict[str, Any] = {}
        for name, shape in fields.items():
            if isinstance(shape, tuple | dict):
                values[name] = FakeMessage(
                    shape if isinstance(shape, dict) else dict.fromkeys(shape))
            else:
                values[name] = None if shape is None else np.full(shape, np.nan)
        self.__dict__.update(values)

    def __setattr__(self, name: str, value: Any) -> None:
        present = self.__dict__[name]  # a KeyError here is a name that ROS does not have
        if isinstance(present, FakeMessage):
            names = tuple(present.__dict__)
            assert len(names) == len(value)
            for part, number in zip(names, value):
                setattr(present, part, number)
            return
        assert not isinstance(present, np.ndarray), f'{name} is a view: assign to {name}[:]'
        self.__dict__[name] = value

    def spoil(self) -> None:
        """Forget everything, as the next slot of a ring does."""
        for name, value in self.__dict__.items():
            if isinstance(value, FakeMessage):
                value.spoil()
            elif isinstance(value, np.ndarray):
                value[:] = np.nan
            else:
                self.__dict__[name] = None

    def snapshot(self) -> FakeMessage:
        """Give a copy; every field has to be filled in."""
        copy = FakeMessage.__new__(FakeMessage)
        for name, value in self.__dict__.items():
            if isinstance(value, FakeMessage):
                value = value.snapshot()
            elif isinstance(value, np.ndarray):
                value = value.copy()
            assert value is not None, f'{name} was not filled in'
            copy.__dict__[name] = value
        return copy

    def values(self) -> tuple[Any, ...]:
        """Give everything, for comparison; NaN becomes text so that it equals itself."""
        found: list[Any] = []
        for value in self.__dict__.values():
            if isinstance(value, FakeMessage):
                found.append(value.values())
            elif isinstance(value, np.ndarray):
                found.append(tuple(value.tolist()))
            else:
                found.append('nan' if value != value else value)
        return tuple(found)


class FakePublisher:
    """Keeps what was published; its message is spoilt after each sample."""

    def __init__(self, publication: TopicSpec) -> None:
        self.publication = publication
        lengths = {name: size for name, size in publication.fixed.items()
                   if isinstance(size, int)}
        self.msg: Any = FakeMessage({**_FIELDS[publication.message], **lengths})
        self.stamps: list[int] = []
        self.samples: list[Any] = []

    def publish(self, stamp_ns: int) -> None:
        self.stamps.append(stamp_ns)
        self.samples.append(self.msg.snapshot())
        self.msg.spoil()

    @property
    def values(self) -> list[tuple[Any, ...]]:
        """Give all samples, for comparison."""
        return [sample.values() for sample in self.samples]


def bind(device: Device) -> list[FakePublisher]:
    """Give the device fake publishers."""
    publishers = [FakePublisher(p) for p in device.publications()]
    device.bind(publishers)
    return publishers


@contextmanager
def scripted(
    driver: type[Device], chunks: list[bytes], **changes: Any,
) -> Iterator[tuple[Device, list[FakePublisher]]]:
    """Open a device whose port gives these chunks, one a read."""
    device = driver('dut', settings_of(driver, **scripted_settings(changes)))
    publishers = bind(device)
    with opened(device, chunks):
        yield device, publishers


def data_file(name: str) -> Path:
    """Give a recording, or skip the test."""
    path = DATA / name
    if not path.exists():
        pytest.skip(f'no recording {path}: set RT_ROBOT_OS_DATA')
    return path


def data_lines(name: str) -> list[bytes]:
    """Give the lines of a recording without its notes, ends included."""
    lines = data_file(name).read_bytes().splitlines(keepends=True)
    return [line for line in lines if not line.startswith(b'#')]
