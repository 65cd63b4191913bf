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
Whether a rule is true, as samples come and time passes; no topics, no kernel.

A rule is true, false or not known. Not known is what nobody has measured yet, or what is too old;
``not`` of it is not known either, ``and`` and ``or`` are when the others do not decide. A rule
that is not known stays as it was: what was wrong is not well because nobody looks any more.

All times are ns of one clock. Between two samples a value holds. What time alone changes (a length
of time that is full, a window that nothing is left in) is judged at that very moment, before any
sample that is later: the same samples give the same transitions, whenever they are handed in.
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
    """A rule began or ceased to be true, and when."""

    active: bool
    time_ns: int


class _Source:
    """
    What is known of a field, or of a topic as a whole.

    :ivar value: the last one; None before the first.
    """

    __slots__ = ('value', 'stamp_ns', 'changed_ns', 'since_ns', 'heard_ns', 'windows')

    def __init__(self) -> None:
        self.value: Value | None = None
        self.stamp_ns = self.heard_ns = 0
        self.changed_ns = -1
        self.since_ns = -1
        self.windows: list[SampleWindow] = []

    def take(self, value: Value | None, time_ns: int) -> None:
        self.heard_ns = time_ns
        if value is None:  # the whole topic is meant
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

    :ivar due_ns: the next moment at which it may change though nothing comes.
    """

    __slots__ = ('due_ns',)

    def __init__(self) -> None:
        self.due_ns: float = NEVER

    def look(self, now_ns: int) -> bool | None:
        """Say how it is; None when that is not known."""
        raise NotImplementedError


class _Comparison(_Node):
    __slots__ = ('_left', '_right', '_compare', '_clear', '_clear_at', '_stale_ns', '_was')

    def __init__(self, left: _Source, right: _Source, term: Compare, stale_ns: int) -> None:
        super().__init__()
        self._left, self._right = left, right
        self._compare = _COMPARISONS[term.comparison]
        self._clear = _COMPARISONS['<' if term.comparison[0] == '>' else '>']
        self._clear_at = None if term.clear is None else term.clear.value
        self._stale_ns = stale_ns
        self._was = False

    def look(self, now_ns: int) -> bool | None:
        left, right = self._left.value, self._right.value
        if left is None or right is None:
            return None
        if self._stale_ns:
            stale_ns = min(self._left.stamp_ns, self._right.stamp_ns) + self._stale_ns
            if now_ns >= stale_ns:
                self.due_ns = NEVER
                return None
            self.due_ns = stale_ns
        if self._was and self._clear_at is not None:
            self._was = not self._clear(left, self._clear_at)
        else:
            self._was = self._compare(left, right)
        return self._was


class _Silence(_Node):
    __slots__ = ('_source', '_lasting_ns')

    def __init__(self, source: _Source, lasting_ns: int) -> None:
        super().__init__()
        self._source, self._lasting_ns = source, lasting_ns

    def look(self, now_ns: int) -> bool | None:
        full_ns = self._source.heard_ns + self._lasting_ns
        self.due_ns = full_ns if now_ns < full_ns else NEVER
        return now_ns >= full_ns


class _Change(_Node):
    """
    Whether a value changed lately.

    That it did not is known only after it was watched for so long, and while it still comes.
    """

    __slots__ = ('_source', '_within_ns')

    def __init__(self, source: _Source, within_ns: int) -> None:
        super().__init__()
        self._source, self._within_ns = source, within_ns

    def look(self, now_ns: int) -> bool | None:
        source = self._source
        over_ns = source.changed_ns + self._within_ns
        if source.changed_ns >= 0 and now_ns < over_ns:
            self.due_ns = over_ns
            return True
        return _not_so(self, source, now_ns, self._within_ns)


def _not_so(node: _Node, source: _Source, now_ns: int, within_ns: int) -> bool | None:
    """Return False when nothing happened in all the time, else None."""
    stale_ns, watched_ns = source.stamp_ns + within_ns, source.since_ns + within_ns
    if source.value is None or now_ns >= stale_ns:
        node.due_ns = NEVER
        return None
    if now_ns < watched_ns:
        node.due_ns = watched_ns
        return None
    node.due_ns = stale_ns
    return False


class _Move(_Node):
    __slots__ = ('_source', '_window', '_term')

    def __init__(self, source: _Source, term: Moved) -> None:
        super().__init__()
        self._source, self._term = source, term
        self._window = SampleWindow(term.within_ns)
        source.windows.append(self._window)

    def look(self, now_ns: int) -> bool | None:
        term, window = self._term, self._window
        window.forget(now_ns)
        if window.spans(term.way) >= term.amount.value:
            self.due_ns = window.next_ns
            return True
        found = _not_so(self, self._source, now_ns, term.within_ns)
        self.due_ns = min(self.due_ns, window.next_ns)
        return found


class _Lasting(_Node):
    __slots__ = ('_part', '_lasting_ns', '_since_ns')

    def __init__(self, part: _Node, lasting_ns: int) -> None:
        super().__init__()
        self._part, self._lasting_ns = part, lasting_ns
        self._since_ns = -1

    def look(self, now_ns: int) -> bool | None:
        found = self._part.look(now_ns)
        self.due_ns = self._part.due_ns
        if not found:
            self._since_ns = -1
            return found
        if self._since_ns < 0:
            self._since_ns = now_ns
        full_ns = self._since_ns + self._lasting_ns
        if now_ns < full_ns:
            self.due_ns = min(self.due_ns, full_ns)
        return now_ns >= full_ns


class _Opposite(_Node):
    __slots__ = ('_part',)

    def __init__(self, part: _Node) -> None:
        super().__init__()
        self._part = part

    def look(self, now_ns: int) -> bool | None:
        found = self._part.look(now_ns)
        self.due_ns = self._part.due_ns
        return None if found is None else not found


class _Several(_Node):
    """
    Of several parts one decides.

    All are looked at, also when the first decides: they have to know since when they are so.
    """

    __slots__ = ('_parts', '_decides')

    def __init__(self, parts: list[_Node], decides: bool) -> None:
        super().__init__()
        self._parts, self._decides = parts, decides

    def look(self, now_ns: int) -> bool | None:
        decides = self._decides
        decided = False
        known = True
        due_ns: float = NEVER
        for part in self._parts:
            found = part.look(now_ns)
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
    One rule at work; safe in the real-time loop once it is made.

    :param rule: its numbers are in the units of their fields; without stars.
    :param stale_ns: age at which a value is not known any more, in comparisons; 0: it holds until
        the next one.
    :param clear_ns: so long it must be false until it counts as over.
    :ivar refs: its fields, by the numbers that :meth:`take` wants.
    :ivar active: whether it is true.
    :ivar known: how it was last: True, False or None for not known.
    :ivar due_ns: when time alone may change something; infinite for never.
    """

    __slots__ = ('refs', 'active', 'known', 'due_ns', '_sources', '_root', '_now_ns', '_clear_ns',
                 '_false_ns')

    def __init__(self, rule: Rule, stale_ns: int = 0, clear_ns: int = 0) -> None:
        self.refs = refs_of(rule)
        self._sources = [_Source() for _ in self.refs]
        self._root = _made(rule, dict(zip(self.refs, self._sources)), stale_ns)
        self._clear_ns = clear_ns
        self._false_ns = -1
        self._now_ns = 0
        self.active = False
        self.known: bool | None = None
        self.due_ns: float = NEVER

    def begin(self, now_ns: int) -> None:
        """Begin to look: a topic that is never heard is silent since then."""
        self._now_ns = now_ns
        self.due_ns = now_ns
        for source in self._sources:
            source.heard_ns = now_ns

    def take(self, number: int, value: Value | None, time_ns: int) -> None:
        """
        Take a value; :meth:`pass_time` up to that moment, and then to it, is the caller's.

        What is older than what was judged already counts from then: time does not go back.

        :param number: of the field in :attr:`refs`.
        :param value: a number that is one, or a text; None for one that is a whole topic.
        """
        time_ns = max(time_ns, self._now_ns)
        self._sources[number].take(value, time_ns)
        self.due_ns = time_ns

    def pass_time(self, to_ns: int, through: bool = True) -> list[Transition]:
        """
        Let time pass.

        :param through: what is due at that very moment as well; else only what was before.
        :return: what changed, in order; hardly ever more than one.
        """
        found: list[Transition] = []
        to_ns = max(to_ns, self._now_ns)
        while self.due_ns < to_ns or (through and self.due_ns <= to_ns):
            self._now_ns = int(self.due_ns)
            if self._judge(self._now_ns):
                found.append(Transition(self.active, self._now_ns))
        return found

    def value(self) -> float:
        """Return the number that its first field has; NaN without one."""
        value = self._sources[0].value
        return value if isinstance(value, float) else math.nan

    def last_values(self) -> list[Value | None]:
        """Return what each field had last; None for what was never heard."""
        return [source.value for source in self._sources]

    def _judge(self, now_ns: int) -> bool:
        """Look how it is; say whether it began or is over."""
        root = self._root
        known = self.known = root.look(now_ns)
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
        over_ns = self._false_ns + self._clear_ns
        if now_ns < over_ns:
            self.due_ns = min(self.due_ns, over_ns)
            return False
        self.active, self._false_ns = False, -1
        return True


def _made(rule: Rule, sources: Mapping[Ref, _Source], stale_ns: int) -> _Node:
    if isinstance(rule, And | Or):
        return _Several([_made(each, sources, stale_ns) for each in rule.rules],
                        decides=isinstance(rule, Or))
    if isinstance(rule, Not):
        return _Opposite(_made(rule.rule, sources, stale_ns))
    if isinstance(rule, For):
        return _Lasting(_made(rule.rule, sources, stale_ns), rule.lasting_ns)
    if isinstance(rule, Silent):
        return _Silence(sources[rule.ref], rule.lasting_ns)
    if isinstance(rule, Changed):
        return _Change(sources[rule.ref], rule.within_ns)
    if isinstance(rule, Moved):
        return _Move(sources[rule.ref], rule)
    right = _constant(rule.right) if isinstance(rule.right, Number | Text) else (
        sources[rule.right])
    return _Comparison(sources[rule.left], right, rule, stale_ns)


def _constant(term: Number | Text) -> _Source:
    source = _Source()
    source.value, source.stamp_ns = term.value, 1 << 62
    return source
