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

"""What one operation costs, and what a job costs the kernel."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import time
from typing import Any

import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.kernel import Kernel
from rt_robot_os.tools.bench.case import Samples

IMU = 'sensor_msgs/msg/Imu'
IMU_SHAPE = {'header.frame_id': 'imu_link'}
TEN_FIELDS = ('orientation', 'angular_velocity', 'linear_acceleration')
_CALLS = 500
_STRETCH_NS = 200 * NS_PER_MS


def block_means_ps(operation: Callable[[], object], duration_ns: int) -> Samples:
    """
    Repeat an operation and take the mean of each block of calls, the empty loop taken off.

    :return: picoseconds a call.
    """
    now_ns = time.perf_counter_ns
    turns = range(_CALLS)
    means: list[int] = []
    end_ns = now_ns() + duration_ns
    begin_ns = 0
    while begin_ns < end_ns or len(means) < 3:
        begin_ns = now_ns()
        for _ in turns:
            operation()
        middle_ns = now_ns()
        for _ in turns:
            pass
        means.append((2 * middle_ns - begin_ns - now_ns()) * 1000 // _CALLS)
    return np.array(means, np.int64)


def job_costs_ns(a: Mapping[str, Any], tasks: int) -> Samples:
    tested = Kernel()
    for i in range(tasks):
        tested.add_task(f'task{i}', _nothing, priority=10 + i % 80, rate_hz=a['rate_hz'])
    tested.run(a['warmup_ns'])
    costs = []
    for _ in range(max(1, a['measure_ns'] // _STRETCH_NS)):
        runs = sum(task.runs for task in tested.tasks)
        begin_ns = time.process_time_ns()
        tested.run(_STRETCH_NS)
        used_ns = time.process_time_ns() - begin_ns
        costs.append(used_ns // (sum(task.runs for task in tested.tasks) - runs))
    return np.array(costs, np.int64)


def _nothing() -> None:
    """Do nothing: what is measured is the kernel."""
