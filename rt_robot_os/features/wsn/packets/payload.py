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
Custom payloads, declared in a few lines: a name, an AM type, fields as struct codes.

In Python::

    SOIL = Payload('soil', 0x42, (
        PayloadField('moisture', 'H', '%', quantity='soil_moisture_percent', scale=0.1),
        PayloadField('skin', 'H', quantity='temperature', conversion='sht1x_temperature')))

A package registers it in the entry-point group ``rt_robot_os.payloads``; in a configuration it is
a string, see :mod:`.payload_text`.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
import math
import re
from struct import error as StructError
from struct import Struct
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.plugins import entry_point_targets
from rt_robot_os.base.plugins import load_object
from rt_robot_os.features.wsn.packets.conversions import CONVERSIONS
from rt_robot_os.features.wsn.packets.conversions import sht1x_humidity
from rt_robot_os.messages.quantities import quantity

GROUP: Final = 'rt_robot_os.payloads'
CODES: Final = 'bBhHiIlLqQfd?sx'
#: Name of the field that counts packets, and its bits by its code.
COUNTING_FIELD: Final = 'seq_no'
_COUNTING_CODES: Final = {'B': 8, 'H': 16, 'I': 32, 'L': 32}
_CODE: Final = re.compile(rf'(\d{{0,3}})([{re.escape(CODES)}])', re.ASCII)
_NAME: Final = re.compile(r'[A-Za-z_][A-Za-z0-9_]{0,63}', re.ASCII)
_NO_NUMBER: Final = 'sx'
_HUMIDITY: Final = 'sht1x_humidity'
#: Limit of a packet of 802.15.4, above that of any mote.
MOST_BYTES: Final = 114

Numbers = Mapping[str, Any]


class _Plan(NamedTuple):
    """How a field is parsed: its values, and the reading that they are."""

    name: str
    values: int
    is_bytes: bool
    wanted: PayloadField | None


@dataclass(frozen=True)
class PayloadField:
    """
    One field.

    A field named ``origin``, ``seqno``, ``parent`` or ``hops`` sets that of the packet, if no
    header of the routing has it. An unsigned field named ``seq_no`` counts the packets of its
    origin: gaps are losses.

    :ivar code: of Python's struct, standard sizes, such as ``H``; with a count, such as ``5H``, it
        is a list, of which the last is the reading; ``8s`` is bytes, ``2x`` skips two.
    :ivar unit: of the sent number, for people.
    :ivar quantity: of the reading, such as ``temperature``; empty: no reading.
    :ivar conversion: from the number to the quantity, a name of :data:`.CONVERSIONS`.
    :ivar scale: without a conversion the reading is ``number * scale + offset``.
    """

    name: str
    code: str
    unit: str = ''
    quantity: str = ''
    conversion: str = ''
    scale: float = 1.0
    offset: float = 0.0

    def problems(self) -> list[str]:
        """Return the problems of the field, each with its remedy."""
        found = []
        if not _NAME.fullmatch(self.name):
            found.append(f'the name {self.name!r} must be a letter, then letters, digits or _')
        code = _CODE.fullmatch(self.code)
        if not code or code[1] and not 0 < int(code[1]) <= MOST_BYTES:
            found.append(f'the code {self.code!r} must be one of {" ".join(CODES)} of Python\'s '
                         'module struct, with a count before it for several, such as 5H')
        if self.conversion and self.conversion not in CONVERSIONS:
            found.append(f'unknown conversion {self.conversion!r}: use one of '
                         f'{", ".join(CONVERSIONS)}, or scale and offset')
        if not all(map(math.isfinite, (self.scale, self.offset))) or self.scale == 0:
            found.append(f'scale {self.scale} and offset {self.offset} must be finite, and the '
                         'scale not 0')
        if self.quantity:
            try:
                quantity(self.quantity)
            except ValueError as error:
                found.append(str(error))
            if code and code[2] in _NO_NUMBER:
                found.append(f'the code {self.code!r} is not a number, so it cannot be the '
                             f'quantity {self.quantity!r}: use another code')
        elif self.conversion or (self.scale, self.offset) != (1.0, 0.0):
            found.append('a conversion, a scale or an offset needs a quantity: add one')
        return found


