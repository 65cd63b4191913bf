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

"""Everything that `plan` finds out about a robot, in one place, and its exit code."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rt_robot_os.tools.plan.analysis import analyse
from rt_robot_os.tools.plan.chains import ChainRequest
from rt_robot_os.tools.plan.chains import ChainResult
from rt_robot_os.tools.plan.chains import chains_of
from rt_robot_os.tools.plan.given import RobotTasks
from rt_robot_os.tools.plan.phases import hyper_period_ns
from rt_robot_os.tools.plan.phases import lowest_peak
from rt_robot_os.tools.plan.phases import PhasePlan
from rt_robot_os.tools.plan.remedy import remedy
from rt_robot_os.tools.plan.result import Analysis
from rt_robot_os.tools.plan.sensitivity import load_margins
from rt_robot_os.tools.plan.sensitivity import Sensitivity

# 2 is for bad use, see rt_robot_os.base.programs.
SCHEDULABLE, NOT_SCHEDULABLE, NOT_JUDGED = 0, 1, 3


@dataclass(frozen=True, slots=True)
class Report:
    """
    What was found.

    :ivar sensitivity: None while tasks with a deadline cannot be judged.
    :ivar hyper_period_ns: None when it is too long to matter, 0 without timers.
    :ivar remedy: the first thing to do; empty when nothing has to be done.
    :ivar chains: that were requested.
    """

    robot: RobotTasks
    analysis: Analysis
    sensitivity: Sensitivity | None
    phases: PhasePlan
    hyper_period_ns: int | None
    remedy: str
    chains: tuple[ChainResult, ...] = ()

    @property
    def exit_code(self) -> int:
        """Return 0 schedulable, 1 not schedulable, 3 something with a deadline is not judged."""
        if self.analysis.failed or any(chain.late for chain in self.chains):
            return NOT_SCHEDULABLE
        unjudged = self.analysis.unjudged or any(chain.unjudged for chain in self.chains)
        return NOT_JUDGED if unjudged else SCHEDULABLE


def make_report(robot: RobotTasks, chains: Sequence[ChainRequest] = ()) -> Report:
    """
    Find out everything about a robot's tasks.

    :param chains: that are requested.
    :raises ConfigError: as :func:`rt_robot_os.tools.plan.analysis.analyse`; or a chain is none.
    """
    tasks, overhead = robot.tasks, robot.overhead
    analysis = analyse(tasks, overhead)
    bounded = chains_of(chains, robot, analysis)  # before what takes long
    sensitivity = None if analysis.unjudged else load_margins(tasks, overhead)
    return Report(
        robot, analysis, sensitivity, lowest_peak(tasks, robot.fixed_phases()),
        hyper_period_ns(tasks), remedy(tasks, overhead, analysis),
        bounded)
