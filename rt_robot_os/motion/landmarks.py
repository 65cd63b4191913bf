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
Numbered landmarks with their poses, read from a list of strings, from YAML or from CSV.

In YAML, at the top or below ``landmarks``, by number or as a list::

    landmarks:
      24706: [0.0, 0.0, 0.0]                              # x and y in m, yaw in rad
      24594: {x_cm: -150, y_cm: -3, yaw_deg: 2.0}
      34: {x: 3.0, y: 0.0}

In CSV the first line names the columns: ``id``, ``x`` and ``y``, and ``yaw`` if there is one. The
names may end in a unit, which is otherwise m and rad: ``x_cm``, ``y_mm``, ``yaw_deg``.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
import math
import re
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError

MOST_LANDMARKS: Final = 10_000
HIGHEST_NUMBER: Final = 999_999
# No building is larger; a wrong unit is detected.
FARTHEST_M: Final = 100_000.0

_SEPARATOR: Final = re.compile('[,;\t]')
_LENGTHS: Final = {'': 1.0, '_m': 1.0, '_cm': 0.01, '_mm': 0.001}
_ANGLES: Final = {'': 1.0, '_rad': 1.0, '_deg': math.pi / 180}
_UNITS: Final = {'x': _LENGTHS, 'y': _LENGTHS, 'yaw': _ANGLES}


class CeilingLandmark(NamedTuple):
    """
    One landmark on the ceiling.

    :ivar number: its ID.
    :ivar x: in the map, in m.
    :ivar y: in the map, in m.
    :ivar yaw: direction of its own x axis in the map, in rad.
    """

    number: int
    x: float
    y: float
    yaw: float


def landmarks_of(texts: Iterable[str], where: str) -> dict[int, CeilingLandmark]:
    """
    Read landmarks from texts such as ``'24706: 0.0, 0.0, 0.0'``: number, x and y in m, yaw in rad.

    Commas and the colon may be left out, and so may the yaw.

    :param where: for the errors.
    :return: by number.
    :raises ConfigError: with every problem found.
    """
    return _collected(
        (f'{where}, {text!r}', _words(text)) for text in texts)


def read_landmarks(text: str, name: str) -> dict[int, CeilingLandmark]:
    """
    Read landmarks from the content of a file.

    :param name: of the file, for the errors; CSV when it ends with ``.csv``, else YAML.
    :return: by number.
    :raises ConfigError: with every problem found, and its place.
    """
    return _collected(_rows_of_csv(text, name) if name.lower().endswith('.csv')
                      else _rows_of_yaml(text, name))


def _rows_of_csv(text: str, name: str) -> Iterator[tuple[str, Sequence[Any]]]:
    header: list[str] | None = None
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.startswith('#'):
            continue
        where = f'{name}: line {number}'
        row = [cell.strip(' \t"') for cell in _SEPARATOR.split(line)]
        if header is None:
            header = [cell.lower() for cell in row]
            if 'id' not in header:
                break
        elif len(row) > len(header):
            yield where, row
        else:
            yield where, _in_order(dict(zip(header, row)), where)
    if header is None or 'id' not in header:
        raise ConfigError([f'{name}: the first line must name the columns, such as id,x,y,yaw or '
                           f'id,x_cm,y_cm,yaw_deg; it is {",".join(header or ())[:80]!r}'])


def _rows_of_yaml(text: str, name: str) -> Iterator[tuple[str, Sequence[Any]]]:
    import yaml
    try:
        content = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ConfigError([f'{name} is not YAML: {error}']) from error
    if isinstance(content, Mapping) and 'landmarks' in content:
        content = content['landmarks']
    if isinstance(content, Mapping):
        entries = [(f'{name}: landmark {key}', key, value) for key, value in content.items()]
    elif isinstance(content, list):
        entries = [(f'{name}: landmark at place {place}', None, value)
                   for place, value in enumerate(content, 1)]
    else:
        raise ConfigError([f'{name} holds no landmarks: write "landmarks:" and below it lines '
                           'such as "24706: [0.0, 0.0, 0.0]" (x and y in m, yaw in rad)'])
    for where, key, value in entries:
        before = () if key is None else (key,)
        if isinstance(value, Mapping):
            yield where, _in_order({'id': key, **value}, where)
        elif isinstance(value, str):
            yield where, (*before, *_words(value))
        else:
            yield where, (*before, *(value if isinstance(value, list) else (value,)))


def _words(text: str) -> list[str]:
    return text.replace(':', ' ').replace(',', ' ').split()


def _in_order(values: Mapping[Any, Any], where: str) -> Sequence[Any]:
    """Return named values in order, in m and rad; unreadable ones are unmodified."""
    found: dict[str, Any] = {}
    for key, value in values.items():
        quantity, _, unit = str(key).strip().lower().partition('_')
        scale = _UNITS.get(quantity, {}).get(f'_{unit}' if unit else '')
        if quantity in ('id', 'number'):
            found['id'] = value
        elif scale is not None and quantity not in found:
            number = _number(value)
            found[quantity] = value if number is None else number * scale
        else:
            raise ConfigError([f'{where}: {key!r} is unknown or duplicate: use id, x, y and yaw, '
                               'as x_cm or yaw_deg where the unit is not m or rad'])
    return [found.get(key) for key in ('id', 'x', 'y')] + [found.get('yaw', 0.0)]


def _collected(rows: Iterable[tuple[str, Sequence[Any]]]) -> dict[int, CeilingLandmark]:
    found: dict[int, CeilingLandmark] = {}
    problems = []
    for where, row in rows:
        landmark = _landmark(row)
        if landmark is None:
            problems.append(f'{where}: must be a number from 0 to {HIGHEST_NUMBER}, then x and y '
                            'in m, and a yaw in rad if it has one')
        elif landmark.number in found:
            problems.append(f'{where}: landmark {landmark.number} is there twice: delete one')
        else:
            found[landmark.number] = landmark
        if len(found) > MOST_LANDMARKS:
            problems.append(f'{where}: more than {MOST_LANDMARKS} landmarks: use a file for each '
                            'floor')
            break
    if problems:
        raise ConfigError(problems)
    return found


def _landmark(row: Sequence[Any]) -> CeilingLandmark | None:
    if not 3 <= len(row) <= 4:
        return None
    number = _number(row[0])
    x, y, yaw = (_number(value) for value in (*row[1:], 0.0)[:3])
    if number is None or x is None or y is None or yaw is None or number != int(number) or (
            not 0 <= number <= HIGHEST_NUMBER or max(abs(x), abs(y)) > FARTHEST_M):
        return None
    return CeilingLandmark(int(number), x, y, math.remainder(yaw, math.tau))


def _number(value: Any) -> float | None:
    """Return a value as a finite number; None when it is not one."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return None
    return number if math.isfinite(number) else None
