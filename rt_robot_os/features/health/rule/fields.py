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


"""The fields of a rule on the topics of a robot: checks and units."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.features.health.rule.terms import Compare
from rt_robot_os.features.health.rule.terms import Condition
from rt_robot_os.features.health.rule.terms import conditions_of
from rt_robot_os.features.health.rule.terms import mapped
from rt_robot_os.features.health.rule.terms import Moved
from rt_robot_os.features.health.rule.terms import Number
from rt_robot_os.features.health.rule.terms import Ref
from rt_robot_os.features.health.rule.terms import Rule
from rt_robot_os.features.health.rule.terms import Silent
from rt_robot_os.features.health.rule.terms import Text
from rt_robot_os.features.health.rule.tokens import RuleError
from rt_robot_os.features.health.rule.units import converted
from rt_robot_os.features.health.rule.units import unit_of
from rt_robot_os.topics import Layout
from rt_robot_os.topics.field_path import field_reader

_ORDER: Final = ('<', '<=', '>', '>=')


def error_lines(key: str, error: RuleError) -> list[str]:
    """Return the lines of an error of a rule, each with the key."""
    return [f'{key}: {line}' for line in error.lines()]


def checked(key: str, text: str, rule: Rule, ref: Ref) -> Callable[[TopicSpec], Iterator[str]]:
    """
    Return the check of a field against the declaration of its topic.

    :param key: of the rule, such as ``smoke.when``.
    :param text: of the rule.
    """
    def check(spec: TopicSpec) -> Iterator[str]:
        try:
            layout = Layout.compile(spec.message, spec.fixed, tail=spec.tail)
        except LayoutError:
            return  # reported where the topic is declared
        problem = problem_of(rule, ref, spec.topic, layout)
        if problem:
            yield from error_lines(key, RuleError(problem, text, ref.span))
    return check


def problem_of(rule: Rule, ref: Ref, topic: str, layout: Layout) -> str:
    """Return the problem with the use of a field; empty without one."""
    uses = [each for each in conditions_of(rule) if ref in _refs(each)]
    if not ref.path and all(isinstance(each, Silent) for each in uses):
        return ''
    try:
        is_text = field_reader(layout, ref.path).is_text
    except LayoutError as error:
        return str(error)
    unit = '' if is_text else unit_of(topic, layout.type_name, ref.path)
    for each in uses:
        if is_text and not _suits_text(each):
            return (f'{topic}.{ref.path} is a string: only == and != with a quoted string, begins '
                    'with and changed within apply')
        if not is_text and isinstance(each, Compare) and (
                isinstance(each.right, Text) and each.left == ref):
            return f'{topic}.{ref.path} is a number: compare it with a number, without quotes'
        for number in _numbers(each):
            try:
                converted(number.value, number.unit, unit)
            except ValueError as error:
                return f'{topic}.{ref.path} and {number}: {error}'
    return ''


def _refs(term: Condition) -> tuple[Ref, ...]:
    if isinstance(term, Compare):
        return (term.left, term.right) if isinstance(term.right, Ref) else (term.left,)
    return (term.ref,)


def _suits_text(term: Condition) -> bool:
    if isinstance(term, Compare):
        return term.comparison not in _ORDER and not isinstance(term.right, Number)
    return not isinstance(term, Moved)


def _numbers(term: Condition) -> list[Number]:
    found: list[object] = []
    if isinstance(term, Compare):
        found = [term.right, term.clear]
    elif isinstance(term, Moved):
        found = [term.amount]
    return [each for each in found if isinstance(each, Number)]


def bound(rule: Rule, star: str, layouts: Callable[[str], Layout]) -> Rule:
    """
    Return a rule without stars, its numbers converted to the units of their fields.

    :param star: replacement of the star.
    :param layouts: returns the layout of a topic.
    """
    def in_units(term: Condition) -> Condition:
        ref = term.left if isinstance(term, Compare) else term.ref
        ref = ref.starred(star)
        unit = ''
        if ref.path:
            unit = unit_of(ref.topic, layouts(ref.topic).type_name, ref.path)

        def number(given: Number) -> Number:
            return Number(converted(given.value, given.unit, unit), '', given.span)

        if isinstance(term, Compare):
            right = term.right
            return replace(
                term, left=ref, right=right.starred(star) if isinstance(right, Ref) else (
                    number(right) if isinstance(right, Number) else right),
                clear=term.clear and number(term.clear))
        if isinstance(term, Moved):
            return replace(term, ref=ref, amount=number(term.amount))
        return replace(term, ref=ref)
    return mapped(rule, in_units)
