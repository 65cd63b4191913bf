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

"""Read and write several fields of a slot with as few calls of :mod:`struct` as possible."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Sequence
from itertools import chain
import re
import struct
from typing import Any
from typing import Final

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.topics._cdr import PRIMITIVES
from rt_robot_os.topics._nodes import LayoutField
from rt_robot_os.topics._shape import brief
from rt_robot_os.topics._shape import suggest

# With more parameters than this, a call is slower than with one tuple.
_NAMED_MAXIMUM: Final = 64
_Run = list[LayoutField]


class Packer:
    """
    Fields of a layout, as a flat tuple of numbers; made by ``Layout.packer``.

    ``pack(buffer, *values)`` writes them and ``unpack(buffer)`` reads them, in the order of
    ``names``, the elements of arrays and the fields of nested messages one by one. Both are safe
    in the real-time loop. A buffer has to be as long as the layout.

    :ivar names: one for each value: ``('angular_velocity.x', ...)``.
    """

    __slots__ = ('names', 'pack', 'unpack')

    def __init__(self, type_name: str, fields: Sequence[LayoutField],
                 wanted: Sequence[str]) -> None:
        chosen = _choose(type_name, fields, wanted)
        self.names = tuple(chain.from_iterable(_value_names(field) for field in chosen))
        used = sorted((field.offset if field.count_offset is None else field.count_offset,
                       field.offset + field.nbytes) for field in fields)
        self.pack: Callable[..., None] = _make_pack(
            type_name, self.names, _split(chosen, used, skip=False))
        self.unpack: Callable[[Any], tuple[Any, ...]] = _make_unpack(
            _split(chosen, used, skip=True))

    def __repr__(self) -> str:
        return f'Packer({", ".join(self.names)})'


def _choose(type_name: str, fields: Sequence[LayoutField],
            wanted: Sequence[str]) -> list[LayoutField]:
    if not wanted:
        raise LayoutError(f'{type_name}: a packer of no fields; name at least one')
    chosen: list[LayoutField] = []
    for name in wanted:
        parts = (f'{name}.', f'{name}[')
        matching = [field for field in fields
                    if field.name == name or field.name.startswith(parts)]
        if not matching:
            names = dict.fromkeys(re.split(r'[.[]', field.name)[0] for field in fields)
            raise LayoutError(f'{type_name} has no field {name!r} to pack: '
                              f'{suggest(name, names)}')
        if any(field.tail for field in matching):
            raise LayoutError(f'{type_name}.{name} is the tail, whose length varies; assign it '
                              'through a view')
        numbers = [field for field in matching if field.type_name in PRIMITIVES and field.count]
        if not numbers:
            raise LayoutError(f'{type_name}.{name} has no numbers to pack: strings and lengths '
                              'are fixed at declaration')
        for field in numbers:
            if field in chosen:
                raise LayoutError(f'{type_name}: field {field.name!r} is packed twice; name it '
                                  'once')
        chosen += numbers
    return chosen


def _value_names(field: LayoutField) -> Iterable[str]:
    if field.count == 1 and field.nbytes == PRIMITIVES[field.type_name].size:
        return (field.name,)
    return (f'{field.name}[{index}]' for index in range(field.count))


def _split(chosen: Iterable[LayoutField], used: Sequence[tuple[int, int]], *,
           skip: bool) -> list[_Run]:
    """
    Split fields into runs that one call handles.

    :param used: first byte, including the count before it, and end of every field of the layout,
        in order; the rest is padding.
    :param skip: whether bytes of other fields may be between two fields of a run.
    """
    following = {end: start for (_, end), (start, _) in zip(used, used[1:])}
    runs: list[_Run] = []
    for field in chosen:
        if runs:
            last = runs[-1][-1]
            end = last.offset + last.nbytes
            if following.get(end) == field.offset or (skip and field.offset >= end):
                runs[-1].append(field)
                continue
        runs.append([field])
    return runs


def _compile(run: _Run) -> struct.Struct:
    text, end = '<', run[0].offset
    for field in run:
        # Elements of arrays of octets are numbers, as in their NumPy views.
        code = PRIMITIVES[field.type_name].code
        code = 'B' if code == 'c' and field.count > 1 else code
        text += f'{field.offset - end}x' if field.offset > end else ''
        text += f'{field.count}{code}' if field.count > 1 else code
        end = field.offset + field.nbytes
    return struct.Struct(text)


def _make_pack(type_name: str, names: Sequence[str], runs: Sequence[_Run]) -> Callable[..., None]:
    if len(names) > _NAMED_MAXIMUM:
        return _make_pack_many(type_name, names, runs)
    parameters, taken = [], {'buffer', 'error'}
    for name in names:
        parameter = re.sub(r'\W+', '_', name).strip('_')
        while parameter in taken:
            parameter += '_'
        taken.add(parameter)
        parameters.append(parameter)
    lines = [f'def pack(buffer, {", ".join(parameters)}):', '    try:']
    namespace: dict[str, Any] = {'_ERRORS': (struct.error, OverflowError), '_fail': _fail,
                                 '_type': type_name, '_names': names}
    first = 0
    for index, run in enumerate(runs):
        namespace[f'_pack_{index}'] = _compile(run).pack_into
        last = first + sum(field.count for field in run)
        lines.append(f'        _pack_{index}(buffer, {run[0].offset}, '
                     f'{", ".join(parameters[first:last])})')
        first = last
    lines += ['    except _ERRORS as error:',
              f'        _fail(_type, _names, ({", ".join(parameters)},), error)']
    exec('\n'.join(lines), namespace)
    return namespace['pack']  # type: ignore[no-any-return]


def _make_pack_many(type_name: str, names: Sequence[str],
                    runs: Sequence[_Run]) -> Callable[..., None]:
    calls, first = [], 0
    for run in runs:
        last = first + sum(field.count for field in run)
        calls.append((_compile(run).pack_into, run[0].offset, first, last))
        first = last

    def pack(buffer: Any, *values: Any) -> None:
        if len(values) != len(names):
            raise TypeError(f'pack() takes {len(names)} values for {type_name}, not '
                            f'{len(values)}')
        try:
            for pack_into, offset, start, stop in calls:
                pack_into(buffer, offset, *values[start:stop])
        except (struct.error, OverflowError) as error:
            _fail(type_name, names, values, error)

    return pack


def _make_unpack(runs: Sequence[_Run]) -> Callable[[Any], tuple[Any, ...]]:
    calls = [(_compile(run).unpack_from, run[0].offset) for run in runs]
    if len(calls) == 1:
        unpack_from, offset = calls[0]
        return lambda buffer: unpack_from(buffer, offset)

    def unpack(buffer: Any) -> tuple[Any, ...]:
        return tuple(chain.from_iterable([unpack_from(buffer, offset)
                                          for unpack_from, offset in calls]))

    return unpack


def _fail(type_name: str, names: Sequence[str], values: Sequence[Any], error: Exception) -> None:
    given = ', '.join(f'{name}={brief(value)}' for name, value in zip(names, values, strict=True))
    raise LayoutError(f'{type_name}: cannot pack {given[:400]}: {error}') from error
