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
Layouts against the real ``rclpy.serialization``, for every message of common_interfaces.

What is padding is found by a small encoder of this file's own, which shares nothing with the code
under test.
"""

from __future__ import annotations

from importlib import import_module
import math
import random
import struct
from typing import Any
import warnings

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.topics.layout import Layout

rclpy = pytest.importorskip('rclpy', reason='rclpy is not installed: nothing to compare with')
serialization = import_module('rclpy.serialization')
with warnings.catch_warnings():
    # The type supports import a parser of ROS 2's own, which uses modules Python deprecates.
    warnings.simplefilter('ignore', DeprecationWarning)
    import_module('rosidl_generator_py')

PACKAGES = ('std_msgs', 'sensor_msgs', 'geometry_msgs', 'nav_msgs', 'diagnostic_msgs',
            'trajectory_msgs', 'actionlib_msgs', 'shape_msgs', 'stereo_msgs',
            'visualization_msgs', 'builtin_interfaces', 'rcl_interfaces',
            'type_description_interfaces')
FLOATS = (0.0, -0.0, 1.5, -1.5, math.inf, -math.inf, math.nan)
EXTREME_FLOATS = {'float': (3.4028234663852886e38, -3.4028234663852886e38, 1.401298464324817e-45),
                  'double': (1.7976931348623157e308, -1.7976931348623157e308, 5e-324)}
TEXTS = ('', 'a', 'map', 'base_link', 'żółw', '机器人', 'x' * 33)
CODES = {'boolean': '?', 'octet': 'c', 'uint8': 'B', 'int8': 'b', 'uint16': 'H', 'int16': 'h',
         'uint32': 'I', 'int32': 'i', 'uint64': 'Q', 'int64': 'q', 'float': 'f', 'double': 'd'}


def _message_classes() -> list[Any]:
    found = [cls for package in PACKAGES for cls in vars(import_module(f'{package}.msg')).values()
             if hasattr(cls, 'SLOT_TYPES')]
    services = import_module('std_srvs.srv')  # a message in a message may be empty here
    return [*found, services.Trigger.Event, services.Empty.Request]


CLASSES = _message_classes()


def _name(cls: Any) -> str:
    return f'{cls.__module__.split(".")[0]}/{cls.__name__}'


def _fields(cls: Any) -> list[tuple[str, str, str, int | None, Any]]:
    """Give (name, type, container, limit, class or bound of text), read from the type texts."""
    result = []
    for (name, text), slot in zip(cls.get_fields_and_field_types().items(), cls.SLOT_TYPES,
                                  strict=True):
        container, limit, extra = '', None, None
        if text.startswith('sequence<'):
            container, text = 'sequence', text[9:-1]
            if ', ' in text:
                text, bound = text.split(', ')
                limit = int(bound)
        elif text.endswith(']'):
            container = 'array'
            text, size = text[:-1].split('[')
            limit = int(size)
        if text.startswith('string<'):
            text, extra = 'string', int(text[7:-1])
        if '/' in text:
            element = slot.value_type if container else slot
            extra = getattr(import_module('.'.join(element.namespaces)), element.name, None)
            extra = extra or getattr(import_module(cls.__module__), element.name)
        result.append((name, text, container, limit, extra))
    return result


def _random_number(rng: random.Random, kind: str) -> Any:
    if kind == 'boolean':
        return rng.random() < 0.5
    if kind == 'octet':
        return bytes([rng.randrange(256)])
    if kind in EXTREME_FLOATS:
        value = rng.choice((*FLOATS, *EXTREME_FLOATS[kind], rng.uniform(-1e6, 1e6)))
        code = CODES[kind]
        return struct.unpack(code, struct.pack(code, value))[0]
    bits = struct.calcsize(CODES[kind]) * 8
    low, high = (0, 2 ** bits - 1) if kind[0] == 'u' else (-2 ** (bits - 1), 2 ** (bits - 1) - 1)
    return rng.choice((low, high, 0, rng.randint(low, high)))


def _random_message(rng: random.Random, cls: Any, depth: int = 0) -> Any:
    message = cls()
    message._check_fields = False
    for name, kind, container, limit, extra in _fields(cls):
        def element(kind: str = kind, extra: Any = extra) -> Any:
            if '/' in kind:
                return _random_message(rng, extra, depth + 1)
            return rng.choice(TEXTS) if kind == 'string' else _random_number(rng, kind)

        if not container:
            setattr(message, name, element())
            continue
        most = 3 if depth < 2 else 1
        count = limit if container == 'array' else rng.randint(0, min(most, limit or most))
        values = [element() for _ in range(count or 0)]
        if isinstance(getattr(message, name), np.ndarray):
            getattr(message, name)[:] = values
        else:
            setattr(message, name, values)
    return message


def _shape(message: Any) -> dict[str, Any]:
    shape: dict[str, Any] = {}
    for name, kind, container, _, _ in _fields(type(message)):
        value = getattr(message, name)
        if '/' in kind:
            shape[name] = [_shape(item) for item in value] if container else _shape(value)
        elif kind == 'string':
            shape[name] = list(value) if container else value
        elif container == 'sequence':
            shape[name] = len(value)
    return shape


class _Encoder:
    """A second opinion: CDR with a mask of the bytes that mean something."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.mask = bytearray()

    def put(self, code: str, *values: Any) -> None:
        padding = -len(self.data) % struct.calcsize(code)
        raw = struct.pack(f'<{len(values)}{code}', *values)
        self.data += bytes(padding) + raw
        self.mask += bytes(padding) + b'\1' * len(raw)

    def message(self, message: Any) -> None:
        fields = _fields(type(message))
        if not fields:
            self.data += b'\0'
            self.mask += b'\0'
        for name, kind, container, _, _ in fields:
            value = getattr(message, name)
            values = list(value) if container else [value]
            if container == 'sequence':
                self.put('I', len(values))
            if '/' in kind:
                for item in values:
                    self.message(item)
            elif kind == 'string':
                for item in values:
                    raw = item.encode() + b'\0'
                    self.put('I', len(raw))
                    self.data += raw
                    self.mask += b'\1' * len(raw)
            elif values:
                self.put(CODES[kind], *values)


