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

"""The requests to the kernel: re-arm tasks, reset statistics, stop the core."""

from __future__ import annotations

from collections.abc import Callable
import os
from typing import Any

from rt_robot_os.base.reports import Severity
from rt_robot_os.core.part import Host
from rt_robot_os.core.part import Note
from rt_robot_os.core.tasks import held
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import TaskState
from rt_robot_os.link.requests import Arguments
from rt_robot_os.link.requests import reason_argument
from rt_robot_os.link.requests import string_argument
from rt_robot_os.link.session import ClientSession


class KernelRequests:
    """
    Answer the requests to the kernel.

    :param stop: stops the core, with a reason.
    """

    def __init__(self, kernel: Kernel, stop: Callable[[str], object], note: Note) -> None:
        self._kernel = kernel
        self._stop = stop
        self._note = note

    def attach(self, host: Host) -> None:
        """Register the requests, and add the kernel's counters."""
        host.requests.add('rearm', self._rearm)
        host.requests.add('reset_statistics', self._reset_statistics)
        host.requests.add('stop', self._end)
        host.watch.add(self._kernel.guard_handlers)
        host.statistics.add_facts(self._facts)

    def _facts(self) -> dict[str, Any]:
        """Return the kernel's counters that belong to no task."""
        kernel, now_ns = self._kernel, self._kernel.now_ns()
        return {'pid': os.getpid(), 'now_ns': now_ns, 'elapsed_ns': now_ns - kernel.start_ns,
                'wakeups': kernel.wakeups, 'overhead_ns': kernel.overhead_ns,
                'looked_ns': kernel.polled_ns, 'alarm_ns': kernel.clock.wake_ns,
                'failures_total': kernel.failures_total, 'stolen': kernel.steal_time.events,
                'stolen_total_ns': kernel.steal_time.total_ns,
                'stolen_maximum_ns': kernel.steal_time.times.maximum_ns}

    def _rearm(self, session: ClientSession, arguments: Arguments) -> Arguments:
        """Re-arm a task that is held, or all of them."""
        kernel = self._kernel
        name = arguments.get('task', '')
        tasks = [kernel.task(string_argument(arguments, 'task'))] if name else held(kernel)
        names = [task.name for task in tasks if task.state is not TaskState.ACTIVE]
        for task in tasks:
            kernel.rearm(task)
        if names:
            self._note(Severity.INFO, 'core', f'{session.name} re-armed {", ".join(names)}')
        return {'tasks': names}

    def _reset_statistics(self, session: ClientSession, arguments: Arguments) -> Arguments:
        for task in self._kernel.tasks:
            task.reset_statistics()
        self._kernel.steal_time.reset()
        return {}

    def _end(self, session: ClientSession, arguments: Arguments) -> Arguments:
        self._stop(reason_argument(session, arguments))
        return {}
