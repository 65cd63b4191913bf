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
Calibration of a vector sensor: offset and scale of each axis, then the mounting.

``corrected = turn(scale * (measured - offset))``: offset and scale belong to the axes of the
sensor; ``axes`` maps them to x, y and z of the frame, such as ``-y x z``. A calibration is a part
of the device's settings, so its file is a parameter file that overrides the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
import math
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.linux.folders import read_file

Vector = tuple[float, float, float]

IDENTITY_AXES: Final = 'x y z'
_LETTERS: Final = 'xyz'


@dataclass(frozen=True)
class AxisMap:
    """
    How a sensor is mounted: a rotation by right angles.

    :ivar axes: for each axis of the frame, the index of the sensor's axis.
    :ivar signs: for each axis of the frame, 1.0 or -1.0.
    """

    axes: tuple[int, int, int] = (0, 1, 2)
    signs: Vector = (1.0, 1.0, 1.0)

    @classmethod
    def parse(cls, text: str) -> AxisMap:
        """
        Read text such as ``-y x z``: the frame's x is minus the sensor's y, and so on.

        :raises ConfigError: not each axis once, or a mirror image.
        """
        words = text.split()
        letters = [word.lstrip('+-') for word in words]
        plain = all(len(word) - len(letter) <= 1 for word, letter in zip(words, letters))
        if sorted(letters) != list(_LETTERS) or not plain:
            raise ConfigError([f'{text!r}: name each of x, y, z once, with - where it is '
                               'inverted, such as "-y x z"'])
        found = cls((_LETTERS.index(letters[0]), _LETTERS.index(letters[1]),
                     _LETTERS.index(letters[2])),
                    (_sign(words[0]), _sign(words[1]), _sign(words[2])))
        if found.determinant() < 0:
            raise ConfigError([f'{text!r} is a mirror image, which is not a possible mounting: '
                               'invert one axis, or exchange two'])
        return found

    def determinant(self) -> float:
        """Return 1.0 for a rotation, -1.0 for a mirror image."""
        a, b, c = self.axes
        even = (a, b, c) in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
        return math.prod(self.signs) * (1.0 if even else -1.0)

    def inverse(self) -> AxisMap:
        """Return the inverse map."""
        back = [self.axes.index(i) for i in range(3)]
        return AxisMap((back[0], back[1], back[2]),
                       (self.signs[back[0]], self.signs[back[1]], self.signs[back[2]]))

    def __str__(self) -> str:
        """Write it as :meth:`parse` reads it."""
        return ' '.join(('-' if sign < 0 else '') + _LETTERS[axis]
                        for axis, sign in zip(self.axes, self.signs))

    def apply(self, vector: Sequence[float]) -> Vector:
        """Map a vector from the axes of the sensor to those of the frame."""
        (a, b, c), (i, j, k) = self.axes, self.signs
        return i * vector[a], j * vector[b], k * vector[c]


@dataclass(frozen=True)
class Calibration:
    """
    Offset, scale and mounting of one vector.

    :ivar offset: what the sensor shows at zero, in the unit of the vector, on its own axes.
    :ivar scale: factor of each of its own axes, not 0.
    """

    offset: Vector = (0.0, 0.0, 0.0)
    scale: Vector = (1.0, 1.0, 1.0)
    axes: AxisMap = AxisMap()

    def apply(self, measured: Sequence[float]) -> Vector:
        """Correct a vector."""
        return self.axes.apply([s * (m - o)
                                for m, o, s in zip(measured, self.offset, self.scale)])

    def undo(self, corrected: Sequence[float]) -> Vector:
        """Return the uncorrected vector of the sensor."""
        x, y, z = self.axes.inverse().apply(corrected)
        return (x / self.scale[0] + self.offset[0], y / self.scale[1] + self.offset[1],
                z / self.scale[2] + self.offset[2])

    def folded(self, unit: float) -> tuple[tuple[int, int, int], Vector, Vector]:
        """
        Include the size of a count, so that the loop multiplies once.

        :param unit: of the vector, a count.
        :return: for each axis of the frame: the sensor's axis, factor of its counts, summand.
        """
        a, b, c = self.axes.axes
        factors = [sign * self.scale[axis] for axis, sign in zip(self.axes.axes, self.axes.signs)]
        summands = [-factor * self.offset[axis]
                    for axis, factor in zip(self.axes.axes, factors)]
        return ((a, b, c), (unit * factors[0], unit * factors[1], unit * factors[2]),
                (summands[0], summands[1], summands[2]))