def _fill(rng: random.Random, view: Any, message: Any) -> None:
    """Write a message through the attributes of a view, in each of the ways there are."""
    for name, kind, container, _, _ in _fields(type(message)):
        value = getattr(message, name)
        if '/' in kind and rng.random() < 0.7:
            pairs = zip(getattr(view, name), value, strict=True) if container else [
                (getattr(view, name), value)]
            for part, item in pairs:
                _fill(rng, part, item)
        elif kind not in ('string', 'octet') and container and rng.random() < 0.5:
            getattr(view, name)[:] = value
        else:
            setattr(view, name, value)


def _plain(message: Any) -> dict[str, Any]:
    result = {}
    for name, kind, container, _, _ in _fields(type(message)):
        values = list(getattr(message, name)) if container else [getattr(message, name)]
        if '/' in kind:
            values = [_plain(item) for item in values]
        elif kind == 'octet':
            values = [item[0] for item in values]
        elif kind != 'string':
            values = [getattr(item, 'tolist', lambda item=item: item)() for item in values]
        result[name] = values if container else values[0]
    return result


def _mask_of(layout: Layout) -> bytearray:
    mask = bytearray(layout.size - 4)
    for field in layout.fields():
        count = [] if field.count_offset is None else [(field.count_offset, 4)]
        for start, length in [(field.offset, field.nbytes), *count]:
            assert not any(mask[start - 4:start - 4 + length]), f'{field} overlaps another'
            mask[start - 4:start - 4 + length] = b'\1' * length
    return mask


def _significant(data: bytes, mask: bytearray) -> bytes:
    return bytes(byte if use else 0 for byte, use in zip(data, mask))


