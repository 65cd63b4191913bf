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

"""What a picture shows, in plain values; :mod:`rt_robot_os.tools.bench.plot_drawing` draws it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_POINTS = 240
_BINS = 120
# A picture whose values differ by less than this part of them shows nothing.
_FLAT = 0.02


@dataclass(frozen=True)
class Series:
    """
    One curve.

    :ivar style: ``line``, ``steps``, ``filled`` (steps over a surface), ``marks`` (on a line) or
        ``points`` (grey: what the others are drawn over).
    """

    label: str
    x: Sequence[float]
    y: Sequence[float]
    style: str = 'line'


@dataclass(frozen=True)
class Plot:
    """
    One picture.

    :ivar name: of its file, unique in its case.
    :ivar caption: what to look at.
    :ivar x_log: the horizontal axis is logarithmic.
    :ivar y_from_zero: the vertical axis begins at 0, so that small changes look small.
    :ivar equal: a metre is as long on both axes: a map.
    :ivar x_ticks: where the horizontal axis is labelled, and how; empty: at round numbers.
    :ivar x_range: what the horizontal axis shows; empty: everything.
    :ivar y_range: the same of the vertical one, for pictures that are compared.
    :ivar y_floor: a power of ten to which smaller values are raised, and what is written there.
    """

    name: str
    title: str
    x_label: str
    y_label: str
    series: Sequence[Series]
    caption: str = ''
    x_log: bool = False
    y_log: bool = False
    y_from_zero: bool = False
    x_ticks: Sequence[tuple[float, str]] = ()
    y_floor: tuple[float, str] | None = None
    x_range: Sequence[float] = ()
    y_range: Sequence[float] = ()
    equal: bool = False

    def flat(self) -> tuple[float, float] | None:
        """
        Return the least and the largest value when they are all but the same; else None.

        A picture that is given a range is to be compared, and its being flat is what it says.
        """
        if self.y_range:
            return None
        values = [y for series in self.series for y in series.y]
        if len(values) < 2 or max(values) - min(values) > _FLAT * abs(max(values)):
            return None
        return min(values), max(values)

    def as_json(self) -> dict[str, Any]:
        """Return what it is about; the samples are elsewhere."""
        return {'name': self.name, 'title': self.title, 'caption': self.caption,
                'series': [series.label for series in self.series]}


def tail(label: str, samples: NDArray[np.int64], unit_ns: float) -> Series:
    """
    Return which part of the samples is above each value: a latency's tail at a glance.

    :param unit_ns: nanoseconds in the unit of the horizontal axis.
    """
    ordered = np.sort(samples)
    count = len(ordered)
    if not count:
        return Series(label, (), (), 'steps')
    # As many points in each decade of what is above, the very last sample included.
    above = np.unique(np.geomspace(1, count, _POINTS).round().astype(np.int64))[::-1]
    values = np.maximum(ordered[count - above] / unit_ns, 0.1)
    return Series(label, values.tolist(), (above / count).tolist(), 'steps')


def histogram(label: str, samples: NDArray[np.int64], unit_ns: float, low: float, high: float,
              bins: int = _BINS) -> Series:
    """
    Count samples in bins of equal ratio; those outside go into the outermost ones.

    :param low: left edge, above 0, in units.
    :param high: right edge.
    :return: per cent of all samples in each bin.
    """
    edges = np.geomspace(low, high, bins + 1)
    inside = np.clip(samples / unit_ns, low, np.nextafter(high, low))
    counts = np.histogram(inside, edges)[0]
    part = 100.0 * counts / max(1, len(samples))
    return Series(label, edges[:-1].tolist(), part.tolist(), 'filled')
