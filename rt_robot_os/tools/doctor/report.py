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

"""The result of all checks: the verdict, the exit code, what to fix first."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from enum import Enum

from rt_robot_os.tools.doctor.finding import Line
from rt_robot_os.tools.doctor.finding import State
from rt_robot_os.tools.doctor.system import Wanted
from rt_robot_os.tools.doctor.wakeup import Wakeup


class Verdict(Enum):
    """The machine as a whole, with its exit code."""

    READY = 0
    USABLE = 1
    NOT_USABLE = 2

    @property
    def text(self) -> str:
        """Return its name as people read it."""
        return self.name.lower().replace('_', ' ')


FAILED = 3


@dataclass(frozen=True)
class Report:
    """
    Everything the doctor found.

    :ivar machine: plain facts for the head of the report.
    :ivar wakeup: None when it was not measured.
    """

    machine: Mapping[str, object]
    wanted: Wanted
    lines: Sequence[Line] = field(default_factory=tuple)
    wakeup: Wakeup | None = None

    @property
    def verdict(self) -> Verdict:
        """Judge: the worst line decides; what is unknown does not count."""
        states = {line.finding.state for line in self.lines}
        if State.BAD in states:
            return Verdict.NOT_USABLE
        return Verdict.USABLE if State.WARN in states else Verdict.READY

    @property
    def to_mend(self) -> list[Line]:
        """Return what is to be mended, the most worthwhile first."""
        found = [line for line in self.lines if line.finding.state in (State.WARN, State.BAD)]
        return sorted(found, key=lambda line: (line.finding.state is not State.BAD,
                                               -line.finding.weight))

    def count(self, state: State) -> int:
        """Count the lines in a state."""
        return sum(line.finding.state is state for line in self.lines)