class PayloadValues(NamedTuple):
    """
    The content of a payload.

    :ivar fields: the numbers as they were sent, by field.
    :ivar readings: in the units of :mod:`rt_robot_os.messages.quantities`, by quantity.
    :ivar problem: empty for a valid payload.
    """

    fields: dict[str, Any]
    readings: dict[str, float]
    problem: str


@dataclass(frozen=True)
class Payload:
    """
    The layout of one payload.

    :ivar name: of its packets.
    :ivar am_type: of the active message, or the collection's identifier under TinyOS 2.x.
    :ivar fields: in order, without gaps between them.
    :ivar byte_order: ``''`` for that of the generation of TinyOS, ``little`` or ``big``.
    :ivar routed: under TinyOS 1.x it follows the header of MultiHopLQI.
    :ivar size: in bytes.
    :ivar count_bits: of the field that counts packets; 0 without one.
    :raises ConfigError: with every problem; each line names payload, field, value and remedy.
    """

    name: str
    am_type: int
    fields: tuple[PayloadField, ...]
    byte_order: str = ''
    routed: bool = True
    size: int = field(init=False, default=0)
    count_bits: int = field(init=False, default=0)
    _layouts: tuple[Struct, ...] = field(init=False, repr=False, compare=False, default=())
    _plan: tuple[_Plan, ...] = field(init=False, repr=False, compare=False, default=())
    _humid: bool = field(init=False, repr=False, compare=False, default=False)

    def __post_init__(self) -> None:
        """Check the declaration, and prepare the parser."""
        object.__setattr__(self, 'fields', tuple(self.fields))
        problems = self._problems()
        if problems:
            raise ConfigError(problems)
        codes = ''.join(each.code for each in self.fields)
        layouts = (Struct('<' + codes), Struct('>' + codes))
        object.__setattr__(self, '_layouts', layouts)
        object.__setattr__(self, 'size', layouts[0].size)
        if self.size > MOST_BYTES:
            raise ConfigError([f'payload {self.name!r} has {self.size} bytes: at most {MOST_BYTES}'
                               ' fit into a packet; remove fields'])
        object.__setattr__(self, 'count_bits', next(
            (_COUNTING_CODES.get(each.code, 0) for each in self.fields
             if each.name == COUNTING_FIELD), 0))
        object.__setattr__(self, '_plan', tuple(map(_plan_of, self.fields)))
        object.__setattr__(self, '_humid', any(each.conversion == _HUMIDITY
                                               for each in self.fields))

    def read(self, data: bytes, big_endian: bool) -> PayloadValues:
        """
        Parse a payload; never raises, safe in the real-time loop.

        :param big_endian: byte order of the generation of TinyOS.
        """
        if len(data) < self.size:
            return PayloadValues({}, {}, f'too short: {len(data)} bytes, {self.name} has '
                                         f'{self.size}')
        more = len(data) - self.size
        problem = f'{more} bytes more than {self.name} has' if more > 1 else ''
        numbers = self._layout(big_endian).unpack_from(data)
        values: dict[str, Any] = {}
        readings: dict[str, float] = {}
        at = 0
        for name, count, is_bytes, wanted in self._plan:
            value: Any = numbers[at] if count == 1 else numbers[at:at + count]
            at += count
            if count == 0:
                continue
            values[name] = value.hex() if is_bytes else value
            if wanted is not None:
                reading = _reading(wanted, value if count == 1 else value[-1])
                if math.isfinite(reading):  # else the node has no reading
                    readings[wanted.quantity] = reading
        if self._humid and 'temperature' in readings:
            self._compensate(values, readings)
        return PayloadValues(values, readings, problem)

    def pack(self, values: Numbers, big_endian: bool) -> bytes:
        """
        Return a payload, as a node would send it.

        :param values: raw numbers by field, or bytes; a missing field is 0.
        :raises ValueError: a value does not fit its field.
        """
        numbers: list[Any] = []
        for name, count, is_bytes, _ in self._plan:
            if count == 1:
                numbers.append(values.get(name, b'' if is_bytes else 0))
            elif count:
                numbers.extend(values.get(name, (0,) * count))
        try:
            return self._layout(big_endian).pack(*numbers)
        except StructError as error:
            raise ValueError(f'payload {self.name!r} cannot hold {dict(values)!r}: '
                             f'{error}') from error

    def _layout(self, big_endian: bool) -> Struct:
        big = self.byte_order == 'big' if self.byte_order else big_endian
        return self._layouts[big]

    def _compensate(self, values: Numbers, readings: dict[str, float]) -> None:
        """Compensate the humidity with the temperature of the same packet."""
        for each in self.fields:
            if each.conversion == _HUMIDITY and each.quantity in readings:
                raw = values[each.name]
                raw = raw[-1] if isinstance(raw, tuple) else raw
                readings[each.quantity] = sht1x_humidity(raw, readings['temperature'])

    def _problems(self) -> list[str]:
        where = f'payload {self.name!r}'
        found = []
        if not _NAME.fullmatch(self.name):
            found.append(f'{where}: the name must be a letter, then letters, digits or _')
        if isinstance(self.am_type, bool) or not isinstance(self.am_type, int) or (
                not 0 <= self.am_type <= 255):
            found.append(f'{where}: the AM type {self.am_type!r} must be a number from 0 to 255')
        if self.byte_order not in ('', 'little', 'big'):
            found.append(f'{where}: the byte order {self.byte_order!r} must be little or big, or '
                         'omitted')
        if not self.fields:
            found.append(f'{where} has no fields: declare at least one')
        seen: set[str] = set()
        for each in self.fields:
            found += [f'{where}, field {each.name!r}: {problem}' for problem in each.problems()]
            for what, name in (('field', each.name), ('quantity', each.quantity)):
                key = f'{what} {name}'
                if name and key in seen and not each.code.endswith('x'):
                    found.append(f'{where}, field {each.name!r}: the {what} {name!r} is '
                                 'declared twice; rename one')
                seen.add(key)
        return found


