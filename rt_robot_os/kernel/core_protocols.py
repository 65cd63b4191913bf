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

"""The interfaces that the core of the kernel calls in exceptional cases."""

from __future__ import annotations

from typing import Any
from typing import Protocol

from rt_robot_os.kernel.failure import FailureReport
from rt_robot_os.kernel.task_core import LimitHandler


class Faults(LimitHandler, Protocol):
    """Called in exceptional cases: an interrupt was late, or a job failed. See FaultHandling."""

    def charge_blocking(self, task: Any, level: int, at_ns: int, late_ns: int) -> int:
        """Charge a late interrupt to the job that ran; return its steal time."""

    def attribute_gap(self, task: Any, now_ns: int, gap_ns: int) -> int:
        """Attribute time in which a job did not compute; return the steal time in it."""

    def after_job(self, task: Any, failure: FailureReport | None, outcome: int,
                  now_ns: int) -> None:
        """Apply the policies after a job that needs more than the counters."""


class StealAccount(Protocol):
    """The account of steal time; see :mod:`rt_robot_os.kernel.steal_time`."""

    def refresh(self, now_ns: int) -> None:
        """Read the clocks from which steal time is computed."""

    def attribute(self, now_ns: int, window_ns: int) -> int:
        """Return and count the steal time in a window that ends now."""
