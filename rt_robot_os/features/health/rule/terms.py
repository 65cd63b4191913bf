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


"""Terms of a rule, and their text; see :mod:`.parser`."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import field
from typing import Union

from rt_robot_os.base.schema import STAR
from rt_robot_os.base.schema import star_match
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S

#: Longest first.
DURATIONS = {'d': 86_400 * NS_PER_S, 'h': 3600 * NS_PER_S, 'min': 60 * NS_PER_S,
             's': NS_PER_S, 'ms': NS_PER_MS}

Span = tuple[int, int]


def _span() -> Span:
    # The position in the text is for errors only, and ignored in comparisons.
    return field(default=(0, 0), compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Ref:
    """
    A field of the messages of a topic.

    :ivar topic: its name; with a star it stands for all that match.
    :ivar path: of the field, such as ``linear_acceleration.z`` or ``ranges[3]``; empty for the
        topic as a whole.
    :ivar span: position in the text of the rule.
    """

    topic: str
    path: str = ''
    span: Span = _span()

    def __str__(self) -> str:
        return f'{self.topic}.{self.path}' if self.path else self.topic

    def matched(self, topic: str) -> str | None:
        """Return the part of a matching topic that replaces the star; empty without a star."""
        return star_match(self.topic, topic)

    def starred(self, name: str) -> Ref:
        """Return the field with a name instead of the star."""
        return Ref(self.topic.replace(STAR, name), self.path, self.span)


@dataclass(frozen=True, slots=True)
class Number:
    """A number with a unit, or without one in that of the field."""

    value: float
    unit: str = ''
    span: Span = _span()

    def __str__(self) -> str:
        text = repr(self.value).removesuffix('.0')
        return f'{text} {self.unit}' if self.unit else text


@dataclass(frozen=True, slots=True)
class Text:
    """A string; it contains single or double quotes, not both."""

    value: str
    span: Span = _span()

    def __str__(self) -> str:
        return f'"{self.value}"' if "'" in self.value else f"'{self.value}'"


@dataclass(frozen=True, slots=True)
class Compare:
    """
    A field compared with a number, a string or another field.

    :ivar comparison: one of ``< <= > >= == !=``, or ``begins`` with a string.
    :ivar clear: once true, it stays true until the value is beyond this number; None: none.
    """

    left: Ref
    comparison: str
    right: Number | Text | Ref
    clear: Number | None = None

    def __str__(self) -> str:
        comparison = 'begins with' if self.comparison == 'begins' else self.comparison
        text = f'{self.left} {comparison} {self.right}'
        if self.clear is None:
            return text
        return f'{text} clear {"below" if self.comparison[0] == ">" else "above"} {self.clear}'


@dataclass(frozen=True, slots=True)
class Silent:
    """No message for a duration."""

    ref: Ref
    duration_ns: int

    def __str__(self) -> str:
        return f'{self.ref} silent for {duration_text(self.duration_ns)}'


@dataclass(frozen=True, slots=True)
class Changed:
    """The value of a field changed."""

    ref: Ref
    within_ns: int

    def __str__(self) -> str:
        return f'{self.ref} changed within {duration_text(self.within_ns)}'


@dataclass(frozen=True, slots=True)
class Moved:
    """
    A field rose or fell by an amount.

    :ivar direction: ``rises``, ``falls``, or ``moves`` for either.
    """

    ref: Ref
    direction: str
    amount: Number
    within_ns: int

    def __str__(self) -> str:
        return f'{self.ref} {self.direction} {self.amount} within {duration_text(self.within_ns)}'


@dataclass(frozen=True, slots=True)
class For:
    """A rule that is true for a duration without a break."""

    rule: Rule
    duration_ns: int

    def __str__(self) -> str:
        inner = f'({self.rule})' if isinstance(self.rule, For | Not | And | Or) else str(self.rule)
        return f'{inner} for {duration_text(self.duration_ns)}'


@dataclass(frozen=True, slots=True)
class Not:
    """Negation of a rule."""

    rule: Rule

    def __str__(self) -> str:
        return f'not {_inner(self.rule)}'


@dataclass(frozen=True, slots=True)
class And:
    """Conjunction of rules."""

    rules: tuple[Rule, ...]

    def __str__(self) -> str:
        return ' and '.join(map(_inner, self.rules))


@dataclass(frozen=True, slots=True)
class Or:
    """Disjunction of rules."""

    rules: tuple[Rule, ...]

    def __str__(self) -> str:
        return ' or '.join(map(_inner, self.rules))


Condition = Union[Compare, Silent, Changed, Moved]
Rule = Union[Condition, For, Not, And, Or]


def _inner(rule: Rule) -> str:
    return f'({rule})' if isinstance(rule, For | And | Or | Not) else str(rule)


def duration_text(length_ns: int) -> str:
    """Return a duration in the largest unit of which it is a multiple, else exactly in s."""
    for unit, unit_ns in DURATIONS.items():
        if length_ns and not length_ns % unit_ns:
            return f'{length_ns // unit_ns} {unit}'
    whole, rest = divmod(length_ns, NS_PER_S)
    return f'{whole}.{rest:09d}'.rstrip('0').rstrip('.') + ' s'


def conditions_of(rule: Rule) -> Iterator[Condition]:
    """Yield the conditions of a rule, in their order."""
    if isinstance(rule, And | Or):
        for each in rule.rules:
            yield from conditions_of(each)
    elif isinstance(rule, Not | For):
        yield from conditions_of(rule.rule)
    else:
        yield rule


def mapped(rule: Rule, change: Callable[[Condition], Condition]) -> Rule:
    """Return a rule with its conditions replaced."""
    if isinstance(rule, And):
        return And(tuple(mapped(each, change) for each in rule.rules))
    if isinstance(rule, Or):
        return Or(tuple(mapped(each, change) for each in rule.rules))
    if isinstance(rule, Not):
        return Not(mapped(rule.rule, change))
    if isinstance(rule, For):
        return For(mapped(rule.rule, change), rule.duration_ns)
    return change(rule)


def refs_of(rule: Rule) -> tuple[Ref, ...]:
    """Return the fields of a rule, each once, in their order."""
    found: dict[Ref, None] = {}
    for each in conditions_of(rule):
        if isinstance(each, Compare):
            found[each.left] = None
            if isinstance(each.right, Ref):
                found[each.right] = None
        else:
            found[each.ref] = None
    return tuple(found)
