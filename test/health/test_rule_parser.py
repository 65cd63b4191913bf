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


"""Rules as text: what they mean, and how errors are shown."""

from __future__ import annotations

from hypothesis import example
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.features.health.rule.parser import read_rule
from rt_robot_os.features.health.rule.parser import RuleError
from rt_robot_os.features.health.rule.terms import And
from rt_robot_os.features.health.rule.terms import Changed
from rt_robot_os.features.health.rule.terms import Compare
from rt_robot_os.features.health.rule.terms import For
from rt_robot_os.features.health.rule.terms import Moved
from rt_robot_os.features.health.rule.terms import Not
from rt_robot_os.features.health.rule.terms import Number
from rt_robot_os.features.health.rule.terms import Or
from rt_robot_os.features.health.rule.terms import Ref
from rt_robot_os.features.health.rule.terms import Rule
from rt_robot_os.features.health.rule.terms import Silent
from rt_robot_os.features.health.rule.terms import Text
from rt_robot_os.features.health.rule.units import converted
from rt_robot_os.features.health.rule.units import unit_of
from rt_robot_os.features.health.rule.units import UNITS

SMOKE = Compare(Ref('wsn/kitchen/smoke', 'data'), '>', Number(0.5))
HEAT = Compare(Ref('t', 'temperature'), '>', Number(45.0, 'degC'))
NS = 10**9

# ---- random rules -------------------------------------------------------------------------------

REFS = st.builds(
    Ref, st.sampled_from(('wsn/kitchen/smoke', 'a', 'imu/data', 'wsn/*/t', 'for_all/not_1')),
    st.sampled_from(('data', 'linear_acceleration.z', 'ranges[3]', 'points[2].x', 'silent')))
NUMBERS = st.builds(Number, st.floats(allow_nan=False, allow_infinity=False),
                    st.sampled_from(('', *(each for each in UNITS if each != '1'))))
AMOUNTS = st.builds(Number, st.floats(1e-3, 1e6))
TEXTS = st.text(st.characters(exclude_characters='\'"', exclude_categories=('Cs', 'Cc')),
                max_size=20).map(Text)
LENGTHS = st.integers(1, 31 * 86_400 * 10**9)


@st.composite
def compares(draw: st.DrawFn) -> Compare:
    left = draw(REFS)
    kind = draw(st.sampled_from(('number', 'clear', 'text', 'ref')))
    if kind == 'text':
        return Compare(left, draw(st.sampled_from(('==', '!=', 'begins'))), draw(TEXTS))
    if kind == 'ref':
        return Compare(left, draw(st.sampled_from(('<', '<=', '>', '>=', '==', '!='))),
                       draw(REFS.filter(lambda ref: ref != left)))
    if kind == 'number':
        return Compare(left, draw(st.sampled_from(('<', '<=', '>', '>=', '==', '!='))),
                       draw(NUMBERS))
    comparison = draw(st.sampled_from(('<', '<=', '>', '>=')))
    low, high = sorted(draw(st.tuples(*[st.floats(-1e6, 1e6)] * 2)))
    first, second = (high, low) if comparison[0] == '>' else (low, high)
    return Compare(left, comparison, Number(first), Number(second))


CONDITIONS = st.one_of(
    compares(), st.builds(Silent, REFS, LENGTHS), st.builds(Changed, REFS, LENGTHS),
    st.builds(Moved, REFS, st.sampled_from(('moves', 'rises', 'falls')), AMOUNTS, LENGTHS))


def _more(rules: st.SearchStrategy[Rule]) -> st.SearchStrategy[Rule]:
    several = st.lists(rules, min_size=2, max_size=3).map(tuple)
    return st.one_of(st.builds(Not, rules), st.builds(And, several), st.builds(Or, several),
                     st.builds(For, rules, LENGTHS))


RULES: st.SearchStrategy[Rule] = st.recursive(CONDITIONS, _more, max_leaves=8)

# ---- what is said -------------------------------------------------------------------------------


