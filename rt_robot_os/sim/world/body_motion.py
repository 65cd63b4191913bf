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
The motion of an inertial sensor at the waist while a person stands, walks, sits, falls, gets up.

A model for simulated persons, not of a particular body; its magnitudes and times are those of
recorded falls of volunteers. A fall is a loss of balance, a descent of a third of a second with
little specific force, an impact of some 4 g, a rebound, then stillness with breathing. The axes
are those of the person (REP 103: x ahead, y left, z up along the trunk); the mounting of a sensor
rotates them.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Final
from typing import NamedTuple
from typing import TypeAlias

from rt_robot_os.base.units import STANDARD_GRAVITY_M_S2

#: Duration of the transition to an activity, in s; the activity itself has no end.
ACTIVITIES: Final = {'stand': 0.8, 'walk': 0.8, 'sit': 1.6, 'lie': 4.0, 'fall': 1.5, 'rise': 3.0}
#: Direction of a fall or of lying down: the signs of roll and pitch.
DIRECTIONS: Final = {'forward': (0.0, 1.0), 'backward': (0.0, -1.0),
                     'left': (-1.0, 0.0), 'right': (1.0, 0.0)}
#: A roll and a pitch, in rad.
Turn: TypeAlias = tuple[float, float]
#: Time of the impact of a fall since its beginning, in s, and its force, in g.
IMPACT_S: Final = 0.72
IMPACT_G: Final = 4.0

_LYING_RAD: Final = math.radians(86.0)
# Leaning back.
_SITTING_RAD: Final = math.radians(-12.0)
_FALLING_FROM_S: Final = 0.1
_IMPACT_LASTS_S: Final = 0.08
_STEPS_HZ: Final = 1.8
_BREATHS_HZ: Final = 0.25
_STEP_S: Final = 1e-3
_LYING: Final = ('lie', 'fall')


class FeltMotion(NamedTuple):
    """
    The motion of a sensor at the waist.

    :ivar force_m_s2: the specific force along x, y, z, in m/s^2: at rest gravity, upwards.
    :ivar rate_rad_s: the angular velocity about x, y, z, in rad/s.
    :ivar roll_rad: the tilt to the right, in rad.
    :ivar pitch_rad: the tilt ahead, in rad.
    """

    force_m_s2: tuple[float, float, float]
    rate_rad_s: tuple[float, float, float]
    roll_rad: float
    pitch_rad: float


def body_motion(activity: str, time_s: float, *, before: str = 'stand',
                direction: str = 'forward') -> FeltMotion:
    """
    Return the motion some time after the beginning of an activity; a pure function.

    :param activity: one of :data:`ACTIVITIES`.
    :param time_s: since its beginning; standing before that.
    :param before: the previous activity, with whose posture it begins.
    :param direction: one of :data:`DIRECTIONS`, of the fall or of lying, also of lying before.
    :raises KeyError: one of these is unknown.
    """
    begin, end = _posture(before, direction), _posture(activity, direction)
    time_s = max(0.0, time_s)
    roll, pitch = _tilt(activity, time_s, begin, end)
    next_roll, next_pitch = _tilt(activity, time_s + _STEP_S, begin, end)
    load, ahead, left = _LOADS[activity](time_s)
    up = (-math.sin(pitch), math.sin(roll) * math.cos(pitch), math.cos(roll) * math.cos(pitch))
    return FeltMotion(
        ((up[0] * load + ahead) * STANDARD_GRAVITY_M_S2,
         (up[1] * load + left) * STANDARD_GRAVITY_M_S2, up[2] * load * STANDARD_GRAVITY_M_S2),
        ((next_roll - roll) / _STEP_S, (next_pitch - pitch) / _STEP_S, 0.0), roll, pitch)


def _posture(activity: str, direction: str) -> Turn:
    if activity in _LYING:
        roll, pitch = DIRECTIONS[direction]
        return roll * _LYING_RAD, pitch * _LYING_RAD
    return 0.0, _SITTING_RAD if activity == 'sit' else 0.0


def _tilt(activity: str, time_s: float, begin: Turn, end: Turn) -> Turn:
    roll, pitch = _TILTS[activity](time_s, begin, end)
    more_roll, more_pitch = _SWAYS[activity](time_s)
    return roll + more_roll, pitch + more_pitch


def _smooth(part: float) -> float:
    part = min(max(part, 0.0), 1.0)
    return part * part * (3.0 - 2.0 * part)


def _bump(time_s: float, begin_s: float, lasts_s: float) -> float:
    """Return half a sine, 0 before and after it."""
    part = (time_s - begin_s) / lasts_s
    return math.sin(math.pi * part) if 0.0 < part < 1.0 else 0.0


# ---- tilt of the trunk --------------------------------------------------------------------------

def _between(begin: Turn, end: Turn, part: float) -> Turn:
    return begin[0] + (end[0] - begin[0]) * part, begin[1] + (end[1] - begin[1]) * part


