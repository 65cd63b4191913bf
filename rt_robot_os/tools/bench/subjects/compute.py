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

"""The disturbance: plain Python that computes, as a planner or a logger does."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from itertools import repeat
import time
from typing import Any

from rt_robot_os.linux.timer import Sleeper


def compute(duration_ns: int) -> None:
    """Compute in plain Python for a duration of wall-clock time."""
    now_ns = time.monotonic_ns
    end_ns = now_ns() + duration_ns
    value = 1
    while now_ns() < end_ns:
        for i in range(20):
            value = (value * 31 + i) & 0xFFFF


def native_call(duration_ns: int) -> Callable[[], object]:
    """
    Make a single native call of about this length, inside which no bytecode ends.

    :return: what makes it.
    """
    count = 1 << 16
    lengths_ns = []
    for _ in range(9):
        begin_ns = time.monotonic_ns()
        sum(repeat(1, count))
        lengths_ns.append(time.monotonic_ns() - begin_ns)
    count = max(1, duration_ns * count // max(1, min(lengths_ns)))
    return lambda: sum(repeat(1, count))


def load(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """
    Be a process that computes, forever; for :class:`rt_robot_os.tools.bench.helper.Helper`.

    :param arguments: ``busy_ns`` of every ``period_ns``; 0 for always.
    """
    busy_ns, period_ns = arguments['busy_ns'], arguments['period_ns']
    sleeper = Sleeper()
    ready()
    next_ns = time.monotonic_ns()
    while True:
        if not busy_ns:
            compute(period_ns)
            continue
        compute(busy_ns)
        next_ns += period_ns
        sleeper.sleep_until_ns(next_ns)
