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

"""What the lowest task of a core looks after, ten times a second."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
import os

from rt_robot_os.base.reports import Reports
from rt_robot_os.kernel import Kernel

POLLS_PER_S = 10


class WatchTask:
    """
    The task ``core/watch`` of the lowest priority: all other tasks preempt it.

    Functions are called in the order in which they were added; reports are written last, so that
    the reports of these functions are included.
    """

    def __init__(self, kernel: Kernel, reports: Reports) -> None:
        self._reports = reports
        self._calls: list[tuple[Callable[[], object], int]] = []
        self._polls = 0
        self._output: int | None = None
        self._written = 0
        kernel.add_task('core/watch', self.poll, priority=1, rate_hz=float(POLLS_PER_S))

    def add(self, call: Callable[[], object], every: int = 1) -> None:
        """
        Call a function at each poll, or at one of ``every`` polls.

        :param call: must not block; an exception counts as a failure of ``core/watch``.
        """
        self._calls.append((call, every))

    def poll(self) -> None:
        """Call the functions that are due; the function of the task."""
        self._polls += 1
        try:
            for call, every in self._calls:
                if self._polls % every == 0:
                    call()
        finally:
            self.write_reports()

    def write_reports_to(self, fd: int) -> None:
        """Write reports to a file descriptor; a terminal that blocks delays only this task."""
        self._output = fd

    def write_reports(self) -> None:
        """Write new reports, if an output was set."""
        if self._output is None:
            return
        self._written, dropped, reports = self._reports.since(self._written)
        lines = [f'{dropped} reports dropped'] * bool(dropped) + [str(r) for r in reports]
        if lines:
            with suppress(OSError):  # the reader has closed it
                os.write(self._output, ('\n'.join(lines) + '\n').encode())
