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

"""How many may read a topic is set in YAML; who only watches needs no room."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.core.app import Core

MakeCore = Callable[[str], Core]


def guards(number: int, topic: str = '', writer: str = '') -> str:
    """Write a robot whose modules all read cmd_vel."""
    names = [f'guard{i}' for i in range(number)]
    sections = ''.join(
        f'{name}: {{type: twist_guard, rate_hz: 1.0, safe_topic: safe/{name}{writer}}}\n'
        for name in names)
    return (f"modules: [{', '.join(names)}]\n{sections}topics: [cmd_vel]\n"
            f'cmd_vel: {{message: geometry_msgs/msg/Twist{topic}}}\n')


def test_a_hundred_modules_read_a_topic_that_has_room_for_them(make_core: MakeCore) -> None:
    core = make_core(guards(100, ', max_subscribers: 100'))
    assert len(core.bus.topic('cmd_vel').subscribers) == 100


def test_more_modules_than_there_is_room_for_are_refused_before_anything_is_opened(
        make_core: MakeCore) -> None:
    with pytest.raises(ConfigError, match=(
            r"cmd_vel\.max_subscribers = 64: but 65 modules read 'cmd_vel': must be at least 65")):
        make_core(guards(65))
    with pytest.raises(ConfigError, match=(
            r"cmd_vel\.max_subscribers = 3: but 4 modules read 'cmd_vel': must be at least 4")):
        make_core(guards(4, ', max_subscribers: 3'))


@pytest.mark.parametrize('wrong', ['0', '-1', "'3'", '1.5', '5000'])
def test_a_limit_that_is_none_is_told_with_what_would_be_right(
        make_core: MakeCore, wrong: str) -> None:
    with pytest.raises(ConfigError, match='cmd_vel.max_subscribers = .*an integer from 1 to'):
        make_core(guards(1, f', max_subscribers: {wrong}'))


def test_a_full_topic_can_still_be_mirrored(make_core: MakeCore) -> None:
    core = make_core(guards(64))
    core.bus.subscribe('cmd_vel', 'link:node', counted=False)
    assert len(core.bus.topic('cmd_vel').subscribers) == 65


def test_outputs_of_modules_and_devices_have_limits_as_well(make_core: MakeCore) -> None:
    core = make_core(
        'devices: [imu]\nimu: {type: witmotion, port: /dev/null, max_subscribers: 7}\n'
        + guards(1, writer=', max_subscribers: 5'))
    assert core.bus.topic('imu/data').max_subscribers == 7
    assert core.bus.topic('safe/guard0').max_subscribers == 5
    assert core.bus.topic('cmd_vel').max_subscribers == 64


def test_of_two_that_write_a_topic_the_larger_limit_counts(make_core: MakeCore) -> None:
    core = make_core("""\
modules: [a, b]
a: {type: twist_guard, max_subscribers: 70}
b: {type: twist_guard, max_subscribers: 5}
topics: [cmd_vel]
cmd_vel: {message: geometry_msgs/msg/Twist}
""")
    assert core.bus.topic('cmd_vel_safe').max_subscribers == 70
