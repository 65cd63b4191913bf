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


"""When a rule is true: some histories by hand, and many against a plain reading of the words."""

from __future__ import annotations

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.features.health.rule.evaluation import RuleState
from rt_robot_os.features.health.rule.evaluation import Transition
from rt_robot_os.features.health.rule.parser import read_rule
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

S = 10**9
NAMES = ('a', 'b')
Samples = list[tuple[int, str, float]]


def transitions(text: str, samples: Samples, until: int, *, stale: int = 0, clear: int = 0,
                rule: Rule | None = None) -> list[tuple[int, bool]]:
    """Return what a rule did, in seconds; samples are (second, topic, value)."""
    state = RuleState(rule or read_rule(text), stale * S, clear * S)
    state.start(0)
    found: list[Transition] = []
    times: dict[int, list[tuple[str, float]]] = {}
    for time, topic, value in samples:
        times.setdefault(time, []).append((topic, value))
    for time, values in sorted(times.items()):
        found += state.advance(time * S, through=False)
        for topic, value in values:
            for number, ref in enumerate(state.refs):
                if ref.topic == topic:
                    state.update(number, value if ref.path else None, time * S)
        found += state.advance(time * S)
    found += state.advance(until * S)
    assert all(each.time_ns % S == 0 for each in found)
    return [(each.time_ns // S, each.active) for each in found]


def test_a_rule_lasts_from_its_duration_to_the_sample_that_ends_it() -> None:
    samples = [(1, 'a', 1.0), (3, 'a', 0.0), (5, 'a', 1.0), (7, 'a', 2.0), (20, 'a', 0.0)]
    assert transitions('a.x > 0.5 for 3 s', samples, 30) == [(8, True), (20, False)]


def test_hysteresis_holds_between_its_limits() -> None:
    samples = [(1, 'a', 51.0), (2, 'a', 48.0), (3, 'a', 45.0), (4, 'a', 44.0), (5, 'a', 49.0)]
    assert transitions('a.x > 50 clear below 45', samples, 9) == [(1, True), (4, False)]


def test_a_topic_that_never_spoke_is_silent_too() -> None:
    assert transitions('a silent for 60 s', [], 200) == [(60, True)]
    assert transitions('a silent for 60 s', [(70, 'a', 1.0)], 200) == [
        (60, True), (70, False), (130, True)]


def test_inactivity_is_known_only_after_it_was_watched_for_so_long_and_is_still_heard() -> None:
    text = 'not a.x changed within 10 s'
    steady = [(second, 'a', 1.0) for second in range(0, 40, 2)]
    assert transitions(text, steady, 40) == [(10, True)]
    assert transitions(text, steady[:1], 40) == []  # nothing says that nobody moved
    moved = [*steady[:8], (16, 'a', 0.0), (18, 'a', 0.0), (30, 'a', 0.0)]
    assert transitions(text, moved, 35) == [(10, True), (16, False), (26, True)]


def test_a_dropout_is_no_rise() -> None:
    text = 'a.x rises 4 within 60 s'
    assert transitions(text, [(0, 'a', 20.0), (300, 'a', 25.0)], 400) == []
    assert transitions(text, [(0, 'a', 20.0), (30, 'a', 25.0)], 400) == [(30, True), (60, False)]
    assert transitions(text, [(0, 'a', 25.0), (30, 'a', 20.0)], 400) == []


def test_what_is_too_old_neither_raises_nor_ends_a_cause() -> None:
    samples = [(1, 'a', 1.0), (40, 'a', 0.0)]
    assert transitions('a.x > 0.5 for 20 s', samples[:1], 90) == [(21, True)]
    assert transitions('a.x > 0.5 for 20 s', samples[:1], 90, stale=10) == []
    assert transitions('a.x > 0.5 for 5 s', samples, 90, stale=10) == [(6, True), (40, False)]


def test_it_is_over_only_after_the_time_to_clear() -> None:
    samples = [(1, 'a', 1.0), (5, 'a', 0.0), (8, 'a', 1.0), (20, 'a', 0.0)]
    assert transitions('a.x > 0.5', samples, 90, clear=5) == [(1, True), (25, False)]


def test_what_comes_too_late_counts_from_then() -> None:
    state = RuleState(read_rule('a.x > 0.5 for 3 s'))
    state.start(0)
    state.advance(10 * S)
    state.update(0, 1.0, 10 * S)
    state.advance(10 * S)
    state.update(0, 0.0, 2 * S)
    assert state.advance(20 * S) == []


# ---- against a plain reading --------------------------------------------------------------------

_COMPARE = {'<': lambda x, y: x < y, '<=': lambda x, y: x <= y, '>': lambda x, y: x > y,
            '>=': lambda x, y: x >= y, '==': lambda x, y: x == y, '!=': lambda x, y: x != y}


class Plain:
    """Says of every second how a rule is, from all samples, second by second."""

    def __init__(self, samples: Samples, until: int, stale: int) -> None:
        self.by_topic = {name: sorted((t, v) for t, topic, v in samples if topic == name)
                         for name in NAMES}
        self.until = until
        self.stale = stale

    def truth(self, rule: Rule) -> list[bool | None]:
        if isinstance(rule, Not):
            return [None if each is None else not each for each in self.truth(rule.rule)]
        if isinstance(rule, And | Or):
            decides = isinstance(rule, Or)
            return [decides if decides in row else None if None in row else not decides
                    for row in zip(*map(self.truth, rule.rules))]
        if isinstance(rule, For):
            inner, length = self.truth(rule.rule), rule.duration_ns // S
            return [None if inner[now] is None else
                    bool(inner[now]) and now >= length and all(inner[now - length:now + 1])
                    for now in range(self.until + 1)]
        if isinstance(rule, Compare):
            return self.compared(rule)
        return [self.event(rule, now) for now in range(self.until + 1)]

    def last(self, ref: Ref, now: int) -> tuple[int, float] | None:
        known = [each for each in self.by_topic[ref.topic] if each[0] <= now]
        return known[-1] if known else None

    def compared(self, rule: Compare) -> list[bool | None]:
        found: list[bool | None] = []
        was = False
        for now in range(self.until + 1):
            left = self.last(rule.left, now)
            right = self.last(rule.right, now) if isinstance(rule.right, Ref) else (
                1 << 40, rule.right.value)
            if left is None or right is None or (
                    self.stale and now - min(left[0], right[0]) >= self.stale):
                found.append(None)
                continue
            if was and rule.clear is not None:
                below = rule.comparison[0] == '>'
                was = not (left[1] < rule.clear.value if below else left[1] > rule.clear.value)
            else:
                was = _COMPARE[rule.comparison](left[1], right[1])
            found.append(was)
        return found

    def event(self, rule: Silent | Changed | Moved, now: int) -> bool | None:
        known = [each for each in self.by_topic[rule.ref.topic] if each[0] <= now]
        if isinstance(rule, Silent):
            return now - (known[-1][0] if known else 0) >= rule.duration_ns // S
        within = rule.within_ns // S
        if isinstance(rule, Changed):
            so = any(before[1] != after[1] and now - after[0] < within
                     for before, after in zip(known, known[1:]))
        else:
            # By sixtieths of the window, as is said.
            part = within // 60
            recent = [value for time, value in known if time // part > now // part - 60]
            pairs = [later - first for place, first in enumerate(recent)
                     for later in recent[place:]]
            if rule.direction == 'falls':
                pairs = [-each for each in pairs]
            elif rule.direction == 'moves':
                pairs = [abs(each) for each in pairs]
            so = any(each >= rule.amount.value for each in pairs)
        if so:
            return True
        if not known or now - known[-1][0] >= within or now - known[0][0] < within:
            return None
        return False


VALUES = st.integers(0, 4).map(float)
FIELDS = st.builds(Ref, st.sampled_from(NAMES), st.just('x'))
SECONDS = st.integers(1, 20).map(lambda each: each * S)
COMPARES = st.builds(Compare, FIELDS, st.sampled_from(tuple(_COMPARE)), VALUES.map(Number))
HYSTERESES = st.builds(
    lambda ref, high, low, above: Compare(ref, '>', Number(high), Number(min(low, high)))
    if above else Compare(ref, '<=', Number(min(low, high)), Number(high)),
    FIELDS, VALUES, VALUES, st.booleans())
SIMPLE = st.one_of(
    COMPARES, HYSTERESES, st.just(Compare(Ref('a', 'x'), '>', Ref('b', 'x'))),
    st.builds(Silent, FIELDS, SECONDS), st.builds(Changed, FIELDS, SECONDS),
    st.builds(Moved, FIELDS, st.sampled_from(('moves', 'rises', 'falls')),
              st.integers(1, 4).map(lambda each: Number(float(each))),
              st.sampled_from((60 * S, 120 * S))))
ALL = st.recursive(SIMPLE, lambda rules: st.one_of(
    st.builds(Not, rules), st.builds(For, rules, SECONDS),
    st.builds(lambda one, two: And((one, two)), rules, rules),
    st.builds(lambda one, two: Or((one, two)), rules, rules)), max_leaves=5)
HISTORIES = st.lists(st.tuples(st.integers(0, 150), st.sampled_from(NAMES), VALUES), max_size=25,
                     unique_by=lambda each: each[:2])


@settings(max_examples=150, deadline=None)
@given(ALL, HISTORIES, st.sampled_from((0, 0, 7)), st.integers(0, 1).map(lambda each: each * 6))
def test_it_does_what_the_words_say(rule: Rule, samples: Samples, stale: int, clear: int) -> None:
    until = 200
    expected = []
    active, false_for = False, 0
    for now, truth in enumerate(Plain(samples, until, stale).truth(rule)):
        false_for = 0 if truth else false_for
        if truth is False and active:
            false_for += 1
        elif truth is None and false_for:
            false_for += 1
        over = truth is False and false_for > clear
        if truth is not None and truth != active and (truth or over):
            active, false_for = bool(truth), 0
            expected.append((now, active))
    assert transitions('', samples, until, stale=stale, clear=clear, rule=rule) == expected


@pytest.mark.parametrize('length_s', [1, 60, 3600])
def test_a_window_takes_no_more_room_however_fast_the_samples(length_s: int) -> None:
    state = RuleState(read_rule(f'a.x moves 5000 within {length_s} s'))
    state.start(0)
    for each in range(5000):
        time_ns = each * length_s * S // 1000
        state.advance(time_ns, through=False)
        state.update(0, float(each), time_ns)
        state.advance(time_ns)
    window = state._sources[0].windows[0]
    assert len(window._parts) <= 61 and window.spans('rises') == pytest.approx(1000.0, abs=20.0)
