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

"""What the command line switches off, and what it simulates."""

from __future__ import annotations

from pathlib import Path
import re
from typing import Any

import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import default_path
from rt_robot_os.settings import load
from rt_robot_os.settings import parameters
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings.load import load_from_arguments


def shipped(**overrides: Any) -> RobotSettings:
    return load([default_path()], {name.replace('__', '.'): value
                                   for name, value in overrides.items()})


@pytest.mark.parametrize('overrides', [{'gps__enabled': False}, {'devices': ('imu',)}])
def test_a_device_is_switched_off_and_its_topics_stay(overrides: dict[str, Any]) -> None:
    robot, whole = shipped(**overrides), shipped()
    assert [device.name for device in robot.devices] == ['imu']
    assert robot.modules == whole.modules and robot.mirrors == whole.mirrors
    silent = [topic for topic in robot.topics if topic not in whole.topics]
    assert {topic.topic for topic in silent} == {'gps/fix', 'gps/time'}
    assert {topic.message for topic in silent} == {
        'sensor_msgs/msg/NavSatFix', 'sensor_msgs/msg/TimeReference'}


def test_who_reads_a_device_that_is_off_waits() -> None:
    assert [m.name for m in shipped(imu__enabled=False).modules] == ['attitude', 'guard']


@pytest.mark.parametrize('overrides', [{'guard__enabled': False}, {'modules': ('attitude',)}])
def test_a_module_is_switched_off_too(overrides: dict[str, Any]) -> None:
    robot = shipped(**overrides)
    assert [module.name for module in robot.modules] == ['attitude']
    assert 'cmd_vel_safe' in {topic.topic for topic in robot.topics}


def test_mirrors_that_are_not_in_the_list_are_left_out() -> None:
    assert [m.name for m in shipped(mirrors=('imu_data',)).mirrors] == ['imu_data']


def test_what_is_off_is_checked_all_the_same() -> None:
    with pytest.raises(ConfigError, match='gps.baud'):
        shipped(gps__enabled=False, gps__baud='fast')


def test_two_devices_may_have_one_port_when_one_is_off() -> None:
    ports = {'imu__port': '/dev/ttyX', 'gps__port': '/dev/ttyX'}
    with pytest.raises(ConfigError, match='is the port of'):
        shipped(**ports)
    assert len(shipped(**ports, gps__enabled=False).devices) == 1


def test_what_is_off_has_parameters_that_ros_can_hold() -> None:
    # Its topic has a layout with a label: a list of messages.
    robot = load([default_path('service_robot.yaml')], {'network.enabled': False})
    for each in parameters(robot):
        values = each.value if isinstance(each.value, (list, tuple)) else [each.value]
        assert all(isinstance(value, (bool, int, float, str)) for value in values), each.name


def test_the_parameters_of_what_is_left_make_the_same_robot(tmp_path: Path) -> None:
    robot = shipped(gps__enabled=False)
    again = load([], {each.name: each.value for each in parameters(robot)})
    assert again == robot


def test_a_robot_without_configuration_did_not_ask_to_be_simulated(tmp_path: Path) -> None:
    robot, _ = load_from_arguments([])
    assert robot.simulated == ('imu', 'gps') and not robot.simulation_asked
    assert not load_from_arguments(
        ['--ros-args', '--params-file', str(default_path())])[0].simulation_asked
    assert load_from_arguments([], simulate=True)[0].simulation_asked
    mine = tmp_path / 'mine.yaml'
    mine.write_text(default_path().read_text())
    assert load_from_arguments(['--ros-args', '--params-file', str(mine)])[0].simulation_asked


def test_a_real_robot_can_be_simulated(tmp_path: Path) -> None:
    mine = tmp_path / 'mine.yaml'
    ports = iter(('/dev/ttyUSB7', '/dev/ttyUSB8', 'sim'))
    mine.write_text(re.sub('port: sim', lambda _: f'port: {next(ports)}',
                           default_path().read_text().replace('With port: sim', '')))
    arguments = ['--ros-args', '--params-file', str(mine)]
    assert load_from_arguments(arguments)[0].simulated == ()
    assert load_from_arguments(arguments, simulate=True)[0].simulated == ('imu', 'gps')
