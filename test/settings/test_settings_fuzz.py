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


"""Whatever is in a parameter file or on the command line: settings, or one ConfigError."""

from __future__ import annotations

from pathlib import Path
import tempfile
from typing import Any

from hypothesis import given
from hypothesis import HealthCheck
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import Catalogue
from rt_robot_os.settings import from_json
from rt_robot_os.settings import load
from rt_robot_os.settings import to_json
import yaml

KEYS = st.sampled_from([
    'autostart', 'core', 'devices', 'modules', 'topics', 'mirrors', 'imu', 'guard', 'cmd_vel',
    'm', 'type', 'port', 'sim', 'rate_hz', 'topic', 'message', 'fixed', 'tail', 'depth',
    'direction', 'ros_topic', 'imu.rate_hz', 'use_sim_time', 'a.b.c', '', '.', 'x y',
]) | st.text(max_size=4)
SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(),
    st.sampled_from(['imu', 'guard', 'cmd_vel', 'm', 'witmotion', 'twist_guard', 'broken', 'sim',
                     'geometry_msgs/msg/Twist', 'imu/data', 'in', 'out', '/dev/x', 'a:b']),
    st.text(max_size=4), st.dates(), st.binary(max_size=3))
TREES = st.recursive(SCALARS, lambda inner: st.one_of(
    st.lists(inner, max_size=3), st.dictionaries(KEYS, inner, max_size=5)), max_leaves=30)
SECTIONS = st.dictionaries(KEYS, TREES, max_size=8)

COMMON = settings(max_examples=60, deadline=None,
                  suppress_health_check=[HealthCheck.function_scoped_fixture,
                                         HealthCheck.too_slow])


def attempt(paths: list[Path], overrides: Any, catalogue: Catalogue) -> None:
    try:
        found = load(paths, overrides, catalogue=catalogue)
    except ConfigError as error:
        assert error.problems
        for line in error.problems:
            assert line.isprintable()
            line.encode()
    else:
        assert from_json(to_json(found)) == found


@COMMON
@given(tree=SECTIONS)
def test_any_structure_in_a_file(tree: dict[str, Any], catalogue: Catalogue) -> None:
    text = yaml.dump({'robot': {'ros__parameters': tree}}, allow_unicode=True)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'robot.yaml'
        path.write_text(text, encoding='utf-8', errors='surrogatepass')
        attempt([path], {}, catalogue)


@COMMON
@given(tree=st.dictionaries(st.one_of(KEYS, st.integers(), st.none()), TREES, max_size=8))
def test_any_structure_on_the_command_line(tree: dict[Any, Any], catalogue: Catalogue) -> None:
    attempt([], tree, catalogue)


@COMMON
@given(data=st.binary(max_size=80))
def test_any_bytes_in_a_file(data: bytes, catalogue: Catalogue) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'robot.yaml'
        path.write_bytes(data)
        attempt([path], {}, catalogue)


def test_structures_without_end(catalogue: Catalogue) -> None:
    deep: dict[str, Any] = {}
    deep['a'] = deep
    endless: list[Any] = []
    endless.append(endless)
    for value in (deep, endless, object(), b'x', {1: 2}):
        with pytest.raises(ConfigError):
            load([], {'devices': value}, catalogue=catalogue)


@COMMON
@given(edits=st.lists(st.tuples(st.integers(0, 700), st.sampled_from(
    list(':,[]{}\'"\n #&*-?|>%~/.0aé\t'))), min_size=1, max_size=4))
def test_a_good_file_with_typing_errors(
    edits: list[tuple[int, str]], good: str, catalogue: Catalogue,
) -> None:
    text = list(good)
    for position, character in edits:
        text[position % len(text)] = character
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'robot.yaml'
        path.write_text(''.join(text), encoding='utf-8')
        attempt([path], {}, catalogue)