@pytest.mark.parametrize('text, meant', [
    ('wsn/kitchen/smoke.data > 0.5', SMOKE),
    ('0.5 < wsn/kitchen/smoke.data', SMOKE),
    ('wsn/kitchen/smoke.data>0.5 for 3s', For(SMOKE, 3 * NS)),
    ('wsn/kitchen/smoke.data > .5 and\n  t.temperature > 45°C for 1 h 30 min',
     And((SMOKE, For(HEAT, 5400 * NS)))),
    ('(wsn/kitchen/smoke.data > 0.5 and t.temperature > 45 degC) for 500 ms',
     For(And((SMOKE, HEAT)), NS // 2)),
    ('wsn/kitchen/smoke.data > 0.5 or not t.temperature > 45 C for 2 s and a silent for 1 d',
     Or((SMOKE, And((Not(For(HEAT, 2 * NS)), Silent(Ref('a'), 86_400 * NS)))))),
    ('estop.data == true', Compare(Ref('estop', 'data'), '==', Number(1.0))),
])
def test_a_text_is_understood(text: str, meant: Rule) -> None:
    assert read_rule(text) == meant


@pytest.mark.parametrize('text, carets, told', [
    ('smoke.data > 0.5 fro 3 s', '                 ^^^', "did you mean 'for'?"),
    ('smoke.data = 0.5', '           ^', "did you mean '=='?"),
    ('smoke.data > 0.5 && b.c > 1', '                 ^^', "did you mean 'and'?"),
    ('a.b > 1 and (c.d < 2 or e.f > 3', '            ^', "this '(' is never closed: add ')'"),
    ('a.b > 1)', '       ^', 'remove it'),
    ('10 < a.b < 20', '         ^', 'write x > 10 and x < 20'),
    ('/wsn/a.b > 1', '^^^^^^^^', 'write wsn/a.b'),
    ('a.b > 1 for 3', '             ^', 'unit of time: must be one of ms, s, min, h, d'),
    ('a.b > 1 for 0 s', '            ^^^', 'more than 0 and at most 31 d'),
    ('a.b > 50 clear below 60', '                     ^^', 'must be below 50'),
    ('a.b > 50 clear above 40', '               ^^^^^', "must be 'below'"),
    ('a.b == 5 clear below 4', '         ^^^^^', 'is only valid with < <= > >='),
    ('a.b', '   ^', 'a.b > 0.5'),
    ('', '^', 'such as wsn/kitchen/smoke.data > 0.5 for 3 s'),
    ('1 < 2', '^', 'one side must be a topic'),
    ("a.b > 'x'", '    ^', 'with == or !='),
    ('a.b > 1 and 22:00', '            ^^', 'a rule has no time of day'),
    ('between 22:00 and 06:00', '^^^^^^^', 'clock/hour.data >= 22'),
    ('wsn/*/a*.b > 1', '^^^^^^^^^^', 'more than one *'),
    ('a.b > 1e999', '      ^^^^^', 'too large'),
    ('a.b > 7 parsecs', '        ^^^^^^^', 'units are degC %'),
    ('a.b moves 0 within 3 s', '          ^', 'more than 0'),
    ('a.b > a.b', '      ^^^', 'both sides are the same field'),
    ('(' * 40 + 'a.b > 1' + ')' * 40, ' ' * 20 + '^', 'write several rules'),
    ('a.b > 1 or ' * 64 + 'a.b > 1', ' ' * 50 + '^^^', 'more than 64 conditions'),
    ('x' * 3000, ' ' * 50 + '^', 'a rule of 3000 characters: at most 2000'),
])
def test_an_error_shows_the_place_the_word_and_what_would_be_right(
        text: str, carets: str, told: str) -> None:
    with pytest.raises(RuleError) as caught:
        read_rule(text)
    problem, shown, marked = caught.value.lines()
    assert told in problem
    assert marked == f'  {carets}'
    assert shown[2:] in text and str(caught.value) == f'{problem}\n{shown}\n{marked}'


@settings(max_examples=40, deadline=None)
@given(RULES)
def test_what_is_written_is_read_as_the_same(rule: Rule) -> None:
    assert read_rule(str(rule)) == rule


_PIECES = st.lists(st.sampled_from((
    'and', 'or', 'not', 'for', 'silent', 'within', 'changed', 'moves', 'rises', 'clear', 'below',
    'begins', 'with', 'true', '(', ')', '>', '<=', '==', 'a.b', 'wsn/*/t.x[3]', '0.5', '-1e9', 's',
    'min', '%', "'x'", '"', '22:00', 'ß', '\0', '*', '.', '1e99999', '9' * 400)), max_size=14)


@settings(max_examples=150, deadline=None)
@given(st.one_of(st.text(max_size=60), _PIECES.map(' '.join), _PIECES.map(''.join)))
@example('a.b > 1 for 1e99999 s')
@example('a.b > 1 for 1e-99999 s')
def test_no_text_is_worse_than_no_rule(text: str) -> None:
    try:
        rule = read_rule(text)
    except RuleError as error:
        problem, shown, carets = error.lines()
        assert problem and '\n' not in problem + shown and carets.strip(' ^') == ''
        assert 0 <= error.span[0] < error.span[1] <= len(text) + 1
    else:
        assert read_rule(str(rule)) == rule


def test_numbers_are_converted_to_what_the_field_is_in() -> None:
    humidity = unit_of('wsn/hall/humidity', 'sensor_msgs/msg/RelativeHumidity',
                       'relative_humidity')
    assert converted(80.0, '%', humidity) == pytest.approx(0.8)
    spo2 = unit_of('health/anna/spo2_percent', 'std_msgs/msg/Float64', 'data')
    assert converted(90.0, '%', spo2) == 90.0
    assert converted(3.0, 'g', unit_of('imu/data', 'sensor_msgs/msg/Imu', 'linear_acceleration.z')
                     ) == pytest.approx(29.42, abs=0.01)
    assert converted(5.0, '', spo2) == 5.0
    with pytest.raises(ValueError, match='unit of voltage, but this field is in %'):
        converted(90.0, 'V', spo2)
    with pytest.raises(ValueError, match='write the number without one'):
        converted(90.0, 'V', unit_of('tank/level', 'std_msgs/msg/Float64', 'data'))
