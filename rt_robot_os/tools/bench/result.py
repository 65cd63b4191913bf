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

"""What a case finds: metrics over the repeats, rows of tables, targets and verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from enum import Enum
import statistics
from typing import Any

from rt_robot_os.tools.bench.machine_state import NOTHING
from rt_robot_os.tools.bench.plot import Plot


class RunStatus(Enum):
    """What became of a run: measured, its software is not installed, or it went wrong."""

    OK = 'ok'
    MISSING = 'missing'
    FAILED = 'failed'


class TargetVerdict(Enum):
    """Whether a target is reached; shown always."""

    REACHED = 'reached'
    MISSED = 'MISSED'
    UNKNOWN = 'not measured'


@dataclass(frozen=True)
class Metric:
    """
    One quantity, measured once a repeat.

    :ivar values: one a repeat, in the order of the repeats; at least one.
    """

    values: tuple[float, ...]

    @property
    def median(self) -> float:
        """Return the middle of the repeats: a repeat that something disturbed does not move it."""
        return statistics.median(self.values)

    @property
    def lowest(self) -> float:
        """Return the least of the repeats."""
        return min(self.values)

    @property
    def highest(self) -> float:
        """Return the greatest of the repeats."""
        return max(self.values)

    def as_json(self) -> dict[str, Any]:
        """Return plain values."""
        return {'median': self.median, 'lowest': self.lowest, 'highest': self.highest,
                'repeats': list(self.values)}


@dataclass(frozen=True)
class Column:
    """
    A column of a table.

    :ivar key: which metric of a row it shows.
    :ivar title: its heading.
    :ivar unit: of its values; shown with the group.
    :ivar group: heading over this column and its neighbours of the same group.
    :ivar spread: show the lowest and the highest of the repeats instead of their median.
    """

    key: str
    title: str
    unit: str
    group: str
    spread: bool = False


@dataclass(frozen=True)
class Row:
    """
    One thing that was measured.

    :ivar metrics: by key; None where there were too few samples.
    :ivar reason: why it was not measured; empty when it was.
    :ivar published: the figures are those of a publication; nothing of it ran here.
    :ivar run: key of the run in the raw samples; empty when it is not of one run.
    """

    label: str
    metrics: Mapping[str, Metric | None] = field(default_factory=dict)
    status: RunStatus = RunStatus.OK
    reason: str = ''
    published: bool = False
    run: str = ''

    def as_json(self) -> dict[str, Any]:
        """Return plain values."""
        return {'label': self.label, 'status': self.status.value, 'reason': self.reason,
                'quoted': self.published, 'run': self.run,
                'metrics': {key: None if metric is None else metric.as_json()
                            for key, metric in self.metrics.items()}}


def published_values(label: str, **figures: float) -> Row:
    """Make a row of the figures of a publication."""
    return Row(label, {key: Metric((value,)) for key, value in figures.items()}, published=True)


@dataclass(frozen=True)
class Table:
    """
    Rows that are compared with each other.

    :ivar notes: how it was measured: what the reader needs to trust or to doubt it.
    """

    title: str
    columns: Sequence[Column]
    rows: Sequence[Row]
    notes: Sequence[str] = ()

    def as_json(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            'title': self.title, 'notes': list(self.notes),
            'columns': [{'key': c.key, 'title': c.title, 'unit': c.unit, 'group': c.group}
                        for c in self.columns if not c.spread],
            'rows': [row.as_json() for row in self.rows]}


@dataclass(frozen=True)
class Target:
    """
    A promise of this package, as a number.

    :ivar text: what is measured.
    :ivar limit: the number.
    :ivar measured: None when it could not be measured.
    :ivar at_most: the measured one has to be at most the limit; else at least.
    :ivar why: what the samples say about the reason, in case that it is missed.
    :ivar paper: the figure of the paper for the same, in words.
    """

    text: str
    limit: float
    measured: Metric | None
    unit: str = ''
    at_most: bool = True
    why: str = ''
    paper: str = ''

    @property
    def reason(self) -> str:
        """Return why it is missed; empty unless it is."""
        if self.verdict is not TargetVerdict.MISSED:
            return ''
        # "No disturbance" adds nothing to a reason that is known.
        return self.why.removesuffix(f'; {NOTHING}')

    @property
    def verdict(self) -> TargetVerdict:
        """Compare the median with the limit."""
        if self.measured is None:
            return TargetVerdict.UNKNOWN
        median = self.measured.median
        met = median <= self.limit if self.at_most else median >= self.limit
        return TargetVerdict.REACHED if met else TargetVerdict.MISSED

    def as_json(self) -> dict[str, Any]:
        """Return plain values."""
        return {'aim': self.text, 'limit': self.limit, 'unit': self.unit,
                'relation': '<=' if self.at_most else '>=', 'verdict': self.verdict.value,
                'reason': self.reason, 'paper': self.paper,
                'measured': None if self.measured is None else self.measured.as_json()}


@dataclass(frozen=True)
class Requirement:
    """
    A requirement of users, and which systems meet it.

    :ivar text: the requirement, with the number that is good enough.
    :ivar limit: that number.
    :ivar systems: what was measured, by system; None where it was not.
    :ivar case: the case that measured it.
    """

    text: str
    limit: float
    unit: str
    systems: Mapping[str, Metric | None]
    at_most: bool = True
    case: str = ''

    @property
    def known(self) -> bool:
        """Return whether it was measured for any system."""
        return any(metric is not None for metric in self.systems.values())

    def meets(self, system: str) -> bool | None:
        """Return whether a system meets it; None when that is not known."""
        metric = self.systems.get(system)
        return None if metric is None else self._enough(metric.median)

    def agrees(self, system: str) -> bool:
        """Return whether each repeat has the same result as their median."""
        metric = self.systems.get(system)
        return metric is None or len({self._enough(value) for value in metric.values}) == 1

    def _enough(self, value: float) -> bool:
        return value <= self.limit if self.at_most else value >= self.limit

    def as_json(self) -> dict[str, Any]:
        """Return plain values."""
        return {'need': self.text, 'limit': self.limit, 'unit': self.unit, 'case': self.case,
                'relation': '<=' if self.at_most else '>=',
                'systems': {name: None if metric is None else metric.as_json()
                            for name, metric in self.systems.items()}}


@dataclass(frozen=True)
class CaseResult:
    """
    All that a case found.

    :ivar facts: single figures by the names of :mod:`rt_robot_os.tools.bench.facts`.
    """

    name: str
    title: str
    tables: Sequence[Table]
    targets: Sequence[Target]
    plots: Sequence[Plot] = ()
    requirements: Sequence[Requirement] = ()
    facts: Mapping[str, Metric | None] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return plain values."""
        return {'name': self.name, 'title': self.title,
                'tables': [table.as_json() for table in self.tables],
                'aims': [target.as_json() for target in self.targets],
                'plots': [plot.as_json() for plot in self.plots],
                'needs': [each.as_json() for each in self.requirements],
                'facts': {name: metric.as_json() for name, metric in self.facts.items()
                          if metric is not None}}
