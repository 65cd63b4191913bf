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
Test vectors of controllers: what `bench control --data FILE` compares with.

A JSON object; each group may be absent, and what is in none of them is refused:

- ``circle_segment``: ``[[x, y], [x, y], radius, [x, y]]``: a segment and where it cuts a circle;
- ``lookahead``: ``defaults`` (dist, time, min, max) and ``cases``: ``[speed, distance]``;
- ``rotate_to_heading``: dt, max_accel, target, and ``cases`` of angle, current, w;
- ``egopolar``: ``target`` and ``current`` (x, y, or x, y, yaw), ``r``, and ``phi``, ``delta``
  where there are headings;
- ``smooth_control_law``: ``target``, ``current``, ``gains`` (k_phi, k_delta, beta, lambda,
  slowdown_radius, deceleration, v_max, w_max), and ``kappa``, ``v``, ``w``;
- ``odometry``: separation, radius, and ``cases`` of wl, wr, dt, x, y, th.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from dataclasses import dataclass
import json
import math
from pathlib import Path
from typing import Any
from typing import Final

from benchmarks.control.checked_json import Checked
from benchmarks.control.checked_json import LayoutError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.motion.controllers.park_kuipers import curvature
from rt_robot_os.motion.controllers.park_kuipers import ParkKuipers
from rt_robot_os.motion.controllers.park_kuipers import ParkKuipersGains
from rt_robot_os.motion.controllers.park_kuipers import polar
from rt_robot_os.motion.controllers.regulated_pure_pursuit import on_circle
from rt_robot_os.motion.controllers.regulated_pure_pursuit import RegulatedPurePursuit
from rt_robot_os.motion.controllers.regulated_pure_pursuit import RegulatedPurePursuitGains
from rt_robot_os.motion.controllers.regulated_pure_pursuit import rotation
from rt_robot_os.motion.differential import body_velocity
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose

_BYTES_MOST: Final = 64 << 20


class VectorsError(RtRobotError):
    """A file of vectors cannot be read; the message names file and place."""


@dataclass(frozen=True)
class Compared:
    """
    A group of vectors.

    :ivar cases: how many there are.
    :ivar worst: the largest difference of a number, in its own unit.
    """

    group: str
    cases: int
    worst: float


def compare(path: Path) -> list[Compared]:
    """
    Compute every vector of a file.

    :raises VectorsError: it cannot be read, or is none.
    """
    try:
        with open(path, 'rb') as file:
            content = json.loads(file.read(_BYTES_MOST))
    except (OSError, ValueError, RecursionError) as error:
        raise VectorsError(f'{path}: cannot be read: {error}') from error
    if not isinstance(content, dict) or not content:
        raise VectorsError(f'{path}: must be a JSON object of groups: {", ".join(_GROUPS)}')
    unknown = sorted(set(content) - set(_GROUPS))
    if unknown:
        raise VectorsError(f'{path}: {unknown[0]!r} is no group of vectors; there are '
                           f'{", ".join(_GROUPS)}')
    return [_compared(path, name, group) for name, group in content.items()]


def _compared(path: Path, name: str, group: Any) -> Compared:
    differences: list[float] = []
    try:
        for found, wanted in _GROUPS[name](Checked(group, name)):
            off = max(abs(a - b) for a, b in zip(found, wanted, strict=True))
            if not math.isfinite(off):
                raise ValueError(f'{found} and {wanted} are not all finite numbers')
            differences.append(off)
    except LayoutError as error:
        raise VectorsError(f'{path}: {name}, case {len(differences)}: {error}') from error
    except (ArithmeticError, ValueError) as error:
        raise VectorsError(f'{path}: {name}, case {len(differences)}: cannot be computed: '
                           f'{error}') from error
    return Compared(name, len(differences), max(differences, default=0.0))


# What is computed, and what it should be.
_Pairs = Iterator[tuple[tuple[float, ...], tuple[float, ...]]]


def _circles(group: Checked) -> _Pairs:
    for case in group:
        one, other, radius, found = case.entries(4)
        yield on_circle(_point(one), _point(other), float(radius)), _point(found)


def _lookaheads(group: Checked) -> _Pairs:
    of = group['defaults']
    law = RegulatedPurePursuit(RegulatedPurePursuitGains(
        *(float(of[name]) for name in ('dist', 'time', 'min', 'max'))))
    for case in group['cases']:
        speed, distance = map(float, case.entries(2))
        yield (law.lookahead(speed),), (distance,)


def _rotations(group: Checked) -> _Pairs:
    for case in group['cases']:
        yield (rotation(*_numbers(case, 'angle', 'current'),
                        *_numbers(group, 'target', 'max_accel', 'dt')),), _numbers(case, 'w')


def _polars(group: Checked) -> _Pairs:
    for case in group:
        found = polar(_pose(case['current']), _pose(case['target']))
        yield tuple(value for name, value in zip(('r', 'phi', 'delta'), found)
                    if name in case), tuple(
            float(case[name]) for name in ('r', 'phi', 'delta') if name in case)


def _graceful(group: Checked) -> _Pairs:
    for case in group:
        k_phi, k_delta, beta, exponent, slowdown, braking, v_max, w_max = map(
            float, case['gains'].entries(8))
        law = ParkKuipers(ParkKuipersGains(k_phi, k_delta, beta, exponent, slowdown_m=slowdown,
                                           speed_min_m_s=0.0))
        current, target = _pose(case['current']), _pose(case['target'])
        v, w = law.to_pose(current, target, v_max, w_max, braking)
        bend = curvature(*polar(current, target), k_phi, k_delta)
        yield (bend, v, w), _numbers(case, 'kappa', 'v', 'w')


def _odometry(group: Checked) -> _Pairs:
    for case in group['cases']:
        separation, radius = _numbers(group, 'separation', 'radius')
        left, right, dt = _numbers(case, 'wl', 'wr', 'dt')
        yield (moved((0.0, 0.0, 0.0), *body_velocity(
            left * radius * dt, right * radius * dt, separation)), _numbers(case, 'x', 'y', 'th'))


def _numbers(fields: Checked, *names: str) -> tuple[float, ...]:
    return tuple(float(fields[name]) for name in names)


def _point(entries: Checked) -> tuple[float, float]:
    return float(entries[0]), float(entries[1])


def _pose(entries: Checked) -> Pose:
    x, y = _point(entries)
    numbers = list(entries)
    return x, y, float(numbers[2]) if len(numbers) > 2 else 0.0


_GROUPS: Final[Mapping[str, Callable[[Checked], _Pairs]]] = {
    'circle_segment': _circles, 'lookahead': _lookaheads, 'rotate_to_heading': _rotations,
    'egopolar': _polars, 'smooth_control_law': _graceful, 'odometry': _odometry}
