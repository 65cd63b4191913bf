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
Parser of rules such as ``wsn/kitchen/smoke.data > 0.5 for 3 s``.

The grammar; ``for`` binds closest, then ``not``, ``and``, ``or``::

    rule       = part {"or" part}
    part       = item {"and" item}
    item       = ["not"] (condition | "(" rule ")") {"for" DURATION}
    condition  = FIELD COMPARISON value ["clear" ("below" | "above") NUMBER]
               | FIELD "begins with" TEXT
               | FIELD "changed within" DURATION
               | FIELD ("rises" | "falls" | "moves") NUMBER "within" DURATION
               | TOPIC "silent for" DURATION
    value      = NUMBER | TEXT | FIELD | "true" | "false"

Python evaluates nothing: the result is a tree of terms, or an error with the position.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
import math
import re
from typing import Final
from typing import NoReturn

from rt_robot_os.base.schema import STAR
from rt_robot_os.features.health.rule.terms import And
from rt_robot_os.features.health.rule.terms import Changed
from rt_robot_os.features.health.rule.terms import Compare
from rt_robot_os.features.health.rule.terms import Condition
from rt_robot_os.features.health.rule.terms import DURATIONS
from rt_robot_os.features.health.rule.terms import For
from rt_robot_os.features.health.rule.terms import Moved
from rt_robot_os.features.health.rule.terms import Not
from rt_robot_os.features.health.rule.terms import Number
from rt_robot_os.features.health.rule.terms import Or
from rt_robot_os.features.health.rule.terms import Ref
from rt_robot_os.features.health.rule.terms import Rule
from rt_robot_os.features.health.rule.terms import Silent
from rt_robot_os.features.health.rule.terms import Text
from rt_robot_os.features.health.rule.tokens import meant
from rt_robot_os.features.health.rule.tokens import RuleError
from rt_robot_os.features.health.rule.tokens import shown
from rt_robot_os.features.health.rule.tokens import Token
from rt_robot_os.features.health.rule.tokens import tokens_of
from rt_robot_os.features.health.rule.units import canonical_unit
from rt_robot_os.features.health.rule.units import UNITS

__all__ = ['read_rule', 'RuleError']

_WORDS: Final = ('and', 'or', 'not', 'for', 'silent', 'changed', 'moves', 'rises', 'falls',
                 'begins', 'with', 'within', 'clear', 'below', 'above', 'true', 'false')
_REF: Final = re.compile(r'(?P<topic>[A-Za-z_*][A-Za-z0-9_*]*(?:/[A-Za-z_*][A-Za-z0-9_*]*)*)'
                         r'(?:\.(?P<path>[A-Za-z_]\w*(?:\[\d{1,7}\])*'
                         r'(?:\.[A-Za-z_]\w*(?:\[\d{1,7}\])*)*))?', re.ASCII)
_TIME_OF_DAY: Final = re.compile(r':\d\d?(:\d\d?)?', re.ASCII)
_MIRRORED: Final = {'<': '>', '<=': '>=', '>': '<', '>=': '<=', '==': '==', '!=': '!='}
_FLAGS: Final = {'true': 1.0, 'false': 0.0}
_DEEPEST: Final = 20
_MOST_CONDITIONS: Final = 64
_LONGEST_NS: Final = 31 * DURATIONS['d']
_UNIT_LIST: Final = ' '.join(each for each in UNITS if each != '1')
_EXAMPLE: Final = 'such as wsn/kitchen/smoke.data > 0.5 for 3 s'

Operand = Ref | Number | Text


def read_rule(text: str) -> Rule:
    """
    Parse a rule; not for the real-time loop.

    :raises RuleError: it is not valid; with the problem, the position and the remedy.
    """
    return _Parser(text).rule()


