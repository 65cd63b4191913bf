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


"""Each mistake gives one line with file, line, key, value and remedy, and all come at once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

Judge = Callable[..., tuple[str, ...]]

NAME_RULE = "letters, digits and '_', not beginning with a digit"


@pytest.mark.parametrize(('old', 'new', 'problem'), [
    # values
    ('baud: 115200', 'baud: fast',
     "robot.yaml:9: imu.baud = 'fast': must be an integer from 1200 to 4000000 (bits/s)"),
    ('baud: 115200', 'baud: 115200.0',
     'robot.yaml:9: imu.baud = 115200.0: must be an integer from 1200 to 4000000 (bits/s)'),
    ('baud: 115200', 'baud: {a: 1}',
     'robot.yaml:9: imu.baud is a section: must be an integer from 1200 to 4000000 (bits/s)'),
    ('frame_id: imu_link', 'frame_id: 5', 'robot.yaml:10: imu.frame_id = 5: must be a string'),
    ('frame_id: imu_link', 'frame_id: "a\\0b"',
     "robot.yaml:10: imu.frame_id = 'a\\x00b': must be a string"),
    ('frame_id: imu_link', 'frame_id: "\\uD800"',
     "robot.yaml:10: imu.frame_id = '\\ud800': must be a string"),
    ('autostart: true', 'autostart: 1', 'robot.yaml:3: autostart = 1: must be true or false'),
    ('frame_id: imu_link', 'range_g: 3',
     'robot.yaml:10: imu.range_g = 3: must be one of 2, 4, 8 (g)'),
    ('frame_id: imu_link', 'gains: [1.0, 6.0]',
     'robot.yaml:10: imu.gains = [1.0, 6.0]: must be a list of numbers from 0 to 5'),
    ('frame_id: imu_link', 'gains: [1.0, .nan]',
     'robot.yaml:10: imu.gains = [1.0, .nan]: must be a list of numbers from 0 to 5'),
    ('frame_id: imu_link', 'gains: 1.0',
     'robot.yaml:10: imu.gains = 1.0: must be a list of numbers from 0 to 5: write [1.0]'),
    ('priority: 80', 'priority: 0',
     'robot.yaml:12: imu.priority = 0: must be an integer from 1 to 99'),
    ('priority: 80', 'priority: 100',
     'robot.yaml:12: imu.priority = 100: must be an integer from 1 to 99'),
    ('{spawn: true, cpu: -1}', '{heartbeat_s: 0}',
     'robot.yaml:4: core.heartbeat_s = 0: must be a number from 0.1 to 60 (s)'),
    ('{spawn: true, cpu: -1}', '{cpu: -3}',
     'robot.yaml:4: core.cpu = -3: must be an integer from -2 to 1023'),
    ('{spawn: true, cpu: -1}', '5', 'robot.yaml:4: core = 5: must be a section'),
    ('policy: latest', 'policy: newest',
     "robot.yaml:20: imu_data.policy = 'newest': must be one of drain, latest"),
    ('direction: in}', 'direction: inward}',
     "robot.yaml:21: cmd_vel_in.direction = 'inward': must be one of out, in"),
    ('depth: 8', 'depth: 9',
     'robot.yaml:18: cmd_vel.depth = 9: must be a power of two, such as 16'),
    ('frame_id: imu_link', 'retry_max_s: 0.1',
     'robot.yaml:10: imu.retry_max_s = 0.1: must be at least retry_s, 0.5 (s)'),
    # keys
    ('baud: 115200', 'bauds: 115200',
     "robot.yaml:9: imu.bauds: unknown key, did you mean 'baud'?"),
    ('spawn: true', 'spwan: true', "robot.yaml:4: core.spwan: unknown key, did you mean 'spawn'?"),
    ('autostart: true', 'autostrat: true',
     "robot.yaml:3: autostrat = true: unknown key, did you mean 'autostart'?"),
    ('port: sim\n      baud', 'baud',
     'robot.yaml:6: imu.port is missing: must be a string. Serial port, or sim'),
    ('type: nmea, ', '',
     'robot.yaml:14: gps.type is missing: must be a driver, known: chip, nmea, witmotion'),
    ('autostart: true', 'autostart: true\n    autostart: false',
     'robot.yaml:4: autostart is given a second time (first at line 3): delete one'),
    ('baud: 115200', 'rate_hz: 5.0',
     'robot.yaml:11: imu.rate_hz is given a second time (first at line 9): delete one'),
    ('autostart: true', 'imu.baud: 9600',
     'robot.yaml:9: imu.baud is given a second time (first at line 3): delete one'),
    ('priority: 80', 'rate_hz.x: 80',
     'robot.yaml:12: imu.rate_hz.x is below a value: see line 11'),
    ('autostart: true', 'a..b: 1',
     "robot.yaml:3: 'a..b' is not a parameter name: a part of it is empty"),
    ('autostart: true', '"a\\nb": 1',
     'robot.yaml:3: a\\nb = 1: unknown key, known: autostart, cmd_vel, cmd_vel_in, core, devices, '
     'diagnostics_rate_hz, gps, guard, imu, imu_data, log, mirrors, modules, parameters_file, '
     'services, static_transforms, topics, watchdog, world'),
    # names and sections
    ('devices: [imu, gps]', 'devices: [imu, gps, imu]',
     "robot.yaml:5: devices = 'imu': is twice in this list: delete one"),
    ('modules: [guard]', 'modules: [guard, imu]',
     "robot.yaml:15: modules = 'imu': is already in 'devices': each section is in one list"),
    ('modules: [guard]', 'modules: [guard, core]',
     "robot.yaml:15: modules = 'core': is the name of a key: choose another name"),
    ('modules: [guard]', 'modules: [guard, 2nd]',
     f"robot.yaml:15: modules = '2nd': a name must be {NAME_RULE}"),
    ('devices: [imu, gps]', 'devices: [imu, gps, lidar]',
     "robot.yaml:5: devices = 'lidar': has no section: write lidar: {...}"),
    ('devices: [imu, gps]', 'devices:\n    - imu\n    - gps\n    - gsp',
     "robot.yaml:8: devices = 'gsp': has no section, did you mean 'gps'?"),
    ('devices: [imu, gps]', 'devices: [imu]',
     "robot.yaml:14: gps: this section is in no list: add 'gps' to 'devices' or delete it"),
    ('modules: [guard]', 'modules: []',
     "robot.yaml:16: guard: this section is in no list: add 'guard' to 'modules' or delete it"),
    ('topics: [cmd_vel]', '',
     "robot.yaml:18: cmd_vel: this section is in no list: add 'cmd_vel' to 'topics' or delete it"),
    ('mirrors: [imu_data, cmd_vel_in]', 'mirrors: [imu_data]',
     "robot.yaml:21: cmd_vel_in: this section is in no list: add 'cmd_vel_in' to 'mirrors' or "
     'delete it'),
    ('autostart: true', 'cores: {spawn: true}',
     "robot.yaml:3: cores: this section is in no list: add 'cores' to 'devices' or 'modules' or "
     "'topics' or 'mirrors' or 'services' or delete it, or did you mean 'core'?"),
    ('modules: [guard]', 'modules: guard',
     "robot.yaml:15: modules = 'guard': must be a list of strings: write ['guard']"),
    ('modules: [guard]', 'modules: [1]',
     'robot.yaml:15: modules = [1]: must be a list of strings'),
    ('guard: {type: twist_guard, rate_hz: 50.0, priority: 40}', 'guard: 7',
     'robot.yaml:16: guard = 7: must be a section'),
    # types
    ('type: nmea', 'type: nmae',
     "robot.yaml:14: gps.type = 'nmae': no such thing, known: witmotion, nmea, chip"),
    ('type: nmea', 'type: 5', 'robot.yaml:14: gps.type = 5: must be a string'),
    ('type: twist_guard', 'type: twist_gard',
     "robot.yaml:16: guard.type = 'twist_gard': no such thing, known: twist_guard, broken"),
    ('type: twist_guard', 'type: broken',
     'robot.yaml:16: guard: this module cannot be made from these settings: '
     "ZeroDivisionError('a module of the user')"),
    ('msg/Twist,', 'msg/Twits,',
     "robot.yaml:18: cmd_vel.message = 'geometry_msgs/msg/Twits': message type "
     "'geometry_msgs/msg/Twits': there is none"),
    ('geometry_msgs/msg/Twist,', 'Twist,',
     "robot.yaml:18: cmd_vel.message = 'Twist': must be package/msg/Type, such as "
     'geometry_msgs/msg/Twist'),
    # simulation
    ("faults: ['unplug at 5 for 2']", 'fault: 1',
     "robot.yaml:13: imu.sim.fault: unknown key, did you mean 'faults'?"),
    ('{rate_hz: 50.0,', '{rate_hz: 0,',
     'robot.yaml:13: imu.sim.rate_hz = 0: must be a number from 0.1 to 1000 (Hz)'),
    ("{rate_hz: 50.0, faults: ['unplug at 5 for 2']}", 'on',
     "robot.yaml:13: imu.sim must be a section of the simulator's keys"),
    ('{type: nmea, port: sim, ', '{type: chip, port: sim, ',
     'robot.yaml:14: gps.port: no such thing, known: witmotion, nmea'),
    # topics
    ('frame_id: imu_link', 'mag_topic: imu//mag',
     f"robot.yaml:10: imu.mag_topic = 'imu//mag': must be names of {NAME_RULE}, separated by '/', "
     'such as imu/data'),
    ('depth: 8', 'depth: 8, topic: 9a',
     f"robot.yaml:18: cmd_vel.topic = '9a': must be names of {NAME_RULE}, separated by '/', "
     'such as imu/data'),
    ('rate_hz: 20,', 'topic: imu/data,',
     "robot.yaml:14: gps.topic = 'imu/data': is sensor_msgs/msg/NavSatFix here but "
     'sensor_msgs/msg/Imu (device imu, robot.yaml:6): choose another name'),
    ('type: twist_guard', 'type: twist_guard, command_topic: cmd_vle',
     "robot.yaml:16: module guard reads 'cmd_vle': no part declares this topic, did you mean "
     "'cmd_vel'? Or add it to 'topics'"),
    ('type: twist_guard', 'type: twist_guard, command_topic: imu/data',
     "robot.yaml:16: module guard reads 'imu/data' as geometry_msgs/msg/Twist, but it is "
     'sensor_msgs/msg/Imu (device imu, robot.yaml:6)'),
    ('depth: 8', 'depth: 8, fixed: 5',
     'robot.yaml:18: cmd_vel.fixed must be a section: fields of the message, with a string or '
     'length'),
    # mirrors
    ('{topic: imu/data,', '{topic: imu/dat,',
     "robot.yaml:20: imu_data.topic = 'imu/dat': no part declares this topic, did you mean "
     "'imu/data'?"),
    ('{topic: cmd_vel, direction', '{topic: nothing, direction',
     "robot.yaml:21: cmd_vel_in.topic = 'nothing': no part declares this topic, known: cmd_vel, "
     'cmd_vel_safe, gps/fix, gps/time, imu/data, imu/mag'),
    ('{topic: imu/data,', '{topic: imu/data, ros_topic: imu/,',
     f"robot.yaml:20: imu_data.ros_topic = 'imu/': must be names of {NAME_RULE}, separated by "
     "'/', such as imu/data"),
    ('{topic: imu/data,', '{topic: imu data,',
     f"robot.yaml:20: imu_data.topic = 'imu data': must be names of {NAME_RULE}, separated by "
     "'/', such as imu/data"),
    ('topic: cmd_vel, direction: in', 'topic: imu/mag, ros_topic: /imu/data',
     "robot.yaml:21: cmd_vel_in.ros_topic = '/imu/data': mirror imu_data (robot.yaml:20) already "
     'has /imu/data out: give each its own'),
    ('direction: in}', 'direction: in, ros_topic: imu/data}',
     "robot.yaml:21: cmd_vel_in.ros_topic = 'imu/data': mirror imu_data (robot.yaml:20) has "
     '/imu/data in the other direction: that is a loop, give each its own'),
])
def test_a_mistake_is_one_line(
    old: str, new: str, problem: str, good: str, problems_of: Judge,
) -> None:
    assert good.count(old) >= 1
    text = good.replace(old, new, 1)
    if not new:
        text = text.replace('    \n', '    # gone\n')
    assert problems_of(text) == (problem,)


@pytest.mark.parametrize('rate', ['0', '-1', '.nan', '.inf', '1e9', '-.inf', '0.09', '10001'])
@pytest.mark.parametrize(('where', 'line'), [('rate_hz: 200.0', 11), ('rate_hz: 50.0, p', 16)])
def test_impossible_rates_are_refused(
    rate: str, where: str, line: int, good: str, problems_of: Judge,
) -> None:
    found = problems_of(good.replace(where, where.replace('200.0', rate).replace('50.0', rate)))
    name = 'imu' if line == 11 else 'guard'
    shown = {'1e9': '1000000000.0'}.get(rate, rate)
    reason = 'must be a number from 0.1 to 10000 (Hz)'
    if name == 'guard':  # a module may leave it to its inputs
        reason = {'0': 'none of its inputs releases the task (wake): give it a rate',
                  '0.09': 'must be at least 0.1 (Hz), or 0 when only its inputs release it'}.get(
                      rate, 'must be a number from 0 to 10000 (Hz)')
        shown = {'0': '0.0'}.get(shown, shown)
    assert found == (f'robot.yaml:{line}: {name}.rate_hz = {shown}: {reason}',)


def test_two_devices_on_one_topic_must_agree_on_what_is_fixed(
    good: str, problems_of: Judge,
) -> None:
    text = good.replace('gps: {type: nmea, port: sim, rate_hz: 20,',
                        'gps: {type: witmotion, port: sim, mag_topic: mag,')
    assert problems_of(text) == (
        "robot.yaml:14: gps.topic = 'imu/data': is sensor_msgs/msg/Imu here but "
        'sensor_msgs/msg/Imu (device imu, robot.yaml:6) with different fixed fields: choose '
        'another name',)


def test_two_devices_on_one_port(good: str, problems_of: Judge) -> None:
    text = good.replace('port: sim', 'port: /dev/ttyUSB0')
    assert problems_of(text) == (
        "robot.yaml:14: gps.port = '/dev/ttyUSB0': is the port of imu (robot.yaml:8): "
        'give each its own',)


def test_a_link_does_not_hide_that_two_devices_are_on_one_port(
    good: str, problems_of: Judge, tmp_path: Path,
) -> None:
    port, link = tmp_path / 'ttyUSB0', tmp_path / 'by-id'
    port.touch()
    link.symlink_to(port)
    text = good.replace('port: sim', f'port: {port}', 1).replace('port: sim', f'port: {link}')
    found = problems_of(text)
    assert len(found) == 1
    assert f"gps.port = '{link}': is the port of imu" in found[0]


def test_devices_on_a_bus_may_share_its_port(load_text: Callable[..., object]) -> None:
    load_text('robot:\n  ros__parameters:\n    devices: [a, b]\n'
              '    a: {type: chip, port: /dev/i2c-1}\n'
              '    b: {type: chip, port: /dev/i2c-1, address: 119}\n')


def test_two_devices_of_one_address_on_a_bus(problems_of: Judge) -> None:
    text = ('robot:\n  ros__parameters:\n    devices: [a, b, c]\n'
            '    a: {type: chip, port: /dev/i2c-1}\n    b: {type: chip, port: /dev/i2c-1}\n'
            '    c: {type: chip, port: /dev/i2c-2}\n')
    found = problems_of(text)
    assert len(found) == 1
    assert 'b.address = 118: is the address of a on this bus' in found[0]


BUS = """\
robot:
  ros__parameters:
    devices: [a, b, gps]
    a: {type: chip, port: /dev/i2c-1, address: 0x76}
    b: {type: chip, port: /dev/i2c-1, address: 0x77}
    gps: {type: nmea, port: /dev/i2c-1, baud: 9600}