def axes_setting() -> Field:
    """Declare the mounting, one for all vectors of a device."""
    return Field('axes', str, IDENTITY_AXES,
                 'Mounting: the axes of the sensor that are x, y and z of the frame, such as "-y '
                 'x z".')


def vector_settings(vector: str, unit: str) -> tuple[Field, ...]:
    """
    Declare offset and scale of one vector.

    :param vector: its name, such as ``acceleration``.
    """
    return (
        Field(f'{vector}_offset', list, (0.0, 0.0, 0.0),
              f'Reading of the sensor at zero {vector}, on its own axes x, y, z.',
              unit=unit, item=float),
        Field(f'{vector}_scale', list, (1.0, 1.0, 1.0),
              'Factor of each of these axes, after the offset is subtracted.',
              item=float, minimum=0.5, maximum=2.0),
    )


def from_settings(name: str, settings: Mapping[str, Any], vector: str) -> Calibration:
    """
    Read a calibration from the settings of a device.

    :param name: of the device, for the errors.
    :raises ConfigError: with every problem found.
    """
    problems: list[str] = []
    axes = AxisMap()
    try:
        axes = AxisMap.parse(settings.get('axes', IDENTITY_AXES))
    except ConfigError as error:
        problems += [f'{name}.axes = {problem}' for problem in error.problems]
    parts = []
    for key in (f'{vector}_offset', f'{vector}_scale'):
        values = tuple(settings[key])
        if len(values) != 3:
            problems.append(f'{name}.{key} = {list(values)}: must be three numbers, x, y, z')
        parts.append(values)
    if problems:
        raise ConfigError(problems)
    return Calibration(parts[0], parts[1], axes)


def to_settings(calibrations: Mapping[str, Calibration]) -> dict[str, Any]:
    """
    Write calibrations as settings.

    :param calibrations: by vector; all of one device, so all have the same axes.
    :raises ConfigError: their axes differ.
    """
    mountings = {str(each.axes) for each in calibrations.values()}
    if len(mountings) != 1:
        raise ConfigError([f'calibrations with the axes {", ".join(sorted(mountings))}: a device '
                           'has one mounting'])
    found: dict[str, Any] = {'axes': mountings.pop()}
    for vector, each in calibrations.items():
        found[f'{vector}_offset'] = [float(v) for v in each.offset]
        found[f'{vector}_scale'] = [float(v) for v in each.scale]
    return found


def save(path: Path, device: str, calibrations: Mapping[str, Calibration]) -> None:
    """
    Write a parameter file that overrides the robot's own, with a second ``--params-file``.

    :param device: its name in the configuration.
    :raises OSError: the file cannot be written; an older one is then left unchanged.
    """
    import yaml
    content = {'/**': {'ros__parameters': {device: to_settings(calibrations)}}}
    temporary = path.with_name(f'.{path.name}.new')
    temporary.write_text(yaml.safe_dump(content, sort_keys=False), encoding='utf-8')
    temporary.replace(path)


def load(path: Path, device: str, vectors: Sequence[str]) -> dict[str, Calibration]:
    """
    Read what :func:`save` has written.

    :param vectors: names of the vectors.
    :raises ConfigError: the file has no such device or vector, or is not a calibration.
    :raises OSError: the file cannot be read.
    """
    import yaml
    try:
        content = yaml.safe_load(read_file(path).decode('utf-8'))
        section = content['/**']['ros__parameters'][device]
        return {vector: from_settings(device, section, vector) for vector in vectors}
    except ConfigError as error:
        raise ConfigError([f'{path}: {problem}' for problem in error.problems]) from error
    except (yaml.YAMLError, UnicodeDecodeError, KeyError, TypeError, AttributeError) as error:
        why = ' '.join(str(error).split())
        raise ConfigError([
            f'{path} holds no calibration of {", ".join(vectors)} for the device {device!r} '
            f'({type(error).__name__}: {why}): save it again']) from error


def _sign(word: str) -> float:
    return -1.0 if word.startswith('-') else 1.0
