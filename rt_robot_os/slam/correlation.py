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
Find where a scan fits best, looking at every place of a window: Olson's correlative matching.

E. Olson, Real-time correlative scan matching, ICRA 2009: a coarse grid bounds what a fine one can
give, so that most of the window is never looked at closely.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.slam.likelihood import LikelihoodField
from rt_robot_os.slam.likelihood import Likelihoods
from rt_robot_os.slam.transforms import Floats
from rt_robot_os.slam.transforms import placed
from rt_robot_os.slam.transforms import wrapped

_COARSE: Final = 4
#: Coarse places that are looked at closely, at most.
_CLOSER_MOST: Final = 400
#: Points of a scan that are looked at, spread evenly: more say the same.
_POINTS_MOST: Final = 120


@dataclass(frozen=True)
class Window:
    """
    Where to look.

    :ivar centre: shape (3,): the pose that is expected.
    :ivar reach_m: to each side.
    :ivar reach_rad: either way.
    :ivar sigma_m: how far from the centre a match may well be; further away it has to fit better.
        inf: it makes no difference.
    :ivar sigma_rad: the same of the angle.
    :ivar weight: what a standard deviation from the centre costs, as a part of a perfect fit.
    :ivar step_rad: from angle to angle.
    """

    centre: Floats
    reach_m: float
    reach_rad: float
    sigma_m: float = np.inf
    sigma_rad: float = np.inf
    weight: float = 0.01
    step_rad: float = float(np.radians(0.5))


def best_fit(field: LikelihoodField, points: Floats, window: Window) -> tuple[Floats, float]:
    """
    Return the pose of the window at which points fit best, and how well: 1 is perfect.

    :param points: shape (n, 2), in the frame of the pose, n > 0.
    """
    points = points[::-(-len(points) // _POINTS_MOST)]
    turns = np.arange(-_steps(window.reach_rad, window.step_rad),
                      _steps(window.reach_rad, window.step_rad) + 1) * window.step_rad
    reach = _steps(window.reach_m, field.cell_m * _COARSE)
    shifts = np.arange(-reach, reach + 1) * _COARSE
    cells = [field.cells_of(placed(window.centre + (0.0, 0.0, turn), points)) for turn in turns]
    bounds = np.stack([_fits(field.coarse(_COARSE), each, shifts, shifts) for each in cells])
    bounds -= _cost(window, np.maximum(np.abs(shifts) - _COARSE, 0) * field.cell_m, turns)
    best, found = -np.inf, (0, 0, 0)
    fine = np.arange(_COARSE)
    for place in np.argsort(bounds, axis=None)[::-1][:_CLOSER_MOST]:
        turn, row, column = np.unravel_index(place, bounds.shape)
        if bounds[turn, row, column] <= best:
            break
        across, up = shifts[column] + fine, shifts[row] + fine
        fits = _fits(field.values, cells[turn], across, up) - _plain_cost(
            window, across * field.cell_m, up * field.cell_m, float(turns[turn]))
        at = int(fits.argmax())
        if fits.flat[at] > best:
            best = float(fits.flat[at])
            found = (int(turn), int(across[at % _COARSE]), int(up[at // _COARSE]))
    pose = window.centre + (found[1] * field.cell_m, found[2] * field.cell_m, turns[found[0]])
    pose[2] = wrapped(pose[2])
    return pose, best


def _steps(reach: float, step: float) -> int:
    return max(1, round(reach / step))


def _fits(values: Likelihoods, cells: npt.NDArray[np.int64], across: npt.NDArray[np.int64],
          up: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """Return the mean value under the points for each shift; shape (up, across)."""
    rows, columns = values.shape
    x, y = cells[:, 0, None] + across, cells[:, 1, None] + up
    inside_x, inside_y = (x >= 0) & (x < columns), (y >= 0) & (y < rows)
    at = (np.where(inside_y, y, 0) * columns)[:, :, None] + np.where(inside_x, x, 0)[:, None, :]
    found = values.ravel()[at] * (inside_y[:, :, None] & inside_x[:, None, :])
    means: npt.NDArray[np.float64] = found.mean(0, dtype=np.float64)
    return means


def _plain_cost(window: Window, across_m: Any, up_m: Any, turn: float) -> Any:
    far = (across_m[None, :] ** 2 + up_m[:, None] ** 2) / window.sigma_m ** 2
    return window.weight * (far + (turn / window.sigma_rad) ** 2)


def _cost(window: Window, shifts_m: Any, turns: Any) -> Any:
    far = (shifts_m[None, :] ** 2 + shifts_m[:, None] ** 2) / window.sigma_m ** 2
    turned = np.maximum(np.abs(turns) - window.step_rad, 0.0) / window.sigma_rad
    return window.weight * (far[None] + (turned ** 2)[:, None, None])
