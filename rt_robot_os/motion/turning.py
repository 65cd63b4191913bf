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
"""Calibrate the mounting of a localiser by turning the robot on the spot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Final

import numpy as np

from rt_robot_os.motion.differential import Pose

FEWEST: Final = 10
# With less of the circle the centre is a guess.
LEAST_TURN_RAD: Final = math.radians(120)


@dataclass(frozen=True)
class TurnFit:
    """
    The result of a turn on the spot.

    :ivar centre_m: centre of the turn on the map.
    :ivar offset_m: how far the pose that was recorded lies ahead and to the left of the turning
        axis, in its own axes.
    :ivar rms_m: of the residuals.
    :ivar turn_rad: how much of the circle the headings cover.
    """

    centre_m: tuple[float, float]
    offset_m: tuple[float, float]
    rms_m: float
    turn_rad: float


def fit_turn(poses: Sequence[Pose]) -> TurnFit:
    """
    Fit the circle that a sensor draws while the robot turns on the spot; not for the loop.

    The sensor is at ``centre + R(heading) offset``, which is linear in both: least squares, and
    the headings say where on the circle each position is.

    :param poses: x and y in m, heading in rad, all of them of the same turn.
    :raises ValueError: there are too few, or they cover too little of the circle.
    """
    if len(poses) < FEWEST:
        raise ValueError(f'{len(poses)} poses: at least {FEWEST} are needed')
    x, y, heading = np.asarray(poses, dtype=float).T
    turn_rad = _covered(heading)
    if turn_rad < LEAST_TURN_RAD:
        raise ValueError(f'the headings cover {math.degrees(turn_rad):.0f} degrees: turn by at '
                         f'least {math.degrees(LEAST_TURN_RAD):.0f}')
    cosine, sine = np.cos(heading), np.sin(heading)
    zero, one = np.zeros(len(poses)), np.ones(len(poses))
    system = np.concatenate((np.stack((one, zero, cosine, -sine), axis=1),
                             np.stack((zero, one, sine, cosine), axis=1)))
    measured = np.concatenate((x, y))
    solution = np.linalg.lstsq(system, measured, rcond=None)[0]
    left = (system @ solution - measured).reshape(2, -1)
    centre_x, centre_y, ahead, to_left = (float(each) for each in solution)
    return TurnFit((centre_x, centre_y), (ahead, to_left),
                   float(np.sqrt((left ** 2).sum(axis=0).mean())), turn_rad)


def _covered(heading: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    """Return how much of the circle lies between headings: all but the widest gap."""
    around = np.sort(np.mod(heading, math.tau))
    gaps = np.diff(np.append(around, around[0] + math.tau))
    return float(math.tau - gaps.max())
