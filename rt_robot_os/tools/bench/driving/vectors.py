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

from rt_robot_os.errors import RtRobotError
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
        for found, wanted in _GROUPS[name](group):
            off = max(abs(a - b) for a, b in zip(found, wanted, strict=True))
            if not math.isfinite(off):
                raise ValueError(f'{found} and {wanted} are not all finite numbers')
            differences.append(off)
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise VectorsError(f'{path}: {name}, case {len(differences)}: '
                           f'{type(error).__name__}: {error}') from error
    return Compared(name, len(differences), max(differences, default=0.0))


# What is computed, and what it should be.
_Pairs = Iterator[tuple[tuple[float, ...], tuple[float, ...]]]


def _circles(group: Any) -> _Pairs:
    for one, other, radius, found in group:
        yield on_circle((one[0], one[1]), (other[0], other[1]), radius), (found[0], found[1])


def _lookaheads(group: Any) -> _Pairs:
    of = group['defaults']
    law = RegulatedPurePursuit(RegulatedPurePursuitGains(
        of['dist'], of['time'], of['min'], of['max']))
    for speed, distance in group['cases']:
        yield (law.lookahead(speed),), (distance,)


def _rotations(group: Any) -> _Pairs:
    for case in group['cases']:
        yield (rotation(case['angle'], case['current'], group['target'], group['max_accel'],
                        group['dt']),), (case['w'],)


def _polars(group: Any) -> _Pairs:
    for case in group:
        found = polar(_pose(case['current']), _pose(case['target']))
        yield tuple(value for name, value in zip(('r', 'phi', 'delta'), found)
                    if name in case), tuple(
            case[name] for name in ('r', 'phi', 'delta') if name in case)


def _graceful(group: Any) -> _Pairs:
    for case in group:
        k_phi, k_delta, beta, exponent, slowdown, braking, v_max, w_max = case['gains']
        law = ParkKuipers(ParkKuipersGains(k_phi, k_delta, beta, exponent, slowdown_m=slowdown,
                                           speed_min_m_s=0.0))
        current, target = _pose(case['current']), _pose(case['target'])
        v, w = law.to_pose(current, target, v_max, w_max, braking)
        bend = curvature(*polar(current, target), k_phi, k_delta)
        yield (bend, v, w), (case['kappa'], case['v'], case['w'])


def _odometry(group: Any) -> _Pairs:
    for case in group['cases']:
        left, right = (case[wheel] * group['radius'] * case['dt'] for wheel in ('wl', 'wr'))
        yield (moved((0.0, 0.0, 0.0), *body_velocity(left, right, group['separation'])),
               (case['x'], case['y'], case['th']))


def _pose(numbers: Any) -> Pose:
    x, y, yaw = (*numbers, 0.0)[:3]
    return x, y, yaw


_GROUPS: Final[Mapping[str, Callable[[Any], _Pairs]]] = {
    'circle_segment': _circles, 'lookahead': _lookaheads, 'rotate_to_heading': _rotations,
    'egopolar': _polars, 'smooth_control_law': _graceful, 'odometry': _odometry}
