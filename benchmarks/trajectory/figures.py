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

"""What is made of the notes of a drive: ways, cycles, how far off the line."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any
from typing import Final

from benchmarks.trajectory.drives import PAPER_GOAL
from benchmarks.trajectory.drives import PAPER_START
from benchmarks.trajectory.subjects import away
import numpy as np

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.case import Samples
from rt_robot_os.tools.bench.cases.common import Of
from rt_robot_os.tools.bench.stats import percentile

# The robot begins askew; how it comes to its line is not how well it keeps it.
_BEGINNING_M: Final = 0.30


def cycles_ns(outcome: RunOutcome) -> Samples:
    """Return the time from each cycle to the next."""
    moments = outcome.samples.get('time_s', np.zeros(0))
    found: Samples = np.round(np.diff(moments) * NS_PER_S).astype(np.int64)
    return found


def cycle_ms(of: Callable[[Any], Any]) -> Of:
    """Take a figure of the cycle times."""
    def found(outcome: RunOutcome) -> float | None:
        cycles = cycles_ns(outcome)
        return float(of(cycles)) / NS_PER_MS if len(cycles) else None

    return found


def deviation_ms(period_ns: int, part: float) -> Of:
    """Take a percentile of how far the cycle times are from the period; 1.0 is the maximum."""
    def found(outcome: RunOutcome) -> float | None:
        value = percentile(np.abs(cycles_ns(outcome) - period_ns), part)
        return None if value is None else value / NS_PER_MS

    return found


def control_us(outcome: RunOutcome) -> float | None:
    """Take the median of what a step of the controller took."""
    value = percentile(outcome.samples.get('control_ns', np.zeros(0, np.int64)), 0.5)
    return None if value is None else value / 1000


def distance_cm(outcome: RunOutcome) -> float | None:
    """Take the way of the robot."""
    value = outcome.figures.get('travelled_m')
    return None if value is None else 100 * value


def missed_cm(outcome: RunOutcome) -> float | None:
    """Take how far from the goal it came to rest."""
    f = outcome.figures
    if 'end_x_m' not in f:
        return None
    return 100 * math.hypot(f['end_x_m'] - PAPER_GOAL[0], f['end_y_m'] - PAPER_GOAL[1])


def heading_deg(outcome: RunOutcome) -> float | None:
    """Take how far the heading is off at the end."""
    value = outcome.figures.get('heading_rad')
    return None if value is None else abs(math.degrees(math.remainder(
        value - PAPER_GOAL[2], math.tau)))


def cross_cm(outcome: RunOutcome) -> float | None:
    """Take the root of the mean square of the distances from the line, after the beginning."""
    x, y = outcome.samples.get('x_m'), outcome.samples.get('y_m')
    if x is None or y is None:
        return None
    off = np.asarray(x)[np.asarray(y) > PAPER_START[1] + _BEGINNING_M] - PAPER_START[0]
    return 100 * float(np.sqrt(np.mean(off ** 2))) if len(off) else None


def eight_cm(of: Callable[[Any], Any]) -> Of:
    """Take a figure of the distances from the eight."""
    def found(outcome: RunOutcome) -> float | None:
        x, y = outcome.samples.get('x_m'), outcome.samples.get('y_m')
        if x is None or y is None or not len(x):
            return None
        return 100 * float(of(away(np.asarray(x), np.asarray(y))))

    return found


def off(of: Of, wanted: float) -> Of:
    """Take how far a figure is from what it should be."""
    def found(outcome: RunOutcome) -> float | None:
        value = of(outcome)
        return None if value is None else abs(value - wanted)

    return found
