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
The room of the simulated world as a camera sees it: walls, floor, ceiling and people, drawn.

The line of sight of each column meets the walls of the map; nearer ones are larger and brighter.
Furniture is as high as the walls, because a map does not contain its height.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.devices.capture.lying_figure import Clothes
from rt_robot_os.devices.capture.lying_figure import Colour
from rt_robot_os.devices.capture.lying_figure import draw_lying
from rt_robot_os.devices.capture.lying_figure import Lying
from rt_robot_os.devices.capture.pattern import Pixels
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.walls import Walls

Floats = npt.NDArray[np.floating[Any]]

# Horizontal field of view of an uncalibrated camera.
FIELD_OF_VIEW_RAD: Final = math.radians(62.0)

_TILE_M: Final = 0.5
_STRIPE_M: Final = 0.25
_NEAREST_M: Final = 0.05
# Distance at which half of the light of an object is lost.
_DIM_M: Final = 9.0
_FULL_LUX: Final = 400.0
_DARKEST: Final = 0.12

_WALL: Final[Colour] = (222, 210, 188)
_FLOOR: Final[Colour] = (158, 116, 74)
_CEILING: Final[Colour] = (238, 238, 234)
_SKIN: Final[Colour] = (226, 178, 146)
_HAIR: Final[Colour] = (72, 48, 32)
_SHOES: Final[Colour] = (40, 36, 34)
_SHIRTS: Final[tuple[Colour, ...]] = ((196, 52, 48), (48, 92, 176), (52, 140, 84), (204, 150, 40))
_TROUSERS: Final[tuple[Colour, ...]] = ((44, 54, 86), (70, 66, 60), (96, 84, 64), (40, 44, 48))
_HEIGHT_M: Final = 1.75
# Highest point, height of the surface below, lying, direction.
_UPRIGHT: Final = (_HEIGHT_M, 0.0, 0.0, 0.0)


