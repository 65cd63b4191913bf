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

"""What is known of a robot's tasks: what the user stated, and what was found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field

from rt_robot_os.tools.plan.task import Overhead
from rt_robot_os.tools.plan.task import PlannedTask
from rt_robot_os.tools.plan.typical import Typical

# What `bench micro` showed on a two-core virtual machine (x86-64, 2026) for a job that does
# nothing: released together with others, and with a wake-up and a timer of its own.
JOB_OVERHEAD_NS = 3_000
TICK_OVERHEAD_NS = 25_000
MARGIN = 1.2


@dataclass(frozen=True, slots=True)
class Given:
    """
    What the user states on the command line.

    :ivar margin: what measured times are multiplied with.
    :ivar execution_ns: by task; before everything else.
    :ivar native_ns: longest native call, by task; instead of what was measured.
    :ivar held_ns: longest time that a resource is held, by resource; as well.
    :ivar rates_hz: of what releases a task from outside, by task.
    :ivar job_ns: the kernel's overhead; None for the default.
    :ivar tick_ns: as well; None for what was measured, else the default.
    :ivar jitter_ns: how late timers are; None for what was measured, else 0.
    :ivar typical: for tasks of which nothing else is known, when nothing was measured.
    """

    margin: float = MARGIN
    execution_ns: Mapping[str, int] = field(default_factory=dict)
    native_ns: Mapping[str, int] = field(default_factory=dict)
    held_ns: Mapping[str, int] = field(default_factory=dict)
    rates_hz: Mapping[str, float] = field(default_factory=dict)
    job_ns: int | None = None
    tick_ns: int | None = None
    jitter_ns: int | None = None
    typical: Typical | None = None


@dataclass(frozen=True, slots=True)
class RobotTasks:
    """
    The tasks of a robot.

    :ivar origins: where each execution time comes from: ``option``, ``declared``, ``measured``,
        ``budget``, ``typical`` or ``unknown``.
    :ivar owners: ``device``, ``module`` or ``core``, by task.
    :ivar responses_ns: the longest that were measured, by task; empty when other priorities or
        periods were active then.
    :ivar notes: what the reader should know of these numbers.
    """

    tasks: tuple[PlannedTask, ...]
    overhead: Overhead
    origins: Mapping[str, str]
    owners: Mapping[str, str]
    notes: tuple[str, ...]
    responses_ns: Mapping[str, int] = field(default_factory=dict)

    def fixed_phases(self) -> tuple[str, ...]:
        """Return the tasks whose phase no configuration can change."""
        return tuple(name for name, owner in self.owners.items() if owner == 'core')
