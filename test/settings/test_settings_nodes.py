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


"""Which sections of which files count, and what wins over what."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import Catalogue
from rt_robot_os.settings import load
from rt_robot_os.settings import RobotSettings

Loader = Callable[..., RobotSettings]
Judge = Callable[..., tuple[str, ...]]


def rate(value: float, *keys: str) -> str:
    """Write a file that sets one number under nested keys."""
    text = ''
    for depth, key in enumerate((*keys, 'ros__parameters')):
        text += f"{'  ' * depth}{key}:\n"
    return text + f"{'  ' * (len(keys) + 1)}diagnostics_rate_hz: {value}\n"


# As rclpy 7.1 does with the same files.
@pytest.mark.parametrize(('keys', 'at_root', 'in_lab'), [
    (('robot',), True, False), (('/robot',), True, False), (('/', 'robot'), True, False),
    (('/**',), True, True), (('/*',), True, False), (('/**', 'robot'), True, True),
    (('/**/robot',), True, True), (('/lab', 'robot'), False, True),
    (('lab', 'robot'), False, True), (('/lab/robot',), False, True), (('/lab/*',), False, True),
    (('/lab/**',), False, True), (('/*/robot',), False, True), (('/other/robot',), False, False),
])
def test_names_and_wildcards_are_those_of_rcl(
    keys: tuple[str, ...], at_root: bool, in_lab: bool, load_text: Loader,
) -> None:
    base = rate(5.0, '/**')
    expected = {True: 7.0, False: 5.0}
    text = rate(7.0, *keys)
    assert load_text(base, text).diagnostics_rate_hz == expected[at_root]
    assert load_text(base, text, namespace='/lab').diagnostics_rate_hz == expected[in_lab]


def test_another_node_name_reads_other_sections(load_text: Loader) -> None:
    text = rate(5.0, 'robot') + rate(6.0, 'rover')
    assert load_text(text, node='rover').diagnostics_rate_hz == 6.0


def test_sections_of_one_file_count_in_their_order(load_text: Loader) -> None:
    named, wild = rate(1.0, 'robot'), rate(2.0, '/**')
    assert load_text(named + wild).diagnostics_rate_hz == 2.0
    assert load_text(wild + named).diagnostics_rate_hz == 1.0


def test_later_files_win_key_by_key_and_the_command_line_over_all(
    good: str, load_text: Loader,
) -> None:
    text = ('robot:\n  ros__parameters:\n    imu: {rate_hz: 10.0, port: /dev/ttyUSB0}\n'
            '    devices: [imu]\n')
    with pytest.raises(ConfigError, match='robot.yaml:14: gps: this section is in no list'):
        load_text(good, text)
    merged = load_text(good, text, overrides={'imu.rate_hz': 20, 'devices': ['imu', 'gps']})
    imu, gps = merged.devices
    assert (imu.rate_hz, imu.port, imu.priority, imu.settings['baud']) == (
        20.0, '/dev/ttyUSB0', 80, 115200)
    assert gps.rate_hz == 20.0
    assert imu.sim is None


def test_a_problem_names_the_file_whose_value_counts(good: str, problems_of: Judge) -> None:
    second = 'robot:\n  ros__parameters:\n    imu.rate_hz: 0\n'
    assert problems_of(good.replace('200.0', '-1'), second) == (
        'second.yaml:3: imu.rate_hz = 0: must be a number from 0.1 to 10000 (Hz)',)


def test_the_command_line_has_no_line(good: str, problems_of: Judge) -> None:
    assert problems_of(good, overrides={'imu.rate_hz': 0, 'imu.x': None, 'a b': 1, '': 2}) == (
        'command line: imu.x has no value: write one or leave the key out',
        "command line: '' is not a parameter name: a part of it is empty",
        'command line: a b = 1: unknown key, known: autostart, cmd_vel, cmd_vel_in, core, '
        'devices, diagnostics_rate_hz, gps, guard, imu, imu_data, log, mirrors, modules, '
        'parameters_file, services, static_transforms, topics, watchdog, world',
        'command line: imu.x: unknown key, known: baud, budget_us, catch_up, critical, '
        'deadline_us, enabled, execution_us, failure, frame_id, gains, log_level, '
        'logical_execution, mag_topic, max_subscribers, on_budget, overrun, overrun_leak, '
        'overrun_limit, phase_us, port, priority, range_g, rate_hz, read, resources, '
        'restart_max_s, restart_s, retry_max_s, retry_s, sim, timeout_s, topic, type',
        'command line: imu.rate_hz = 0: must be a number from 0.1 to 10000 (Hz)',
    )


def test_parameters_of_ros_itself_are_left_alone(good: str, load_text: Loader) -> None:
    extra = ('/**:\n  ros__parameters:\n    use_sim_time: false\n'
             '    start_type_description_service: true\n'
             '    qos_overrides: {/parameter_events: {publisher: {depth: 1000}}}\n')
    assert load_text(good, extra) == load_text(good)


def test_parameters_of_other_nodes_are_left_alone(good: str, load_text: Loader) -> None:
    other = 'camera:\n  ros__parameters:\n    a: [1, x]\n    a: ~\n    nonsense: {b: {}}\n'
    assert load_text(good + other) == load_text(good)


def test_no_file_and_no_list_is_a_robot_without_anything(load_text: Loader) -> None:
    settings = load_text()
    assert (settings.devices, settings.mirrors) == ((), ())
    assert settings.core.heartbeat_s == 1.0


@pytest.mark.parametrize(('text', 'problem'), [
    ('', 'robot.yaml: has no parameters for /robot, only for nothing: put them under '
     "'/robot:'"),
    (rate(1.0, 'camera'), 'robot.yaml: has no parameters for /robot, only for /camera: put them '
     "under '/robot:'"),
    (rate(1.0, 'robto'), 'robot.yaml: has no parameters for /robot, only for /robto: did you mean '
     "'robot' by 'robto'?"),
    ('robot:\n  autostart: true\n  core: {}\n',
     "robot.yaml:2: /robot/autostart is outside 'ros__parameters': parameters must be below "
     "'robot:' and then 'ros__parameters:'"),
    ('robot:\n  ros_parameters:\n    autostart: true\n',
     "robot.yaml:2: /robot/ros_parameters is outside 'ros__parameters': did you mean "
     "'ros__parameters:'?"),
    ('ros__parameters:\n  autostart: true\n',
     "robot.yaml:1: ros__parameters must be below the node's name: robot:"),
    ('robot:\n  ros__parameters: 5\n',
     'robot.yaml:2: /robot/ros__parameters must be a section: write {} when it is empty'),
    (rate(1.0, 'robot') + rate(2.0, 'robot'),
     'robot.yaml:4: /robot already exists at line 1: join the two'),
])
def test_files_without_parameters_for_the_node(
    text: str, problem: str, problems_of: Judge,
) -> None:
    assert problem in problems_of(text)
    assert len(problems_of(text)) <= 2


def test_a_second_file_meant_for_this_node_but_misspelt_is_noticed(
    good: str, load_text: Loader, problems_of: Judge,
) -> None:
    assert len(problems_of(good, rate(1.0, 'robbot'))) == 1
    for other in ('camera', 'robot2', '/lab/robot'):
        load_text(good, rate(1.0, other))


def test_all_broken_files_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, catalogue: Catalogue,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path('a.yaml').write_text('a: [\n')
    Path('b.yaml').write_text('robot:\n  ros__parameters:\n    imu: 5\n    x: ~\n')
    with pytest.raises(ConfigError) as caught:
        load([Path('a.yaml'), Path('b.yaml'), Path('c.yaml')], catalogue=catalogue)
    assert [line.split(':')[0] for line in caught.value.problems] == ['a.yaml', 'b.yaml', 'c.yaml']
