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
A lying person in the view of a camera: slices of a body, from the lowest to the highest.

Each line of sight meets each slice in one point, which belongs to the body or not.
"""

from __future__ import annotations

import math
from typing import Any
from typing import Final
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rt_robot_os.devices.capture.pattern import Pixels

Floats = npt.NDArray[np.floating[Any]]
Colour = tuple[int, int, int]

# A lying body is about 0.25 m high; slices much farther apart than the rows of the picture would
# be visible.
_LOWEST_M: Final = 0.01
_HIGHEST_M: Final = 0.244
_SLICES: Final = 14
_ROWS_OF_A_SLICE: Final = 12
_MIDDLE_M: Final = 0.12
_NEAREST_M: Final = 0.15
_HALF_M: Final = 0.9
_BESIDE_M: Final = 0.32
_CELL_M: Final = 0.01


class Lying(NamedTuple):
    """
    A lying person, relative to the camera.

    :ivar ahead_m: from the camera to the middle of the body.
    :ivar left_m: the same to the left.
    :ivar heading_rad: from the feet to the head; 0 is away from the camera.
    :ivar floor_m: height of the surface below the person, above the camera.
    """

    ahead_m: float
    left_m: float
    heading_rad: float
    floor_m: float


class Clothes(NamedTuple):
    """The colours of somebody."""

    shirt: Colour
    trousers: Colour
    skin: Colour
    hair: Colour
    shoes: Colour


def draw_lying(picture: Pixels, lying: Lying, clothes: Clothes, left: Floats, up: Floats,
               walls: Floats, shade: float, fine: bool = False) -> None:
    """
    Draw a person over a picture, where no wall hides them.

    :param left: of each column, metres to the left per metre ahead.
    :param up: of each row, metres upwards per metre ahead.
    :param walls: distance ahead of the wall of each column, in m.
    :param shade: applies the light to a colour.
    :param fine: as many slices as the resolution needs, which is slow.
    """
    cosine, sine = math.cos(lying.heading_rad), math.sin(lying.heading_rad)
    colours = np.array([[round(shade * value) for value in colour] for colour in (
        _NOTHING, *clothes)], np.uint8)
    slices = max(_SLICES, picture.shape[0] // _ROWS_OF_A_SLICE) if fine else _SLICES
    for slice_m in np.linspace(_LOWEST_M, _HIGHEST_M, slices).tolist():
        with np.errstate(divide='ignore'):
            away = (lying.floor_m + slice_m) / up
        rows = np.nonzero((away > _NEAREST_M) & (np.abs(away - lying.ahead_m) < _HALF_M))[0]
        if not rows.size:
            continue
        ahead = away[rows][:, None]
        columns = np.nonzero(np.abs(left * lying.ahead_m - lying.left_m) < 2 * _HALF_M)[0]
        beside = ahead * left[columns][None, :] - lying.left_m
        # A round body: widest in the middle of its height.
        width = math.sqrt(1.0 - ((slice_m - _MIDDLE_M) / 0.15) ** 2)
        along = (ahead - lying.ahead_m) * cosine + beside * sine
        across = (beside * cosine - (ahead - lying.ahead_m) * sine) / width
        part = _BODY[_cells(along, _HALF_M, _BODY.shape[0]),
                     _cells(np.abs(across), 0.0, _BODY.shape[1])]
        found_rows, found = np.nonzero((part > 0) & (ahead < walls[columns][None, :]))
        picture[rows[found_rows], columns[found]] = colours[part[found_rows, found]]


def _cells(place: Floats, first_m: float, count: int) -> Any:
    """Return the cells of the body's plan; positions outside are in the last, which is empty."""
    cells = ((place + first_m) / _CELL_M).astype(np.int16)
    return np.where((cells < 0) | (cells >= count), count - 1, cells)


def _plan() -> npt.NDArray[np.uint8]:
    """Return the index of the part of ``Clothes`` in each cell, from 1: along and across."""
    along = (np.arange(round(2 * _HALF_M / _CELL_M)) + 0.5)[:, None] * _CELL_M - _HALF_M
    across = (np.arange(round(_BESIDE_M / _CELL_M)) + 0.5)[None, :] * _CELL_M
    head = ((along - 0.72) / 0.145) ** 2 + (across / 0.10) ** 2 < 1.0
    shirt, trousers, skin, hair, shoes = range(1, 6)
    plan: npt.NDArray[np.uint8] = np.zeros((along.size, across.size), np.uint8)
    for part, number in (
            ((along > -0.87) & (along < 0.02) & (across > 0.015) & (across < 0.17), trousers),
            ((along > -0.88) & (along < -0.78) & (across > 0.01) & (across < 0.15), shoes),
            ((along > -0.03) & (along < 0.58) & (across < 0.21), shirt),
            ((along > 0.0) & (along < 0.55) & (across > 0.23) & (across < 0.30), shirt),
            ((along > -0.1) & (along <= 0.0) & (across > 0.235) & (across < 0.295), skin),
            ((along >= 0.56) & (along < 0.63) & (across < 0.05), skin),
            (head, skin), (head & (along > 0.76), hair)):
        plan[part] = number
    return plan


_NOTHING: Final[Colour] = (0, 0, 0)
_BODY: Final = _plan()
