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

"""Run the children of a case, repeat by repeat, so that a disturbance meets all systems alike."""

from __future__ import annotations

from collections.abc import Callable

from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.processes import measure
from rt_robot_os.tools.bench.progress import ProgressLine
from rt_robot_os.tools.bench.result import RunStatus

Measure = Callable[[Run], RunOutcome]


def expected_seconds(case: Case, options: BenchOptions) -> float:
    """Estimate how long a case takes."""
    return sum(run.seconds * repeats(run, case, options) for run in case.plan(options))


def repeats(run: Run, case: Case, options: BenchOptions) -> int:
    """Return how often a run of a case is repeated."""
    return 1 if run.once else rounds(case, options)


def rounds(case: Case, options: BenchOptions) -> int:
    """Return how often a case is repeated."""
    return case.docs_repeats if options.docs else options.repeats


def run_case(case: Case, options: BenchOptions, progress: ProgressLine, measured: Measure = measure
             ) -> Outcomes:
    """
    Measure everything that a case asks for: all runs once, then all again, and so on.

    The order is reversed every other time: no run profits from always being after the same one.

    :param progress: is notified before and after each run.
    :param measured: runs one of them.
    """
    runs = list(case.plan(options))
    outcomes = Outcomes(runs)
    missing: dict[str, RunOutcome] = {}
    total = sum(repeats(run, case, options) for run in runs)
    count = 0
    for repeat in range(rounds(case, options)):
        for run in runs if repeat % 2 == 0 else reversed(runs):
            if repeat >= repeats(run, case, options):
                continue
            count += 1
            progress.show(f'{case.name} {count}/{total}: {run.label.strip()}')
            outcome = missing.get(run.key) or measured(run)
            if outcome.status is RunStatus.MISSING:
                missing[run.key] = outcome
            outcomes.add(run.key, outcome)
            progress.done(run.seconds)
    return outcomes
