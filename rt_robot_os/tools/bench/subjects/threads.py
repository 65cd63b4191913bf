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

"""The peer that everybody knows: Python threads that sleep until their next deadline."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
import os
import threading
import time

from rt_robot_os.base.units import NS_PER_S

_LEAD_NS = NS_PER_S // 20


def set_priority(priority: int) -> None:
    try:
        os.sched_setscheduler(threading.get_native_id(), os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        pass  # the harness has said that it is refused


class Threads:
    """
    One thread a job, each on a time grid that begins at the same moment.

    :param jobs: (period in nanoseconds, priority of SCHED_FIFO or 0, what it does).
    :param over: asked after each job whether that was all.
    """

    def __init__(self, jobs: Sequence[tuple[int, int, Callable[[], object]]], total_ns: int,
                 over: Callable[[], bool] = bool) -> None:
        self._over = over
        self.begin_ns = time.monotonic_ns() + _LEAD_NS
        self._end_ns = self.begin_ns + total_ns
        self._threads = [threading.Thread(target=self._loop, args=job, daemon=True)
                         for job in jobs]

    def run(self) -> None:
        """Run them until the end of the time."""
        for thread in self._threads:
            thread.start()
        for thread in self._threads:
            thread.join()

    def _loop(self, period_ns: int, priority: int, job: Callable[[], object]) -> None:
        if priority:
            set_priority(priority)
        deadline_ns = self.begin_ns
        now_ns, sleep = time.monotonic_ns, time.sleep
        while deadline_ns < self._end_ns and not self._over():
            wait_ns = deadline_ns - now_ns()
            if wait_ns > 0:
                sleep(wait_ns / NS_PER_S)
            job()
            deadline_ns += period_ns
            late_ns = now_ns() - deadline_ns
            if late_ns > 0:  # skip what was missed, stay on the grid
                deadline_ns += (late_ns // period_ns + 1) * period_ns
