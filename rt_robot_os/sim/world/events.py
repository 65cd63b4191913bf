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

"""Events of the world, parsed from commands and from scheduled events."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import replace
import re
from typing import Final
from typing import NamedTuple

from rt_robot_os.sim.world.texts import LONGEST_S
from rt_robot_os.sim.world.texts import numbers_of
from rt_robot_os.sim.world.texts import seconds_of
from rt_robot_os.sim.world.texts import words_of
from rt_robot_os.sim.world.vitals import SIGNS

_TIMES: Final = re.compile(r'(.*\S)\s+at\s+(\S+)(?:\s+for\s+(\S+))?')


@dataclass(frozen=True)
class WorldEvent:
    """
    An event of the world.

    :ivar kind: ``kidnap``, ``person``, ``fall``, ``slip``, ``lamp``, ``alarm``, or such as
        ``node off``.
    :ivar name: of the person or node; empty without one.
    :ivar numbers: its numbers.
    :ivar for_s: its duration; 0: permanent.
    :ivar word: its variant, such as ``help`` of a button.
    """

    kind: str
    name: str
    numbers: tuple[float, ...]
    at_s: float = 0.0
    for_s: float = 0.0
    word: str = ''


class _Form(NamedTuple):
    """
    How an event is written.

    :ivar numbers: the names of its numbers.
    :ivar lasts: a duration may follow.
    :ivar named: it is followed by the name of a person or node.
    :ivar words: one of these follows the name.
    """

    numbers: tuple[str, ...] = ()
    lasts: bool = False
    named: bool = True
    words: tuple[str, ...] = ()


HELP: Final = 'help'
FINE: Final = 'fine'
SILENT: Final = 'silent'

_HAPPENINGS: Final[Mapping[str, _Form]] = {
    'kidnap': _Form(('X', 'Y', 'YAW'), named=False),
    'person': _Form(('X', 'Y'), lasts=True),
    'walk': _Form(),
    'fall': _Form(lasts=True),
    'rise': _Form(),
    'sit': _Form(lasts=True),
    'sleep': _Form(lasts=True),
    'speak': _Form(('SECONDS',)),
    'vital': _Form(('VALUE',), lasts=True, words=tuple(SIGNS)),
    'press': _Form(lasts=True, words=(HELP, FINE)),
    'answer': _Form(words=(FINE, HELP, SILENT)),
    'slip': _Form(('SHARE',), lasts=True, named=False),
    'lamp': _Form(('SHARE',), lasts=True, named=False),
    'heat': _Form(('DEGREES',), lasts=True),
    'node off': _Form(lasts=True),
    'node on': _Form(),
    'node reboot': _Form(),
    'node move': _Form(('X', 'Y')),
    'alarm': _Form(lasts=True),
    'smoke': _Form(lasts=True),
    'water': _Form(lasts=True),
}
# The name of the node is before the action, as in "node kitchen off".
_NODE: Final = 'node'


def _written(kind: str, form: _Form) -> str:
    first, *rest = kind.split()
    words = '|'.join(form.words) if len(form.words) < 4 else 'SIGN'
    return ' '.join([first, *(['NAME'] if form.named else []), *rest, *([words] if words else []),
                     *form.numbers, *(['[SECONDS]'] if form.lasts else [])])


#: All forms, for help and errors.
EVENT_FORMS: Final = '; '.join(_written(kind, form) for kind, form in _HAPPENINGS.items())
#: Events of wireless nodes, by their name or by that of their wearer.
OF_NODES: Final = frozenset({'alarm', 'press', 'smoke', 'water', *(
    kind for kind in _HAPPENINGS if kind.startswith(_NODE))})
#: Events of people.
OF_PEOPLE: Final = frozenset({'person', 'walk', 'fall', 'rise', 'sit', 'sleep', 'speak', 'vital',
                              'answer'})


def parse_timed_event(text: str) -> WorldEvent:
    """
    Parse a scheduled event, such as ``person anna 2.0 1.0 at 12 for 4``.

    :raises ValueError: the message contains the valid form.
    """
    match = _TIMES.fullmatch(text.strip())
    if match is None:
        raise ValueError('must end with "at SECONDS" or "at SECONDS for SECONDS"')
    words = words_of(match[1])
    at_s = seconds_of(match[2])
    for_s = seconds_of(match[3]) if match[3] else 0.0
    found = parse_event(words)
    if match[3] and (not _HAPPENINGS[found.kind].lasts or not for_s):
        raise ValueError(f'{found.kind} has no duration' if for_s else 'must last more than 0 s')
    return replace(found, at_s=at_s, for_s=for_s or found.for_s)


def parse_event(words: list[str]) -> WorldEvent:
    """
    Parse ``person anna 2.0 1.0`` or, with a duration at the end, ``person anna 2 1 4``.

    :raises ValueError: the message contains the valid form.
    """
    if len(words) > 2 and words[0] == _NODE:
        words = [f'{_NODE} {words[2]}', words[1], *words[3:]]
    kind = words[0] if words else ''
    if kind not in _HAPPENINGS:
        raise ValueError(f'{kind!r} is not a known event: write {EVENT_FORMS}')
    form, left = _HAPPENINGS[kind], words[1:]
    name = left.pop(0) if form.named and left else ''
    word = left.pop(0) if form.words and left else ''
    if form.words and word not in form.words:
        raise ValueError(f'{word[:40]!r}: must be one of {", ".join(form.words)}, as in '
                         f'{_written(kind, form)}')
    numbers = numbers_of(' '.join(left), 0)
    seconds = 0.0
    if form.lasts and len(numbers) == len(form.numbers) + 1:
        seconds = numbers.pop()
    if len(numbers) != len(form.numbers) or form.named and not name or not (
            0.0 <= seconds <= LONGEST_S):
        raise ValueError(f'must be one of: {EVENT_FORMS}')
    if form.numbers == ('SHARE',) and not 0.0 <= numbers[0] <= 1.0:
        raise ValueError(f'a share of {numbers[0]:g}: it must be from 0 to 1')
    if form.numbers == ('SECONDS',):
        seconds, = numbers
        if not 0.0 < seconds <= LONGEST_S:
            raise ValueError(f'{seconds:g} s: it must be above 0 and at most {LONGEST_S:g}')
        numbers = []
    return WorldEvent(kind, name, tuple(numbers), for_s=seconds, word=word)
