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

"""What a case is: runs in child processes, and a function that makes tables of their samples."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Metric
from rt_robot_os.tools.bench.result import Row
from rt_robot_os.tools.bench.result import RunStatus

# The core's own defaults, so that what is measured is what runs.
FIFO_PRIORITY = 80
LAST_CPU = -1
UNPINNED = -2
# Which build of the package a child runs: with the C core, or all in Python.
COMPILED, PURE = 'compiled', 'pure'
BUILDS = (COMPILED, PURE)

Samples = NDArray[np.int64]


@dataclass(frozen=True)
class BenchOptions:
    """
    How long and how often.

    :ivar seconds: of one measurement.
    :ivar repeats: of each run; other runs lie between them.
    :ivar full: measure the slow variants as well.
    :ivar quick: leave out what a first look does not need.
    :ivar docs: for the documentation: each case is repeated as often as it says itself.
    :ivar hours: of the case `stability`.
    :ivar out: the folder of the results, for what is written while measuring; or empty.
    :ivar data: a recording for the cases that take one; or empty.
    :ivar expected: what others make of that recording; empty: the file beside it, if any.
    :ivar imu_mounting: roll, pitch and yaw in rad of the inertial sensor of that recording.
    """

    seconds: float
    repeats: int
    full: bool = False
    quick: bool = False
    docs: bool = False
    hours: float = 1 / 60
    out: str = ''
    data: str = ''
    expected: str = ''
    imu_mounting: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def measure_ns(self) -> int:
        """How long one measurement takes."""
        return round(self.seconds * NS_PER_S)


@dataclass(frozen=True)
class Run:
    """
    One measurement, in a child process of its own.

    :ivar key: names it in its case.
    :ivar label: names it for people.
    :ivar subject: ``package.module:function``; called in the child with a
        :class:`rt_robot_os.tools.bench.child.Harness`.
    :ivar arguments: plain values for the subject.
    :ivar seconds: how long it is expected to take, start included.
    :ivar cpu: that the child is pinned to; ``LAST_CPU`` or ``UNPINNED``.
    :ivar priority: of SCHED_FIFO; 0 for an ordinary process.
    :ivar once: not repeated: a long run that has its repeats inside.
    :ivar build: of this package, ``COMPILED`` or ``PURE``; empty for the one that is here.
    """

    key: str
    label: str
    subject: str
    arguments: Mapping[str, Any]
    seconds: float
    cpu: int = LAST_CPU
    priority: int = FIFO_PRIORITY
    once: bool = False
    build: str = ''


@dataclass(frozen=True)
class RunOutcome:
    """
    What a child brought back.

    :ivar samples: raw, by name.
    :ivar figures: single numbers, by name.
    :ivar realtime: steps of the real-time set-up as (step, in force, reason).
    """

    status: RunStatus
    reason: str = ''
    samples: Mapping[str, Samples] = field(default_factory=dict)
    figures: Mapping[str, float] = field(default_factory=dict)
    realtime: Sequence[tuple[str, bool, str]] = ()


class Outcomes:
    """The outcomes of all runs of a case, by run and repeat."""

    def __init__(self, runs: Sequence[Run]) -> None:
        self.runs = {run.key: run for run in runs}
        self._outcomes: dict[str, list[RunOutcome]] = {run.key: [] for run in runs}

    def add(self, key: str, outcome: RunOutcome) -> None:
        """Append the outcome of a further repeat."""
        self._outcomes[key].append(outcome)

    def all(self, key: str) -> Sequence[RunOutcome]:  # noqa: A003
        """Return what one run brought back, in the order of the repeats."""
        return self._outcomes.get(key, [])

    def measured(self, key: str) -> Sequence[RunOutcome]:
        """Return the repeats of a run that were measured."""
        return [o for o in self.all(key) if o.status is RunStatus.OK]

    def metric(self, key: str, of: Callable[[RunOutcome], float | None]) -> Metric | None:
        """
        Take one number from each measured repeat of a run.

        :param of: gives the number, or None when there are too few samples for it.
        :return: None unless every measured repeat, and at least one, gives it.
        """
        values = [of(outcome) for outcome in self.measured(key)]
        known = tuple(value for value in values if value is not None)
        return Metric(known) if known and len(known) == len(values) else None

    def ratio(self, key: str, other: str, of: Callable[[RunOutcome], float | None]
              ) -> Metric | None:
        """
        Divide a number of one run by that of another, repeat by repeat.

        :return: None unless both were measured together at least once.
        """
        return self.between(key, of, other, of)

    def between(self, key: str, of: Callable[[RunOutcome], float | None], other: str,
                other_of: Callable[[RunOutcome], float | None]) -> Metric | None:
        """Divide a number of one run by another number of another one, repeat by repeat."""
        values = []
        for one, two in zip(self.all(key), self.all(other)):
            if one.status is RunStatus.OK and two.status is RunStatus.OK:
                above, below = of(one), other_of(two)
                if above is not None and below:
                    values.append(above / below)
        return Metric(tuple(values)) if values else None

    def row(self, key: str, of: Mapping[str, Callable[[RunOutcome], float | None]],
            label: str | None = None) -> Row:
        """
        Make the row of a run; one that was never measured says why.

        :param of: for each metric how to get it from an outcome.
        :param label: instead of the run's own.
        """
        text = self.runs[key].label if label is None else label
        outcomes = self.all(key)
        if not self.measured(key):
            last = outcomes[-1] if outcomes else RunOutcome(RunStatus.FAILED, 'was not run')
            return Row(text, status=last.status, reason=last.reason, run=key)
        return Row(text, {name: self.metric(key, one) for name, one in of.items()}, run=key)


@dataclass(frozen=True)
class Case:
    """
    A case of the benchmark; :mod:`rt_robot_os.tools.bench.registry` knows them all.

    :ivar name: what a user types.
    :ivar title: what it measures, in a line.
    :ivar plan: the runs for these options, in the order of one repeat.
    :ivar evaluate: makes tables and verdicts; knows nothing but the outcomes.
    :ivar partial: what a case that was interrupted has written so far, or None.
    :ivar takes_data: a recording of the user's can be evaluated with it.
    :ivar docs_repeats: how often its runs are repeated for the documentation: more often where
        small figures are compared with floors, once where it takes long.
    """

    name: str
    title: str
    plan: Callable[[BenchOptions], Sequence[Run]]
    evaluate: Callable[[BenchOptions, Outcomes], CaseResult]
    partial: Callable[[BenchOptions], Outcomes | None] | None = None
    takes_data: bool = False
    docs_repeats: int = 1
