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

"""What a measurement gets in its child process: arguments, the real-time set-up, helpers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
import os
from pathlib import Path
from typing import Any

from rt_robot_os.linux import realtime
from rt_robot_os.linux.realtime import RtResult
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.case import UNPINNED
from rt_robot_os.tools.bench.helper import Helper
from rt_robot_os.tools.bench.machine_state import MachineState


class Unavailable(Exception):
    """What was to be measured is not on this machine: a line in the table, not an error."""


@dataclass(frozen=True)
class Measurement:
    """
    What a subject returns.

    :ivar samples: raw, by name; integers.
    :ivar figures: single numbers, by name.
    """

    samples: Mapping[str, Samples] = field(default_factory=dict)
    figures: Mapping[str, float] = field(default_factory=dict)


class Harness:
    """
    The surroundings of one subject.

    :param arguments: those of its :class:`rt_robot_os.tools.bench.case.Run`.
    :param folder: for files; gone afterwards.
    :ivar priority: of SCHED_FIFO that was asked for; 0 for none.
    :ivar surroundings: counters since the set-up.
    :ivar realtime: what became of each step of the set-up.
    """

    def __init__(self, arguments: Mapping[str, Any], cpu: int, priority: int, folder: Path
                 ) -> None:
        self.arguments = arguments
        self.priority = priority
        self.folder = folder
        self.machine_state = MachineState()
        self.realtime: list[RtResult] = []
        self._cpu = cpu
        self._allowed = sorted(os.sched_getaffinity(0))

    def prepare(self, freeze: bool = False) -> None:
        """
        Ask Linux for real time as the core does; what it refuses is noted.

        Threads that are started afterwards inherit it, those before do not.

        :param freeze: take what is there out of the garbage collector and turn it off.
        """
        self.realtime.append(realtime.set_timer_slack())
        if self._cpu != UNPINNED:
            self.realtime.append(realtime.set_affinity(self._cpu))
        self.realtime.append(realtime.lock_memory())
        if freeze:
            realtime.freeze_garbage()
        if self.priority:
            self.realtime.append(realtime.set_fifo(self.priority))
        self.machine_state = MachineState()

    @property
    def own_cpu(self) -> int:
        """Return which CPU this subject is, or will be, pinned to."""
        return self._allowed[-1] if self._cpu < 0 else self._cpu

    def helper(self, subject: str, arguments: Mapping[str, Any], same_cpu: bool) -> Helper:
        """
        Start a process beside this one, without real time; it is ready when this returns.

        :param subject: ``package.module:function``; called with the arguments and a callable that
            says "ready".
        :param same_cpu: on the subject's CPU; else on the others, where there are any.
        """
        others = [cpu for cpu in self._allowed if cpu != self.own_cpu]
        cpus = [self.own_cpu] if same_cpu or not others else others
        return Helper(subject, arguments, cpus)


def prepare(harness: Harness) -> Measurement:
    """Do the real-time set-up and nothing else."""
    harness.prepare()
    return Measurement()
