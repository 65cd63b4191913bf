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


"""What several tests of the kernel need."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import subprocess
import sys

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import MonotonicClock
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import TraceLog
from rt_robot_os.kernel import VirtualClock

ROOT = Path(__file__).resolve().parents[2]
US = 1_000
MS = 1_000_000
S = 1_000_000_000
STEP_NS = 50 * US
PATIENCE_NS = 30 * S

CLOCKS = {'virtual': VirtualClock, 'real': MonotonicClock}


class StallingClock(VirtualClock):
    """A virtual clock on which a job can also make a native call, which nothing preempts."""

    def stall(self, duration_ns: int) -> None:
        self._now_ns += duration_ns
        self.spend(1)  # the first instruction after the call: the timer's handler runs
        self._now_ns -= 1


def spin_until(kernel: Kernel, condition: Callable[[], object]) -> None:
    """Compute, in a job, until something is so; fail if it never is."""
    end_ns = kernel.now_ns() + PATIENCE_NS
    while not condition():
        kernel.clock.spend(STEP_NS)
        assert kernel.now_ns() < end_ns, 'what the job waited for never came'


def starts(log: TraceLog, name: str) -> list[int]:
    """Give the times at which a task's jobs started."""
    return [event.at_ns for event in log.events() if (event.kind, event.task) == ('start', name)]


def names(log: TraceLog) -> list[str]:
    """Give the tasks in the order in which their jobs started."""
    return [event.task for event in log.events() if event.kind == 'start']


def balance(task: Task) -> int:
    """Give what is left of a task's releases when all that became of them is taken off."""
    return task.releases - task.runs - task.missed - task.coalesced


def waits(task: Task) -> bool:
    """Whether a task waits for its turn, as of now."""
    task.account()
    return task.pending


def run_program(program: str, *arguments: str, timeout_s: float = 300.0,
                **options: object) -> subprocess.CompletedProcess[str]:
    """Run Python code in a process of its own, with this package."""
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(
        [str(ROOT), os.environ.get('PYTHONPATH', '')])}
    return subprocess.run(  # type: ignore[call-overload, no-any-return]
        [sys.executable, '-c', program, *arguments], capture_output=True, text=True,
        timeout=timeout_s, env=environment, **options)
