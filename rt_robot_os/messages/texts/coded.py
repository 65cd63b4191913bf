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
Texts for people as codes with arguments, so that a page words them in the language of its reader.

A text is written where the fact is known, in English, and goes out as it is: to the log, to
topics, journals and other clients. Where it leaves for a page its code is found by the templates
of this release, and goes beside it: ``{'code': 'after_s', 'args': {'seconds': 25}}``. A text
without a template has no code, and is shown as it is (decision 118).

Holes of templates: ``{name}`` any text, ``{name:w}`` one word, ``{name:n}`` a number,
``{name:sign}`` a vital sign, ``{name:t}`` a text that has a code itself, ``{name:l}`` several such
texts, ``{name:kinds}`` several words, both with ``, `` between them, ``{name:e}`` an emergency as
the agent names it, ``{name:a}`` what happened to the agent, ``{name:word}`` a word as code has it.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
from functools import lru_cache
import math
import re
from types import MappingProxyType
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.messages.signs import SIGNS
from rt_robot_os.messages.texts.robot_templates import TEMPLATES as ROBOT
from rt_robot_os.messages.texts.server_templates import TEMPLATES as SERVER

#: All templates by their code.
TEMPLATES: Final[Mapping[str, str]] = MappingProxyType({**ROBOT, **SERVER})
#: A longer text has no code, nor one that is nested deeper.
LONGEST: Final = 500
_DEEPEST: Final = 4
#: Of several texts so many have codes: a robot cannot keep a server busy with one line.
_CODED_MOST: Final = 12
_HOLE: Final = re.compile(r'\{(\w+)(?::(\w+))?\}')
_TITLES: Final = MappingProxyType({sign.title: name for name, sign in SIGNS.items()})
_NUMBER: Final = r'[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?'
_PATTERNS: Final = MappingProxyType({
    '': r'.+?', 'w': r'\S+?', 'n': _NUMBER, 't': r'.+', 'l': r'.+', 'kinds': r'\w+(?:, \w+)*',
    'e': r'[^:]+', 'a': r'.+', 'word': r'[a-z][a-z0-9_]*',
    'sign': '|'.join(map(re.escape, sorted(_TITLES, key=len, reverse=True)))})


class _Template(NamedTuple):
    code: str
    pattern: re.Pattern[str]
    holes: tuple[tuple[str, str], ...]


def _compiled(code: str, template: str) -> _Template:
    parts, end = [], 0
    holes = []
    for each in _HOLE.finditer(template):
        name, kind = each[1], each[2] or ''
        holes.append((name, kind))
        parts += [re.escape(template[end:each.start()]), f'(?P<{name}>{_PATTERNS[kind]})']
        end = each.end()
    parts.append(re.escape(template[end:]))
    return _Template(code, re.compile(''.join(parts)), tuple(holes))


def _letters(template: str) -> int:
    return len(_HOLE.sub('', template))


# What begins with a word of its own is the outer text of two; then what says more by itself.
_ALL: Final = tuple(_compiled(code, template) for code, template in sorted(
    TEMPLATES.items(), key=lambda each: (each[1].startswith('{'), -_letters(each[1]))))
#: What says little by itself, by the hole in which alone it counts.
_ONLY_IN: Final = MappingProxyType({
    'agent_event_operator': 'a', 'agent_event_help': 'a', 'emergency': 'e', 'emergency_at': 'e',
    **{code: 'l' for code in TEMPLATES if code == 'points' or re.match('(sign|found)_?', code)
       and not code.startswith(('signs', 'found_there')) and code != 'found'}})


@lru_cache(maxsize=4096)
def coded(text: str, depth: int = 0, hole: str = '') -> Mapping[str, Any] | None:
    """
    Return the code of a text and its arguments, as JSON has them; None without one.

    A nested text is ``{'text': ...}``, with its code when it has one. Not for the real-time loop.

    :param hole: the kind of the hole in which it stands.
    """
    if not 0 < len(text) <= LONGEST or depth > _DEEPEST:
        return None
    for code, pattern, holes in _ALL:
        found = pattern.fullmatch(text)
        if found is not None and _ONLY_IN.get(code, hole) == hole:
            return {'code': code, 'args': {
                name: _READERS[kind](found[name], depth) for name, kind in holes}}
    return None


def codes_of(content: Mapping[str, Any], names: Iterable[str]) -> dict[str, Any]:
    """
    Return the codes of some texts in a message, by their names; those it brings itself stay.

    :param content: what it brings stands in ``codes``, as of a robot of another release.
    """
    brought = content.get('codes')
    found = dict(brought) if isinstance(brought, Mapping) else {}
    for name in names:
        text = content.get(name)
        if name not in found and isinstance(text, str) and (code := coded(text)) is not None:
            found[name] = code
    return found


def _nested(text: str, depth: int, hole: str = '') -> dict[str, Any]:
    return {'text': text, **(coded(text, depth + 1, hole) or {})}


def _number(text: str, depth: int) -> float | str:
    value = float(text)
    if not math.isfinite(value):
        return text  # JSON has no such number
    return int(value) if value.is_integer() and '.' not in text else value


def _several(text: str, depth: int) -> list[dict[str, Any]]:
    parts = text.split(', ')
    return [_nested(each, depth, 'l') if place < _CODED_MOST else {'text': each}
            for place, each in enumerate(parts)]


_READERS: Final[Mapping[str, Callable[[str, int], Any]]] = MappingProxyType({
    '': lambda text, depth: text, 'w': lambda text, depth: text, 'n': _number,
    'word': lambda text, depth: text, 'sign': lambda text, depth: _TITLES[text],
    't': _nested, 'e': lambda text, depth: _nested(text, depth, 'e'),
    'a': lambda text, depth: _nested(text, depth, 'a'),
    'l': _several,
    'kinds': lambda text, depth: text.split(', ')})