class RoomView:
    """
    Pictures of one size.

    :param width: in pixels.
    :param height: in pixels.
    :param k: the 9 numbers of the calibration; all 0 for an uncalibrated camera.
    :param fine: draw in detail, for a still, at several times the cost.
    """

    def __init__(self, width: int, height: int, k: tuple[float, ...] = (0.0,) * 9,
                 fine: bool = False) -> None:
        self._fine = fine
        self.width, self.height = width, height
        usual = width / 2 / math.tan(FIELD_OF_VIEW_RAD / 2)
        self._focal_x, self._focal_y = (k[0], k[4]) if k[0] else (usual, usual)
        self._centre_x, self._centre_y = (k[2], k[5]) if k[0] else (width / 2, height / 2)
        # Metres to the left and upwards per metre ahead.
        self._left = ((self._centre_x - np.arange(width) - 0.5) / self._focal_x)
        self._up = ((self._centre_y - np.arange(height) - 0.5) / self._focal_y)
        self._map = ''
        self._walls = Walls(np.empty((0, 4)))

    def picture(self, scene: Mapping[str, Any]) -> Pixels:
        """
        Draw a picture of red, green and blue bytes; equal scenes give equal bytes.

        :param scene: ``map`` (its path, or nothing), ``camera`` (x, y, height, yaw, and pitch,
            positive downwards), ``ceiling`` (height), ``lux``, ``people`` (x, y of each, and of
            those not standing upright: highest point, height of the surface below, 1 if lying,
            direction of the head).
        """
        if scene['map'] != self._map:
            self._map = scene['map']
            self._walls = Walls.of(GridMap.load(self._map))
        x, y, height_m, yaw, pitch = scene['camera']
        up = (self._up - math.tan(pitch)).astype(np.float32)
        light = _DARKEST + (1.0 - _DARKEST) * min(scene['lux'] / _FULL_LUX, 1.0) ** 0.5
        picture, ahead = self._room(x, y, yaw, up, height_m, scene['ceiling'], light)
        distances = [(self._seen_from(x, y, yaw, *person[:2]), index)
                     for index, person in enumerate(scene['people'])]
        for (away, left), index in sorted(distances, reverse=True):
            top_m, base_m, lies, heading = scene['people'][index][2:] or _UPRIGHT
            if lies:
                draw_lying(picture, Lying(away, left, heading - yaw, base_m - height_m),
                           _clothes(index), self._left, up, ahead,
                           light / (1.0 + max(away, 0.0) / _DIM_M), self._fine)
            elif away > 2 * _NEAREST_M:
                self._person(picture, away, left, index, up, height_m, ahead, light,
                             top_m / _HEIGHT_M)
        return picture

    # ---- the room ----------------------------------------------------------------------------

    def _room(self, x: float, y: float, yaw: float, up: Floats, height_m: float, ceiling_m: float,
              light: float) -> tuple[Pixels, Floats]:
        """Return the picture without people, and the distance ahead of the wall of each column."""
        angles = np.arctan(self._left) + yaw
        ranges = self._walls.cast(x, y, angles)
        ahead = np.maximum(ranges * np.cos(angles - yaw), _NEAREST_M).astype(np.float32)
        walls = self._wall_colours(x + ranges * np.cos(angles), y + ranges * np.sin(angles),
                                   ahead, light)
        picture: Pixels = np.empty((self.height, self.width, 3), np.uint8)
        # The first row below the horizon; above it is the ceiling.
        horizon = int(np.searchsorted(-up, 0.0))
        picture[:horizon] = self._plane(_CEILING, (ceiling_m - height_m) / np.maximum(
            up[:horizon], 1e-3), light)
        picture[horizon:] = self._floor(x, y, yaw, height_m / np.maximum(-up[horizon:], 1e-3),
                                        light)
        level = up[:, None] * ahead
        covered = (level < ceiling_m - height_m) & (level > -height_m)
        rows, columns = np.nonzero(covered)
        picture[rows, columns] = walls[columns]
        return picture, ahead

    def _wall_colours(self, x: Floats, y: Floats, ahead: Floats, light: float) -> Pixels:
        """Return the colour of each column: stripes, and walls that face the light brighter."""
        finite = np.isfinite(x)
        x, y = np.where(finite, x, 0.0), np.where(finite, y, 0.0)
        along_x, along_y = np.gradient(x), np.gradient(y)
        facing = 0.72 + 0.28 * np.abs(along_x) / np.maximum(np.hypot(along_x, along_y), 1e-9)
        stripe = 1.0 - 0.06 * (np.floor((x + y) / _STRIPE_M) % 2)
        shade = light * facing * stripe / (1.0 + ahead / _DIM_M)
        return _bytes(shade[:, None] * np.array(_WALL))

    @staticmethod
    def _plane(colour: Colour, away: Floats, light: float) -> Pixels:
        shade = light / (1.0 + away / _DIM_M)
        return _bytes(shade[:, None, None] * np.array(colour))

    def _floor(self, x: float, y: float, yaw: float, away: Floats, light: float) -> Pixels:
        """Return the rows below the horizon: tiles."""
        beside = away[:, None] * self._left.astype(np.float32)
        cosine, sine = np.float32(math.cos(yaw) / _TILE_M), np.float32(math.sin(yaw) / _TILE_M)
        across = np.floor(np.float32(x / _TILE_M) + cosine * away[:, None] - sine * beside)
        up = np.floor(np.float32(y / _TILE_M) + sine * away[:, None] + cosine * beside)
        dark = (across + up).astype(np.int64) & 1
        two = np.stack([self._plane(_FLOOR, away, light),
                        self._plane(_FLOOR, away, 0.84 * light)])[:, :, 0]
        tiles: Pixels = np.where(dark[:, :, None] == 1, two[1][:, None], two[0][:, None])
        return tiles

    # ---- people ------------------------------------------------------------------------------

    @staticmethod
    def _seen_from(x: float, y: float, yaw: float, there_x: float, there_y: float
                   ) -> tuple[float, float]:
        """Return the distance of a person ahead and to the left."""
        dx, dy = there_x - x, there_y - y
        cosine, sine = math.cos(yaw), math.sin(yaw)
        return cosine * dx + sine * dy, cosine * dy - sine * dx

    def _person(self, picture: Pixels, away: float, left: float, index: int, up: Floats,
                height_m: float, ahead: Floats, light: float, size: float) -> None:
        """Draw a figure over the picture, where no wall hides it."""
        beside = self._left * away - left
        columns = np.nonzero((np.abs(beside) < 0.35) & (ahead > away))[0]
        level = (up * away + height_m) / size
        rows = np.nonzero(np.abs(level - _HEIGHT_M / 2) < _HEIGHT_M / 2)[0]
        if not (columns.size and rows.size):
            return
        a, h = np.abs(beside[columns])[None, :], level[rows][:, None]
        head = (a / 0.10) ** 2 + ((h - 1.60) / 0.145) ** 2 < 1.0
        parts = (
            ((a > 0.015) & (a < 0.16) & (h < 0.88), _TROUSERS),
            ((a < 0.19) & (a > 0.01) & (h < 0.07), (_SHOES,)),
            ((a < 0.15 + 0.05 * (h - 0.85) / 0.6) & (h > 0.84) & (h < 1.46), _SHIRTS),
            ((a > 0.21) & (a < 0.28) & (h > 0.78) & (h < 1.42), _SHIRTS),
            ((a > 0.215) & (a < 0.275) & (h > 0.68) & (h <= 0.78), (_SKIN,)),
            ((a < 0.05) & (h >= 1.44) & (h < 1.50), (_SKIN,)),
            (head, (_SKIN,)),
            (head & (h > 1.655), (_HAIR,)),
        )
        shade = light / (1.0 + away / _DIM_M)
        for part, colours in parts:
            colour = [round(shade * value) for value in colours[index % len(colours)]]
            found_rows, found_columns = np.nonzero(np.broadcast_to(part, (rows.size,
                                                                          columns.size)))
            picture[rows[found_rows], columns[found_columns]] = colour


def _clothes(index: int) -> Clothes:
    return Clothes(_SHIRTS[index % len(_SHIRTS)], _TROUSERS[index % len(_TROUSERS)], _SKIN, _HAIR,
                   _SHOES)


def _bytes(colours: Floats) -> Pixels:
    found: Pixels = colours.clip(0, 255).astype(np.uint8)
    return found
