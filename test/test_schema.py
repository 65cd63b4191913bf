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

"""A field says what is wrong with a value, and a dataclass declares the fields it is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from typing import ClassVar

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.schema import declared
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import inline
from rt_robot_os.base.schema import made
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.schema import setting

RATE = Field('rate_hz', float, 1.0, 'rate', 'Hz', 0.1, 4_000_000.0)
LEVELS = Field('levels', list, (), 'levels', '', 1, 9, item=int)


@pytest.mark.parametrize('value', [1, 0.1, 4_000_000])
def test_a_good_value_has_no_problem_and_gets_its_type(value: Any) -> None:
    assert RATE.problem(value) is None
    assert isinstance(RATE.coerce(value), float)


@pytest.mark.parametrize('value', [0, -1, 4_000_001, float('nan'), float('inf'), '1', True, None,
                                   10 ** 400, -10 ** 400, [1.0]])
def test_a_bad_value_is_told_what_would_be_right(value: Any) -> None:
    assert RATE.problem(value) == 'a number from 0.1 to 4000000 (Hz)'


@pytest.mark.parametrize('value', [[0], [1, 10], [1.5], ['1'], 3, [True]])
def test_items_of_a_list_are_checked_like_values(value: Any) -> None:
    assert LEVELS.problem(value) == 'a list of integers from 1 to 9'


def test_choices_are_listed() -> None:
    field = Field('policy', str, 'a', 'policy', choices=('a', 'b'))
    assert field.problem('c') == 'one of a, b'
    assert field.problem('b') is None


@given(st.recursive(st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
                    st.lists, max_leaves=4),
       st.sampled_from([bool, int, float, str]))
def test_no_value_raises(value: Any, kind: type) -> None:
    field = Field('x', kind, None, 'x', minimum=-5, maximum=5) if kind in (int, float) else (
        Field('x', kind, None, 'x'))
    if field.problem(value) is None:
        assert isinstance(field.coerce(value), kind)


@dataclass(frozen=True)
class Arm:
    """A part whose settings stand among those of the whole."""

    length_m: float = setting(0.5, 'length', 'm', 0.0, 2.0)


@dataclass(frozen=True)
class Machine:
    """What a robot might declare of itself."""

    name: str
    type: str = setting(REQUIRED, 'what it is')  # noqa: A003
    enabled: ClassVar[bool] = setting(True, 'whether it is there')
    arm: Arm = inline(Arm())
    speeds: tuple[float, ...] = setting((1.0,), 'speeds', 'm/s', 0.0, 5.0, live=True)
    arms: tuple[Arm, ...] = setting((), 'names of its arms')
    limit: int | None = setting(0, 'limit', choices=(0, 1))


def test_a_dataclass_is_the_one_declaration_of_its_settings() -> None:
    assert declared(Machine) == (
        Field('type', str, REQUIRED, 'what it is'),
        Field('enabled', bool, True, 'whether it is there'),
        Field('length_m', float, 0.5, 'length', 'm', 0.0, 2.0),
        Field('speeds', list, (1.0,), 'speeds', 'm/s', 0.0, 5.0, item=float, live=True),
        Field('arms', list, (), 'names of its arms'),
        Field('limit', int, 0, 'limit', choices=(0, 1)))


def test_an_object_is_made_of_what_was_read() -> None:
    values = {'type': 'crane', 'enabled': True, 'length_m': 1.5, 'limit': 1}
    assert made(Machine, values, name='a') == Machine('a', 'crane', Arm(1.5), limit=1)
    assert made(Machine, {}, name='a', type='crane') == Machine('a', 'crane')
    with pytest.raises(TypeError, match='type'):
        made(Machine, {}, name='a')
