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

"""Parse the short strings of the world: names, numbers, seconds."""

from __future__ import annotations

import math
import re
from typing import Final

# Beyond any map.
_FARTHEST: Final = 1e6
LONGEST_S: Final = 1e6
_NAME: Final = re.compile(r'[A-Za-z_]\w{0,63}', re.ASCII)


def words_of(text: str) -> list[str]:
    """Split a string; colons and commas may separate words, as in the driver's landmarks."""
    return text.replace(',', ' ').replace(':', ' ').split()


def name_of(text: str) -> str:
    """
    Return the first word.

    :raises ValueError: it is not a name.
    """
    words = words_of(text)
    if not words or not _NAME.fullmatch(words[0]):
        raise ValueError('must begin with a name: a letter, then letters, digits and _')
    return words[0]


def numbers_of(text: str, skip: int) -> list[float]:
    """
    Return the numbers after some words.

    :raises ValueError: one is not a valid number.
    """
    found = []
    for word in words_of(text)[skip:]:
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not abs(value) <= _FARTHEST:
            raise ValueError(f'{word[:40]!r} is not a valid number')
        found.append(value)
    return found


def exactly(text: str, skip: int, wanted: str) -> list[float]:
    """
    Return as many numbers as another string has words.

    :raises ValueError: there are more or fewer, or one is invalid.
    """
    numbers = numbers_of(text, skip)
    if len(numbers) != len(wanted.split()) - skip:
        raise ValueError(f'must be: {wanted}')
    return numbers


def seconds_of(word: str) -> float:
    """
    Return a time in seconds.

    :raises ValueError: it is invalid.
    """
    found, = numbers_of(word, 0)
    if not 0.0 <= found <= LONGEST_S:
        raise ValueError(f'{word} s: it must be from 0 to {LONGEST_S:g}')
    return found
