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

"""Which mountings are published, and which hang in the air."""

from __future__ import annotations

import pytest
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings.model import MountedFrame
from rt_robot_os.settings.static_frames import loose_parents
from rt_robot_os.settings.static_frames import published_frames

FRAMES = (MountedFrame('laser_link', Mounting((0.1, 0.0, 0.2))),
          MountedFrame('imu_link', Mounting(), stated=False),
          MountedFrame('head_link', Mounting((0.0, 0.0, 1.0), parent='neck_link')),
          MountedFrame('ear_link', Mounting((0.0, 0.1, 0.0), parent='head_link')))


@pytest.mark.parametrize(('which', 'expected'), [
    ('mounted', ['laser_link', 'head_link', 'ear_link']),
    ('all', ['laser_link', 'imu_link', 'head_link', 'ear_link']), ('none', [])])
def test_the_setting_says_which_are_published(which: str, expected: list[str]) -> None:
    robot = RobotSettings(static_transforms=which, frames=FRAMES)
    assert [each.frame_id for each in published_frames(robot)] == expected


def test_a_parent_that_is_no_frame_of_the_robot_is_named() -> None:
    assert loose_parents(FRAMES) == ('neck_link',), 'a mistake, or of a robot description'
