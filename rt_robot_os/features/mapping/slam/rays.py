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
The evidence of the beams of a scan for the cells of a grid: those they hit, those they passed.

Each cell gets one code a scan: a hit outranks a pass, and both outrank beams without an echo.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final
import zlib

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.scan import Surface
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import placed

Codes = npt.NDArray[np.uint8]
#: First row and column of a rectangle, and the row and column behind its last.
Box = tuple[int, int, int, int]

NOTHING: Final = 0
PASSED: Final = 1
HIT: Final = 2
#: Passed only by beams without an echo.
ECHOLESS: Final = 3

#: How far before the measured point the wall may start, in cells.
_BEFORE_END: Final = 0.5
#: Smallest sine of the angle between a beam and its wall.
_FLATTEST: Final = 0.1
#: Neighbours up to this distance belong to one wall, if the line between them is this flat on it.
_GAP_MOST_M: Final = 0.3
_ALONG: Final = 0.3
#: Speed before size: most codes are runs of nothing.
_PACKING: Final = 1


@dataclass(frozen=True)
class ScanFootprint:
    """
    The evidence of a scan for a rectangle of cells.

    :ivar row: of the lowest row of the rectangle, counted from y = 0 of the map;
    :ivar column: of its first column, counted from x = 0.
    :ivar codes: shape (rows, columns): ``NOTHING``, ``PASSED``, ``HIT`` or ``ECHOLESS``.
    """

    row: int
    column: int
    codes: Codes

    @property
    def box(self) -> Box:
        """Return its edges."""
        rows, columns = self.codes.shape
        return self.row, self.column, self.row + rows, self.column + columns


@dataclass(frozen=True)
class PackedScanFootprint:
    """A compressed footprint, a hundredth of its size."""

    box: Box
    packed: bytes

    @classmethod
    def of(cls, footprint: ScanFootprint) -> PackedScanFootprint:
        """Pack a footprint."""
        flat = footprint.codes.reshape(-1)
        bits = np.concatenate((np.packbits(flat & 1), np.packbits(flat >> 1)))
        return cls(footprint.box, zlib.compress(bits.tobytes(), _PACKING))

    def unpacked(self) -> ScanFootprint:
        """Return it as it was."""
        row, column, row_end, column_end = self.box
        shape = row_end - row, column_end - column
        bits = np.frombuffer(zlib.decompress(self.packed), np.uint8).reshape(2, -1)
        low, high = np.unpackbits(bits, axis=1, count=shape[0] * shape[1])
        return ScanFootprint(row, column, (low | high << 1).reshape(shape))


def footprint_of(pose: Floats, surface: Surface, cell_m: float, reach_m: float,
                 echoless_m: float) -> ScanFootprint:
    """
    Return the evidence of a scan for the cells round it.

    :param pose: shape (3,): of the laser on the map.
    :param cell_m: edge of a cell.
    :param reach_m: beams are drawn until there: the rectangle has a bounded size.
    :param echoless_m: length of free space along a beam without an echo.
    """
    start = pose[:2] / cell_m
    ends = placed(pose, surface.points) / cell_m
    length = np.hypot(*(ends - start).T)
    spare = _spare(surface)
    far = length * cell_m > reach_m
    hits = ends[~far]
    cut = start + (ends[far] - start) * (reach_m / cell_m / length[far])[:, None]
    bearings = surface.echoless + pose[2] if echoless_m > 0.0 else surface.echoless[:0]
    nothing = start + min(echoless_m, reach_m) / cell_m * np.stack(
        (np.cos(bearings), np.sin(bearings)), -1)
    every = np.concatenate((start[None], hits, cut, nothing))
    # A cell of border: a place may be rounded up.
    low, high = np.floor(every.min(0)) - 1.0, np.floor(every.max(0)) + 1.0
    columns, rows = (int(each) for each in high - low + 1.0)
    flat = np.zeros(rows * columns, np.uint8)
    beams = np.concatenate((hits, cut)) - low
    spare = np.concatenate((spare[~far], np.zeros(len(cut))))
    flat[_passed(start - low, nothing - low, np.zeros(len(nothing)), columns)] = ECHOLESS
    flat[_passed(start - low, beams, spare, columns)] = PASSED
    at = (np.concatenate((hits, _between(surface, ends, far, cell_m))) - low).astype(np.int64)
    flat[at[:, 1] * columns + at[:, 0]] = HIT
    return ScanFootprint(int(low[1]), int(low[0]), flat.reshape(rows, columns))


def _spare(surface: Surface) -> Floats:
    """Return how long before its end each beam comes near to its wall, in cells."""
    length = np.maximum(np.hypot(*surface.points.T), 1e-9)
    ahead = np.abs((surface.points * surface.normals).sum(1)) / length
    return np.where(surface.lined, _BEFORE_END / np.maximum(ahead, _FLATTEST), _BEFORE_END)


def _between(surface: Surface, ends: Floats, far: npt.NDArray[np.bool_], cell_m: float) -> Floats:
    """Return places on the lines between neighbours that lie on the same wall."""
    step = np.diff(surface.points, axis=0)
    apart = np.hypot(step[:, 0], step[:, 1])
    on = surface.lined & ~far
    same = on[1:] & on[:-1] & (apart > cell_m) & (apart < _GAP_MOST_M)
    for normals in (surface.normals[1:], surface.normals[:-1]):
        same &= np.abs((step * normals).sum(1)) < _ALONG * apart
    which = np.flatnonzero(same)
    count = (apart[which] / (0.7 * cell_m)).astype(np.int64)
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + 1
    part = (number / np.repeat(count + 1, count))[:, None]
    first = np.repeat(which, count)
    places: Floats = ends[first] * (1.0 - part) + ends[first + 1] * part
    return places


def _passed(start: Floats, ends: Floats, spare: Floats, columns: int) -> npt.NDArray[np.int32]:
    """
    Return the cells on the ray to each end, some several times.

    :param start: in cells; never below 0, as ends.
    :param spare: shape (ends,): length before the end without evidence, in cells.
    """
    reach = ends - start
    length = np.hypot(reach[:, 0], reach[:, 1])
    # One point for each column or row on the ray, in the middle of its step.
    steps = np.ceil(np.abs(reach).max(1, initial=0.0))
    size = np.divide(1.0, steps, out=np.zeros_like(steps), where=steps > 0.0)
    part = 1.0 - np.divide(spare, length, out=np.ones_like(length), where=length > 0.0)
    count = np.maximum(np.ceil(steps * part - 0.5), 0.0).astype(np.int32)
    number = np.arange(count.sum(), dtype=np.int32)
    number -= np.repeat(np.cumsum(count, dtype=np.int32) - count, count)
    place = number.astype(np.float32)
    place += np.float32(0.5)
    along = (reach * size[:, None]).astype(np.float32)
    x = (place * np.repeat(along[:, 0], count) + np.float32(start[0])).astype(np.int32)
    cells: npt.NDArray[np.int32] = (
        place * np.repeat(along[:, 1], count) + np.float32(start[1])).astype(np.int32)
    cells *= np.int32(columns)
    cells += x
    return cells
