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


"""What comes with the package: its configurations, its registries, its page of keys."""

from __future__ import annotations

from pathlib import Path

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import default_path
from rt_robot_os.settings import from_json
from rt_robot_os.settings import load
from rt_robot_os.settings import parameters
from rt_robot_os.settings import to_json
from rt_robot_os.settings.describe import describe
from rt_robot_os.settings.tasks import without_watchdog
import yaml

pytest.importorskip('geometry_msgs.msg', reason='the ROS 2 messages are not installed')

ROOT = Path(__file__).resolve().parents[2]
COMMAND = 'python3 -m rt_robot_os.settings.describe > docs/configuration.md'


@pytest.mark.parametrize('name', ['robot.yaml', 'serial.yaml'])
@pytest.mark.parametrize('namespace', ['/', '/lab'])
def test_a_shipped_configuration_has_no_problem(name: str, namespace: str) -> None:
    robot = load([ROOT / 'config' / name], namespace=namespace)
    assert from_json(to_json(robot)) == robot
    assert [device.name for device in robot.devices] == ['imu', 'gps']
    assert {mirror.message for mirror in robot.mirrors} == {
        'sensor_msgs/msg/Imu', 'sensor_msgs/msg/MagneticField', 'sensor_msgs/msg/NavSatFix',
        'sensor_msgs/msg/TimeReference', 'geometry_msgs/msg/Twist'}


def test_the_default_configuration_opens_no_port() -> None:
    robot = load([default_path()])
    assert all(device.port == 'sim' and device.sim is not None for device in robot.devices)
    assert all(device.sim is None for device in load([default_path('serial.yaml')]).devices)


def test_the_default_configuration_says_the_defaults_of_the_core() -> None:
    bare = load([])
    robot = load([default_path()])
    assert robot.core == bare.core
    assert (robot.autostart, robot.diagnostics_rate_hz) == (
        bare.autostart, bare.diagnostics_rate_hz)


@pytest.mark.parametrize('name', ['robot.yaml', 'serial.yaml'])
def test_the_simulator_goes_away_with_a_real_port(name: str) -> None:
    path = ROOT / 'config' / name
    robot = load([path], {'imu.port': '/dev/ttyUSB7', 'gps.port': 'sim'})
    imu, gps = robot.devices
    assert (imu.port, imu.sim) == ('/dev/ttyUSB7', None)
    assert gps.sim is not None


def test_mistakes_that_only_the_classes_can_find() -> None:
    overrides = {
        'imu.sim.faults': ['unplug at noon for 2'], 'gps.sim.rate_hz': 50.0,
        'guard.type': 'no.such:Module', 'topics': ['cmd_vel', 'scan', 'joint'],
        'scan.message': 'sensor_msgs/msg/Lidar', 'joint.message': 'no_such_msgs/msg/X',
        'cmd_vel.fixed.nothing': 3,
    }
    with pytest.raises(ConfigError) as caught:
        load([default_path()], overrides)
    text = '\n'.join(caught.value.problems)
    assert len(caught.value.problems) == 6
    for part in ("imu.sim: fault 'unplug at noon for 2'", 'gps.sim: rate_hz 50 needs',
                 "guard.type = 'no.such:Module': ", "scan.message = 'sensor_msgs/msg/Lidar': ",
                 "joint.message = 'no_such_msgs/msg/X': ", 'cmd_vel.message'):
        assert part in text


def test_chips_on_the_simulated_bus_have_addresses_of_their_own() -> None:
    chips = {'devices': ['a', 'b'], 'a.type': 'bmp280', 'b.type': 'ms5611', 'b.topic': 'b/p',
             'b.temperature_topic': '', 'b.altitude_topic': '', 'a.port': 'sim', 'b.port': 'sim'}
    assert len(load([], chips).devices) == 2
    with pytest.raises(ConfigError, match='b.address = 118: is the address of a on this bus'):
        load([], {**chips, 'b.address': 118})


def test_every_driver_has_what_the_page_and_ros_need() -> None:
    for each in parameters(load([default_path()])):
        assert each.field.description, each.name
        assert each.field.default is None or each.field.problem(each.value) is None, each.name


def test_the_page_of_keys_is_up_to_date() -> None:
    page = (ROOT / 'docs' / 'configuration.md').read_text(encoding='utf-8')
    assert page == describe(), f'write it again: {COMMAND}'


def test_ros_reads_the_shipped_configurations_the_same_way() -> None:
    # PyYAML and rcl differ in details; what is shipped must not depend on them.
    for name in ('robot.yaml', 'serial.yaml'):
        text = (ROOT / 'config' / name).read_text(encoding='utf-8')
        node, = yaml.safe_load(text).values()
        tree = node['ros__parameters']
        found = {each.name: each.value for each in parameters(load([ROOT / 'config' / name]))}
        for section, values in tree.items():
            leaves = values if isinstance(values, dict) else {'': values}
            for key, value in leaves.items():
                if not isinstance(value, dict):
                    dotted = f'{section}.{key}'.rstrip('.')
                    assert found[dotted] == value, dotted


SHIPPED = ['robot.yaml', 'serial.yaml', 'service_robot.yaml', 'assisted_living.yaml']


@pytest.mark.parametrize('name', SHIPPED)
def test_a_shipped_robot_that_moves_has_a_watchdog_and_budgets(name: str) -> None:
    robot = load([ROOT / 'config' / name])
    parts = {part.name: part for part in (*robot.devices, *robot.modules)}
    critical = [part for part in parts.values() if part.task.critical]
    assert {part.type for part in critical} <= {'twist_guard', 'collision_guard'} and critical
    assert robot.watchdog.timeout_s >= 2.0  # shorter ones end cores that a busy machine starves
    assert robot.watchdog.action == 'exit'
    above = [part for part in robot.modules
             if part.priority >= min(each.priority for each in critical)]
    if name != 'robot.yaml':  # its attitude is the page of keys
        assert all(part.task.on_budget == 'abort' for part in above)
    assert without_watchdog(robot) == ''


def test_what_is_critical_without_a_watchdog_is_named_with_the_remedy() -> None:
    robot = load([ROOT / 'config/service_robot.yaml'], {'watchdog.timeout_s': 0.0})
    assert without_watchdog(robot) == (
        "critical: true of 'collision_guard' has no effect: watchdog.timeout_s is 0, so no "
        'watchdog runs; set it, for instance to 2.0 with action: exit')
    assert without_watchdog(load([])) == ''
