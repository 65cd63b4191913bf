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
Limits of the fields of a message, and how a message is read from JSON.

A message is a frozen dataclass. The type of each field says its limit too, as in
``text: Annotated[str, Text(240)]``. :class:`rt_robot_os.messages.codec.Codec` reads all fields by
these limits, and ``scripts/message_schema.py`` writes the documentation from them.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from enum import Enum
import functools
import json
import math
import re
from typing import Any
from typing import Final
from typing import Generic
from typing import NamedTuple
from typing import Protocol
from typing import TypeVar

from rt_robot_os.base.safe_text import safe_line

E = TypeVar('E', bound=Enum)
_SHOWN: Final = 60

_DECODE: Final = json.JSONDecoder().decode
#: Write JSON without blanks; one encoder for all, because making one takes as long as using it.
compact: Final = json.JSONEncoder(ensure_ascii=False, separators=(',', ':')).encode


def clean(text: str) -> str:
    """Replace what no ROS message can hold: NUL and lone surrogates, which JSON can escape."""
    if text.isascii() and '\0' not in text:
        return text
    return text.replace('\0', ' ').encode('utf-8', 'replace').decode()


def parse_object(text: str, example: str) -> dict[str, Any]:
    """
    Parse a JSON object.

    :param example: of what would be right, for the error.
    :raises ValueError: it is not a JSON object.
    """
    try:
        found = _DECODE(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f'{text[:_SHOWN]!r} is not JSON: {error}') from None
    if not isinstance(found, dict):
        raise ValueError(f'{text[:_SHOWN]!r} is not a JSON object: write {example}')
    return found


class FieldLimit(Protocol):
    """What the value of a field may be."""

    def read(self, value: object) -> Any:
        """
        Return a value from JSON as that of the field.

        :raises ValueError: with the value and what it must be.
        """

    def repair(self, value: object) -> Any:
        """
        Return it as :meth:`read` does; shorten what is only too long.

        :raises ValueError: there is nothing to shorten.
        """

    def schema(self) -> dict[str, Any]:
        """Return it as a JSON schema."""


@functools.cache
def _matcher(pattern: str) -> Callable[[str], re.Match[str] | None]:
    return re.compile(pattern, re.ASCII).fullmatch


class Text(NamedTuple):
    """
    A string.

    :ivar most: characters.
    :ivar least: characters, without blanks around them.
    :ivar pattern: that the whole string matches; any if empty.
    :ivar must_be: the pattern in words.
    :ivar printable: write control characters as escapes: people read it on a terminal.
    """

    most: int
    least: int = 0
    pattern: str = ''
    must_be: str = ''
    printable: bool = False

    def read(self, value: object) -> str:
        """Return it; :raises ValueError: it is not such a string."""
        if not isinstance(value, str) or len(value) > self.most or (
                self.least and len(value.strip()) < self.least) or (
                self.pattern and not _matcher(self.pattern)(value)):
            raise ValueError(f'{str(value)[:_SHOWN]!r}: it must be '
                             + (self.must_be or f'a string of {self.least} to {self.most} '
                                                'characters'))
        return safe_line(value, self.most) if self.printable else clean(value)

    def repair(self, value: object) -> str:
        """Return it, cut; :raises ValueError: it is not a string."""
        return self.read(value[:self.most] if isinstance(value, str) else value)

    def schema(self) -> dict[str, Any]:
        """Return it as a JSON schema."""
        return {'type': 'string', **({'minLength': self.least} if self.least else {}),
                'maxLength': self.most,
                **({'pattern': f'^{self.pattern}$'} if self.pattern else {})}


class Real(NamedTuple):
    """
    A number; NaN, which is left out of JSON, is a value that is not known.

    :ivar unit: ``m``, ``s`` ...; empty for none.
    """

    low: float = -math.inf
    high: float = math.inf
    unit: str = ''

    def read(self, value: object) -> float:
        """Return it; :raises ValueError: it is not a number within the limits."""
        if isinstance(value, float) and self.low <= value <= self.high:
            return value
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise ValueError(f'{str(value)[:20]!r}: it must be a number')
        try:
            number = float(value)
        except OverflowError:
            raise ValueError('is too large a number') from None
        if number == number and not self.low <= number <= self.high:
            raise ValueError(f'{str(value)[:20]!r}: it must be a number from {self.low:g} to '
                             f'{self.high:g}')
        return number

    def repair(self, value: object) -> float:
        """Return it as :meth:`read` does."""
        return self.read(value)

    def schema(self) -> dict[str, Any]:
        """Return it as a JSON schema."""
        return {'type': 'number', **_bounds(self.low, self.high, self.unit)}


class Whole(NamedTuple):
    """An integer."""

    low: int = 0
    high: int = (1 << 63) - 1
    unit: str = ''

    def read(self, value: object) -> int:
        """Return it; :raises ValueError: it is not an integer within the limits."""
        if type(value) is int and self.low <= value <= self.high:
            return value
        raise ValueError(f'{str(value)[:20]!r}: it must be an integer from {self.low} to '
                         f'{self.high}')

    def repair(self, value: object) -> int:
        """Return it as :meth:`read` does."""
        return self.read(value)

    def schema(self) -> dict[str, Any]:
        """Return it as a JSON schema."""
        return {'type': 'integer', **_bounds(self.low, self.high, self.unit)}


