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
Find the best match of a scan in a window by exhaustive search: Olson's correlative matching.

E. Olson, Real-time correlative scan matching, ICRA 2009: a coarse grid bounds the score of a fine
one, so that most of the window is never evaluated finely.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any
from typing import Final
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.likelihood import LikelihoodField
from rt_robot_os.features.mapping.slam.likelihood import POINTS_MOST
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import wrapped

Result = TypeVar('Result')

_COARSE: Final = 4
#: Coarse cells that are evaluated finely at most, and how many in the first batch; each batch is
#: twice as large as the one before.
_CLOSER_MOST: Final = 400
_AT_ONCE: Final = 8
#: Matches nearer to each other are one.
_APART_M: Final = 0.5
#: Values that are added up in one piece.
_PIECE: Final = 3_000_000


@dataclass(frozen=True)
class SearchWindow:
    """
    The poses to search.

    :ivar centre: shape (3,): the pose that is expected.
    :ivar reach_m: to each side.
    :ivar reach_rad: in both directions.
    :ivar sigma_m: expected distance of a match from the centre; further away it must score
        higher. inf: no difference.
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


def best_fit(field: LikelihoodField, points: Floats, window: SearchWindow) -> tuple[Floats, float]:
    """
    Return the pose of the window at which points fit best, and how well: 1 is perfect.

    :param points: shape (n, 2), in the frame of the pose, n > 0.
    """
    return finished(fitting(field, points, window))


def finished(work: Generator[None, None, Result]) -> Result:
    """Run a generator to its end, and return its result."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            result: Result = end.value
            return result


def fitting(field: LikelihoodField, points: Floats, window: SearchWindow
            ) -> Generator[None, None, tuple[Floats, float]]:
    """Do as :func:`best_fit`, in pieces of some milliseconds."""
    found = yield from fittings(field, points, window, 1)
    return found[0]


def fittings(field: LikelihoodField, points: Floats, window: SearchWindow, count: int
             ) -> Generator[None, None, list[tuple[Floats, float]]]:
    """
    Do as :func:`fitting`, for the best matches that are some distance apart.

    :param count: the most.
    :return: the best first, at least one.
    """
    # A subset, spread evenly: more points add nothing.
    points = points[::-(-len(points) // POINTS_MOST)]
    reach_turn = _steps(window.reach_rad, window.step_rad)
    turns = np.linspace(-reach_turn, reach_turn, 2 * reach_turn + 1) * window.step_rad
    reach = _steps(window.reach_m, field.cell_m * _COARSE)
    shifts = np.arange(-reach, reach + 1) * _COARSE
    cells = field.cells_of(_turned(points, window.centre, turns))
    parts, some = [], max(1, _PIECE // (len(points) * (2 * reach + 1) ** 2))
    for begin in range(0, len(cells), some):
        parts.append(field.coarse_means(cells[begin:begin + some], reach, _COARSE))
        yield
    bounds = np.concatenate(parts)
    bounds -= _cost(window, np.maximum(np.abs(shifts) - _COARSE, 0) * field.cell_m, turns)
    yield
    fits: list[tuple[Floats, float]] = []
    apart = round(_APART_M / field.cell_m)
    while len(fits) < count:
        found, best = _closest(field, window, cells, bounds, shifts, turns)
        if not fits or np.isfinite(best):
            pose = window.centre + (found[1] * field.cell_m, found[2] * field.cell_m,
                                    turns[found[0]])
            pose[2] = wrapped(pose[2])
            fits.append((pose, best))
        yield
        near = np.abs(shifts - found[1])[None, :] < apart
        bounds[:, near & (np.abs(shifts - found[2])[:, None] < apart)] = -np.inf
        if not np.isfinite(bounds).any():
            break
    return fits


def _closest(field: LikelihoodField, window: SearchWindow, cells: Any, bounds: Any, shifts: Any,
             turns: Any) -> tuple[tuple[int, int, int], float]:
    """Evaluate finely where bounds are best; return turn and shifts of the best, and its score."""
    best, found = -np.inf, (0, 0, 0)
    fine = np.arange(_COARSE)
    order = _best_first(bounds)
    begin, count = 0, _AT_ONCE
    while begin < len(order) and bounds.flat[order[begin]] > best:
        places = order[begin:begin + count]
        begin, count = begin + count, 2 * count
        turn, row, column = np.unravel_index(places, bounds.shape)
        fits = field.means(cells[turn], shifts[column], shifts[row], _COARSE)
        fits -= _plain_cost(window, (shifts[column, None] + fine) * field.cell_m,
                            (shifts[row, None] + fine) * field.cell_m, turns[turn])
        at = int(fits.argmax())
        if fits.flat[at] > best:
            best = float(fits.flat[at])
            which, up, across = np.unravel_index(at, fits.shape)
            found = (int(turn[which]), int(shifts[column[which]] + across),
                     int(shifts[row[which]] + up))
    return found, best


def _steps(reach: float, step: float) -> int:
    return max(1, round(reach / step))


def _turned(points: Floats, centre: Floats, turns: Floats) -> Floats:
    """Return points turned by each angle; shape (turns, points, 2)."""
    cosine, sine = np.cos(centre[2] + turns)[:, None], np.sin(centre[2] + turns)[:, None]
    return np.stack((cosine * points[:, 0] - sine * points[:, 1] + centre[0],
                     sine * points[:, 0] + cosine * points[:, 1] + centre[1]), -1)


def _best_first(bounds: npt.NDArray[np.float32]) -> npt.NDArray[np.int64]:
    """Return the coarse cells to evaluate finely, the best first."""
    flat = bounds.ravel()
    some: npt.NDArray[np.int64] = np.arange(len(flat))
    if len(flat) > _CLOSER_MOST:
        some = np.argpartition(flat, len(flat) - _CLOSER_MOST)[-_CLOSER_MOST:]
    return some[np.argsort(-flat[some], kind='stable')]


def _plain_cost(window: SearchWindow, across_m: Any, up_m: Any, turns: Any) -> Any:
    far = (across_m[:, None, :] ** 2 + up_m[:, :, None] ** 2) / window.sigma_m ** 2
    return window.weight * (far + (turns[:, None, None] / window.sigma_rad) ** 2)


def _cost(window: SearchWindow, shifts_m: Any, turns: Any) -> Any:
    far = (shifts_m[None, :] ** 2 + shifts_m[:, None] ** 2) / window.sigma_m ** 2
    turned = np.maximum(np.abs(turns) - window.step_rad, 0.0) / window.sigma_rad
    return window.weight * (far[None] + (turned ** 2)[:, None, None])
