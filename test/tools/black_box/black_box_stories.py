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


"""Random stories of one CPU, told as a kernel would tell them and as a model that sees all."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from dataclasses import field
from typing import Any

from hypothesis import strategies as st

from rt_robot_os.kernel import BlackBoxDump
from rt_robot_os.kernel import TaskFacts
from rt_robot_os.kernel.black_box import ABORT
from rt_robot_os.kernel.black_box import BLOCKED
from rt_robot_os.kernel.black_box import CEILING
from rt_robot_os.kernel.black_box import INTERRUPT
from rt_robot_os.kernel.black_box import JOB
from rt_robot_os.kernel.black_box import MARK
from rt_robot_os.kernel.black_box import MISS
from rt_robot_os.kernel.black_box import OVERRUN
from rt_robot_os.kernel.black_box import PUBLISH

NAMES = ('watch', 'planner', 'camera', 'control', 'imu')
PRIORITIES = (1, 20, 20, 60, 80)
TASKS = tuple(TaskFacts(name, priority, 0 if name == 'control' else 2_000_000)
              for name, priority in zip(NAMES, PRIORITIES))
TEXTS = st.text(st.characters(exclude_categories=['Cs']), max_size=8)
IDLE = -1


@dataclass
class Story:
    """
    A schedule as it unfolds.

    :ivar owner: the task that has the CPU, nanosecond by nanosecond.
    """

    now_ns: int = 0
    records: list[tuple[Any, ...]] = field(default_factory=list)
    owner: list[int] = field(default_factory=list)
    executed: list[tuple[int, int, int]] = field(default_factory=list)  # task, start, own time
    stack: list[tuple[int, int, int]] = field(default_factory=list)

    def compute(self, task: int, time_ns: int) -> int:
        self.owner += [task] * time_ns
        self.now_ns += time_ns
        return time_ns

    def job(self, task: int, plan: list[Any], ends: bool = True) -> None:
        start_ns, own_ns = self.now_ns, 0
        release_ns = max(0, start_ns - len(plan))
        self.stack.append((task, release_ns, start_ns))
        for part in plan:
            if isinstance(part, int):
                own_ns += self.compute(task, part)
                self._remark(task, part)
            elif (above := self._above(task, len(part))) is not None:
                self.job(above, part)
        if ends:
            self.stack.pop()
            self.records.append((JOB, task, release_ns, start_ns, self.now_ns, len(plan) % 3))
        self.executed.append((task, start_ns, own_ns))

    def _above(self, task: int, choice: int) -> int | None:
        higher = [i for i, p in enumerate(PRIORITIES) if p > PRIORITIES[task]]
        return higher[choice % len(higher)] if higher else None

    def _remark(self, task: int, part: int) -> None:
        at_ns = self.now_ns
        more: dict[int, tuple[Any, ...]] = {
            1: (PUBLISH, task, at_ns, 'imu/data', at_ns), 2: (INTERRUPT, 4, at_ns, 'uart'),
            3: (OVERRUN, task, at_ns, 2), 4: (ABORT, task, at_ns, part),
            5: (CEILING, task, at_ns - part, at_ns, 'map'), 6: (BLOCKED, task, at_ns, part),
            7: (MISS, task, at_ns, part), 8: (MARK, -1, at_ns, 'a mark'),
            9: (PUBLISH, -1, at_ns, 'cmd', 1)}
        if part in more:
            self.records.append(more[part])

    def dump(self, keep: int | None = None) -> BlackBoxDump:
        kept = self.records if keep is None else self.records[len(self.records) - keep:]
        return BlackBoxDump('a test', self.now_ns, 0, TASKS, tuple(self.stack), tuple(kept),
                            len(kept) < len(self.records))

    def used(self, from_ns: int, to_ns: int) -> Counter[int]:
        used = Counter(self.owner[from_ns:to_ns])
        del used[IDLE]
        return used


PLANS = st.recursive(
    st.lists(st.integers(0, 12), max_size=4),
    lambda inner: st.lists(st.integers(0, 12) | inner, max_size=5), max_leaves=15)


@st.composite
def stories(draw: st.DrawFn) -> Story:
    """Draw what happened, which may end in the middle of jobs."""
    story = Story()
    for plan in draw(st.lists(PLANS, max_size=5)):
        story.job(draw(st.sampled_from((0, 1, 3))), plan)
        story.compute(IDLE, draw(st.integers(0, 5)))
    for task in sorted(draw(st.sets(st.sampled_from((0, 1, 3, 4))))):
        story.job(task, draw(PLANS), ends=False)
    return story
