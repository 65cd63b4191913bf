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
Slow paths of assigning numbers and strings: conversions and errors.

The fast paths are generated, field by field, in :mod:`rt_robot_os.topics._view_class`.
"""

from __future__ import annotations

from array import array
from typing import Any
from typing import Final
from typing import NoReturn

import numpy as np

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.topics._cdr import encode_string
from rt_robot_os.topics._shape import brief

ERRORS: Final = (TypeError, ValueError, OverflowError)


def refuse_text(label: str, fixed: Any, value: Any) -> NoReturn:
    """Raise the error for a change of a fixed string."""
    raise LayoutError(f'{label} is fixed at declaration as {brief(fixed)} and cannot be set to '
                      f'{brief(value)}; give the other string in the shape of the layout')


def refuse(view: Any, name: str, value: Any, cause: BaseException | None = None) -> NoReturn:
    """Raise the error for an invalid value of a field."""
    raise LayoutError(f'{view._type_name}.{name} ({view._types[name]}) cannot be set to '
                      f'{brief(value)}' + (f': {cause}' if cause else '')) from cause


def set_scalar(view: Any, name: str, target: memoryview, index: int, value: Any,
               error: BaseException) -> None:
    """Finish the assignment of a number after the fast path failed."""
    if target.readonly:
        _refuse_read_only(view, name)
    if target.format == 'c':  # ROS messages have bytes of length 1 here; numbers are accepted, too
        try:
            target[index] = bytes((value,))  # type: ignore[call-overload]
            return
        except ERRORS:
            pass
    refuse(view, name, value, error)


def set_numbers(view: Any, name: str, target: np.ndarray[Any, Any], value: Any) -> None:
    """Copy numbers into an array or sequence, all of them or none."""
    kind = type(value)
    if kind is np.ndarray and value.shape == target.shape:
        _copy(view, name, target, value, value)
        return
    if kind is list and 0 < len(value) == len(target) and type(value[0]) in (float, int):
        try:
            target[:] = np.array(value, target.dtype)  # converted first: all of them or none
            return
        except ERRORS:
            pass  # repeated below for the error message
    numbers = _as_numbers(view, name, target, value)
    if len(numbers) != len(target):
        raise LayoutError(f'{view._type_name}.{name} has {len(target)} elements, fixed at '
                          f'declaration, and cannot be set to {len(numbers)} of them')
    _copy(view, name, target, numbers, value)


def set_tail(view: Any, name: str, target: np.ndarray[Any, Any], value: Any) -> int:
    """
    Copy numbers into a variable tail.

    :param target: the whole space.
    :return: the number of elements.
    """
    numbers = _as_numbers(view, name, target, value)
    count = len(numbers)
    if count > len(target):
        raise LayoutError(f'{view._type_name}.{name} was declared with a tail of at most '
                          f'{len(target)} elements and cannot be set to {count} of them')
    _copy(view, name, target[:count], numbers, value)
    return count


def set_text_tail(view: Any, name: str, target: memoryview, value: Any) -> int:
    """
    Copy text into a variable tail.

    :param target: the whole space, including that for the NUL.
    :return: its length with the NUL.
    """
    try:
        raw = encode_string(value if isinstance(value, str) else bytes(value).decode())
    except (AttributeError, *ERRORS) as error:
        refuse(view, name, value, error)
    if len(raw) > len(target):
        raise LayoutError(f'{view._type_name}.{name} was declared with a tail of at most '
                          f'{len(target) - 1} bytes and {brief(value)} has {len(raw) - 1}')
    if target.readonly:
        _refuse_read_only(view, name)
    target[:len(raw)] = raw
    return len(raw)


def get_text_tail(target: memoryview, length: int) -> str:
    """Read text up to its NUL; invalid UTF-8 becomes replacement characters."""
    return bytes(target[:length]).partition(b'\0')[0].decode('utf-8', 'replace')


def _as_numbers(view: Any, name: str, target: np.ndarray[Any, Any],
                value: Any) -> np.ndarray[Any, Any]:
    """Return the values as a flat array; bytes are elements of one byte."""
    try:
        if isinstance(value, bytes | bytearray) and target.itemsize == 1:
            return np.frombuffer(value, target.dtype)
        if isinstance(value, str | bytes | bytearray):
            refuse(view, name, value)
        if hasattr(value, '__array__') or isinstance(value, array | memoryview):
            numbers = np.asarray(value)
        else:  # with the type, so that NumPy checks the range of Python's integers
            values = value if isinstance(value, list | tuple) else list(value)
            if values and isinstance(values[0], bytes):  # octets, as in ROS messages
                values = list(b''.join(values))
            if values and isinstance(values[0], str):  # NumPy would parse them
                refuse(view, name, value)
            numbers = np.array(values, target.dtype)
        if numbers.ndim == 0:
            refuse(view, name, value)
        return numbers.reshape(-1)
    except ERRORS as error:
        if isinstance(error, LayoutError):
            raise
        refuse(view, name, value, error)


def _copy(view: Any, name: str, target: np.ndarray[Any, Any], numbers: np.ndarray[Any, Any],
          value: Any) -> None:
    try:
        target[:] = numbers
    except ERRORS as error:
        if not target.flags.writeable:
            _refuse_read_only(view, name)
        refuse(view, name, value, error)


def _refuse_read_only(view: Any, name: str) -> NoReturn:
    raise LayoutError(f'{view._type_name}.{name} cannot be set: this view is bound to read-only '
                      'bytes; copy them to the buffer that Layout.new_buffer() gives')
