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

"""Periodic modules as timers of one rclpy node."""

# mypy: allow-untyped-calls

from __future__ import annotations

from array import array
from collections.abc import Callable
import time
from typing import Any

from benchmarks.delay.subjects import MESSAGE
from benchmarks.frequency.subjects import collect
from benchmarks.frequency.subjects import make_modules
from benchmarks.frequency.subjects import TOPIC_BYTES
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.rclpy_graph import graph
from rt_robot_os.tools.bench.subjects.rclpy_graph import RclpyGraph
from rt_robot_os.topics.resolve import message_class

_DEPTH = 10


def executor(harness: Harness) -> Measurement:
    """
    Run the modules, see :func:`benchmarks.frequency.subjects.kernel`.

    With ``receive`` one subscription serves all modules, which is kind to rclpy.
    """
    a = harness.arguments
    modules = make_modules(a)
    harness.prepare()
    total_ns = a['warmup_ns'] + a['measure_ns']
    with graph(a['executor']) as tested:
        jobs = [module.work for module in modules]
        if a['receive']:
            jobs = _receiving(tested, jobs, a)
        for (rate, _), job in zip(a['modules'], jobs):
            tested.timer(round(NS_PER_S / rate), job)
        begin_ns, cpu_ns = time.monotonic_ns(), time.process_time_ns()
        tested.spin(total_ns)
        used_ns, duration_ns = time.process_time_ns() - cpu_ns, time.monotonic_ns() - begin_ns
    return collect(modules, begin_ns, a, used_ns, duration_ns)


def _receiving(tested: RclpyGraph, jobs: list[Callable[[], None]], a: Any
               ) -> list[Callable[[], None]]:
    kind = message_class(MESSAGE)
    message = kind(data=array('B', bytes(TOPIC_BYTES)))
    latest = [message]

    def note(received: Any) -> None:
        latest[0] = received

    def receiving(job: Callable[[], None]) -> Callable[[], None]:
        def both() -> Any:
            job()
            return latest[0].data

        return both

    publisher = tested.node.create_publisher(kind, 'test', _DEPTH)
    tested.node.create_subscription(kind, 'test', note, _DEPTH)
    tested.timer(round(NS_PER_S / a['modules'][0][0]), lambda: publisher.publish(message))
    return [receiving(job) for job in jobs]