def test_no_message_of_common_interfaces_is_refused() -> None:
    # Refused would be wstring, wchar, long double: no message of these packages has one.
    refused = {}
    for cls in CLASSES:
        try:
            Layout.compile(cls)
        except ValueError as error:
            refused[_name(cls)] = str(error)
    assert refused == {}
    assert len(CLASSES) > 100


@pytest.mark.parametrize('cls', CLASSES, ids=_name)
@settings(max_examples=8, deadline=None, database=None)
@given(seed=st.integers(0, 2 ** 32))
def test_bytes_are_those_of_rclpy(cls: Any, seed: int) -> None:
    rng = random.Random(seed)
    message = _random_message(rng, cls)
    layout = Layout.compile(cls, _shape(message))
    buffer = layout.new_buffer()
    _fill(rng, layout.view(buffer), message)
    ours = bytes(buffer)

    encoder = _Encoder()
    encoder.message(message)
    assert _mask_of(layout) == encoder.mask
    assert ours == b'\0\1\0\0' + encoder.data  # padding is zero

    theirs = serialization.serialize_message(message)
    assert theirs[:4] == ours[:4]
    assert len(theirs) >= len(ours)
    assert _significant(theirs[4:], encoder.mask) == bytes(encoder.data)
    back = serialization.deserialize_message(ours, cls)
    assert repr(_plain(back)) == repr(_plain(message))  # by repr: NaN, and the sign of zero


@pytest.mark.parametrize('cls', CLASSES, ids=_name)
@settings(max_examples=4, deadline=None, database=None)
@given(seed=st.integers(0, 2 ** 32))
def test_bytes_of_rclpy_are_accepted_and_read(cls: Any, seed: int) -> None:
    message = _random_message(random.Random(seed), cls)
    layout = Layout.compile(cls, _shape(message))
    theirs = serialization.serialize_message(message)  # garbage in the padding and behind
    assert layout.check(theirs) is None
    assert layout.length(theirs) == layout.size
    plain = layout.to_dict(theirs)
    assert repr(plain) == repr(_plain(message))
    assert layout.check(layout.from_dict(plain)) is None
    assert repr(layout.to_dict(layout.from_dict(plain))) == repr(plain)


@pytest.mark.parametrize(('type_name', 'shape', 'field', 'values'), [
    ('std_msgs/String', {}, 'data', ['', 'a', 'żółw', 'x' * 50]),
    ('std_msgs/Header', {}, 'frame_id', ['', 'map']),
    ('sensor_msgs/Image', {'encoding': 'rgb8'}, 'data', [[], [1], list(range(50))]),
    ('sensor_msgs/LaserScan', {'ranges': 3}, 'intensities', [[], [1.5], [0.5] * 50]),
    ('std_msgs/Float64MultiArray', {'layout.dim': 1}, 'data', [[], [1.5], [-0.0] * 50]),
    ('std_msgs/ByteMultiArray', {}, 'data', [[], [b'\1'], [b'\xff'] * 50]),
    ('sensor_msgs/JointState', {'name': ['a', 'bc'], 'position': 2}, 'effort', [[], [2.0] * 2]),
])
def test_tails_are_those_of_rclpy(type_name: str, shape: dict[str, Any], field: str,
                                  values: list[Any]) -> None:
    layout = Layout.compile(type_name, shape, tail=50)
    buffer = layout.new_buffer()
    view = layout.view(buffer)
    for value in [*values, *reversed(values)]:
        setattr(view, field, value)
        ours = bytes(buffer[:layout.length(buffer)])
        package, short = type_name.split('/')
        cls = getattr(import_module(f'{package}.msg'), short)
        message = serialization.deserialize_message(ours, cls)
        theirs = serialization.serialize_message(message)
        assert list(getattr(message, field)) == list(value)
        encoder = _Encoder()
        encoder.message(message)
        assert ours == b'\0\1\0\0' + encoder.data
        assert layout.check(theirs) is None
        assert layout.length(theirs) == len(ours)
