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

"""The real-time properties of the core's process: CPU, locked memory, priority, CPU latency."""

from __future__ import annotations

from rt_robot_os.core.process_guard import ProcessGuard
from rt_robot_os.core.watchdog import Watchdog
from rt_robot_os.linux import realtime
from rt_robot_os.linux.realtime import CpuLatencyRequest
from rt_robot_os.linux.realtime import request_cpu_latency
from rt_robot_os.linux.realtime import RtResult
from rt_robot_os.settings import CoreSettings

UNPINNED = -2


class RealtimeProcess:
    """
    Request real-time properties from Linux.

    :param cpu: to be pinned to; ``UNPINNED`` for none.
    :ivar results: the result of each request.
    """

    def __init__(self, settings: CoreSettings, cpu: int) -> None:
        self.results: tuple[RtResult, ...] = ()
        self._settings = settings
        self._cpu = cpu
        self._cpu_latency: CpuLatencyRequest | None = None

    def prepare(self, guard: ProcessGuard, watchdog: Watchdog | None) -> tuple[RtResult, ...]:
        """Request everything; refused requests are among the results."""
        wanted = self._settings
        results = [realtime.set_timer_slack()]
        if self._cpu != UNPINNED:
            results.append(realtime.set_affinity(self._cpu))
        if wanted.lock_memory:
            results.append(realtime.lock_memory())
        if wanted.cpu_latency_us >= 0:
            result, self._cpu_latency = request_cpu_latency(wanted.cpu_latency_us)
            results.append(result)
        results += guard.equip(watchdog)
        results.append(realtime.freeze_garbage())
        # Last, so that the slow steps before do not delay other programs at this priority.
        if wanted.scheduler_priority:
            results.append(realtime.set_fifo(wanted.scheduler_priority, alone=True))
        self.results = tuple(results)
        return self.results

    def close(self) -> None:
        """Release the CPU latency request; may be called twice."""
        if self._cpu_latency is not None:
            self._cpu_latency.close()
