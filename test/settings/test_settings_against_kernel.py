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


"""What the settings let through the kernel takes: nothing is refused after the check."""

from __future__ import annotations

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import TaskError
from rt_robot_os.base.schema import declared
from rt_robot_os.core.tasks import declaration
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.kernel.spec import DeclarationRule
from rt_robot_os.settings import TaskSettings
from rt_robot_os.settings.tasks import contradictions
from rt_robot_os.settings.tasks import RULE_TEXTS

TASK = declared(TaskSettings)
TIMES = st.one_of(st.just(0.0), st.floats(0.0, 1e9), st.sampled_from([1.0, 500.0, 10000.0, 2e4]))


def values_of(name: str) -> st.SearchStrategy[object]:
    field = next(each for each in TASK if each.name == name)
    if field.kind is bool:
        return st.booleans()
    if field.choices:
        return st.sampled_from(field.choices)
    if field.kind is list:
        return st.sampled_from([(), ('arm',), ('arm', 'map')])
    if field.name.endswith('_us'):
        return TIMES
    if field.kind is int:
        return st.one_of(st.just(field.default), st.integers(field.minimum, field.maximum))
    return st.floats(field.minimum, field.maximum)


TASKS = st.builds(TaskSettings, **{
    each.name: st.one_of(st.just(each.default), values_of(each.name)) for each in TASK})
RATES = st.one_of(st.sampled_from([0.0, 100.0, 3.0]), st.floats(0.1, 10_000.0))


@settings(max_examples=300, deadline=None)
@given(TASKS, RATES)
def test_the_kernel_takes_what_the_settings_let_through(
    task: TaskSettings, rate_hz: float,
) -> None:
    if list(contradictions(rate_hz, task)):
        return
    kernel = Kernel(VirtualClock())
    kernel.add_task('it', print, priority=1, rate_hz=rate_hz or None, on_safe_state=print,
                    **declaration(task, kernel))


@settings(max_examples=200, deadline=None)
@given(TASKS, RATES)
def test_what_contradicts_has_keys_of_the_file(task: TaskSettings, rate_hz: float) -> None:
    for key, remedy in contradictions(rate_hz, task):
        assert key in {each.name for each in TASK}
        assert remedy


@settings(max_examples=300, deadline=None)
@given(TASKS, RATES)
def test_what_the_kernel_refuses_is_told_with_a_key_of_the_file(
    task: TaskSettings, rate_hz: float,
) -> None:
    kernel = Kernel(VirtualClock())
    try:
        kernel.add_task('it', print, priority=1, rate_hz=rate_hz or None, on_safe_state=print,
                        **declaration(task, kernel))
    except TaskError as error:
        told = {key for key, _ in contradictions(rate_hz, task)}
        assert len(told) > 0, str(error)


@pytest.mark.parametrize('rule', DeclarationRule)
def test_each_rule_of_the_kernel_has_words_for_the_file(rule: DeclarationRule) -> None:
    key, remedy = RULE_TEXTS[rule]
    assert key in {each.name for each in TASK}
    assert remedy
