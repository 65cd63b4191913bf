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
How a message is read from a JSON object, by the limits of its fields.

:class:`Codec` makes the function that reads a class once, at import, as ``dataclasses`` makes
``__init__``: events of alarms are read in the real-time loop.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import fields
from dataclasses import MISSING
import math
from types import MappingProxyType
from typing import Annotated
from typing import Any
from typing import Final
from typing import Generic
from typing import get_args
from typing import get_origin
from typing import get_type_hints
from typing import NamedTuple
from typing import TypeVar

from rt_robot_os.messages.fields import FieldLimit
from rt_robot_os.messages.fields import Flag
from rt_robot_os.messages.fields import OneOf
from rt_robot_os.messages.fields import Real
from rt_robot_os.messages.fields import Text
from rt_robot_os.messages.fields import Whole

T = TypeVar('T')
_LARGEST: Final = math.nextafter(math.inf, 0.0)


def _is_special(limit: FieldLimit, value: str) -> str:
    """Return the condition, as code, under which a value needs a closer check."""
    if isinstance(limit, OneOf) or isinstance(limit, Text) and not (
            limit.least > 1 or limit.pattern or limit.printable):
        blank = f' or not {value}.strip()' if isinstance(limit, Text) and limit.least else ''
        return (f'type({value}) is not str or len({value}) > {limit.most} '
                f"or not {value}.isascii() or '\\0' in {value}{blank}")
    if isinstance(limit, Whole):
        return f'type({value}) is not int or not {limit.low} <= {value} <= {limit.high}'
    if isinstance(limit, Real):
        low, high = max(limit.low, -_LARGEST), min(limit.high, _LARGEST)
        return f'type({value}) is not float or not {low!r} <= {value} <= {high!r}'
    if isinstance(limit, Flag):
        return f'type({value}) is not bool'
    return 'True'


class FieldOf(NamedTuple):
    """
    A field of a message.

    :ivar key: in JSON.
    :ivar name: in the dataclass.
    :ivar needed: a message without it is not valid.
    """

    key: str
    name: str
    limit: FieldLimit
    default: Any
    needed: bool


class Codec(Generic[T]):
    """
    Reads messages of one class.

    :param repairs: a value of the wrong type counts as missing, and what is too long is cut: one
        odd field must not lose an alarm. Otherwise both are errors.
    :param refuses_unknown: a key that is not a field is an error. Otherwise it is ignored: it is
        of a newer release.
    :param keys: in JSON, where they are not the names of the fields.
    :param missing: what fields without a default are when JSON lacks them.
    :ivar fields: of the class, in its order.
    :ivar refuses_unknown: as given.
    :ivar read: makes a message of a JSON object; a ``ValueError`` names the field, its value and
        what it must be.
    """

    def __init__(self, cls: type[T], *, repairs: bool = False, refuses_unknown: bool = False,
                 keys: Mapping[str, str] = MappingProxyType({}),
                 missing: Mapping[str, Any] = MappingProxyType({})) -> None:
        self._cls = cls
        self.refuses_unknown = refuses_unknown
        hints = get_type_hints(cls, include_extras=True)
        made, self._others = [], []
        for each in fields(cls):  # type: ignore[arg-type]
            if get_origin(hints[each.name]) is not Annotated:
                self._others.append((each.name, each.default_factory))
                continue
            default = missing.get(each.name, each.default)
            made.append(FieldOf(keys.get(each.name, each.name), each.name,
                                get_args(hints[each.name])[1], default, default is MISSING))
        self.fields = tuple(made)
        self.keys = tuple(each.key for each in self.fields)
        self._known_keys = frozenset(self.keys)
        self._read_fields = self._reader(repairs)
        self.read = self._read_strictly if refuses_unknown else self._read_fields

    def _read_strictly(self, found: Mapping[str, Any]) -> T:
        if not found.keys() <= self._known_keys:
            unknown = sorted(set(found) - self._known_keys)
            raise ValueError(f'unknown keys {", ".join(unknown)[:80]}; '
                             f'there are {", ".join(self.keys)}')
        return self._read_fields(found)

    def _reader(self, repairs: bool) -> Callable[[Mapping[str, Any]], T]:
        """
        Return the function that reads all fields, made as ``dataclasses`` makes ``__init__``.

        A loop over the fields takes twice as long, and events are read in the real-time loop.
        """
        names: dict[str, Any] = {'cls': self._cls, 'new': object.__new__}
        lines = ['def read(found):', '    get = found.get']
        for number, each in enumerate(self.fields):
            value, default, check = f'v{number}', f'd{number}', f'c{number}'
            names[default], names[check] = each.default, self._check(each, repairs)
            lines += [f'    {value} = get({each.key!r}, {default})',
                      f'    if {_is_special(each.limit, value)}:',
                      f'        if {value} is not {default} or {each.needed}:',
                      f'            {value} = {check}({value})']
        # The slots are set directly, as the __init__ of a frozen dataclass cannot.
        lines.append('    made = new(cls)')
        for number, each in enumerate(self.fields):
            names[f's{number}'] = getattr(self._cls, each.name).__set__
            lines.append(f'    s{number}(made, v{number})')
        for name, factory in self._others:
            names[f's_{name}'], names[f'f_{name}'] = getattr(self._cls, name).__set__, factory
            lines.append(f'    s_{name}(made, f_{name}())')
        exec('\n'.join([*lines, '    return made']), names)
        made: Callable[[Mapping[str, Any]], T] = names['read']
        return made

    def _check(self, field: FieldOf, repairs: bool) -> Callable[[object], Any]:
        """Return the function that checks a value which is not of the plain type and range."""
        read = field.limit.repair if repairs else field.limit.read

        def check(value: object) -> Any:
            if value is MISSING:
                raise ValueError(f'{field.key} is missing; there must be ' + ', '.join(
                    each.key for each in self.fields if each.needed))
            try:
                return read(value)
            except ValueError as error:
                if field.needed or not repairs:
                    raise ValueError(f'{field.key} {error}') from None
                return field.default

        return check

    def known(self, found: Mapping[str, Any]) -> dict[str, Any]:
        """Return the valid fields that a JSON object has, by key, in its order."""
        made = {}
        readers = {each.key: each.limit.repair for each in self.fields}
        for key, value in found.items():
            if key in readers:
                try:
                    made[key] = readers[key](value)
                except ValueError:
                    continue
        return made
