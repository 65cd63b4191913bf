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
Faults and other events of a network, parsed from the strings of a scenario.

========================================  =========================================================
``kill WHO at S``                         no power from then on
``boot WHO at S``                         switched on then, not at the start
``reboot WHO at S [for D]``               without power for D seconds (1), then a cold boot
``sleep WHO at S for D``                  switched off for D seconds; it boots when it wakes
``silence WHO at S [for D]``              its application sends nothing; it forwards
``move WHO X Y [at S]``                   has this position from then on
``noise DB at S for D``                   noise is higher by this everywhere
========================================  =========================================================

WHO is an id, several separated by commas (``3,4``), ``all``, ``sink``, or a share: ``10%`` of all
nodes except the sink, drawn with the seed.
"""

from __future__ import annotations

from collections.abc import Collection
from collections.abc import Sequence
import math
from random import Random
import re
from typing import Final
from typing import NamedTuple

_FORM: Final = re.compile(
    r'\s*(\w+)\s+(.+?)\s+at\s+(\S+?)\s*s?(?:\s+for\s+(\S+?)\s*s?)?\s*', re.ASCII)
_LONGEST_S: Final = 1e9
_DEFAULT_OFF_S: Final = 1.0


class _Kind(NamedTuple):
    who: bool
    numbers: tuple[str, ...]
    lasts: str       # 'must', 'may' or 'no'


_KINDS: Final = {
    'kill': _Kind(True, (), 'no'),
    'boot': _Kind(True, (), 'no'),
    'reboot': _Kind(True, (), 'may'),
    'sleep': _Kind(True, (), 'must'),
    'silence': _Kind(True, (), 'may'),
    'move': _Kind(True, ('X', 'Y'), 'no'),
    'noise': _Kind(False, ('DB',), 'must'),
}


class Fault(NamedTuple):
    """
    A fault or another event.

    :ivar kind: one of those in this module.
    :ivar who: as written in the scenario; see :func:`nodes_of`. Empty for noise.
    :ivar numbers: x and y in m, or noise in dB.
    :ivar for_s: duration; 0: permanent.
    """

    kind: str
    who: str
    numbers: tuple[float, ...]
    at_s: float
    for_s: float = 0.0


def fault(text: str) -> Fault:
    """
    Parse one string.

    :raises ValueError: the string is invalid; with the remedy.
    """
    match = _FORM.fullmatch(text)
    if match is None:
        raise ValueError('must be such as "kill 5 at 120"')
    name, middle, at, lasts = match.groups()
    kind = _KINDS.get(name)
    if kind is None:
        raise ValueError(f'{name!r} is not an event: there are {", ".join(_KINDS)}')
    words = middle.replace(', ', ',').split()
    form = _form(name, kind)
    if len(words) != kind.who + len(kind.numbers):
        raise ValueError(f'must be {form}')
    if (lasts is None) if kind.lasts == 'must' else (lasts is not None and kind.lasts == 'no'):
        raise ValueError(f'must be {form}')
    who = words.pop(0) if kind.who else ''
    if kind.who and not re.fullmatch(r'all|sink|\d{1,6}(,\d{1,6})*|\d{1,3}(\.\d+)?%', who):
        raise ValueError(f'{who!r} must be an id, several with commas, all, sink or a share such '
                         'as 10%')
    numbers = tuple(_number(word, -1e6, 1e6, form) for word in words)
    for_s = _DEFAULT_OFF_S if name == 'reboot' else 0.0
    if lasts is not None:
        for_s = _number(lasts, 0.0, _LONGEST_S, form)
    return Fault(name, who, numbers, _number(at, 0.0, _LONGEST_S, form), for_s)


def _form(name: str, kind: _Kind) -> str:
    words = [name, *(['WHO'] if kind.who else []), *kind.numbers, 'at S']
    return ' '.join(words) + {'must': ' for S', 'may': ' [for S]', 'no': ''}[kind.lasts]


def _number(word: str, least: float, most: float, form: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not least <= value <= most:
        raise ValueError(f'{word!r} must be a number from {least:g} to {most:g}: {form}')
    return value


def nodes_of(one: Fault, ids: Collection[int], sinks: Collection[int], random: Random
             ) -> Sequence[int]:
    """
    Return the ids of the nodes that a fault affects.

    :param ids: of all nodes.
    :param sinks: ids of the sinks.
    :param random: draws a share.
    :raises ValueError: there is no such node.
    """
    if one.who == 'sink':
        return sorted(sinks)
    if one.who in ('all', ''):
        return sorted(set(ids).difference(sinks))
    if one.who.endswith('%'):
        others = sorted(set(ids).difference(sinks))
        share = min(1.0, float(one.who[:-1]) / 100)
        return sorted(random.sample(others, round(share * len(others))))
    found = [int(word) for word in one.who.split(',')]
    for each in found:
        if each not in ids:
            raise ValueError(f'there is no node {each}')
    return found
