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

"""A parameter is the same thing for ROS and for the core: one list, one judgement, one way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.core.app import Core
from rt_robot_os.settings import check_change
from rt_robot_os.settings import parameters

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')

ROBOT = """\
devices: [sonar, depth]
sonar: {type: maxbotix, port: /dev/ttyUSB0, rate_hz: 30.0}
depth: {type: bmp280, port: /dev/i2c-1, rate_hz: 10.0}
modules: [guard, woken, walker]
guard: {type: twist_guard, rate_hz: 100.0, budget_us: 5000.0, on_budget: abort}
woken: {type: 'core_parameter_modules:Woken', rate_hz: 0.0}
walker: {type: 'core_parameter_modules:Walker'}
topics: [cmd_vel]
cmd_vel: {message: geometry_msgs/msg/Twist}
mirrors: [safe]
safe: {topic: cmd_vel_safe}
"""


@pytest.fixture
def core(make_core: Callable[[str], Core]) -> Core:
    return make_core(ROBOT)


def test_what_ros_may_change_in_the_core_is_what_the_core_lets_change(core: Core) -> None:
    told = {each['name']: each['value'] for each in core.parameters.facts()}
    live = {each.name: each for each in parameters(core.settings) if each.live}
    assert told == {name: each.value for name, each in live.items() if each.in_core}
    assert [name for name, each in live.items() if not each.in_core] == [
        'safe.policy', 'safe.max_rate_hz', 'safe.delay_ms']
    assert 'guard.rate_hz' in told and 'depth.sea_level_pa' in told
    # Neither has a period that could change.
    assert not {'woken.rate_hz', 'walker.rate_hz'} & {*told, *live}


@pytest.mark.parametrize(('name', 'value'), [
    ('guard.rate_hz', 0), ('guard.rate_hz', 'fast'), ('guard.rate_hz', True),
    ('guard.rate_hz', float('nan')), ('guard.rate_hz', [1.0]), ('guard.rate_hz', 1000.0),
    ('sonar.rate_hz', None), ('guard.timeout_s', -1.0), ('guard.log_level', 'loud'),
    ('depth.sea_level_pa', float('inf')), ('guard.timeout_s', {'x': 1})])
def test_a_value_is_refused_in_the_same_words_on_either_side(
        core: Core, name: str, value: Any) -> None:
    before = core.parameters.digest()
    with pytest.raises(ConfigError) as refused:
        core.parameters.change(name, value)
    assert str(refused.value) == check_change(core.settings, name, value)
    assert core.parameters.digest() == before


def test_a_change_is_where_it_is_used(core: Core) -> None:
    values = {'guard.rate_hz': 50, 'sonar.rate_hz': 15.0, 'guard.log_level': 'debug',
              'guard.timeout_s': 0.25, 'depth.sea_level_pa': 100_000}
    digests = {core.parameters.digest()}
    for name, value in values.items():
        assert core.parameters.change(name, value) == value
        digests.add(core.parameters.digest())
    assert len(digests) == 1 + len(values)
    told = {each['name']: each for each in core.parameters.facts()}
    assert {name: told[name]['value'] for name in values} == values
    assert told['guard.rate_hz']['loaded'] == 100.0 and told['guard.log_level']['loaded'] == 'info'
    assert core.kernel.task('sonar').period_ns == round(1e9 / 15)
    assert core.modules[0].log.level == 10


def test_what_a_module_changes_by_itself_changes_the_digest(core: Core) -> None:
    before = core.parameters.digest()
    core.modules[0].change('rate_hz', 25.0)
    told = {each['name']: each['value'] for each in core.parameters.facts()}
    assert told['guard.rate_hz'] == 25.0 and core.parameters.digest() != before