"""


@pytest.mark.parametrize(('devices', 'problem'), [
    ('[a, b, gps]', "6: gps.port = '/dev/i2c-1': is the port of a (robot.yaml:4)"),
    ('[gps, a]', "4: a.port = '/dev/i2c-1': is the port of gps (robot.yaml:6)"),
])
def test_what_is_made_for_no_bus_is_not_on_one(
    devices: str, problem: str, problems_of: Judge,
) -> None:
    text = BUS.replace('[a, b, gps]', devices)
    if devices == '[gps, a]':
        text = text.replace('    b: {type: chip, port: /dev/i2c-1, address: 0x77}\n', '\n')
    assert problems_of(text) == (f'robot.yaml:{problem}: give each its own',)


def test_ten_mistakes_are_ten_lines(good: str, problems_of: Judge) -> None:
    text = good
    for old, new in (
        ('autostart: true', 'autostart: maybe'), ('cpu: -1', 'cpu: x'),
        ('gps]', 'gps, lidar]'), ('baud: 115200', 'baud: fast'),
        ('rate_hz: 200.0', 'rate_hz: 0'), ('priority: 80', 'priority: 100'),
        ('type: twist_guard', 'type: twist_guard, extra: 1'), ('depth: 8', 'depth: 7'),
        ('topic: imu/data', 'topic: imu/dta'), ('direction: in', 'direction: up'),
    ):
        text = text.replace(old, new, 1)
    found = problems_of(text, overrides={'gps.rate_hz': -1})
    assert [line.split(' = ')[0].split(': unknown')[0] for line in found] == [
        'robot.yaml:3: autostart', 'robot.yaml:4: core.cpu', 'robot.yaml:5: devices',
        'robot.yaml:9: imu.baud', 'robot.yaml:11: imu.rate_hz', 'robot.yaml:12: imu.priority',
        'robot.yaml:16: guard.extra', 'robot.yaml:18: cmd_vel.depth',
        'robot.yaml:20: imu_data.topic', 'robot.yaml:21: cmd_vel_in.direction',
        'command line: gps.rate_hz']


def test_one_mistake_does_not_bring_on_others(good: str, problems_of: Judge) -> None:
    # The topics of a device that nobody can make are not reported as missing.
    text = good.replace('type: witmotion', 'type: unknown').replace(
        'port: sim\n', 'port: sim\n      topic: imu/data\n')
    assert len(problems_of(text)) == 1


def test_nonsense_by_the_thousand_is_told_in_a_bounded_number_of_lines(
    problems_of: Judge,
) -> None:
    lines = '\n'.join(f'    k{i}: {i}' for i in range(3000))
    found = problems_of(f'robot:\n  ros__parameters:\n{lines}\n')
    assert len(found) == 501
    assert found[-1] == 'and 2500 more problems'
