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
The description of a ROS map: the YAML file of the picture.

Source: the keys and the rules of map_server and map_saver (nav2_map_server), which all maps of
ROS 1 and ROS 2 follow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError

MODES: Final = ('trinary', 'scale', 'raw')

# The longest edge of a cell and the farthest origin that make sense.
_LARGEST_CELL_M: Final = 1000.0
_FARTHEST_M: Final = 1e7
_WORDS: Final = {'0': False, '1': True, 'false': False, 'true': True, 'no': False, 'yes': True}


@dataclass(frozen=True)
class MapFile:
    """
    The content of the YAML file of a map.

    :ivar image: the picture; a relative path is relative to the folder of the YAML file.
    :ivar resolution_m: edge of a cell.
    :ivar origin: x and y in m of the lower left corner of the picture in the frame of the map, and
        the yaw in rad by which the picture is turned about that corner.
    :ivar occupied_thresh: above this share of black a cell is occupied.
    :ivar free_thresh: below it a cell is free.
    :ivar negate: white is occupied.
    :ivar mode: ``trinary`` (free, occupied or unknown), ``scale`` (values between the thresholds
        as well) or ``raw`` (the pixel is the value).
    """

    image: Path
    resolution_m: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    occupied_thresh: float = 0.65
    free_thresh: float = 0.196
    negate: bool = False
    mode: str = 'trinary'

    def text(self) -> str:
        """Return it as YAML; numbers are preserved exactly."""
        x, y, yaw = self.origin
        return (f'image: {_quoted(str(self.image))}\nmode: {self.mode}\n'
                f'resolution: {self.resolution_m!r}\norigin: [{x!r}, {y!r}, {yaw!r}]\n'
                f'negate: {int(self.negate)}\noccupied_thresh: {self.occupied_thresh!r}\n'
                f'free_thresh: {self.free_thresh!r}\n')


def read_map_file(text: str, path: Path) -> MapFile:
    """
    Read the YAML file of a map.

    :param path: of the file; for the errors and for a relative image.
    :raises ConfigError: with all problems, each with file and line.
    """
    reader = _MapFileReader(text, path)
    image = reader.take('image', _text_of)
    values: dict[str, Any] = {
        'resolution_m': reader.take('resolution', _resolution),
        'origin': reader.take('origin', _origin),
        'negate': reader.take('negate', _negate, False),
        'mode': reader.take('mode', _mode, 'trinary'),
        'occupied_thresh': reader.take('occupied_thresh', _threshold),
        'free_thresh': reader.take('free_thresh', _threshold),
    }
    reader.raise_any()
    if values['free_thresh'] > values['occupied_thresh']:
        reader.problem('free_thresh', f'{values["free_thresh"]:g} must not be above '
                       f'occupied_thresh, {values["occupied_thresh"]:g}')
        reader.raise_any()
    return MapFile(image=path.parent / image, **values)


class _MapFileReader:
    """The keys of the file, and their problems."""

    def __init__(self, text: str, path: Path) -> None:
        self._path = path
        self._problems: list[str] = []
        self._nodes: dict[str, Any] = {}
        self._lines: dict[str, int] = {}
        root = self._compose(text)
        if root is None or root.id != 'mapping':
            raise ConfigError([f'{path}: is not a map: it must have the keys image, resolution, '
                               'origin, negate, occupied_thresh and free_thresh'])
        for key, value in root.value:
            name = str(key.value)
            if name in self._nodes:
                self._add(key.start_mark.line + 1, f'{name} is there twice: delete one')
            self._nodes[name] = value
            self._lines[name] = key.start_mark.line + 1

    def _compose(self, text: str) -> Any:
        # Imported late: look-ups of cells need no YAML.
        import yaml
        try:
            return yaml.compose(text, Loader=yaml.SafeLoader)
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            line = f':{mark.line + 1}' if mark is not None else ''
            raise ConfigError([f'{self._path}{line}: not YAML: {error.problem}']) from None
        except (yaml.YAMLError, RecursionError, ValueError) as error:
            raise ConfigError([f'{self._path}: not YAML: {error}']) from None

    def take(self, key: str, convert: Callable[[Any], Any], default: Any = None) -> Any:
        """Return the value of a key; None after a problem, or the default when it is absent."""
        node = self._nodes.get(key)
        if node is None:
            if default is None:
                self._add(0, f'{key} is missing')
            return default
        try:
            return convert(node)
        except ValueError as error:
            self.problem(key, str(error))
            return None

    def problem(self, key: str, text: str) -> None:
        self._add(self._lines[key], f'{key}: {text}')

    def _add(self, line: int, text: str) -> None:
        place = f'{self._path}:{line}' if line else str(self._path)
        self._problems.append(f'{place}: {text}')

    def raise_any(self) -> None:
        if self._problems:
            raise ConfigError(self._problems)


def _text_of(node: Any) -> str:
    if node.id != 'scalar' or not node.value:
        raise ValueError('must be the name of a picture: PGM, PNG or BMP')
    if '\0' in node.value:
        raise ValueError('a path cannot contain a null character')
    return str(node.value)


def _number(node: Any) -> float:
    try:
        value = float(node.value)
    except (TypeError, ValueError):
        value = math.nan
    if node.id != 'scalar' or not math.isfinite(value):
        raise ValueError(f'{_shown(node)} must be a number')
    return value


def _resolution(node: Any) -> float:
    value = _number(node)
    if not 0.0 < value <= _LARGEST_CELL_M:
        raise ValueError(f'{value:g} must be the edge of a cell in m, above 0')
    return value


def _origin(node: Any) -> tuple[float, float, float]:
    if node.id != 'sequence' or len(node.value) != 3:
        raise ValueError('must be a list of three numbers: x and y in m, yaw in rad')
    x, y, yaw = (_number(each) for each in node.value)
    if max(abs(x), abs(y)) > _FARTHEST_M:
        raise ValueError(f'{x:g}, {y:g} is farther than {_FARTHEST_M:g} m away')
    return x, y, yaw


def _threshold(node: Any) -> float:
    value = _number(node)
    if not 0.0 <= value <= 1.0:
        raise ValueError(f'{value:g} must be from 0 to 1')
    return value


def _negate(node: Any) -> bool:
    word = node.value.lower() if node.id == 'scalar' else ''
    if word not in _WORDS:
        raise ValueError(f'{_shown(node)} must be 0 or 1')
    return _WORDS[word]


def _mode(node: Any) -> str:
    mode = str(node.value).lower() if node.id == 'scalar' else ''
    if mode not in MODES:
        raise ValueError(f'{_shown(node)} must be one of {", ".join(MODES)}')
    return mode


def _shown(node: Any) -> str:
    return repr(node.value[:40]) if node.id == 'scalar' else f'a {node.id}'


def _quoted(text: str) -> str:
    return "'" + text.replace("'", "''") + "'"
