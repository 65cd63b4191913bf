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

"""Poses of the plane in each other's frames; all are safe in the real-time loop."""

from __future__ import annotations

import math

from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import Pose


def composed(first: Pose, second: Pose) -> Pose:
    """Return a pose that is given in the frame of another one, in the frame of that one."""
    cosine, sine = math.cos(first[2]), math.sin(first[2])
    return (first[0] + cosine * second[0] - sine * second[1],
            first[1] + sine * second[0] + cosine * second[1], wrapped(first[2] + second[2]))


def transform(pose: Pose, same: Pose) -> Pose:
    """
    Return where a frame is in which the robot is at ``same``, while it is at ``pose`` here.

    With a pose on the map and one of odometry, of one moment, that is ``map`` -> ``odom``.
    """
    turn = wrapped(pose[2] - same[2])
    cosine, sine = math.cos(turn), math.sin(turn)
    return (pose[0] - cosine * same[0] + sine * same[1],
            pose[1] - sine * same[0] - cosine * same[1], turn)


def arc_between(first: Pose, second: Pose) -> tuple[float, float]:
    """
    Return length and turn of the arc that leads from a pose to another: the inverse of ``moved``.

    What lies sideways of an arc, which no wheel rolls, is left out. The turn is less than half
    a turn either way.
    """
    turn = wrapped(second[2] - first[2])
    x, y = second[0] - first[0], second[1] - first[1]
    middle = first[2] + turn / 2
    chord = x * math.cos(middle) + y * math.sin(middle)
    half = turn / 2
    return (chord if abs(half) < 1e-6 else chord * half / math.sin(half)), turn
