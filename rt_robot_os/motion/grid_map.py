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
Grid maps of ROS, with occupied, free and unknown cells: look-ups and files.

The values are those of ``nav_msgs/msg/OccupancyGrid``. The files are those that map_server reads
and map_saver writes: a YAML file and a picture (PGM).
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import replace
from functools import cached_property
import math
import os
from pathlib import Path
import stat
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.motion.map_file import MapFile
from rt_robot_os.motion.map_file import MODES
from rt_robot_os.motion.map_file import read_map_file
from rt_robot_os.motion.map_picture import MapPicture
from rt_robot_os.motion.map_picture import read_picture
from rt_robot_os.motion.map_picture import write_picture
from rt_robot_os.motion.pgm import MOST_PIXELS

UNKNOWN: Final = -1
FREE: Final = 0
OCCUPIED: Final = 100

# The greys of map_saver.
_GREY_OCCUPIED: Final = 0
_GREY_UNKNOWN: Final = 205
_GREY_FREE: Final = 254
_RAW_UNKNOWN: Final = 255
_WHITE: Final = 255

_LONGEST_YAML: Final = 1 << 16
_LONGEST_PICTURE: Final = 5 * MOST_PIXELS

Cells = npt.NDArray[np.int8]
Mask = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.intp]
Coordinates = npt.NDArray[np.float64]
Origin = tuple[float, float, float]
_NOTHING: Final[Cells] = np.zeros((1, 1), np.int8)


