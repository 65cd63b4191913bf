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

"""
What is known of the recording of x-io Technologies without any filter.

In four windows the sensor rests in an undisturbed field: there gravity and the field say how it is
turned. Between 65 s and 72 s it is spun flat on a table, half a metre or so from the axis: its
tilt stays that of the table. From 100 s to 116 s it rests and a magnet comes near: its heading
stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from benchmarks.attitude_comparison.errors import headings
from benchmarks.attitude_comparison.errors import tilts
from benchmarks.attitude_comparison.recordings import Array
from benchmarks.attitude_comparison.recordings import Recording
import numpy as np
import numpy.typing as npt

Window = tuple[float, float]
RESTS: Final[tuple[Window, ...]] = ((5.0, 11.0), (60.0, 62.0), (96.0, 98.5), (125.0, 135.0))
SPUN: Final[Window] = (65.0, 72.0)
MAGNET: Final[Window] = (100.0, 116.0)


@dataclass(frozen=True)
class Found:
    """
    Errors in degrees.

    :ivar heading: the largest at rest; without magnetometer, from the first rest on.
    :ivar inclination: the largest at rest.
    :ivar spun: the largest difference from the tilt of the table while spun.
    :ivar magnet: how far the heading moves while the magnet is near.
    """

    heading: float
    inclination: float
    spun: float
    magnet: float


def find(recording: Recording, turned: Array, axes: int) -> Found:
    """Compare an estimate with what is known; headings with those of the first rest."""
    yaw, tilt = headings(turned), tilts(turned)
    offsets, leans = [], []
    for window in RESTS:
        rows = _rows(recording, window)
        up, heading = _static(recording, rows)
        offsets.append(float(np.mean(yaw[rows])) - heading)
        leans.append(_angle(_mean_up(turned[rows]), up))
    # Without magnetometer the first heading is anything, with one its frame may be another.
    first = offsets[0] if axes == 6 else 90.0 * round(offsets[0] / 90)
    away = [abs((offset - first + 180) % 360 - 180) for offset in offsets]
    table = float(np.mean(tilt[_rows(recording, RESTS[0])]))
    near = yaw[_rows(recording, MAGNET)]
    return Found(max(away), max(leans),
                 float(np.max(np.abs(tilt[_rows(recording, SPUN)] - table))),
                 float(np.max(near) - np.min(near)))


def _rows(recording: Recording, window: Window) -> npt.NDArray[np.bool_]:
    times = recording.time_s - recording.time_s[0]
    rows: npt.NDArray[np.bool_] = (times >= window[0]) & (times < window[1])
    return rows


def _static(recording: Recording, rows: npt.NDArray[np.bool_]) -> tuple[Array, float]:
    """Return "up" in the sensor's axes and the heading, from the means of a window at rest."""
    up = recording.acceleration[rows].mean(axis=0)
    up = up / np.linalg.norm(up)
    east = np.cross(recording.field[rows].mean(axis=0), up)
    east = east / np.linalg.norm(east)
    return up, float(np.degrees(np.arctan2(np.cross(up, east)[0], east[0])))


def _mean_up(turned: Array) -> Array:
    x, y, z, w = turned.T
    up = np.stack((2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)), axis=1)
    mean: Array = up.mean(axis=0)
    return mean


def _angle(a: Array, b: Array) -> float:
    cosine = np.dot(a, b) / (np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
