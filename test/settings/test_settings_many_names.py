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

"""A configuration of thousands of names is read in linear time: counted, not measured."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
import sys
from types import FrameType
from typing import Any

import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import load
from rt_robot_os.settings.problems import did_you_mean
from rt_robot_os.settings.problems import Names


def topics(n: int) -> str:
    return '\n'.join([f'    topics: [{", ".join(f"t{i}" for i in range(n))}]', *(
        f'    t{i}: {{message: geometry_msgs/msg/Twist}}' for i in range(n))])


def resources(n: int) -> str:
    return ('    modules: [guard]\n    guard: {type: twist_guard, resources: '
            f'[{", ".join(f"r{i * 7919 % 100003}x{i}" for i in range(n))}]}}')


def misspelt(n: int) -> str:
    return topics(n).replace(': {', 'x: {')


def mirrors_of_nothing(n: int) -> str:
    return '\n'.join([topics(n), f'    mirrors: [{", ".join(f"m{i}" for i in range(n))}]', *(
        f'    m{i}: {{topic: t{i}/x}}' for i in range(n))])


def chain_of_modules(n: int) -> str:
    return '\n'.join([f'    modules: [{", ".join(f"m{i}" for i in range(n))}]', *(
        f'    m{i}: {{type: twist_guard, command_topic: c{i}, safe_topic: c{i + 1}}}'
        for i in range(n))])


def calls_of(work: Callable[[], Any]) -> int:
    count = 0

    def note(frame: FrameType, event: str, argument: Any) -> None:
        nonlocal count
        count += 1

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(before)
    return count


@pytest.mark.parametrize('lines', [
    topics, resources, misspelt, mirrors_of_nothing, chain_of_modules])
def test_twice_the_names_is_twice_the_work(lines: Callable[[int], str], tmp_path: Path) -> None:
    def work(n: int) -> int:
        path = tmp_path / f'{n}.yaml'
        path.write_text(f'robot:\n  ros__parameters:\n{lines(n)}\n')

        def read() -> None:
            with suppress(ConfigError):
                load([path])

        return calls_of(read)

    work(2)  # what is imported at the first time
    one, two = work(300), work(600)
    assert two < 2.6 * one


def test_of_many_names_the_one_a_letter_away_is_guessed() -> None:
    names = Names(f'sensor_number_{i * 7919}' for i in range(5000))
    assert names.nearest('sensor_numbr_7919') == 'sensor_number_7919'
    assert names.nearest('sensor_number_7919', but='sensor_number_7919') != 'sensor_number_7919'
    assert names.nearest('quite_another_thing') is None


def test_of_many_names_a_hundred_are_listed() -> None:
    text = did_you_mean('zzzzzzzz', [f'a{i:04}' for i in range(1000)])
    assert text.startswith('known: a0000, a0001, ') and text.endswith(', a0099 and 900 more')