def _steady(name: str) -> Callable[[float, Turn, Turn], Turn]:
    lasts_s = ACTIVITIES[name]
    return lambda time_s, begin, end: _between(begin, end, _smooth(time_s / lasts_s))


def _falling(time_s: float, begin: Turn, end: Turn) -> Turn:
    return _between(begin, end, _smooth(
        (time_s - _FALLING_FROM_S) / (IMPACT_S - _FALLING_FROM_S)))


def _lying_down(time_s: float, begin: Turn, end: Turn) -> Turn:
    # First to the edge of the bed, then down on it.
    sat = _between(begin, (0.0, _SITTING_RAD), _smooth(time_s / 1.6))
    return _between(sat, end, _smooth((time_s - 2.0) / 1.8))


_TILTS: Final[dict[str, Callable[[float, Turn, Turn], Turn]]] = {
    'stand': _steady('stand'), 'walk': _steady('walk'), 'sit': _steady('sit'),
    'rise': _steady('rise'), 'fall': _falling, 'lie': _lying_down}


# ---- small added rotations: roll, pitch---------------------------------------------------------

def _breathing(time_s: float) -> Turn:
    return 0.0, 0.008 * math.sin(2.0 * math.pi * _BREATHS_HZ * time_s)


def _leaning(time_s: float) -> Turn:
    # A person leans ahead while sitting down.
    return 0.0, 0.45 * math.sin(math.pi * _smooth(time_s / ACTIVITIES['sit']))


def _stepping(time_s: float) -> Turn:
    grown = _smooth(time_s / ACTIVITIES['walk'])
    turn = 2.0 * math.pi * _STEPS_HZ * time_s
    return 0.04 * grown * math.sin(0.5 * turn), 0.03 * grown * math.sin(turn)


_SWAYS: Final[dict[str, Callable[[float], Turn]]] = {
    'stand': _breathing, 'walk': _stepping, 'sit': lambda time_s: _sum(
        _leaning(time_s), _breathing(time_s)),
    'lie': _breathing, 'fall': _breathing, 'rise': _breathing}


def _sum(one: Turn, two: Turn) -> Turn:
    return one[0] + two[0], one[1] + two[1]


# ---- specific force in g: upwards, ahead, to the left -------------------------------------------

def _resting(time_s: float) -> tuple[float, float, float]:
    return 1.0 + 0.004 * math.sin(2.0 * math.pi * _BREATHS_HZ * time_s), 0.0, 0.0


def _walking(time_s: float) -> tuple[float, float, float]:
    grown = _smooth(time_s / ACTIVITIES['walk'])
    turn = 2.0 * math.pi * _STEPS_HZ * time_s
    return (1.0 + grown * (0.26 * math.sin(turn) + 0.1 * math.sin(2.0 * turn)),
            0.12 * grown * math.cos(turn), 0.08 * grown * math.sin(0.5 * turn))


def _sitting(time_s: float) -> tuple[float, float, float]:
    load = _resting(time_s)[0] - 0.2 * _bump(time_s, 0.3, 0.8) + 0.45 * _bump(time_s, 1.1, 0.15)
    return load, 0.1 * _bump(time_s, 0.4, 0.9), 0.0


def _settling(time_s: float) -> tuple[float, float, float]:
    load, ahead, left = _sitting(time_s)
    return load - 0.12 * _bump(time_s, 2.2, 0.9) + 0.3 * _bump(time_s, 3.1, 0.25), ahead, left


def _dropping(time_s: float) -> tuple[float, float, float]:
    end_s = IMPACT_S + _IMPACT_LASTS_S
    if time_s < IMPACT_S:
        lost = _smooth((time_s - 0.25) / 0.2) * (1.0 - _smooth((time_s - IMPACT_S + 0.04) / 0.04))
        return 1.0 - 0.7 * lost, 0.05 * _bump(time_s, 0.0, IMPACT_S), 0.0
    if time_s < end_s:
        struck = _bump(time_s, IMPACT_S, _IMPACT_LASTS_S)
        return 1.0 + (IMPACT_G - 1.0) * struck, 0.3 * struck, 0.2 * struck
    since_s = time_s - end_s
    swing = math.exp(-since_s / 0.15) * math.sin(2.0 * math.pi * 4.0 * since_s)
    return _resting(time_s)[0] - 0.5 * swing, 0.1 * swing, -0.1 * swing


def _rising(time_s: float) -> tuple[float, float, float]:
    return (_resting(time_s)[0] + 0.22 * _bump(time_s, 0.2, 0.8) + 0.2 * _bump(time_s, 1.6, 0.9)
            - 0.15 * _bump(time_s, 2.5, 0.5)), 0.1 * _bump(time_s, 0.5, 2.0), 0.0


_LOADS: Final[dict[str, Callable[[float], tuple[float, float, float]]]] = {
    'stand': _resting, 'walk': _walking, 'sit': _sitting, 'lie': _settling, 'fall': _dropping,
    'rise': _rising}
