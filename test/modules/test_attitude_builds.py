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

"""The filters are the same whichever build runs: their numbers, and who may inherit from them."""

from __future__ import annotations

import os
from pathlib import Path
import subprocess
import sys

from attitude_motion import feed
from attitude_motion import Motion
import pytest

from rt_robot_os import compiled
from rt_robot_os.modules.attitude import AttitudeFilter
from rt_robot_os.modules.attitude import MahonyFilter
from rt_robot_os.modules.attitude import Tuning
from rt_robot_os.motion.quaternion import IDENTITY
from rt_robot_os.motion.quaternion import Quaternion
from rt_robot_os.motion.quaternion import Vector

FOLDERS = (Path(compiled.__file__).parents[2], Path(__file__).parent)

# With rest, turning, acceleration, a foreign field and an odd interval in it.
PROGRAM = """
import math
from attitude_motion import EARTH, feed, Motion
from rt_robot_os.modules.attitude import MahonyFilter, Tuning
attitude = MahonyFilter(Tuning(inclination_time_s=1.0, heading_time_s=2.0))
motion = Motion(
    turning=lambda t: (math.sin(t), 0.3 * math.cos(3 * t), 0.2) if t > 3 else (0.0, 0.0, 0.0),
    moving=lambda t: (2.0 * math.sin(9 * t), 0.0, 8.0 if 9 < t < 10 else 0.0),
    field=lambda t: EARTH if t < 12 else (3e-5, 3e-5, 0.0), bias=(0.01, -0.004, 0.002))
for sample in motion.samples(15.0, 97.0):
    feed(attitude, sample)
print(*attitude.attitude, *attitude.bias, attitude.bias_stddev, attitude.field_rejected)
"""


def told(switch: str) -> str:
    environment = {**os.environ, compiled.SWITCH: switch,
                   'PYTHONPATH': os.pathsep.join([*map(str, FOLDERS), *sys.path])}
    return subprocess.run([sys.executable, '-c', PROGRAM], env=environment, capture_output=True,
                          text=True, check=True).stdout


def test_both_builds_compute_the_same_to_the_last_bit() -> None:
    if not compiled.state().compiled:
        pytest.skip('there is no compiled build of these sources')
    assert told('1') == told('0')


class Still(AttitudeFilter):
    """A filter as a user may write one."""

    name = 'still'

    def update(self, rate: Vector, acceleration: Vector | None, field: Vector | None,
               dt_s: float) -> Quaternion:
        self.aligned = True
        return self.attitude

    def restart(self) -> None:
        self.aligned = False

    def tune(self, tuning: Tuning) -> None:
        self.tuning = tuning


def test_a_class_of_a_user_may_inherit_from_the_base() -> None:
    attitude = Still(Tuning())
    sample = Motion().step(0.01)
    assert feed(attitude, sample) == IDENTITY and attitude.aligned
    attitude.restart()
    assert not attitude.aligned and attitude.name == 'still'
    assert [kind.name for kind in (Still, MahonyFilter)] == ['still', 'mahony']
