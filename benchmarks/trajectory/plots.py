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

"""The pictures of the case `trajectory`: Figures 12 to 14 of the second paper."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from typing import Any
from typing import Final

from benchmarks.trajectory.drives import PAPER_GOAL
from benchmarks.trajectory.drives import PAPER_START
from benchmarks.trajectory.figures import cycles_ns
import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series

LOADS: Final = (0, 5, 7, 20)
# Without real time: the first of these that was measured, as a robot's programmer would have it.
_WITHOUT: Final = ('single', 'process', 'threads')
# Paper, Table 1, without real time: way in cm, time in ms, shortest and longest cycle in ms.
PAPER: Final = {0: (132, 6300, 300, 300), 5: (143, 7803, 300, 600), 7: (140, 7960, 500, 600)}
_SYSTEMS: Final = ('rt', 'threads', 'process', 'single', 'multi', 'events')
_LINE: Final = 'reference'
_ACROSS_CM: Final = (336.0, 348.0)
_TIME_S: Final = (0.0, 14.0)
_HIDDEN: Final = ' Of loads that lie on each other the last one is seen.'

Points = tuple[Sequence[float], Sequence[float]]


def plots(outcomes: Outcomes) -> Sequence[Plot]:
    """Draw the three figures, each without and with real time."""
    without = next((system for system in _WITHOUT if any(
        outcomes.measured(f'{system} {count}') for count in LOADS)), '')
    found: list[Plot] = []
    for system, letter in ((without, 'a'), ('rt', 'b')):
        label = next((run.label.partition(',')[0] for key, run in outcomes.runs.items()
                      if key.startswith(f'{system} ')), '')
        if system and any(outcomes.measured(f'{system} {count}') for count in LOADS):
            found += _figures(outcomes, system, label, letter)
    return [*_table(outcomes), *sorted(found, key=lambda plot: plot.name)]


def _table(outcomes: Outcomes) -> Sequence[Plot]:
    """Draw Table 1: way and time by the number of tasks."""
    def series(paper: int, scale: float, name: str) -> list[Series]:
        lines = [Series('paper, without real time', list(PAPER),
                        [row[paper] / (1000 if paper else 1) for row in PAPER.values()], 'marks')]
        for system in _SYSTEMS:
            known = [(count, outcome.figures[name] * scale) for count in LOADS
                     for outcome in outcomes.measured(f'{system} {count}')[:1]]
            if known:
                label = next(outcomes.runs[f'{system} {count}'].label for count, _ in known[:1])
                lines.append(Series(label.partition(',')[0], [count for count, _ in known],
                                    [value for _, value in known], 'marks'))
        return lines

    where, ticks = 'workload tasks in the same program', [(n, str(n)) for n in LOADS]
    return (
        Plot('1-way', 'How far the robot drove (Table 1)', where, 'way, cm',
             series(0, 100.0, 'travelled_m'),
             '130 cm are right. After 20 s it is stopped wherever it is.', x_ticks=ticks,
             y_range=(125, 160)),
        Plot('1-time', 'How long it took (Table 1)', where, 'time, s',
             series(1, 0.001, 'time_ms'), '6.3 s are right.', x_ticks=ticks, y_range=(5, 20.5)))


def _figures(outcomes: Outcomes, system: str, label: str, letter: str) -> Sequence[Plot]:
    def series(of: Callable[[RunOutcome], Points]) -> list[Series]:
        return [Series(f'{count} tasks', *of(outcomes.measured(f'{system} {count}')[0]), 'marks')
                for count in LOADS if outcomes.measured(f'{system} {count}')]

    goal_cm, goal_deg = 100 * PAPER_GOAL[1], np.degrees(PAPER_GOAL[2])
    return (
        Plot(f'12{letter}-way', f'{label}: the way (Fig. 12{letter})', 'y, cm', 'x, cm',
             [*series(_way), Series(_LINE, (100 * PAPER_START[1], goal_cm),
                                    (100 * PAPER_START[0], 100 * PAPER_GOAL[0])),
              Series('goal', (goal_cm, goal_cm), _ACROSS_CM)],
             f'A point is a cycle; beyond the goal it drove too far.{_HIDDEN}',
             x_range=(95, 250), y_range=_ACROSS_CM),
        Plot(f'13{letter}-heading', f'{label}: the heading (Fig. 13{letter})', 'time, s',
             'heading, degrees', [*series(_heading), Series(_LINE, _TIME_S, (goal_deg, goal_deg))],
             f'A point is a cycle; 6.3 s are right.{_HIDDEN}', x_range=_TIME_S,
             y_range=(60, 125)),
        Plot(f'14{letter}-cycle', f'{label}: the sampling times (Fig. 14{letter})', 'cycle',
             'time since the cycle before, ms', series(_cycles),
             f'Flat at 300 ms is right.{_HIDDEN}', x_range=(0, 32), y_range=(0, 1300)))


def _way(outcome: RunOutcome) -> Points:
    samples = outcome.samples
    return _list(100 * samples['y_m']), _list(100 * samples['x_m'])


def _heading(outcome: RunOutcome) -> Points:
    samples = outcome.samples
    return _list(samples['time_s']), _list(np.degrees(np.unwrap(samples['heading_rad'])))


def _cycles(outcome: RunOutcome) -> Points:
    cycles = cycles_ns(outcome) / NS_PER_MS
    return _list(np.arange(1, len(cycles) + 1)), _list(cycles)


def _list(values: Any) -> Sequence[float]:
    found: list[float] = np.asarray(values, float).tolist()
    return found
