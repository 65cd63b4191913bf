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


"""Settings as ROS 2 parameters: what is declared and what may change while the robot runs."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import Catalogue
from rt_robot_os.settings import changed
from rt_robot_os.settings import check_change
from rt_robot_os.settings import parameters
from rt_robot_os.settings import RobotParameters
from rt_robot_os.settings import RobotSettings

Loader = Callable[..., RobotSettings]


@pytest.fixture
def robot(good: str, load_text: Loader) -> RobotSettings:
    return load_text(good.replace('depth: 8', 'depth: 8, fixed: {header.frame_id: base, n: 3}'))


def test_every_key_is_a_parameter_once(robot: RobotSettings, catalogue: Catalogue) -> None:
    found = {each.name: each.value for each in parameters(robot, catalogue)}
    assert len(found) == len(parameters(robot, catalogue))
    for name, value in {
        'autostart': True, 'devices': ['imu', 'gps'], 'core.heartbeat_s': 1.0,
        'imu.type': 'witmotion', 'imu.port': 'sim', 'imu.rate_hz': 200.0, 'imu.baud': 115200,
        'imu.gains': [1.0, 2.0], 'imu.sim.faults': ['unplug at 5 for 2'], 'gps.rate_hz': 20.0,
        'guard.timeout_s': 0.5, 'cmd_vel.message': 'geometry_msgs/msg/Twist', 'cmd_vel.tail': 0,
        'cmd_vel.fixed.header.frame_id': 'base', 'cmd_vel.fixed.n': 3,
        'imu_data.policy': 'latest', 'cmd_vel_in.ros_topic': 'cmd_vel',
    }.items():
        assert found[name] == value, name
        assert type(found[name]) is type(value), name


def test_every_parameter_has_a_description_and_fits_its_own_field(
    robot: RobotSettings, catalogue: Catalogue,
) -> None:
    for each in parameters(robot, catalogue):
        assert each.field.description
        assert each.field.problem(each.value) is None, each.name
        assert each.read_only is not each.live


def test_parameters_given_back_as_overrides_make_the_same_robot(
    robot: RobotSettings, catalogue: Catalogue, load_text: Loader,
) -> None:
    found = {each.name: each.value for each in parameters(robot, catalogue)}
    assert load_text(overrides=found) == robot


def test_what_is_live(robot: RobotSettings, catalogue: Catalogue) -> None:
    assert [each.name for each in parameters(robot, catalogue) if each.live] == [
        'imu.rate_hz', 'imu.log_level', 'gps.rate_hz', 'gps.log_level', 'guard.rate_hz',
        'guard.log_level', 'guard.timeout_s', 'imu_data.policy', 'imu_data.max_rate_hz',
        'imu_data.delay_ms', 'cmd_vel_in.policy', 'cmd_vel_in.max_rate_hz', 'cmd_vel_in.delay_ms']


@pytest.mark.parametrize(('name', 'value', 'reason'), [
    ('imu.rate_hz', 0.0, 'imu.rate_hz = 0.0: must be a number from 0.1 to 10000 (Hz)'),
    ('imu.rate_hz', float('nan'), 'imu.rate_hz = .nan: must be a number from 0.1 to 10000 (Hz)'),
    ('imu.rate_hz', 'fast', "imu.rate_hz = 'fast': must be a number from 0.1 to 10000 (Hz)"),
    ('imu_data.policy', 'newest', "imu_data.policy = 'newest': must be one of drain, latest"),
    ('guard.timeout_s', 100.0, 'guard.timeout_s = 100.0: must be a number from 0.01 to 60 (s)'),
    ('imu.rate', 1.0, "imu.rate: unknown parameter, did you mean 'imu.rate_hz'?"),
])
def test_a_change_that_cannot_be_is_refused_with_the_reason(
    name: str, value: object, reason: str, robot: RobotSettings, catalogue: Catalogue,
) -> None:
    assert check_change(robot, name, value, catalogue) == reason
    with pytest.raises(ConfigError):
        changed(robot, name, value, catalogue)


def test_what_is_read_at_the_start_cannot_change(
    robot: RobotSettings, catalogue: Catalogue,
) -> None:
    reason = check_change(robot, 'imu.baud', 9600, catalogue)
    assert reason is not None
    assert reason.startswith('imu.baud is read at the start only: change the file and restart')
    assert 'imu.rate_hz' in reason


def test_changes_are_kept(robot: RobotSettings, catalogue: Catalogue) -> None:
    now = RobotParameters(robot, catalogue)
    for name, value in {'imu.rate_hz': 50, 'guard.timeout_s': 1.5, 'imu_data.policy': 'drain',
                        'guard.rate_hz': 10.0}.items():
        assert now.refusal(name, value) is None
        now.set(name, value)
    robot = now.settings
    found = {each.name: each.value for each in parameters(robot, catalogue)}
    assert {name: found[name] for name in now.live_values()} == now.live_values()
    assert found['imu.rate_hz'] == 50.0 and isinstance(found['imu.rate_hz'], float)
    assert (found['guard.timeout_s'], found['imu_data.policy']) == (1.5, 'drain')
    assert (robot.devices[0].rate_hz, robot.modules[0].rate_hz) == (50.0, 10.0)
    assert robot.modules[0].settings['timeout_s'] == 1.5
