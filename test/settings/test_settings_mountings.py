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

"""Where devices are on the robot: checked as a whole, and known to whoever needs it."""

from __future__ import annotations

from collections.abc import Mapping
import math
from pathlib import Path
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.motion.mounting import in_base
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.settings import from_json
from rt_robot_os.settings import load
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import to_json
import yaml

pytest.importorskip('geometry_msgs.msg', reason='the ROS 2 messages are not installed')


def robot(folder: Path, **devices: Mapping[str, Any]) -> RobotSettings:
    path = folder / 'robot.yaml'
    path.write_text(yaml.safe_dump(
        {'robot': {'ros__parameters': {'devices': [*devices], **devices}}}, sort_keys=False))
    return load([path])


def laser(**values: Any) -> dict[str, Any]:
    return {'type': 'hokuyo', 'port': 'sim', 'topic': 'scan', **values}


def sonar(**values: Any) -> dict[str, Any]:
    return {'type': 'maxbotix', 'port': 'sim', 'topic': 'sonar', **values}


def test_a_mounting_is_read_with_its_parent(tmp_path: Path) -> None:
    found = robot(tmp_path, laser=laser(mounting_m=[0.1, 0.0, 0.3], mounting_rad=[0.0, 0.0, 0.5],
                                        parent_frame_id='plate_link'))
    assert found.mountings == {
        'laser_link': Mounting((0.1, 0.0, 0.3), (0.0, 0.0, 0.5), 'plate_link')}
    assert from_json(to_json(found)) == found


def test_what_is_said_of_no_mounting_is_told_from_what_is_said(tmp_path: Path) -> None:
    found = robot(tmp_path, laser=laser(mounting_m=[0.0, 0.0, 0.0]),
                  sonar=sonar(parent_frame_id='plate_link'))
    assert {each.frame_id: each.stated for each in found.frames} == {
        'laser_link': False, 'sonar_link': True}


def test_one_who_says_nothing_takes_the_mounting_of_the_other(tmp_path: Path) -> None:
    found = robot(tmp_path, laser=laser(frame_id='head'),
                  sonar=sonar(frame_id='head', mounting_m=[0.0, 0.0, 1.0]))
    assert found.mountings == {'head': Mounting((0.0, 0.0, 1.0))}
    assert [each.stated for each in found.frames] == [True]


def test_two_places_of_one_frame_name_both_devices(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        robot(tmp_path, laser=laser(frame_id='head', mounting_m=[0.0, 0.0, 2.0]),
              sonar=sonar(frame_id='head', mounting_m=[0.0, 0.0, 1.0]))
    assert "sonar mounts 'head' at [0.0, 0.0, 1.0] m" in str(caught.value)
    assert 'but laser (' in str(caught.value)


@pytest.mark.parametrize(('values', 'problem'), [
    ({'mounting_m': [1.0, 2.0]}, r'laser.mounting_m = .*a list of 3 numbers \(m\)'),
    ({'mounting_rad': [0.0, 0.0, math.inf]}, 'laser.mounting_rad = .*a list of 3 numbers'),
    ({'mounting_m': [0.0, 0.0, 1.0], 'parent_frame_id': ''},
     'laser.parent_frame_id = .*refuses empty'),
    ({'mounting_m': [0.0, 0.0, 1.0], 'frame_id': '/laser'}, 'laser.frame_id = .*with a slash'),
    ({'frame_id': 'base_link', 'mounting_m': [0.0, 0.0, 1.0]},
     "laser: 'base_link' on 'base_link': a frame cannot be its own parent")])
def test_what_cannot_be_is_told(tmp_path: Path, values: dict[str, Any], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        robot(tmp_path, laser=laser(**values))


def test_a_circle_of_frames_is_told_once(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        robot(tmp_path, laser=laser(frame_id='a', parent_frame_id='b'),
              sonar=sonar(frame_id='b', parent_frame_id='a'))
    assert caught.value.problems[0].endswith(
        "laser: 'a' on 'b' on 'a': a frame cannot be its own parent, set another parent_frame_id")
    assert len(caught.value.problems) == 1


@pytest.mark.parametrize('frame_id', ['base_link', 'map', 'odom'])
def test_frames_of_the_robot_and_the_world_are_mounted_nowhere(
        tmp_path: Path, frame_id: str) -> None:
    assert robot(tmp_path, laser=laser(frame_id=frame_id)).frames == ()


def test_a_device_that_is_off_mounts_nothing(tmp_path: Path) -> None:
    assert robot(tmp_path, laser=laser(enabled=False), sonar=sonar()).mountings.keys() == {
        'sonar_link'}


# ---- devices with several frames -------------------------------------------------------------

def sharp(**values: Any) -> dict[str, Any]:
    return {'type': 'sharp', 'port': 'sim', 'channels': [0, 3], **values}


def test_each_channel_has_a_place_of_its_own(tmp_path: Path) -> None:
    found = robot(tmp_path, sharp=sharp(mounting_m=[0.1, 0.2, 0.0, 0.1, -0.2, 0.0],
                                        mounting_rad=[0.0, 0.0, 0.4]))
    assert found.mountings == {
        'infrared_link_0': Mounting((0.1, 0.2, 0.0), (0.0, 0.0, 0.4)),
        'infrared_link_3': Mounting((0.1, -0.2, 0.0), (0.0, 0.0, 0.4))}


def test_numbers_for_some_channels_only_are_told(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='sharp.mounting_m has 4 numbers: .*, or 6: 3 for each'):
        robot(tmp_path, sharp=sharp(mounting_m=[0.0, 0.0, 0.0, 1.0]))


def test_the_picture_of_a_camera_that_looks_ahead_has_z_ahead(tmp_path: Path) -> None:
    camera = {'type': 'camera', 'port': 'sim', 'mounting_m': [0.2, 0.0, 1.0]}
    found = robot(tmp_path, camera=camera)
    assert found.mountings['camera_link'] == Mounting((0.2, 0.0, 1.0))
    assert found.mountings['camera_optical_frame'].parent == 'camera_link'
    picture = in_base(found.mountings, 'camera_optical_frame')
    assert picture.in_parent((0.0, 0.0, 1.0)) == pytest.approx((1.2, 0.0, 1.0))
    assert picture.in_parent((1.0, 0.0, 0.0)) == pytest.approx((0.2, -1.0, 1.0))
    assert picture.in_parent((0.0, 1.0, 0.0)) == pytest.approx((0.2, 0.0, 0.0))
