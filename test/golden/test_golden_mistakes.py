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

"""Each mistake in a configuration gets the message that it always got, with file and line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import check_change
from rt_robot_os.settings import load
from rt_robot_os.settings import parse_ros_args

pytest.importorskip('sensor_msgs.msg', reason='the ROS 2 messages are not installed')

FILE = 'robot.yaml'
GOOD = """\
robot:
  ros__parameters:
    core: {cpu: -1, heartbeat_s: 1.0}
    devices: [imu, gps, depth]
    imu:
      type: witmotion
      port: sim
      baud: 115200
      rate_hz: 200.0
      priority: 80
      sim: {rate_hz: 50.0}
    gps: {type: nmea, port: /dev/ttyUSB0, rate_hz: 20.0, priority: 60}
    depth: {type: bmp280, port: /dev/i2c-1, address: 0x76, topic: depth}
    modules: [attitude, guard]
    attitude: {type: attitude, rate_hz: 400.0, priority: 70}
    guard:
      type: twist_guard
      rate_hz: 50.0
      priority: 40
    topics: [cmd_vel, joints]
    cmd_vel: {message: geometry_msgs/msg/Twist, depth: 8}
    joints: {message: sensor_msgs/msg/JointState, fixed: {name: [a, b], position: 2}}
    mirrors: [imu_data, cmd_vel_in]
    imu_data: {topic: imu/data, max_rate_hz: 50.0}
    cmd_vel_in: {topic: cmd_vel, direction: in, stamped: true}
"""
# Of each mistake: what is written instead of what; several are made at once.
MISTAKES: tuple[tuple[tuple[str, str], ...], ...] = (
    # keys
    (('baud: 115200', 'bauds: 115200'),),
    (('cpu: -1', 'cpus: -1'),),
    (('core:', 'cores:'),),
    (('sim: {rate_hz: 50.0}', 'sim: {rates_hz: 50.0}'),),
    (('depth: 8}', 'depth: 8, latched: true}'),),
    (('stamped: true', 'stampd: true'),),
    (('type: nmea, ', ''),),
    (('baud: 115200', 'rate_hz: 5.0'),),
    (('message: geometry_msgs/msg/Twist, ', ''),),
    # values: type, range, unit, choice
    (('baud: 115200', 'baud: fast'),),
    (('baud: 115200', 'baud: 115200.5'),),
    (('rate_hz: 200.0', 'rate_hz: 200Hz'),),
    (('rate_hz: 200.0', 'rate_hz: .nan'),),
    (('rate_hz: 50.0\n', 'rate_hz: 1000000\n'),),
    (('priority: 80', 'priority: 100'),),
    (('heartbeat_s: 1.0', 'heartbeat_s: 1000ms'),),
    (('port: sim', 'port: 5'),),
    (('direction: in', 'direction: inwards'),),
    (('depth: 8', 'depth: 7'),),
    (('cpu: -1', 'dispatcher: fair'),),
    (('address: 0x76', 'address: 0x50'),),
    (('priority: 60}', 'priority: 60, enabled: yes please}'),),
    # names, lists, sections
    (('devices: [imu, gps, depth]', 'devices: [imu, gps, depth, lidar]'),),
    (('devices: [imu, gps, depth]', 'devices: [imu, gps, depth, imu]'),),
    (('devices: [imu, gps, depth]', 'devices: [imu, gps]'),),
    (('modules: [attitude, guard]', 'modules: guard'),),
    (('modules: [attitude, guard]', 'modules: [attitude, guard, core]'),),
    (('attitude: {type: attitude, rate_hz: 400.0, priority: 70}', 'attitude: 7'),),
    # kinds
    (('type: witmotion', 'type: witmotoin'),),
    (('type: twist_guard', 'type: twist_gaurd'),),
    (('type: twist_guard', "type: 'no_such_package.guard:Guard'"),),
    (('type: twist_guard', "type: 'json:JSONDecoder'"),),
    # topics
    (('msg/Twist,', 'msg/Twits,'),),
    (('geometry_msgs/msg/Twist', 'Twist'),),
    (('address: 0x76, topic: depth', 'address: 0x76, topic: imu/data'),),
    (('type: attitude, ', 'type: attitude, imu_topic: gps/fix, '),),
    (('type: attitude, ', 'type: attitude, imu_topic: imu/dta, '),),
    (('message: geometry_msgs/msg/Twist', 'message: geometry_msgs/msg/TwistStamped'),),
    (('position: 2', 'position: two'),),
    (('fixed: {name: [a, b], position: 2}', 'tail: -1'),),
    (('topic: depth', 'topic: 9th'),),
    # mirrors
    (('topic: imu/data,', 'topic: imu/dat,'),),
    (('direction: in,', 'direction: in, ros_topic: imu/data,'),),
    (('topic: cmd_vel, direction: in', 'topic: imu/mag, direction: in'),),
    (('topic: imu/data, max', 'topic: joints, stamped: true, max'),),
    # devices against each other, and simulated ones
    (('port: sim', 'port: /dev/ttyUSB0'),),
    (('type: nmea, port: /dev/ttyUSB0', 'type: bmp280, topic: b, port: /dev/i2c-1'),),
    (('sim: {rate_hz: 50.0}', "sim: {faults: ['unplug at noon for 2']}"),),
    (('sim: {rate_hz: 50.0}', 'sim: {rate_hz: 900.0}'),),
    (('port: /dev/ttyUSB0', "port: 'tcp://nowhere'"),),
    # tasks
    (('priority: 40', 'on_budget: abort'),),
    (('priority: 40', 'deadline_us: 50000'),),
    (('priority: 40', 'overrun: stop\n      overrun_limit: 3'),),
    (('priority: 40', 'resources: [arm, arm]'),),
    (('rate_hz: 50.0\n', 'rate_hz: 0\n'),),
    (('core:', 'watchdog: {timeout_s: 0.05}\n    core:'),),
    # the text
    (('      baud: 115200', '\t baud: 115200'),),
    (('devices: [imu, gps, depth]', 'devices: [imu, gps, depth'),),
    (('robot:', 'robto:'),),
    (('baud: 115200', 'baud: *speed'),),
    # several at once
    (('baud: 115200', 'baud: fast'), ('priority: 80', 'priority: 0')),
    (('type: nmea', 'type: nmae'), ('depth: 8', 'depth: 9'), ('heartbeat_s', 'heart_beat_s'),
     ('topic: imu/data,', 'topic: imu/dat,')),
)
COMMAND_LINES = (
    '-p imu.baud:=fast', '-p imu.bauds:=9600', '-p imu.rate_hz:=0', '-p gps.port:=5',
    '-p devices:=[imu,lidar]', '-p imu.baud', '-r __node:=2nd', '--params-file',
    '--log-level loud', '--no-such-option',
)
CHANGES: tuple[tuple[str, Any], ...] = (
    ('imu.rate_hz', 100.0), ('imu.rate_hz', 100), ('imu.rate_hz', 0), ('imu.rate_hz', 'fast'),
    ('imu.rate_hz', float('nan')), ('imu.rat_hz', 5.0), ('imu.baud', 9600),
    ('guard.timeout_s', -1.0), ('guard.rate_hz', 20000.0),
    ('guard.log_level', 'loud'), ('nobody.x', 1),
)


@pytest.fixture(autouse=True)
def in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work where messages name files without a folder."""
    monkeypatch.chdir(tmp_path)
    Path(FILE).write_text(GOOD)


