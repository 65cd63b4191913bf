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


"""Tokens of a rule, and the error that shows the position of a problem."""

from __future__ import annotations

from collections.abc import Iterable
import difflib
import re
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.health.rule.terms import Span

#: Largest number of characters of a rule.
LONGEST: Final = 2000

_TOKEN: Final = re.compile(
    r'(?P<space>\s+)'
    r'|(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)'
    r'|(?P<text>\'[^\']*\'|"[^"]*")'
    r'|(?P<comparison><=|>=|==|!=|<|>)'
    r'|(?P<bracket>[()])'
    r'|(?P<word>[^\s()<>=!\'",]+)'
    r'|(?P<other>.)', re.ASCII | re.IGNORECASE | re.DOTALL)

# Words of other languages, and their equivalents.
_MEANT: Final = {'=': '==', '!': 'not', '&&': 'and', '&': 'and', '||': 'or', '|': 'or',
                 'greater': '>', 'above': '>', 'below': '<', 'less': '<', 'is': '==',
                 'equals': '==', 'during': 'for', 'since': 'for', 'after': 'for', 'xor': '!='}
_SHOWN: Final = 100


class RuleError(ValueError):
    """
    An invalid rule.

    :ivar problem: what is wrong, and the remedy.
    :ivar text: of the rule.
    :ivar span: position of the problem in the text: start and end.
    """

    def __init__(self, problem: str, text: str, span: Span) -> None:
        super().__init__(problem)
        self.problem = problem
        self.text = text
        self.span = span

    def lines(self) -> tuple[str, str, str]:
        """Return the problem, the text, and a line with carets under the position."""
        begin, end = self.span
        # Of a long text only the part around the position.
        first = max(0, begin - _SHOWN // 2) if len(self.text) > _SHOWN else 0
        shown = ''.join(each if each.isprintable() else ' '
                        for each in self.text[first:first + _SHOWN])
        carets = '^' * max(1, min(end, first + _SHOWN) - begin)
        return self.problem, f'  {shown}', f'  {" " * (begin - first)}{carets}'

    def __str__(self) -> str:
        return '\n'.join(self.lines())


class Token(NamedTuple):
    """
    A token.

    :ivar kind: number, text, comparison, bracket, word, other or end.
    """

    kind: str
    text: str
    span: Span


def tokens_of(text: str) -> list[Token]:
    """
    Split a text into tokens.

    :return: at least a token of the kind end.
    :raises RuleError: the text is too long.
    """
    if len(text) > LONGEST:
        raise RuleError(f'a rule of {len(text)} characters: at most {LONGEST}; write several '
                        'rules', text[:LONGEST], (LONGEST - 1, LONGEST))
    found = [Token(str(match.lastgroup), match[0], match.span())
             for match in _TOKEN.finditer(text) if match.lastgroup != 'space']
    end = len(text.rstrip())
    return [*found, Token('end', '', (end, end + 1))]


def shown(token: Token) -> str:
    """Return the name of a token in errors."""
    if token.kind == 'end':
        return 'the end'
    return repr(token.text if len(token.text) <= 60 else f'{token.text[:57]}...')


def meant(word: str, known: Iterable[str]) -> str:
    """Return a suggestion, ``; did you mean 'for'?``; empty without one."""
    small = word.lower()
    names = list(known)
    guess = _MEANT.get(small)
    if guess is None:
        guess = next(iter(difflib.get_close_matches(small[:64], names, 1)), None)
    return f'; did you mean {guess!r}?' if guess else ''
