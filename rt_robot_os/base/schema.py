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
The declarations of a part of a robot: its settings, and the topics that it writes and reads.

A driver and a module declare their settings as a tuple of :class:`Field`. The robot declares its
own as dataclasses: each field is a :func:`setting`, and :func:`declared` makes such a tuple.
This one declaration validates the YAML file, describes the ROS 2 parameter, documents the key and
provides the default.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
import dataclasses
from dataclasses import dataclass
from dataclasses import field
import functools
import keyword
import math
import re
import sys
from typing import Any
from typing import ClassVar
from typing import get_args
from typing import get_origin
from typing import get_type_hints

REQUIRED: Any = object()
#: Value of ``Field.before``: the key is omitted, and its class handles that.
ABSENT: Any = object()
# Value of ``Field.before``: the default.
_DEFAULT: Any = object()

#: Wildcard in the name of a topic that is read: it matches one part of the name, or some of it.
STAR = '*'

_NOUNS: Mapping[type, str] = {
    bool: 'true or false', int: 'an integer', float: 'a number', str: 'a string'}
_PLURALS: Mapping[type, str] = {
    bool: 'true or false', int: 'integers', float: 'numbers', str: 'strings'}

# Metadata of a dataclass field: its declaration, or that its own keys are on the same level.
_SETTING = 'rt_robot_os.setting'
_INLINE = 'rt_robot_os.inline'


@dataclass(frozen=True)
class Field:
    """
    One setting.

    :ivar name: the key in YAML and in the ROS 2 parameter.
    :ivar kind: ``bool``, ``int``, ``float``, ``str`` or ``list`` (of ``item``).
    :ivar default: used when the key is absent; ``REQUIRED`` makes that an error.
    :ivar minimum: smallest allowed value, in ``unit``.
    :ivar maximum: largest allowed value, in ``unit``.
    :ivar choices: the allowed values; empty allows all.
    :ivar live: whether it may be changed while the robot runs.
    :ivar length: number of items of a list; 0 for any number.
    :ivar is_file: it names a file: a relative path is relative to the folder of the configuration
        that contains it, or to the folder of the shipped ones.
    :ivar before: for a key that an earlier release did not have: the value with which recordings
        of that release replay identically, or ``ABSENT``; by default the default.
    """

    name: str
    kind: type
    default: Any
    description: str
    unit: str = ''
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[Any, ...] = ()
    item: type = str
    live: bool = False
    length: int = 0
    is_file: bool = False
    before: Any = _DEFAULT

    def value_before(self) -> Any:
        """Return the value for a recording of a release without this key."""
        return self.default if self.before is _DEFAULT else self.before

    def problem(self, value: Any) -> str | None:
        """
        Validate a value, including each item of a list.

        :return: None when the value is valid, otherwise what is required.
        """
        if self.kind is list:
            right = (isinstance(value, list | tuple)
                     and self.length in (0, len(value))
                     and all(self._fits(each, self.item) for each in value))
        else:
            right = self._fits(value, self.kind)
        return None if right else self.wanted()

    def coerce(self, value: Any) -> Any:
        """Return the value in its declared type; it must have passed :meth:`problem`."""
        if self.kind is list:
            return [self.item(v) for v in value]
        return self.kind(value)

    def wanted(self) -> str:
        """Describe valid values: the type, range and unit, or the choices."""
        if self.choices:
            names = ', '.join(str(choice) for choice in self.choices)
            text = f'a list of any of {names}' if self.kind is list else f'one of {names}'
        elif self.kind is list:
            count = f'{self.length} ' if self.length else ''
            text = f'a list of {count}{_PLURALS[self.item]}{self.limits()}'
        else:
            text = f'{_NOUNS[self.kind]}{self.limits()}'
        return f'{text} ({self.unit})' if self.unit else text

    def limits(self) -> str:
        """Return the range, such as ' from 1 to 99'; empty when there is none."""
        low, high = number(self.minimum), number(self.maximum)
        if low and high:
            return f' from {low} to {high}'
        if low:
            return f' of at least {low}'
        return f' of at most {high}' if high else ''

    def _fits(self, value: Any, kind: type) -> bool:
        if isinstance(value, bool) or kind is bool:
            return isinstance(value, bool) and kind is bool
        if not isinstance(value, (int, float) if kind is float else kind):
            return False
        if self.choices and value not in self.choices:
            return False
        if kind is str:
            return True
        return self._in_range(value, kind)

    def _in_range(self, value: Any, kind: type) -> bool:
        # An int may be too large for a float: it is compared without conversion.
        if isinstance(value, float) and not math.isfinite(value):
            return False
        if kind is float and abs(value) > sys.float_info.max:
            return False
        return bool((self.minimum is None or value >= self.minimum)
                    and (self.maximum is None or value <= self.maximum))


@dataclass(frozen=True)
class TopicSpec:
    """
    A published topic.

    :ivar topic: its name, relative, such as ``imu/data``.
    :ivar message: ROS 2 type such as ``sensor_msgs/msg/Imu``.
    :ivar fixed: dotted field name -> constant value: all strings, sequence lengths; see
        :class:`rt_robot_os.topics.Layout`.
    :ivar depth: number of stored samples, a power of two.
    :ivar rate_hz: expected samples per second; 0 when unknown.
    :ivar tail: maximum number of elements of a variable-length last field; None without one.
    :ivar most_hz: maximum long-term publication rate, for ``plan``; 0 means up to one per job. Set
        it for a topic that is published rarely and has no ``rate_hz``.
    """

    topic: str
    message: str
    fixed: Mapping[str, Any] = field(default_factory=dict)
    depth: int = 16
    rate_hz: float = 0.0
    tail: int | None = None
    most_hz: float = 0.0


