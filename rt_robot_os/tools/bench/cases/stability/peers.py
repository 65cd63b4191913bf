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

"""Acquisition, attitude and a receiver as timers and subscriptions of one rclpy node."""

# mypy: allow-untyped-calls

from __future__ import annotations

from pathlib import Path
import time
from typing import Any

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.cases.stability.motion import Filter
from rt_robot_os.tools.bench.cases.stability.motion import ImuModel
from rt_robot_os.tools.bench.cases.stability.subjects import ACQUIRE_HZ
from rt_robot_os.tools.bench.cases.stability.subjects import ATTITUDE
from rt_robot_os.tools.bench.cases.stability.subjects import ATTITUDE_HZ
from rt_robot_os.tools.bench.cases.stability.subjects import Notes
from rt_robot_os.tools.bench.cases.stability.subjects import read_csv
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.operation_cost import IMU
from rt_robot_os.tools.bench.subjects.rclpy_graph import graph
from rt_robot_os.tools.bench.subjects.rclpy_graph import RclpyGraph
from rt_robot_os.topics.resolve import message_class

_DEPTH = 10


def executor(harness: Harness) -> Measurement:
    """Run the three modules; rclpy does not report missed releases."""
    a = harness.arguments
    if a['measure_ns'] <= 0:  # it was complete before the interruption
        return Measurement(read_csv(Path(a['csv'])))
    notes = Notes(a['csv'], a['measure_ns'] // a['row_ns'] + 2, a['from_s'])
    harness.prepare()
    with graph(a['executor']) as tested:
        _modules(tested, notes)
        tested.spin(a['warmup_ns'])
        notes.begin()
        tested.timer(a['row_ns'], lambda: notes.row(0))
        tested.spin(a['measure_ns'] + a['row_ns'] // 20)
    return notes.measured()


def _modules(tested: RclpyGraph, notes: Notes) -> None:
    sensor, solver = ImuModel(), Filter()
    imu_kind, attitude_kind = message_class(IMU), message_class(ATTITUDE)
    imu_message, attitude_message = imu_kind(), attitude_kind()
    imu = tested.node.create_publisher(imu_kind, 'imu', _DEPTH)
    attitude = tested.node.create_publisher(attitude_kind, 'attitude', _DEPTH)
    held: list[Any] = []
    turn = [0]

    def acquire() -> None:
        now_ns = notes.acquire.call()
        p, q, r, ax, ay, az = sensor.read(now_ns / NS_PER_S)
        v, f, stamp = (imu_message.angular_velocity, imu_message.linear_acceleration,
                       imu_message.header.stamp)
        v.x, v.y, v.z, f.x, f.y, f.z = p, q, r, ax, ay, az
        stamp.sec, stamp.nanosec = divmod(now_ns, NS_PER_S)
        imu.publish(imu_message)

    def solve() -> None:
        notes.attitude.call()
        for message in held:
            v, f, stamp = (message.angular_velocity, message.linear_acceleration,
                           message.header.stamp)
            solver.update(stamp.sec + stamp.nanosec / NS_PER_S, (v.x, v.y, v.z, f.x, f.y, f.z))
        held.clear()
        turn[0] ^= 1
        if turn[0]:
            attitude_message.x, attitude_message.y, attitude_message.z = (
                solver.roll, solver.pitch, solver.time)
            notes.sent_ns = time.monotonic_ns()
            attitude.publish(attitude_message)

    def receive(message: Any) -> None:
        notes.received(message.x, message.y, message.z)

    tested.node.create_subscription(imu_kind, 'imu', held.append, _DEPTH)
    tested.node.create_subscription(attitude_kind, 'attitude', receive, _DEPTH)
    tested.timer(NS_PER_S // ACQUIRE_HZ, acquire)
    tested.timer(NS_PER_S // ATTITUDE_HZ, solve)
