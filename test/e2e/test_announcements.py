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

"""The node announces itself often, unless its user has settings of Fast DDS."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from rt_robot_os.ros import announcements  # noqa: E402, I100

VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE',
             'SKIP_DEFAULT_XML', 'SKIP_DEFAULT_XML_FILE', 'RMW_FASTRTPS_USE_QOS_FROM_XML',
             'ROS_DISCOVERY_SERVER', 'RMW_IMPLEMENTATION')

# Without the settings of whoever runs the tests, and of the tests themselves.
alone = pytest.mark.usefixtures('no_settings')


@pytest.fixture
def no_settings(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)


@alone
def test_the_profile_is_there_while_the_node_is_created_and_gone_afterwards() -> None:
    before = dict(os.environ), os.listdir('/proc/self/fd')
    with announcements.frequent_announcements():
        path = Path(os.environ[announcements.FILE_VARIABLE])
        text = path.read_text()
    assert not path.exists()
    assert (dict(os.environ), os.listdir('/proc/self/fd')) == before
    period = next(e for e in ElementTree.fromstring(text).iter()
                  if e.tag.endswith('leaseAnnouncement'))
    assert [child.text for child in period] == ['0', '500000000']


@alone
@pytest.mark.parametrize('name', [*VARIABLES[:-1]])
def test_a_variable_of_the_user_is_left_alone(
        monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setenv(name, '1')
    before = dict(os.environ)
    with announcements.frequent_announcements():
        assert dict(os.environ) == before


@alone
@pytest.mark.parametrize('name', ['DEFAULT_FASTRTPS_PROFILES.xml', 'DEFAULT_FASTDDS_PROFILES.xml'])
def test_a_file_of_the_user_is_left_alone(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text('<profiles/>')
    with announcements.frequent_announcements():
        assert announcements.FILE_VARIABLE not in os.environ


@alone
def test_without_a_folder_for_the_file_the_node_starts_all_the_same(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr('tempfile.tempdir', str(tmp_path / 'nowhere'))
    before = dict(os.environ)
    with announcements.frequent_announcements():
        assert dict(os.environ) == before


@alone
@pytest.mark.parametrize(('rmw', 'ours'), [
    ('rmw_fastrtps_cpp', True), ('rmw_fastrtps_dynamic_cpp', True), ('rmw_cyclonedds_cpp', False)])
def test_only_fast_dds_is_told(monkeypatch: pytest.MonkeyPatch, rmw: str, ours: bool) -> None:
    monkeypatch.setenv('RMW_IMPLEMENTATION', rmw)
    with announcements.frequent_announcements():
        assert (announcements.FILE_VARIABLE in os.environ) == ours


def test_fast_dds_takes_the_profile_of_a_robot_without_settings(world: Any, until: Any) -> None:
    robot = world.robot(ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST',
                        **{announcements.FILE_VARIABLE: ''})
    robot.wait_for_line('connected to the core')
    until(lambda: 'robot' in world.node.get_node_names(), 'the robot found')
    assert robot.end() == 0
    assert 'XMLPARSER' not in robot.output and 'XMLProfile' not in robot.output