@dataclass(frozen=True)
class TopicRead:
    """
    A subscribed topic.

    :ivar topic: its name.
    :ivar wake: True: each publication releases the reader; an integer n above 1: each n-th does;
        ``'all'``: it is released when each of its inputs with ``'all'`` has a new sample.
    :ivar initial: begin with the last existing sample.
    :ivar newest: ``take`` returns only the newest sample; earlier ones count as skipped.
    :ivar message: type such as ``'sensor_msgs/msg/Imu'``; empty accepts any.
    :ivar key: the setting that it comes from, if that is more than its name.
    :ivar check: validates the declaration of the topic when the settings are read; returns one
        line per problem.
    """

    topic: str
    wake: bool | int | str = False
    initial: bool = False
    newest: bool = False
    message: str = ''
    key: str = ''
    check: Callable[[TopicSpec], Iterable[str]] | None = field(
        default=None, compare=False, repr=False)


@dataclass(frozen=True)
class PartTopics:
    """
    The topics of a device or a module.

    :ivar published: the topics that it writes.
    :ivar read: the topics that it reads; one may occur more than once.
    """

    published: tuple[TopicSpec, ...] = ()
    read: tuple[TopicRead, ...] = ()


def star_match(pattern: str, topic: str) -> str | None:
    """
    Match the name of a topic against a pattern that may contain a :data:`STAR`.

    :return: the part that the star matches, empty without a star; None when it does not match.
    """
    if STAR not in pattern:
        return '' if topic == pattern else None
    found = re.fullmatch('([A-Za-z0-9_]+)'.join(map(re.escape, pattern.split(STAR))), topic)
    return found and found[1]


def number(value: float | None) -> str:
    """Format a limit without an exponent where that is short; empty for None."""
    if value is None:
        return ''
    if float(value).is_integer() and abs(value) < 1e15:
        return str(int(value))
    return f'{value:g}'


def setting(
    default: Any, description: str, unit: str = '', minimum: float | None = None,
    maximum: float | None = None, *, choices: tuple[Any, ...] = (), live: bool = False,
    is_file: bool = False,
) -> Any:
    """
    Declare a setting as a field of a dataclass: name and type are those of the field.

    A key that is a Python keyword, such as ``as``, is a field with an underscore: ``as_``.

    A tuple of strings is a list in YAML; so is a tuple of dataclasses: a list of their names. A
    setting that is a ``ClassVar`` is read and validated but not stored in an object.
    """
    facts = {'default': default, 'description': description, 'unit': unit, 'minimum': minimum,
             'maximum': maximum, 'choices': choices, 'live': live, 'is_file': is_file}
    return dataclasses.field(default=dataclasses.MISSING if default is REQUIRED else default,
                             metadata={_SETTING: facts})


def inline(default: Any) -> Any:
    """Declare that the settings of another dataclass are on the level of this one's."""
    return dataclasses.field(default=default, metadata={_INLINE: True})


def attribute_of(key: str) -> str:
    """Return the name of the field that holds a setting."""
    return f'{key}_' if keyword.iskeyword(key) else key


@functools.cache
def hints_of(cls: type) -> Mapping[str, Any]:
    """Return the annotated type of each field of a dataclass."""
    return get_type_hints(cls)


@functools.cache
def declared(cls: type) -> tuple[Field, ...]:
    """Return the settings of a dataclass, in order."""
    hints = hints_of(cls)
    found: list[Field] = []
    everything: Mapping[str, dataclasses.Field[Any]] = getattr(cls, '__dataclass_fields__')
    for name, each in everything.items():  # dataclasses.fields() leaves the ClassVars out
        if _INLINE in each.metadata:
            found += declared(hints[name])
        elif _SETTING in each.metadata:
            key = name.removesuffix('_')
            found.append(_field(key, hints[name], each.metadata[_SETTING]))
    return tuple(found)


def made(cls: type, values: Mapping[str, Any], **others: Any) -> Any:
    """
    Make an object of a dataclass.

    :param values: of its settings, by name; missing ones take their default.
    :param others: attributes that are not settings, or that replace one.
    """
    hints = hints_of(cls)
    given: dict[str, Any] = {}
    for each in dataclasses.fields(cls):
        if _INLINE in each.metadata:
            given[each.name] = made(hints[each.name], values)
        elif _SETTING in each.metadata and (key := each.name.removesuffix('_')) in values:
            given[each.name] = values[key]
    return cls(**{**given, **others})


def _field(name: str, hint: Any, facts: Mapping[str, Any]) -> Field:
    kind = get_args(hint)[0] if get_origin(hint) is ClassVar else hint
    if get_origin(kind) is tuple:
        item = get_args(kind)[0]
        return Field(name, list, item=item if item in _NOUNS else str, **facts)
    known = [each for each in (kind, *get_args(kind)) if each in _NOUNS]
    return Field(name, known[0], **facts)
