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


"""The ROS part of a command line."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import parse_ros_args


def test_an_ordinary_command_line() -> None:
    found = parse_ros_args([
        '--verbose', '--ros-args', '--params-file', 'a.yaml', '-p', 'imu.rate_hz:=100.0',
        '--param', 'devices:=[imu, gps]', '-p', 'imu.port:="5"', '-r', '__node:=rover',
        '-r', '__ns:=/lab', '-r', 'imu/data:=other', '--log-level', 'debug', '--params-file',
        'b.yaml', '--', 'rest', '--ros-args', '-p', 'autostart:=off'])
    assert found.params_files == (Path('a.yaml'), Path('b.yaml'))
    assert dict(found.overrides) == {
        'imu.rate_hz': 100.0, 'devices': ('imu', 'gps'), 'imu.port': '5', 'autostart': False}
    assert (found.node_name, found.namespace) == ('rover', '/lab')
    assert found.rest == ('--verbose', 'rest')


def test_nothing_given() -> None:
    found = parse_ros_args([])
    assert (found.params_files, dict(found.overrides), found.rest) == ((), {}, ())
    assert (found.node_name, found.namespace) == ('robot', '/')


def test_values_meant_for_another_node_are_left_alone() -> None:
    found = parse_ros_args(['--ros-args', '-p', 'camera:rate:=1', '-p', 'rover:rate:=2',
                            '-r', 'robot:__node:=rover', '-r', 'camera:__ns:=/x'])
    assert dict(found.overrides) == {'rate': 2}
    assert (found.node_name, found.namespace) == ('rover', '/')


def test_the_first_remapping_of_a_name_counts_as_in_rcl() -> None:
    found = parse_ros_args(['--ros-args', '-r', '__name:=a', '-r', '__node:=b'])
    assert found.node_name == 'a'


def test_a_value_of_a_flag_is_no_flag() -> None:
    assert not parse_ros_args(['--ros-args', '--log-file-name', '-p']).overrides


@pytest.mark.parametrize(('arguments', 'problem'), [
    (['-p'], 'command line: -p is the last argument: its value is missing'),
    (['--params-file'],
     'command line: --params-file is the last argument: its value is missing'),
    (['-p', 'autostart'], 'command line: -p autostart: must be name:=value, such as '
     'imu.rate_hz:=100.0'),
    (['-p', ':=1'], 'command line: -p :=1: must be name:=value, such as imu.rate_hz:=100.0'),
    (['-p', 'a:='], "command line: a has no value: write a:='\"\"' for an empty string"),
    (['-p', 'a:=~'], "command line: a has no value: write a:='\"\"' for an empty string"),
    (['-p', 'a:={b: 1}'], 'command line: a must be one value or a list: give the keys of a '
     'section one by one, a.key:=value'),
    (['-p', 'a:=[1, x]'], "command line: a = [1, 'x']: ROS 2 requires a list of one type: quote "
     'strings'),
    (['-p', 'a:=*b'], "command line: a: column 1: '*b': ROS 2 has no aliases, repeat the "
     'value'),
    (['-r', '__node:=a b'], "command line: -r __node = 'a b': must be letters, digits and '_', "
     'not beginning with a digit'),
    (['-r', '__ns:=lab'], "command line: -r __ns = 'lab': must be '/' or begin with '/', in names "
     "of letters, digits and '_', not beginning with a digit, such as /lab"),
    (['-r', '__node:=' + 300 * 'a'], f"command line: -r __node = '{96 * 'a'}...: must be at most "
     '255 characters'),
    (['-r', 'imu/data'], 'command line: -r imu/data: must be FROM:=TO, such as '
     'imu/data:=/head/imu or __node:=arm'),
    (['--log-level', 'loud'], "command line: --log-level = 'loud': must be one of debug, info, "
     'warn, error, fatal'),
    (['--parms-file'], 'command line: --parms-file: is not an argument of ROS 2: did you mean '
     '--params-file?'),
    (['my.yaml'], 'command line: my.yaml: is not an argument of ROS 2: write --params-file '
     'my.yaml'),
    (['imu.rate_hz:=1'], 'command line: imu.rate_hz:=1: is not an argument of ROS 2: write -p '
     'imu.rate_hz:=1 for a parameter, -r imu.rate_hz:=1 for another name'),
    (['--simulate'], "command line: --simulate: is not an argument of ROS 2: the program's own "
     'arguments must come before --ros-args'),
])
def test_arguments_that_cannot_be_understood(arguments: list[str], problem: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_ros_args(['--ros-args', *arguments])
    assert caught.value.problems == (problem,)


def test_all_bad_arguments_are_told_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        parse_ros_args(['--ros-args', '-p', 'a', '-p', 'b:=[', '-r', '__ns:=x', '-p'])
    assert len(caught.value.problems) == 4


@settings(max_examples=60, deadline=None)
@given(st.lists(st.one_of(
    st.sampled_from(['--ros-args', '--', '-p', '-r', '--params-file', '--remap', '-e']),
    st.text(st.sampled_from('ab_:=/[]{}*&"\' \x00'), max_size=12)), max_size=12))
def test_no_command_line_fails_in_any_other_way(argv: list[str]) -> None:
    try:
        parse_ros_args(argv)
    except ConfigError as error:
        assert error.problems
