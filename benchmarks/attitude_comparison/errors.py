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

"""Errors of an attitude in the three parts that the BROAD benchmark defines."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.attitude_comparison.recordings import Array
import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Errors:
    """Root mean squares in degrees: of the whole turn between, about up, and of up itself."""

    total: float
    heading: float
    inclination: float


def products(p: Array, q: Array) -> Array:
    """Multiply quaternions, row by row."""
    px, py, pz, pw = p.T
    qx, qy, qz, qw = q.T
    return np.stack((pw * qx + px * qw + py * qz - pz * qy, pw * qy - px * qz + py * qw + pz * qx,
                     pw * qz + px * qy - py * qx + pz * qw, pw * qw - px * qx - py * qy - pz * qz),
                    axis=1)


def errors_of(estimate: Array, reference: Array, counted: npt.NDArray[np.bool_]) -> Errors:
    """
    Compare orientations.

    The turn from the reference to the estimate, about the world's axes, is a turn about the
    vertical (heading) after one about a level axis (inclination).

    :param estimate: rows of x, y, z, w.
    :param reference: the same; rows of NaN are left out.
    :param counted: the rows to compare.
    """
    between = products(estimate, reference * (-1.0, -1.0, -1.0, 1.0))[counted]
    x, y, z, w = np.abs(between[~np.isnan(between).any(axis=1)]).T
    level, upright = np.hypot(x, y), np.hypot(z, w)
    halves = (np.arctan2(np.hypot(level, z), w), np.arctan2(z, w), np.arctan2(level, upright))
    total, heading, inclination = (
        float(np.degrees(2 * np.sqrt(np.mean(half * half)))) for half in halves)
    return Errors(total, heading, inclination)


def headings(turned: Array) -> Array:
    """Return the yaw of orientations in degrees, without jumps."""
    x, y, z, w = turned.T
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    unwrapped: Array = np.degrees(np.unwrap(yaw))
    return unwrapped


def tilts(turned: Array) -> Array:
    """Return the angle between the sensor's z axis and up, in degrees."""
    x, y, _, _ = turned.T
    angles: Array = np.degrees(np.arccos(np.clip(1 - 2 * (x * x + y * y), -1.0, 1.0)))
    return angles
