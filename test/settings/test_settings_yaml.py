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


"""The text: values as ROS 2 reads them, and one clear line where it is no parameter file."""

from __future__ import annotations

from collections.abc import Callable
import math
from pathlib import Path
import subprocess
import sys
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import Catalogue
from rt_robot_os.settings import load
from rt_robot_os.settings.tree import Leaf
from rt_robot_os.settings.yaml_text import parse
from rt_robot_os.settings.yaml_text import scalar
from rt_robot_os.settings.yaml_text import YamlProblem

Judge = Callable[..., tuple[str, ...]]


# Read out of rclpy 7.1 (rcl_yaml_param_parser) with automatically declared parameters.
@pytest.mark.parametrize(('text', 'value'), [
    ('1e9', 1e9), ('1E+2', 100.0), ('.5', 0.5), ('1.', 1.0), ('1.e5', 1e5), ('08', 8.0),
    ('0x1p3', 8.0), ('inf', math.inf), ('-.inf', -math.inf), ('+.Inf', math.inf),
    ('.InF', '.InF'), ('Infinity', math.inf), ('99999999999999999999', 1e20), ('1e999', '1e999'),
    ('0x1p2000', '0x1p2000'), ('5', 5), ('+5', 5), ('-0', 0), ('010', 8), ('0x10', 16),
    ('-0x1f', -31), ('9223372036854775807', 2 ** 63 - 1), ('0b11', '0b11'), ('0o17', '0o17'),
    ('1_000', '1_000'), ('12:30', '12:30'), ('2024-01-01', '2024-01-01'), ('', ''), ('.', '.'),
    ('yes', True), ('Y', True), ('On', True), ('TRUE', True), ('off', False), ('n', False),
    ('tRue', 'tRue'), ('=', '='), ('1e', '1e'),
])
def test_plain_text_has_the_value_that_ros_reads(text: str, value: object) -> None:
    found = scalar(text, quoted=False)
    assert (type(found), found) == (type(value), value)


def test_not_a_number_is_read_as_such() -> None:
    for text in ('nan', 'NaN', '.nan', '.NAN', '-nan'):
        value = scalar(text, quoted=False)
        assert isinstance(value, float) and math.isnan(value)


def test_quoted_text_stays_text() -> None:
    leaf = parse("['5', \"on\", !!str 7]", 'f')
    assert isinstance(leaf, Leaf)
    assert (leaf.value, leaf.fault) == (('5', 'on', '7'), '')


def test_a_number_of_a_million_digits_is_a_text() -> None:
    assert scalar('1' * 1_000_000, quoted=False) == '1' * 1_000_000


@pytest.mark.parametrize(('text', 'problem'), [
    ('robot:\n\tros__parameters: 1\n',
     'robot.yaml:2: column 1: not YAML: a tab: YAML is indented with spaces only'),
    ('robot: [1\n',
     "robot.yaml:2: column 1: not YAML: while parsing a flow sequence expected ',' or ']', "
     "but got '<stream end>'"),
    ('a: b: c\n', 'robot.yaml:1: column 5: not YAML: mapping values are not allowed here'),
    ('a: @b\n', 'robot.yaml:1: column 4: not YAML: while scanning for the next token found '
     "character '@' that cannot start any token"),
    ('a: 1\nb: \x07\n', 'robot.yaml:2: column 4: not YAML: character 7 is not allowed'),
    ('a: "\\UFFFFFFFF"\n', None),
    ('a: &x 1\nb: *x\n',
     "robot.yaml:2: column 4: '*x': ROS 2 has no aliases, repeat the value"),
    ('a: 1\n---\nb: 1\n', "robot.yaml:2: column 1: a second document ('---'): write one"),
    ('[a]: 1\n', 'robot.yaml:1: column 1: a key must be a string'),
    ('[' * 5000, 'robot.yaml:1: column 21: nested more than 20 deep'),
    ('- 1\n', "robot.yaml:1: must be parameters: 'robot:', then 'ros__parameters:'"),
    ('hello\n', "robot.yaml:1: must be parameters: 'robot:', then 'ros__parameters:'"),
])
def test_text_that_is_no_parameter_file_is_one_line(
    text: str, problem: str | None, problems_of: Judge,
) -> None:
    found = problems_of(text)
    assert len(found) == 1
    if problem is not None:
        assert found[0] == problem


@pytest.mark.parametrize(('value', 'problem'), [
    ('', 'robot.yaml:3: autostart has no value: write one or leave the key out'),
    ('~', 'robot.yaml:3: autostart has no value: write one or leave the key out'),
    ('!foo true', "robot.yaml:3: autostart = true: the tag '!foo' is unknown to ROS 2: "
     'delete it'),
    ('[[a]]', "robot.yaml:3: autostart = [['a']]: a list must not contain a section or a list: "
     'ROS 2 parameters are flat'),
    ('[{a: 1}]', 'robot.yaml:3: autostart = []: a list must not contain a section or a list: '
     'ROS 2 parameters are flat'),
    ('[1, 2.0]', 'robot.yaml:3: autostart = [1, 2.0]: ROS 2 requires a list of one type: '
     'write integers with a decimal point (1.0)'),
    ('[1, x]', "robot.yaml:3: autostart = [1, 'x']: ROS 2 requires a list of one type: "
     'quote strings'),
])
def test_values_that_ros_refuses_or_misreads(
    value: str, problem: str, problems_of: Judge,
) -> None:
    assert problems_of(f'robot:\n  ros__parameters:\n    autostart: {value}\n') == (problem,)


def test_files_that_cannot_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, catalogue: Catalogue,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path('latin.yaml').write_bytes(b'robot:\n  x: caf\xe9\n')
    Path('long.yaml').write_bytes(b'#' * (1 << 20) + b'\n')
    names = ('none.yaml', '.', 'latin.yaml', 'long.yaml', 'a\0b')
    with pytest.raises(ConfigError) as caught:
        load([Path(name) for name in names], catalogue=catalogue)
    assert caught.value.problems == (
        'none.yaml: cannot be read: No such file or directory',
        '.: cannot be read: it is not a regular file',
        'latin.yaml:2: column 9: not UTF-8: byte 0xe9',
        'long.yaml: cannot be read: it is longer than 1048576 bytes',
        'a\\x00b: cannot be read: its path has a null character',
    )


def test_a_byte_order_mark_is_no_part_of_the_first_key(
    good: str, load_text: Callable[..., Any],
) -> None:
    assert load_text('\ufeff' + good) == load_text(good)


def test_the_core_needs_no_yaml_parser() -> None:
    program = ('import sys; from rt_robot_os.settings import from_json, RobotSettings; '
               "sys.exit('yaml' in sys.modules)")
    root = Path(__file__).resolve().parents[2]
    assert subprocess.run([sys.executable, '-c', program], cwd=root).returncode == 0


@settings(max_examples=60, deadline=None)
@given(st.text(st.sampled_from('ab:-[]{}"\'\n \t#&*!|>%@`,?.0~é\x00\\U'), max_size=60))
def test_no_text_fails_in_any_other_way(text: str) -> None:
    try:
        parse(text, 'f')
    except YamlProblem:
        pass
