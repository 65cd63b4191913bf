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


"""
Evaluation of a rule over samples and time; no topics, no kernel.

A rule is true, false or unknown. It is unknown without a sample, or with one that is stale.
``not`` of unknown is unknown; ``and`` and ``or`` are unknown when the other operands do not
decide. An active rule stays active while its inputs are stale, and an inactive one inactive.

All times are ns of one clock. Between two samples a value holds. Deadlines (the end of a
duration, of a window) are evaluated at their own time, before any later sample: the same samples
give the same transitions, whenever they are handed in.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import math
import operator
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.health.rule.sample_window import SampleWindow
from rt_robot_os.features.health.rule.terms import And
from rt_robot_os.features.health.rule.terms import Changed
from rt_robot_os.features.health.rule.terms import Compare
from rt_robot_os.features.health.rule.terms import For
from rt_robot_os.features.health.rule.terms import Moved
from rt_robot_os.features.health.rule.terms import Not
from rt_robot_os.features.health.rule.terms import Number
from rt_robot_os.features.health.rule.terms import Or
from rt_robot_os.features.health.rule.terms import Ref
from rt_robot_os.features.health.rule.terms import refs_of
from rt_robot_os.features.health.rule.terms import Rule
from rt_robot_os.features.health.rule.terms import Silent
from rt_robot_os.features.health.rule.terms import Text

NEVER: Final = math.inf
Value = float | str

_COMPARISONS: Final[Mapping[str, Callable[[Value, Value], bool]]] = {
    '<': operator.lt, '<=': operator.le, '>': operator.gt, '>=': operator.ge,
    '==': operator.eq, '!=': operator.ne,
    'begins': lambda left, right: str(left).startswith(str(right))}


class Transition(NamedTuple):
    """A change of a rule between true and false, and its time."""

    active: bool
    time_ns: int


class _FieldHistory:
    """
    Newest sample of a field, or of a topic as a whole, and its times.

    :ivar value: the last one; None before the first.
    """

    __slots__ = ('value', 'stamp_ns', 'changed_ns', 'since_ns', 'received_ns', 'windows')

    def __init__(self) -> None:
        self.value: Value | None = None
        self.stamp_ns = self.received_ns = 0
        self.changed_ns = -1
        self.since_ns = -1
        self.windows: list[SampleWindow] = []

    def update(self, value: Value | None, time_ns: int) -> None:
        self.received_ns = time_ns
        if value is None:  # the field is the whole topic
            return
        if self.value is None:
            self.since_ns = time_ns
        elif value != self.value:
            self.changed_ns = time_ns
        self.value, self.stamp_ns = value, time_ns
        for window in self.windows:
            window.add(float(value), time_ns)


class _Node:
    """
    A part of a rule.

    :ivar due_ns: the next time at which it may change without a sample.
    """

    __slots__ = ('due_ns',)

    def __init__(self) -> None:
        self.due_ns: float = NEVER

    def evaluate(self, now_ns: int) -> bool | None:
        """Return whether it is true; None when that is unknown."""
        raise NotImplementedError


class _Comparison(_Node):
    __slots__ = ('_left', '_right', '_compare', '_clear', '_clear_at', '_stale_ns', '_active')

    def __init__(self, left: _FieldHistory, right: _FieldHistory, term: Compare, stale_ns: int
                 ) -> None:
        super().__init__()
        self._left, self._right = left, right
        self._compare = _COMPARISONS[term.comparison]
        self._clear = _COMPARISONS['<' if term.comparison[0] == '>' else '>']
        self._clear_at = None if term.clear is None else term.clear.value
        self._stale_ns = stale_ns
        self._active = False

    def evaluate(self, now_ns: int) -> bool | None:
        left, right = self._left.value, self._right.value
        if left is None or right is None:
            return None
        if self._stale_ns:
            stale_ns = min(self._left.stamp_ns, self._right.stamp_ns) + self._stale_ns
            if now_ns >= stale_ns:
                self.due_ns = NEVER
                return None
            self.due_ns = stale_ns
        if self._active and self._clear_at is not None:
            self._active = not self._clear(left, self._clear_at)
        else:
            self._active = self._compare(left, right)
        return self._active


class _Absent(_Node):
    __slots__ = ('_source', '_duration_ns')

    def __init__(self, source: _FieldHistory, duration_ns: int) -> None:
        super().__init__()
        self._source, self._duration_ns = source, duration_ns

    def evaluate(self, now_ns: int) -> bool | None:
        full_ns = self._source.received_ns + self._duration_ns
        self.due_ns = full_ns if now_ns < full_ns else NEVER
        return now_ns >= full_ns


class _ChangedWithin(_Node):
    """
    Whether a value changed within a time.

    False only after samples have arrived for the whole time, and while they still arrive.
    """

    __slots__ = ('_source', '_within_ns')

    def __init__(self, source: _FieldHistory, within_ns: int) -> None:
        super().__init__()
        self._source, self._within_ns = source, within_ns

    def evaluate(self, now_ns: int) -> bool | None:
        source = self._source
        end_ns = source.changed_ns + self._within_ns
        if source.changed_ns >= 0 and now_ns < end_ns:
            self.due_ns = end_ns
            return True
        return _false_if_watched(self, source, now_ns, self._within_ns)


def _false_if_watched(node: _Node, source: _FieldHistory, now_ns: int, within_ns: int
                      ) -> bool | None:
    """Return False when samples have covered the whole time, else None."""
    stale_ns, watched_ns = source.stamp_ns + within_ns, source.since_ns + within_ns
    if source.value is None or now_ns >= stale_ns:
        node.due_ns = NEVER
        return None
    if now_ns < watched_ns:
        node.due_ns = watched_ns
        return None
    node.due_ns = stale_ns
    return False


class _MovedWithin(_Node):
    __slots__ = ('_source', '_window', '_term')

    def __init__(self, source: _FieldHistory, term: Moved) -> None:
        super().__init__()
        self._source, self._term = source, term
        self._window = SampleWindow(term.within_ns)
        source.windows.append(self._window)

    def evaluate(self, now_ns: int) -> bool | None:
        term, window = self._term, self._window
        window.expire(now_ns)
        if window.spans(term.direction) >= term.amount.value:
            self.due_ns = window.next_ns
            return True
        found = _false_if_watched(self, self._source, now_ns, term.within_ns)
        self.due_ns = min(self.due_ns, window.next_ns)
        return found


class _Sustained(_Node):
    __slots__ = ('_part', '_duration_ns', '_since_ns')

    def __init__(self, part: _Node, duration_ns: int) -> None:
        super().__init__()
        self._part, self._duration_ns = part, duration_ns
        self._since_ns = -1

    def evaluate(self, now_ns: int) -> bool | None:
        found = self._part.evaluate(now_ns)
        self.due_ns = self._part.due_ns
        if not found:
            self._since_ns = -1
            return found
        if self._since_ns < 0:
            self._since_ns = now_ns
        full_ns = self._since_ns + self._duration_ns
        if now_ns < full_ns:
            self.due_ns = min(self.due_ns, full_ns)
        return now_ns >= full_ns


class _Not(_Node):
    __slots__ = ('_part',)

    def __init__(self, part: _Node) -> None:
        super().__init__()
        self._part = part

    def evaluate(self, now_ns: int) -> bool | None:
        found = self._part.evaluate(now_ns)
        self.due_ns = self._part.due_ns
        return None if found is None else not found


class _NaryOperator(_Node):
    """
    And, or: one part decides.

    All parts are evaluated, even when the first decides, because they measure durations.
    """

    __slots__ = ('_parts', '_decides')

    def __init__(self, parts: list[_Node], decides: bool) -> None:
        super().__init__()
        self._parts, self._decides = parts, decides

    def evaluate(self, now_ns: int) -> bool | None:
        decides = self._decides
        decided = False
        known = True
        due_ns: float = NEVER
        for part in self._parts:
            found = part.evaluate(now_ns)
            if found is None:
                known = False
            elif found is decides:
                decided = True
            if part.due_ns < due_ns:
                due_ns = part.due_ns
        self.due_ns = due_ns
        if decided:
            return decides
        return not decides if known else None


class RuleState:
    """
    State of one rule; safe in the real-time loop once it is constructed.

    :param rule: without stars, its numbers in the units of their fields.
    :param stale_ns: age at which a value in a comparison becomes unknown; 0: never.
    :param clear_ns: time for which the rule must be false before it becomes inactive.
    :ivar refs: its fields; :meth:`update` takes their indices.
    :ivar active: whether it is active.
    :ivar known: result of the last evaluation: True, False or None for unknown.
    :ivar due_ns: next deadline; infinite without one.
    """

    __slots__ = ('refs', 'active', 'known', 'due_ns', '_sources', '_root', '_now_ns', '_clear_ns',
                 '_false_ns')

    def __init__(self, rule: Rule, stale_ns: int = 0, clear_ns: int = 0) -> None:
        self.refs = refs_of(rule)
        self._sources = [_FieldHistory() for _ in self.refs]
        self._root = _build(rule, dict(zip(self.refs, self._sources)), stale_ns)
        self._clear_ns = clear_ns
        self._false_ns = -1
        self._now_ns = 0
        self.active = False
        self.known: bool | None = None
        self.due_ns: float = NEVER

    def start(self, now_ns: int) -> None:
        """Start: a topic without a message counts as silent since then."""
        self._now_ns = now_ns
        self.due_ns = now_ns
        for source in self._sources:
            source.received_ns = now_ns

    def update(self, number: int, value: Value | None, time_ns: int) -> None:
        """
        Add a sample; the caller calls :meth:`advance` up to its time before, and to it after.

        A sample that is older than the last evaluation counts from then: time does not go back.

        :param number: index of the field in :attr:`refs`.
        :param value: a finite number, or a string; None for a whole topic.
        """
        time_ns = max(time_ns, self._now_ns)
        self._sources[number].update(value, time_ns)
        self.due_ns = time_ns

    def advance(self, to_ns: int, through: bool = True) -> list[Transition]:
        """
        Process the deadlines until a time.

        :param through: also those at that time; else only earlier ones.
        :return: the transitions, in order.
        """
        found: list[Transition] = []
        to_ns = max(to_ns, self._now_ns)
        while self.due_ns < to_ns or (through and self.due_ns <= to_ns):
            self._now_ns = int(self.due_ns)
            if self._evaluate_root(self._now_ns):
                found.append(Transition(self.active, self._now_ns))
        return found

    def value(self) -> float:
        """Return the number of its first field; NaN without one."""
        value = self._sources[0].value
        return value if isinstance(value, float) else math.nan

    def last_values(self) -> list[Value | None]:
        """Return the last value of each field; None without a sample."""
        return [source.value for source in self._sources]

    def _evaluate_root(self, now_ns: int) -> bool:
        """Evaluate the rule; return whether it became active or inactive."""
        root = self._root
        known = self.known = root.evaluate(now_ns)
        self.due_ns = root.due_ns
        if known is None or known == self.active:
            if known:
                self._false_ns = -1
            return False
        if known or not self._clear_ns:
            self.active, self._false_ns = known, -1
            return True
        if self._false_ns < 0:
            self._false_ns = now_ns
        end_ns = self._false_ns + self._clear_ns
        if now_ns < end_ns:
            self.due_ns = min(self.due_ns, end_ns)
            return False
        self.active, self._false_ns = False, -1
        return True


def _build(rule: Rule, sources: Mapping[Ref, _FieldHistory], stale_ns: int) -> _Node:
    if isinstance(rule, And | Or):
        return _NaryOperator([_build(each, sources, stale_ns) for each in rule.rules],
                             decides=isinstance(rule, Or))
    if isinstance(rule, Not):
        return _Not(_build(rule.rule, sources, stale_ns))
    if isinstance(rule, For):
        return _Sustained(_build(rule.rule, sources, stale_ns), rule.duration_ns)
    if isinstance(rule, Silent):
        return _Absent(sources[rule.ref], rule.duration_ns)
    if isinstance(rule, Changed):
        return _ChangedWithin(sources[rule.ref], rule.within_ns)
    if isinstance(rule, Moved):
        return _MovedWithin(sources[rule.ref], rule)
    right = _constant(rule.right) if isinstance(rule.right, Number | Text) else (
        sources[rule.right])
    return _Comparison(sources[rule.left], right, rule, stale_ns)


def _constant(term: Number | Text) -> _FieldHistory:
    source = _FieldHistory()
    source.value, source.stamp_ns = term.value, 1 << 62
    return source
