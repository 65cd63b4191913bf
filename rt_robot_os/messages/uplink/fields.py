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
The fields of a message, checked as they are read; the limits stand in the classes of messages.

A field that is missing, or that an older or newer program writes in another way, has a default
where a message makes sense without it; else :class:`ValueError` says what is wrong.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final
from typing import TypeGuard

#: Times in ns, and counters, fit into 64 bits with a sign.
INT_END: Final = 1 << 63
_SHOWN: Final = 20


def is_count(value: object) -> TypeGuard[int]:
    """Return whether a value is an integer from 0 to 2**63 - 1, such as a time in ns."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < INT_END


def count_in(message: Mapping[str, Any], name: str, default: int | None = None,
             end: int = INT_END) -> int:
    """
    Return an integer that is not negative.

    :param end: it must be less.
    :raises ValueError: it is not one, or missing without a default.
    """
    value = message.get(name, default)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < end:
        raise wrong(name, value, f'an integer from 0 to {end - 1}')
    return value


def number_in(message: Mapping[str, Any], name: str, default: float | None = None,
              low: float = -math.inf, high: float = math.inf) -> float:
    """
    Return a finite number from ``low`` to ``high``.

    :raises ValueError: it is not one, or missing without a default.
    """
    value = message.get(name, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise wrong(name, value, 'a number')
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise wrong(name, value, 'a finite number')
    if not low <= number <= high:
        raise wrong(name, value, f'a number from {low:g} to {high:g}')
    return number


def text_in(message: Mapping[str, Any], name: str, most: int, default: str | None = None) -> str:
    """
    Return a string; one that is not empty where there is no default.

    :raises ValueError: it is not one, too long, or missing without a default.
    """
    value = message.get(name, default)
    if not isinstance(value, str) or len(value) > most or (not value and default is None):
        raise wrong(name, value, f'a string of {int(default is None)} to {most} characters')
    return value


def cut_text_in(message: Mapping[str, Any], name: str, most: int, default: str = '') -> str:
    """Return a value as a string, cut: what is only shown is never refused."""
    return str(message.get(name, default))[:most]


def object_in(message: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """
    Return an object.

    :raises ValueError: it is not one.
    """
    value = message.get(name)
    if not isinstance(value, dict):
        raise wrong(name, value, 'an object')
    return value


def loose_object_in(message: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return an object; an empty one in the place of anything else."""
    value = message.get(name)
    return value if isinstance(value, dict) else {}


def texts_in(message: Mapping[str, Any], name: str, most: int, characters: int) -> list[str]:
    """Return the strings of a list that have 1 to ``characters``, of its first ``most``."""
    value = message.get(name)
    return [each for each in value[:most] if isinstance(each, str) and 0 < len(each) <= characters
            ] if isinstance(value, list) else []


def wrong(name: str, value: object, expected: str) -> ValueError:
    """Return the error for a field."""
    return ValueError(f'{name} must be {expected}, not {repr(value)[:_SHOWN]}')