@dataclass(frozen=True, eq=False)
class GridMap:
    """
    An immutable map of square cells.

    Single look-ups (:meth:`cell`, :meth:`value`, :meth:`occupied`, :meth:`free`) are plain floats
    and safe in the real-time loop.

    :ivar cells: of shape (rows, columns), read-only: -1 unknown, 0 free, to 100 occupied. Row 0 is
        the lowest y and column 0 the lowest x, as in ``nav_msgs/msg/OccupancyGrid``.
    :ivar resolution_m: edge of a cell.
    :ivar origin: x and y in m of the outer corner of cell (0, 0) in the frame of the map, and the
        yaw in rad by which the rows are turned against its x axis.
    :ivar path: the YAML file from which it was read.
    """

    cells: Cells
    resolution_m: float
    origin: Origin = (0.0, 0.0, 0.0)
    path: Path | None = None

    def __post_init__(self) -> None:
        given = np.asarray(self.cells)
        if given.ndim != 2 or not given.size:
            raise ConfigError([f'a map of shape {given.shape}: it must have rows and columns'])
        if given.min() < UNKNOWN or given.max() > OCCUPIED:
            raise ConfigError([f'a map with values from {given.min()} to {given.max()}: they must '
                               f'be from {UNKNOWN} (unknown) to {OCCUPIED} (occupied)'])
        numbers = (self.resolution_m, *self.origin)
        if not all(map(math.isfinite, numbers)) or self.resolution_m <= 0.0:
            raise ConfigError([f'a map with cells of {self.resolution_m} m at {self.origin}: '
                               'all must be finite, and cells above 0'])
        cells = given.astype(np.int8)  # a copy: the caller may change its own
        cells.flags.writeable = False
        object.__setattr__(self, 'cells', cells)

    @classmethod
    def owning(cls, cells: Cells, resolution_m: float, origin: Origin) -> GridMap:
        """
        Make a map of cells that are not shared, without checks; it takes some us.

        :param cells: of shape (rows, columns), each from -1 to 100, and not empty.
        :raises ConfigError: the resolution or the origin is invalid.
        """
        made = cls(_NOTHING, resolution_m, origin)
        cells.flags.writeable = False
        object.__setattr__(made, 'cells', cells)
        return made

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> GridMap:
        """
        Read a map, as map_server does.

        :param path: of the YAML file.
        :raises ConfigError: with every problem, each with the file and, where there is one, the
            line.
        """
        file = Path(path)
        text = _bytes_of(file, _LONGEST_YAML)
        try:
            described = read_map_file(text.decode('utf-8-sig'), file)
        except UnicodeDecodeError as error:
            raise ConfigError([f'{file}: not UTF-8: byte 0x{text[error.start]:02x}']) from None
        try:
            picture = read_picture(_bytes_of(described.image, _LONGEST_PICTURE), described.mode)
        except ValueError as error:
            if isinstance(error, ConfigError):
                raise
            raise ConfigError([f'{described.image}: {error}']) from None
        return cls(np.flipud(_values_of(picture, described)), described.resolution_m,
                   described.origin, file)

    def save(self, path: str | os.PathLike[str], mode: str = 'trinary',
             suffix: str = '.pgm') -> None:
        """
        Write the map as a YAML file and a picture of the same name.

        :param path: of the YAML file.
        :param mode: ``trinary`` as map_saver writes it: values from 1 to 99 become unknown, unless
            a threshold says what they are; ``raw`` keeps every value.
        :param suffix: of the picture: ``.pgm``, or ``.png``, which needs Pillow.
        :raises ConfigError: the mode cannot be written, as ``scale`` has no grey for unknown; the
            format of the picture is unknown, or Pillow is missing.
        :raises OSError: a file cannot be written.
        """
        file = Path(path)
        image = file.with_suffix(suffix)
        try:
            text, pixels = self.files(image.name, mode)
        except ConfigError as error:
            raise ConfigError([f'{file}: {error}']) from None
        _replace(image, pixels)
        _replace(file, text)

    def files(self, image: str, mode: str = 'trinary') -> tuple[bytes, bytes]:
        """
        Return the bytes of the YAML file and of the picture.

        :param image: name of the picture, as the YAML file gives it; it ends with ``.pgm`` or
            ``.png``.
        :param mode: as in :meth:`save`.
        :raises ConfigError: the mode or the format of the picture cannot be written.
        """
        if mode not in MODES or mode == 'scale':
            raise ConfigError([f'a map cannot be written with mode {mode!r}: use trinary or raw'])
        described = MapFile(Path(image), self.resolution_m, self.origin, mode=mode)
        try:
            pixels = write_picture(np.flipud(_grey_of(self.cells, described)), Path(image).suffix)
        except ValueError as error:
            raise ConfigError([f'{image}: {error}']) from None
        return described.text().encode(), pixels

    def trinary(self) -> GridMap:
        """Return the map as it is after saving and loading: free, occupied or unknown."""
        described = MapFile(Path(), self.resolution_m, self.origin)
        grey = _grey_of(self.cells, described).astype(np.uint16)
        return replace(self, cells=_values_of(MapPicture(grey, _WHITE), described))

    # ---- size and place ----------------------------------------------------------------------

    @property
    def rows(self) -> int:
        """Return how many cells it has along y."""
        return int(self.cells.shape[0])

    @property
    def columns(self) -> int:
        """Return how many cells it has along x."""
        return int(self.cells.shape[1])

    @property
    def size_m(self) -> tuple[float, float]:
        """Return its lengths along its own x and y."""
        return self.columns * self.resolution_m, self.rows * self.resolution_m

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Return the lowest x, the lowest y, the highest x and the highest y of its corners."""
        width, height = self.size_m
        corners = [self.point(x, y) for x in (0.0, width) for y in (0.0, height)]
        xs, ys = [x for x, _ in corners], [y for _, y in corners]
        return min(xs), min(ys), max(xs), max(ys)

    @cached_property
    def _turn(self) -> tuple[float, float, float, float]:
        x, y, yaw = self.origin
        return x, y, math.cos(yaw), math.sin(yaw)

    def point(self, along_m: float, across_m: float) -> tuple[float, float]:
        """Return the point at distances from the origin along rows and columns."""
        x, y, cosine, sine = self._turn
        return x + cosine * along_m - sine * across_m, y + sine * along_m + cosine * across_m

    def along(self, x: float, y: float) -> tuple[float, float]:
        """Return how far a point is from the origin along rows and columns, in m."""
        x0, y0, cosine, sine = self._turn
        dx, dy = x - x0, y - y0
        return cosine * dx + sine * dy, cosine * dy - sine * dx

    def centre(self, row: int, column: int) -> tuple[float, float]:
        """Return the middle of a cell, in m; it need not be on the map."""
        return self.point((column + 0.5) * self.resolution_m, (row + 0.5) * self.resolution_m)

    # ---- single look-ups ---------------------------------------------------------------------

    def cell(self, x: float, y: float) -> tuple[int, int] | None:
        """
        Return row and column of the cell at a point; safe in the real-time loop.

        :return: None when the point is not on the map, or not a number.
        """
        x0, y0, cosine, sine = self._turn
        dx, dy = x - x0, y - y0
        column = (cosine * dx + sine * dy) / self.resolution_m
        row = (cosine * dy - sine * dx) / self.resolution_m
        if not (0.0 <= column < self.columns and 0.0 <= row < self.rows):
            return None
        return int(row), int(column)

    def value(self, x: float, y: float) -> int:
        """Return the value at a point, -1 beyond the map; safe in the real-time loop."""
        found = self.cell(x, y)
        return UNKNOWN if found is None else self.cells.item(*found)

    def occupied(self, x: float, y: float, least: int = 50) -> bool:
        """
        Return whether a point is occupied; False beyond the map or on unknown cells.

        Safe in the real-time loop.

        :param least: the smallest value that counts as occupied.
        """
        return self.value(x, y) >= least

    def free(self, x: float, y: float, most: int = 49) -> bool:
        """
        Return whether a point is known to be free; safe in the real-time loop.

        :param most: the largest value that counts as free.
        """
        return FREE <= self.value(x, y) <= most

    # ---- arrays ------------------------------------------------------------------------------

    def occupied_mask(self, least: int = 50) -> Mask:
        """Return which cells are occupied, of shape (rows, columns)."""
        return np.asarray(self.cells >= least)

    def unknown_mask(self) -> Mask:
        """Return which cells are unknown, of shape (rows, columns)."""
        return np.asarray(self.cells == UNKNOWN)

    def indices(self, x: Coordinates, y: Coordinates) -> tuple[Indices, Indices, Mask]:
        """
        Find the cells at many points.

        :param x: in m, of any shape.
        :param y: in m, of the same shape.
        :return: rows, columns, and which points are on the map; the others have row and column 0.
        """
        x0, y0, cosine, sine = self._turn
        dx, dy = np.asarray(x) - x0, np.asarray(y) - y0
        with np.errstate(invalid='ignore', over='ignore'):  # such a point is off the map
            across = (cosine * dx + sine * dy) / self.resolution_m
            up = (cosine * dy - sine * dx) / self.resolution_m
        inside = (across >= 0.0) & (across < self.columns) & (up >= 0.0) & (up < self.rows)
        return (np.where(inside, up, 0.0).astype(np.intp),
                np.where(inside, across, 0.0).astype(np.intp), inside)

    def values(self, x: Coordinates, y: Coordinates) -> Cells:
        """Return the values at many points, -1 beyond the map."""
        rows, columns, inside = self.indices(x, y)
        return np.where(inside, self.cells[rows, columns], np.int8(UNKNOWN))

    def centres(self) -> tuple[Coordinates, Coordinates]:
        """Return x and y of the middles of all cells, each of shape (rows, columns)."""
        x0, y0, cosine, sine = self._turn
        along = (np.arange(self.columns) + 0.5) * self.resolution_m
        across = ((np.arange(self.rows) + 0.5) * self.resolution_m)[:, None]
        return (x0 + cosine * along - sine * across, y0 + sine * along + cosine * across)


def _replace(path: Path, data: bytes) -> None:
    """Write a file atomically."""
    made = path.with_name(f'.{path.name}.new')
    try:
        made.write_bytes(data)
        made.replace(path)
    finally:
        made.unlink(missing_ok=True)


def _bytes_of(path: Path, longest: int) -> bytes:
    """
    Read a file of unknown kind.

    :raises ConfigError: it is missing, not a regular file, or absurdly long.
    """
    try:
        about = path.stat()
        if not stat.S_ISREG(about.st_mode):  # a read of a pipe would block
            raise ConfigError([f'{path}: is not a file'])
        if about.st_size > longest:
            raise ConfigError([f'{path}: {about.st_size} bytes are more than {longest}'])
        return path.read_bytes()
    except OSError as error:
        raise ConfigError([f'{path}: cannot be read: {error.strerror}']) from None


def _values_of(picture: MapPicture, described: MapFile) -> Cells:
    """Turn greys into values; one look-up a pixel, for there are few greys."""
    shade = np.arange(picture.highest + 1) / picture.highest
    if described.mode == 'raw':
        raw = np.rint(shade * 255.0)
        table = np.where(raw <= OCCUPIED, raw, UNKNOWN)
    else:
        black = shade if described.negate else 1.0 - shade
        above, below = described.occupied_thresh, described.free_thresh
        between: npt.NDArray[np.float64] = np.full(black.shape, float(UNKNOWN))
        if described.mode == 'scale' and above > below:
            between = np.rint((black - below) / (above - below) * OCCUPIED)
        table = np.where(black > above, OCCUPIED, np.where(black < below, FREE, between))
    values: Cells = table.astype(np.int8)[picture.grey]
    if picture.unknown is not None:
        values[picture.unknown] = UNKNOWN
    return values


def _grey_of(cells: Cells, described: MapFile) -> npt.NDArray[np.uint8]:
    """Turn values into greys; one look-up a cell, for there are few values."""
    values = np.arange(UNKNOWN, OCCUPIED + 1)
    if described.mode == 'raw':
        grey = np.where(values == UNKNOWN, _RAW_UNKNOWN, values)
    else:
        # map_saver rounds the thresholds to integers: 20 is free, though above 0.196.
        occupied, free = (round(each * OCCUPIED) for each in (
            described.occupied_thresh, described.free_thresh))
        grey = np.where(values >= occupied, _GREY_OCCUPIED, np.where(
            (values >= FREE) & (values <= free), _GREY_FREE, _GREY_UNKNOWN))
    # Unknown, -1, is the last item of the table.
    return np.roll(grey, UNKNOWN).astype(np.uint8)[cells]
