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


"""What each key does to the live screen."""

from __future__ import annotations

from rt_robot_os.tools.top.columns import TABLES
from rt_robot_os.tools.top.screen_layout import Choices
from rt_robot_os.tools.top.screen_layout import PARTS

INTERVALS_S = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0)
_FILTER_MAXIMUM = 40
_PART_KEYS = tuple(str(number) for number in range(1, 1 + len(PARTS)))

UP, DOWN, PAGE_UP, PAGE_DOWN = '\x1b[A', '\x1b[B', '\x1b[5~', '\x1b[6~'
ESCAPE = '\x1b'
_ENTER = ('\r', '\n')
_ERASE = ('\x7f', '\x08')
_SCROLL = {UP: -1, DOWN: 1, PAGE_UP: -10, PAGE_DOWN: 10}


class Controls:
    """
    The user's choices and the keys that change them.

    :ivar typing: whether what is typed goes into the filter.
    """

    def __init__(self, choices: Choices, interval_s: float) -> None:
        self.choices = choices
        self.interval_s = interval_s
        self.typing = False

    def press(self, key: str) -> bool:
        """
        Do what a key means.

        :return: False when the program is to end.
        """
        if self.typing:
            self._type(key)
            return True
        choices = self.choices
        if key in ('q', 'Q', '\x03'):
            return False
        if key in _PART_KEYS:
            choices.part, choices.first = PARTS[_PART_KEYS.index(key)], 0
        elif key in ('p', ' '):
            choices.paused = not choices.paused
        elif key in ('s', 'S'):
            self._sort(1 if key == 's' else -1)
        elif key == 'r':
            choices.backwards = not choices.backwards
        elif key in ('f', '/'):
            self.typing = True
        elif key in ('+', '-'):
            self._interval(key == '+')
        elif key == ESCAPE:
            choices.pattern = ''
        elif key in _SCROLL:
            choices.first = max(0, choices.first + _SCROLL[key])
        return True

    def _type(self, key: str) -> None:
        choices = self.choices
        if key in _ENTER:
            self.typing = False
        elif key == ESCAPE:
            self.typing, choices.pattern = False, ''
        elif key in _ERASE:
            choices.pattern = choices.pattern[:-1]
        elif key.isprintable() and len(choices.pattern) < _FILTER_MAXIMUM:
            choices.pattern += key
        choices.first = 0

    def _sort(self, step: int) -> None:
        choices = self.choices
        part = choices.part if choices.part in TABLES else 'tasks'
        keys = ['', *(c.key for c in TABLES[part] if not c.fills)]
        at = keys.index(choices.sort) if choices.sort in keys else 0
        choices.sort = keys[(at + step) % len(keys)]

    def _interval(self, longer: bool) -> None:
        if longer:
            self.interval_s = next((s for s in INTERVALS_S if s > self.interval_s),
                                   INTERVALS_S[-1])
        else:
            self.interval_s = next((s for s in reversed(INTERVALS_S) if s < self.interval_s),
                                   INTERVALS_S[0])

    def help_line(self) -> str:
        """Return which keys there are and what is chosen; 80 columns."""
        if self.typing:
            return f'filter: {self.choices.pattern}_   Enter: done  Esc: all'
        backwards = ' (reversed)' if self.choices.backwards else ''
        sort = f'{self.choices.sort or "default"}{backwards}'
        return (f'q quit  p pause  s sort: {sort}  r reverse  f filter  '
                f'1-{len(PARTS)} {self.choices.part}  + - {self.interval_s:g} s')


def split_keys(typed: str) -> list[str]:
    """Split what a terminal sent into keys; escape sequences stay whole."""
    keys: list[str] = []
    at = 0
    while at < len(typed):
        end = at + 1
        if typed[at] == ESCAPE and typed[end:end + 1] in ('[', 'O'):
            end += 1
            while end < len(typed) and not '@' <= typed[end] <= '~':
                end += 1
            end += 1
        key = typed[at:end].replace('\x1bO', '\x1b[')
        keys.append(key)
        at = end
    return keys
