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
Parser of personal limits and trends of vital signs.

A limit is ``SIGN > NUMBER [for TIME] [clear NUMBER] [level LEVEL]``, with ``>`` or ``<``; a trend
is ``SIGN rising|falling NUMBER in TIME [level LEVEL]``::

    pulse_per_min > 120 for 60 s clear 110 level urgent
    spo2_percent falling 4 in 10 min
"""

from __future__ import annotations

import math
import re
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.health.duration import duration_ns
from rt_robot_os.messages.cause import Level
from rt_robot_os.messages.cause import LEVELS
from rt_robot_os.messages.signs import checked_sign
from rt_robot_os.messages.signs import SIGNS

LIMIT_FORM: Final = 'SIGN > NUMBER [for TIME] [clear NUMBER] [level LEVEL]'
TREND_FORM: Final = 'SIGN rising|falling NUMBER in TIME [level LEVEL]'
_NUMBER: Final = r'([+-]?[0-9.]+(?:e[+-]?[0-9]+)?)'
_TIME: Final = r'([0-9.]+\s*[a-z]+)'
_LEVEL: Final = r'(?:\s+level\s+(\w+))?'
_LIMIT: Final = re.compile(
    rf'(\w+)\s*([<>])\s*{_NUMBER}(?:\s+for\s+{_TIME})?(?:\s+clear\s+{_NUMBER})?{_LEVEL}')
_TREND: Final = re.compile(rf'(\w+)\s+(rising|falling)\s+{_NUMBER}\s+in\s+{_TIME}{_LEVEL}')
_WORD: Final = re.compile(r'[<>=!]+|[^\s<>=!]+')
_RELATIONS: Final = ('>', '<', 'rising', 'falling')
_EXAMPLE: Final = 'such as "pulse_per_min > 120 for 60 s clear 110 level urgent"'
_NS_PER_S: Final = 1_000_000_000
_WINDOW_MINIMUM_NS: Final = 30 * _NS_PER_S
_WINDOW_MAXIMUM_NS: Final = 14 * 86_400 * _NS_PER_S


class Limit(NamedTuple):
    """
    A limit of a sign.

    :ivar sign: name of the sign.
    :ivar is_high: an upper limit; else a lower one.
    :ivar value: the last value that is allowed.
    :ivar for_ns: time for which the value must be beyond the limit.
    :ivar clear: the cause ends at this value.
    :ivar level: of the cause.
    """

    sign: str
    is_high: bool
    value: float
    for_ns: int
    clear: float
    level: Level

    @property
    def kind(self) -> str:
        """Return the kind of its cause."""
        return f'{self.sign}_{"high" if self.is_high else "low"}'

    def is_exceeded(self, value: float, was_exceeded: bool) -> bool:
        """Return whether a value is beyond the limit; if it was before, beyond ``clear``."""
        limit = self.clear if was_exceeded else self.value
        return value > limit if self.is_high else value < limit


class TrendLimit(NamedTuple):
    """
    A limit for the change of a sign within a time.

    :ivar sign: name of the sign.
    :ivar is_rising: else falling.
    :ivar amount: in the unit of the sign, above 0.
    :ivar window_ns: the time.
    :ivar level: of the cause.
    """

    sign: str
    is_rising: bool
    amount: float
    window_ns: int
    level: Level

    @property
    def kind(self) -> str:
        """Return the kind of its cause."""
        return f'{self.sign}_{"rising" if self.is_rising else "falling"}'


def parse_limit(text: str) -> Limit | TrendLimit:
    """
    Parse a limit or a trend.

    :raises ValueError: with the problem and the correct form.
    """
    text = ' '.join(text.split())
    if found := _LIMIT.fullmatch(text):
        return _limit(*found.groups())
    if found := _TREND.fullmatch(text):
        return _trend(*found.groups())
    raise ValueError(_syntax_problem(text))


def _syntax_problem(text: str) -> str:
    """Return which word is wrong, and what is expected there."""
    words = _WORD.findall(text)
    if not words:
        return f'it is empty: must be {LIMIT_FORM}, or {TREND_FORM}, {_EXAMPLE}'
    sign = SIGNS[checked_sign(words[0])]
    words += ['', '']
    if words[1] not in _RELATIONS:
        return (f'{_shown(words[1])} is not valid after the sign, only {" ".join(_RELATIONS)}: '
                f'must be {LIMIT_FORM}, or {TREND_FORM}, {_EXAMPLE}')
    form = LIMIT_FORM if words[1] in '<>' else TREND_FORM
    if not re.fullmatch(_NUMBER, words[2]):
        unit = f', in {sign.unit}' if sign.unit else ''
        return f'{_shown(words[2])} is not a number; write it without a unit{unit}: must be {form}'
    rest = ' '.join(words[3:]).strip()
    return (f'{_shown(rest)} is not valid after {words[2]}: must be {form}, in this order, '
            f'times with a unit (s, min, h, d), {_EXAMPLE}')


def _shown(text: str) -> str:
    return repr(text[:40]) if text else 'the end'


def _limit(sign: str, relation: str, value: str, time: str | None, clear: str | None,
           level: str | None) -> Limit:
    checked_sign(sign)
    is_high = relation == '>'
    number = _number(value)
    clear_at = number if clear is None else _number(clear)
    if clear_at != number and (clear_at > number) == is_high:
        raise ValueError(f'clear {clear_at:g} is beyond the limit {number:g}: must be '
                         f'{"below" if is_high else "above"} it')
    low, high = SIGNS[sign].low, SIGNS[sign].high
    if not low <= number <= high or number == (high if is_high else low):
        raise ValueError(f'{sign} is never {relation} {number:g}: plausible values are from '
                         f'{low:g} to {high:g}')
    if clear is not None and not low <= clear_at <= high:
        raise ValueError(f'clear {clear_at:g}: the cause would never end; plausible values of '
                         f'{sign} are from {low:g} to {high:g}')
    return Limit(sign, is_high, number, 0 if time is None else duration_ns(time), clear_at,
                 _level(level))


def _trend(sign: str, direction: str, amount: str, time: str, level: str | None) -> TrendLimit:
    checked_sign(sign)
    number = _number(amount)
    if not 0.0 < number <= SIGNS[sign].high - SIGNS[sign].low:
        raise ValueError(f'{direction} {number:g}: must be above 0, and at most the range of '
                         f'{sign}')
    window_ns = duration_ns(time)
    if not _WINDOW_MINIMUM_NS <= window_ns <= _WINDOW_MAXIMUM_NS:
        raise ValueError(f'in {time}: must be from 30 s to 14 d')
    return TrendLimit(sign, direction == 'rising', number, window_ns, _level(level))


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f'{text[:40]!r} is not a finite number')
    return value


def _level(text: str | None) -> Level:
    if text is None:
        return Level.WARNING
    if text not in LEVELS:
        raise ValueError(f'level {text[:20]!r}: must be one of {", ".join(LEVELS)}')
    return LEVELS[text]
