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

"""The same as the case network's queue with simpy, a library for discrete events."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random
from time import process_time_ns
from typing import Any

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement


def simpy_queue(harness: Harness) -> Measurement:
    """Run processes that wait again and again, which is how simpy is used."""
    import simpy

    environment = simpy.Environment()
    random = Random(1).random
    count = 0

    def node() -> Iterator[Any]:
        nonlocal count
        while True:
            yield environment.timeout(int(random() * NS_PER_S) + 1)
            count += 1

    for _ in range(harness.arguments['nodes']):
        environment.process(node())
    harness.prepare(freeze=True)
    step_ns = max(1, 20_000 * NS_PER_S // (2 * harness.arguments['nodes']))
    environment.run(until=step_ns)
    events, begun_ns = count, process_time_ns()
    while process_time_ns() - begun_ns < harness.arguments['measure_ns']:
        environment.run(until=environment.now + step_ns)
    spent_ns = process_time_ns() - begun_ns
    return Measurement({}, {'event_us': spent_ns / 1000 / (count - events)})