class Flag(NamedTuple):
    """True or false."""

    def read(self, value: object) -> bool:
        """Return it; :raises ValueError: it is neither."""
        if isinstance(value, bool):
            return value
        raise ValueError(f'{str(value)[:20]!r}: it must be true or false')

    def repair(self, value: object) -> bool:
        """Return it, also of 0 and 1; :raises ValueError: it is something else."""
        return bool(value) if isinstance(value, int) else self.read(value)

    def schema(self) -> dict[str, Any]:
        """Return it as a JSON schema."""
        return {'type': 'boolean'}


class Texts(NamedTuple):
    """A list of strings, which is a tuple in the dataclass."""

    most: int
    of: Text

    def read(self, value: object) -> tuple[str, ...]:
        """Return it; :raises ValueError: it is not such a list."""
        if not isinstance(value, list) or len(value) > self.most:
            raise ValueError(f'{str(value)[:_SHOWN]!r}: it must be a list of at most {self.most}')
        return tuple(map(self.of.read, value))

    def repair(self, value: object) -> tuple[str, ...]:
        """Return the first strings of it; :raises ValueError: it is not a list."""
        if not isinstance(value, list):
            return self.read(value)
        most, of = self
        found = []
        for each in value[:most]:
            if type(each) is str:
                plain = len(each) <= of.most and each.isascii() and '\0' not in each
                found.append(each if plain and not of.printable else of.repair(each))
        return tuple(found)

    def schema(self) -> dict[str, Any]:
        """Return it as a JSON schema."""
        return {'type': 'array', 'maxItems': self.most, 'items': self.of.schema()}


class OneObject(NamedTuple):
    """A JSON object whose content is not a message of its own."""

    def read(self, value: object) -> dict[str, Any]:
        """Return it; :raises ValueError: it is not an object."""
        if not isinstance(value, dict):
            raise ValueError(f'{str(value)[:_SHOWN]!r}: it must be a JSON object')
        return value

    def repair(self, value: object) -> dict[str, Any]:
        """Return it as :meth:`read` does."""
        return self.read(value)

    def schema(self) -> dict[str, Any]:
        """Return it as a JSON schema."""
        return {'type': 'object'}


class Objects(NamedTuple):
    """A list of JSON objects."""

    most: int = 4096

    def read(self, value: object) -> tuple[dict[str, Any], ...]:
        """Return it; :raises ValueError: it is not such a list."""
        if not isinstance(value, list) or len(value) > self.most or not all(
                isinstance(each, dict) for each in value):
            raise ValueError(f'{str(value)[:_SHOWN]!r}: it must be a list of at most {self.most} '
                             'JSON objects')
        return tuple(value)

    def repair(self, value: object) -> tuple[dict[str, Any], ...]:
        """Return the objects of a list; :raises ValueError: it is not a list."""
        if not isinstance(value, list):
            return self.read(value)
        return tuple(each for each in value[:self.most] if isinstance(each, dict))

    def schema(self) -> dict[str, Any]:
        """Return it as a JSON schema."""
        return {'type': 'array', 'maxItems': self.most, 'items': {'type': 'object'}}


class Choice(Generic[E]):
    """
    One member of an enumeration.

    :param values: the members, by what they are in JSON.
    """

    def __init__(self, values: Mapping[str, E]) -> None:
        self.values = values

    def read(self, value: object) -> E:
        """Return the member; :raises ValueError: there is none."""
        if isinstance(value, str) and value in self.values:
            return self.values[value]
        raise ValueError(f'{str(value)[:20]!r}: it must be one of {", ".join(self.values)}')

    def repair(self, value: object) -> E:
        """Return it as :meth:`read` does."""
        return self.read(value)

    def schema(self) -> dict[str, Any]:
        """Return it as a JSON schema."""
        return {'enum': list(self.values)}


class OneOf(NamedTuple):
    """
    A string that is one of those known to this release; another one is of a newer release.

    :ivar most: characters.
    """

    values: tuple[str, ...]
    most: int = 64

    def read(self, value: object) -> str:
        """Return it; :raises ValueError: it is not a string."""
        return Text(self.most).read(value)

    def repair(self, value: object) -> str:
        """Return it; :raises ValueError: it is not a string."""
        if isinstance(value, str) and value in self.values:
            return value
        return Text(self.most).repair(value)

    def schema(self) -> dict[str, Any]:
        """Return it as a JSON schema."""
        return {'type': 'string', 'maxLength': self.most, 'examples': list(self.values)}


def _bounds(low: float, high: float, unit: str) -> dict[str, Any]:
    return {**({'minimum': low} if math.isfinite(low) else {}),
            **({'maximum': high} if math.isfinite(high) else {}),
            **({'unit': unit} if unit else {})}