def installed_payloads() -> tuple[Payload, ...]:
    """
    Return the payloads that other packages add by entry points.

    :raises ConfigError: one cannot be imported, or is not a Payload.
    """
    found = []
    for name, target in sorted(entry_point_targets(GROUP).items()):
        payload = load_object(f'payload {name!r}', target)
        if not isinstance(payload, Payload):
            raise ConfigError([
                f'payload {name!r} ({target}) is broken: not a Payload but a '
                f'{type(payload).__name__}; report it to its author'])
        found.append(payload)
    return tuple(found)


def check_payloads(payloads: Iterable[Payload]) -> tuple[Payload, ...]:
    """
    Check that payloads are distinguishable.

    :raises ConfigError: two have the same name, or the same AM type and size.
    """
    found = tuple(payloads)
    problems = []
    for at, each in enumerate(found):
        for other in found[:at]:
            if other.name == each.name:
                problems.append(f'payload {each.name!r} is declared twice: rename one')
            elif (other.am_type, other.size) == (each.am_type, each.size):
                problems.append(
                    f'payload {each.name!r} and payload {other.name!r} both have the AM type '
                    f'{each.am_type:#04x} and {each.size} bytes: they are indistinguishable')
    if problems:
        raise ConfigError(problems)
    return found


def _plan_of(each: PayloadField) -> _Plan:
    code = each.code[-1]
    count = 0 if code == 'x' else 1 if code == 's' else int(each.code[:-1] or 1)
    return _Plan(each.name, count, code == 's', each if each.quantity else None)


def _reading(wanted: PayloadField, raw: Any) -> float:
    if wanted.conversion:
        return CONVERSIONS[wanted.conversion].convert(raw)
    return float(raw * wanted.scale + wanted.offset)