def told(text: str, overrides: dict[str, Any] | None = None) -> str:
    """Load a text; give the problems."""
    Path(FILE).write_text(text)
    try:
        load([Path(FILE)], overrides or {})
    except ConfigError as error:
        return '\n'.join(error.problems)
    return 'no problem'


def test_the_messages_for_mistakes_are_those_they_were(golden: Any) -> None:
    assert told(GOOD) == 'no problem'
    shown = []
    for changes in MISTAKES:
        text = GOOD
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new, 1)
        before, after = GOOD.splitlines(), text.splitlines()
        shown.append('\n'.join([
            *(f'- {line.strip()}' for line in before if line not in after),
            *(f'+ {line.strip()}' for line in after if line not in before), told(text), '']))
    golden.check('mistakes.txt', '\n'.join(shown))


def test_the_messages_for_command_lines_are_those_they_were(golden: Any) -> None:
    shown = []
    for line in COMMAND_LINES:
        try:
            arguments = parse_ros_args(['--ros-args', '--params-file', FILE, *line.split()])
            load([Path(path) for path in arguments.params_files], arguments.overrides)
            problem = 'no problem'
        except ConfigError as error:
            problem = '\n'.join(error.problems)
        shown.append(f'--ros-args {line}\n{problem}\n')
    golden.check('command_lines.txt', '\n'.join(shown))


def test_the_reasons_against_changes_are_those_they_were(golden: Any) -> None:
    settings = load([Path(FILE)])
    golden.check('changes.txt', '\n'.join(
        f'{name} := {value}\n{check_change(settings, name, value) or "no problem"}\n'
        for name, value in CHANGES))
