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

"""What a job of the module costs, beside one that only hands the sample on."""

from __future__ import annotations

from dataclasses import dataclass
import statistics
import time
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.features.navigation.attitude import Attitude
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.modules import Input
from rt_robot_os.modules import Module
from rt_robot_os.modules import Output
from rt_robot_os.topics import Bus

_IMU: Final = 'sensor_msgs/msg/Imu'
_FRAME: Final = {'header.frame_id': 'imu_link'}
_CALLS: Final = 500
_BLOCKS: Final = 20
_PERIOD_NS: Final = 10 * NS_PER_MS


class Copy(Module):
    """Take a sample and publish it again: the least that a module in the way of samples costs."""

    imu = Input('imu/data')
    copy = Output('copy', _IMU, _FRAME)

    def step(self) -> None:
        """Hand on what is new."""
        while self.imu.take():
            source, message = self.imu.msg, self.copy.msg
            message.orientation = source.orientation
            message.angular_velocity = source.angular_velocity
            message.linear_acceleration = source.linear_acceleration
            self.copy.publish(self.imu.stamp_ns)


@dataclass(frozen=True)
class Cost:
    """CPU time of a job in microseconds: median of the runs, and their range."""

    name: str
    median: float
    lowest: float
    highest: float


class _Rig:
    """A sensor and a module on a kernel that does not run."""

    def __init__(self, module: Module) -> None:
        kernel = Kernel(VirtualClock(start_ns=1))
        bus = Bus(kernel)
        bus.declare('imu/data', _IMU, _FRAME, rate_hz=100.0)
        bus.declare('imu/mag', 'sensor_msgs/msg/MagneticField', rate_hz=100.0)
        self._imu, self._mag = bus.publisher('imu/data'), bus.publisher('imu/mag')
        module.declare(bus, 400.0)
        module.bind(bus, kernel.add_task(module.name, module.job, priority=10, rate_hz=400.0))
        module.configure()
        self._job = module.job
        self._stamp_ns = _PERIOD_NS
        self._imu.msg.linear_acceleration = (0.5, 0.3, 9.8)
        self._mag.msg.magnetic_field = (1e-5, 2e-5, -4e-5)

    def block_us(self, new: bool) -> float:
        """Return the mean CPU time of 500 jobs, each with a new sample if so wanted."""
        job = self._job
        begin_ns = time.thread_time_ns()
        for number in range(_CALLS):
            if new:
                self._say(number)
            job()
        middle_ns = time.thread_time_ns()
        for number in range(_CALLS):
            if new:
                self._say(number)
        end_ns = time.thread_time_ns()
        # What was said in the second half is read, and not measured.
        job()
        return (2 * middle_ns - begin_ns - end_ns) / 1000 / _CALLS

    def _say(self, number: int) -> None:
        self._stamp_ns += _PERIOD_NS
        self._imu.msg.angular_velocity = (0.3, 0.001 * number, -0.2)
        self._mag.publish(self._stamp_ns)
        self._imu.publish(self._stamp_ns)


def costs(names: tuple[str, ...], runs: int) -> list[Cost]:
    """
    Measure jobs in turns, so that a slow moment of the machine hits all.

    :param names: of the filters.
    :param runs: each with 20 blocks of 500 jobs.
    """
    tested: dict[str, tuple[_Rig, bool]] = {'a module that copies': (_Rig(Copy('copy', {})), True)}
    for name in names:
        for axes in (9, 6):
            tested[f'{name}, {axes} axes'] = _Rig(_attitude(name, axes)), True
    tested[f'{names[0]}, nothing new'] = _Rig(_attitude(names[0], 9)), False
    medians: dict[str, list[float]] = {name: [] for name in tested}
    for _ in range(runs):
        blocks: dict[str, list[float]] = {name: [] for name in tested}
        for _ in range(_BLOCKS):
            for name, (rig, new) in tested.items():
                blocks[name].append(rig.block_us(new))
        for name, values in blocks.items():
            medians[name].append(statistics.median(values))
    return [Cost(name, statistics.median(values), min(values), max(values))
            for name, values in medians.items()]


def _attitude(name: str, axes: int) -> Module:
    defaults: dict[str, Any] = {field.name: field.default for field in Attitude.fields()}
    return Attitude('attitude', {**defaults, 'filter': name, 'axes': axes})