class _Parser:
    """Recursive descent parser with one token of lookahead."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._tokens = tokens_of(text)
        self._at = self._depth = self._conditions = 0

    # ---- rules -------------------------------------------------------------------------------

    def rule(self) -> Rule:
        found = self._or()
        token = self._token
        if token.kind == 'end':
            return found
        if token.kind == 'comparison':
            self._fail('one comparison at a time: write x > 10 and x < 20 instead of 10 < x < 20')
        if token.text == ')':
            self._fail("this ')' closes nothing: remove it")
        self._fail(f"{shown(token)} is not valid here: expected 'and', 'or', "
                   f"'for' with a duration{meant(token.text, _WORDS)}")

    def _or(self) -> Rule:
        found = [self._and()]
        while self._word('or'):
            found.append(self._and())
        return Or(tuple(found)) if len(found) > 1 else found[0]

    def _and(self) -> Rule:
        found = [self._item()]
        while self._word('and'):
            found.append(self._item())
        return And(tuple(found)) if len(found) > 1 else found[0]

    def _item(self) -> Rule:
        if self._token.text == 'not':
            return self._deeper(lambda: Not(self._item()))
        found: Rule
        if self._token.text == '(' and self._token.kind == 'bracket':
            found = self._deeper(self._group)
        else:
            found = self._condition()
        if self._word('for'):
            found = For(found, self._duration())
            if self._token.text == 'for':
                self._fail("'for' twice: remove one, or put the first and its condition in "
                           'brackets')
        return found

    def _group(self) -> Rule:
        opened = self._next()
        found = self._or()
        if self._token.text != ')' or self._token.kind != 'bracket':
            if self._token.kind == 'end':
                self._fail("this '(' is never closed: add ')'", opened)
            self._fail(f"{shown(self._token)} is not valid here: expected 'and', 'or', 'for' or "
                       f"')'{meant(self._token.text, _WORDS)}")
        self._next()
        return found

    def _deeper(self, read: Callable[[], Rule]) -> Rule:
        self._depth += 1
        if self._depth > _DEEPEST:
            self._fail(f"brackets and 'not' are nested more than {_DEEPEST} deep: write several "
                       'rules')
        token = self._token
        if token.text == 'not':
            self._next()
        found = read()
        self._depth -= 1
        return found

    # ---- conditions --------------------------------------------------------------------------

    def _condition(self) -> Condition:
        self._conditions += 1
        if self._conditions > _MOST_CONDITIONS:
            self._fail(f'more than {_MOST_CONDITIONS} conditions: write several rules')
        first = self._token
        left = self._operand('a topic with a field, ' + _EXAMPLE)
        if self._token.kind == 'comparison':
            return self._comparison(left, first)
        if not isinstance(left, Ref):
            self._fail('a condition starts with a topic and its field, ' + _EXAMPLE, first)
        return self._event(left)

    def _event(self, ref: Ref) -> Condition:
        token = self._token
        if self._word('silent'):
            self._expect('for', 'a duration, such as silent for 60 s')
            return Silent(ref, self._duration())
        if self._word('changed'):
            self._expect('within', 'a duration, such as changed within 12 h')
            return Changed(ref, self._duration())
        if self._word('begins'):
            self._expect('with', "a string, such as begins with 'idle'")
            return Compare(ref, 'begins', self._quoted())
        if token.text in ('moves', 'rises', 'falls'):
            self._next()
            by = self._token
            amount = self._number(f'an amount, such as {token.text} 0.5 within 10 min')
            if not amount.value > 0.0:
                self._fail('must be more than 0', by)
            self._expect('within', f'a duration, such as {token.text} 0.5 within 10 min')
            return Moved(ref, token.text, amount, self._duration())
        if token.kind == 'end' or token.text in ('and', 'or', 'for', ')'):
            self._fail(f'{ref} has no condition: add one such as {ref} > 0.5, {ref} == true, '
                       'silent for 60 s, changed within 1 h')
        self._fail(f'{shown(token)} is not valid here: expected one of < <= > >= == !=, '
                   'silent, changed, moves, rises, falls, begins'
                   f'{meant(token.text, _WORDS)}')

    def _comparison(self, left: Operand, first: Token) -> Condition:
        sign = self._next()
        second = self._token
        right = self._operand(f'a value to compare with, such as {sign.text} 0.5')
        comparison = sign.text
        if not isinstance(left, Ref):
            if not isinstance(right, Ref):
                self._fail('one side must be a topic with a field, ' + _EXAMPLE, first)
            left, right, comparison = right, left, _MIRRORED[comparison]
            first, second = second, first
        if isinstance(right, Text) and comparison not in ('==', '!='):
            self._fail('a string can only be compared with == or !=, or begins with', sign)
        if isinstance(right, Ref) and right == left:
            self._fail('both sides are the same field', second)
        return Compare(left, comparison, right, self._clear(comparison, right, sign))

    def _clear(self, comparison: str, right: Operand, sign: Token) -> Number | None:
        clear = self._token
        if not self._word('clear'):
            return None
        if comparison[0] not in '<>' or not isinstance(right, Number):
            self._fail("'clear' is only valid with < <= > >= and a number", clear)
        wanted = 'below' if comparison[0] == '>' else 'above'
        self._expect(wanted, f'a number: {sign.text} ends when the value is {wanted} it')
        place = self._token
        found = self._number(f'a number, such as clear {wanted} {right}')
        if canonical_unit(found.unit) == canonical_unit(right.unit) and (
                found.value > right.value if wanted == 'below' else found.value < right.value):
            self._fail(f'must be {wanted} {right}, the limit of the condition', place)
        return found

    # ---- words -------------------------------------------------------------------------------

    def _operand(self, wanted: str) -> Operand:
        token = self._token
        if token.kind == 'number':
            return self._number(wanted)
        if token.kind == 'text':
            return self._quoted()
        if token.text in _FLAGS:
            self._next()
            return Number(_FLAGS[token.text], '', token.span)
        if token.text == 'between':
            self._time_of_day()
        if token.kind != 'word' or token.text in _WORDS:
            self._fail(f'{shown(token)} is not valid here: must be {wanted}'
                       f'{meant(token.text, ()) if token.kind == "other" else ""}')
        return self._ref()

    def _ref(self) -> Ref:
        token = self._next()
        found = _REF.fullmatch(token.text)
        if found is None:
            if token.text.startswith(('/', '~')) and _REF.fullmatch(token.text.lstrip('/~')):
                self._fail('topics of the core have no leading /: write '
                           f'{token.text.lstrip("/~")}', token)
            self._fail(f'{shown(token)} is not a topic with a field: must be {_EXAMPLE[8:]}'
                       f'{meant(token.text, _WORDS)}', token)
        topic = found['topic']
        if topic.count(STAR) > 1:
            self._fail(f'{topic} has more than one {STAR}: write the other parts', token)
        return Ref(topic, found['path'] or '', token.span)

    def _number(self, wanted: str) -> Number:
        token = self._token
        if token.kind != 'number':
            self._fail(f'{shown(token)} is not valid here: must be {wanted}')
        self._next()
        value = float(token.text)
        if not math.isfinite(value):
            self._fail('this number is too large', token)
        follows = self._token
        if follows.kind == 'word' and follows.text not in _WORDS:
            if _TIME_OF_DAY.fullmatch(follows.text):
                self._time_of_day(token)
            unit = canonical_unit(follows.text)
            if unit not in UNITS:
                self._fail(f'{shown(follows)} is not a unit, and not valid here: units are '
                           f'{_UNIT_LIST}{meant(follows.text, _WORDS)}')
            self._next()
            return Number(value, unit, (token.span[0], follows.span[1]))
        return Number(value, '', token.span)

    def _quoted(self) -> Text:
        token = self._token
        if token.kind != 'text':
            self._fail(f"{shown(token)} is not valid here: must be a string in quotes, 'idle'")
        self._next()
        return Text(token.text[1:-1], token.span)

    def _duration(self) -> int:
        first = self._token
        total_ns, parts = 0, 0
        while self._token.kind == 'number':
            number, unit = self._next(), self._token
            if _TIME_OF_DAY.fullmatch(unit.text):
                self._time_of_day(number)
            if unit.kind != 'word' or unit.text not in DURATIONS:
                self._fail(f'{shown(unit)} is not a unit of time: must be one of '
                           f'{", ".join(reversed(DURATIONS))}')
            self._next()
            parts += 1
            total_ns += _nanoseconds(number.text, DURATIONS[unit.text])
        if not parts:
            self._fail(f'{shown(first)} is not valid here: must be a duration, such as '
                       '3 s or 1 h 30 min')
        span = first.span[0], self._tokens[self._at - 1].span[1]
        if not 0 < total_ns <= _LONGEST_NS:
            raise RuleError('must be more than 0 and at most 31 d', self._text, span)
        return total_ns

    @property
    def _token(self) -> Token:
        return self._tokens[self._at]

    def _next(self) -> Token:
        token = self._tokens[self._at]
        self._at += token.kind != 'end'
        return token

    def _word(self, word: str) -> bool:
        found = self._token.kind == 'word' and self._token.text == word
        if found:
            self._next()
        return found

    def _expect(self, word: str, then: str) -> None:
        token = self._token
        if not self._word(word):
            self._fail(f'{shown(token)} is not valid here: must be {word!r} and {then}')

    def _time_of_day(self, token: Token | None = None) -> NoReturn:
        self._fail('a rule has no time of day, so that replays give the same result: publish it '
                   'on a topic, and compare that: clock/hour.data >= 22', token)

    def _fail(self, problem: str, token: Token | None = None) -> NoReturn:
        raise RuleError(problem, self._text, (token or self._token).span)


def _nanoseconds(number: str, unit_ns: int) -> int:
    """Return a duration exactly; out of the valid range if it is far out of it."""
    about_ns = float(number) * unit_ns
    if not 0.5 < about_ns <= 2 * _LONGEST_NS:
        return 0 if about_ns < 1.0 else 2 * _LONGEST_NS
    return round(Decimal(number) * unit_ns)
