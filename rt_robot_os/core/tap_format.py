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
The bytes of the taps: what devices read, and when jobs ran, as the core notes them for replay.

Both are ``std_msgs/msg/UInt8MultiArray``, whose ``layout.data_offset`` says how many bytes in
front of ``data`` are not data: everything of ours stands there. So of ``device/imu/bytes`` what
follows the offset is exactly what the port gave.

In front of the bytes of a device, little-endian:

====== ======= ==========================================================
offset size    meaning
====== ======= ==========================================================
0      1       what happened, see :class:`TapKind`
1      1       0
2      2       number n of rounds before that found nothing to read
4      8 n     when each of them was, then when this happened (8 more)
====== ======= ==========================================================

A moment is nanoseconds on CLOCK_MONOTONIC times two, plus one if the round wrote first.

In front of the schedule stands one byte: 1 when it is complete up to the stamp of the message, 0
when more messages of the same moment follow. Four more follow it once records were dropped: how
many since the taps were turned on. The schedule is a row of records of 16 bytes: number of the
task, number of the topic (or ``A_JOB``), number of the sample (or length of the job in ns), moment
of the publication (or start of the job). With ``WENT_ON`` for a topic it is the moment at which a
coroutine went on with what it had awaited, which may be several times a job.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
from enum import IntEnum
import struct
from typing import Final
from typing import NamedTuple

MESSAGE: Final = 'std_msgs/msg/UInt8MultiArray'
SCHEDULE_TOPIC: Final = 'core/schedule'
A_JOB: Final = 0xFFFF
WENT_ON: Final = 0xFFFE
NO_TASK: Final = 0xFFFF

# Encapsulation, no dimensions, data_offset, length of data.
_CDR: Final = struct.Struct('<4sIII')
_ENCAPSULATION: Final = bytes((0, 1, 0, 0))
_HEAD: Final = struct.Struct('<BxH')
RECORD: Final = struct.Struct('<HHIq')
_COMPLETE: Final = struct.Struct('<?')
_COMPLETE_DROPPED: Final = struct.Struct('<?I')
SCHEDULE_FRONT_BYTES: Final = _COMPLETE_DROPPED.size
CDR_BYTES: Final = _CDR.size
_DROPPED_MOST: Final = (1 << 32) - 1


class TapKind(IntEnum):
    """What happened to a device: bytes came, more of the same read, it was opened, it failed."""

    READ = 0
    MORE = 1
    OPENED = 2
    FAILED = 3


class DeviceEvent(NamedTuple):
    """
    What happened to a device.

    :ivar at_ns: on CLOCK_MONOTONIC.
    :ivar command: whether that round wrote first.
    :ivar idle: the rounds since the event before, that found nothing: moment and command.
    """

    kind: TapKind
    at_ns: int
    command: bool
    idle: tuple[tuple[int, bool], ...]
    data: bytes


class ScheduleRecord(NamedTuple):
    """
    A job, a publication, or that a coroutine went on.

    :ivar task: number of the task, ``NO_TASK`` when there is none.
    :ivar topic: number of the topic, ``A_JOB`` for a job, ``WENT_ON`` for a coroutine that did.
    :ivar number: of the sample; of a job how long it took in ns.
    :ivar at_ns: of the publication; of a job when it started.
    """

    task: int
    topic: int
    number: int
    at_ns: int


def device_topic(device: str) -> str:
    """Return the topic of a device's bytes."""
    return f'device/{device}/bytes'


def is_tap(topic: str) -> bool:
    """Return whether a topic is one of the taps."""
    return topic == SCHEDULE_TOPIC or bool(tapped_device(topic))


def tapped_device(topic: str) -> str:
    """Return the device whose bytes a topic holds; empty when it is no such topic."""
    parts = topic.split('/')
    return parts[1] if len(parts) == 3 and topic == device_topic(parts[1]) else ''


def array_cdr(front: bytes, data: bytes) -> bytes:
    """Make an UInt8MultiArray of what stands in front of the data, and the data."""
    return _CDR.pack(_ENCAPSULATION, 0, len(front), len(front) + len(data)) + front + data


def device_front(kind: TapKind, moment: int, idle: Sequence[int]) -> bytes:
    """Make what stands in front of the bytes of a device; a moment is doubled."""
    return _HEAD.pack(kind, len(idle)) + struct.pack(f'<{len(idle) + 1}q', *idle, moment)


def split_array(cdr: bytes | memoryview) -> tuple[bytes, bytes]:
    """
    Return what stands in front of the data, and the data.

    :raises ValueError: it is no UInt8MultiArray of ours.
    """
    if len(cdr) < CDR_BYTES:
        raise ValueError(f'{len(cdr)} bytes are too short')
    encapsulation, dimensions, offset, length = _CDR.unpack_from(cdr)
    if encapsulation[:2] != _ENCAPSULATION[:2] or dimensions or not (
            offset <= length <= len(cdr) - CDR_BYTES):
        raise ValueError('an array of another form')
    end = CDR_BYTES + offset
    return bytes(cdr[CDR_BYTES:end]), bytes(cdr[end:CDR_BYTES + length])


def parse_device(cdr: bytes | memoryview) -> DeviceEvent:
    """
    Read a message of ``device/<name>/bytes``.

    :raises ValueError: it is none.
    """
    front, data = split_array(cdr)
    if len(front) < _HEAD.size:
        raise ValueError('nothing stands in front of the bytes')
    kind, count = _HEAD.unpack_from(front)
    if len(front) != _HEAD.size + 8 * (count + 1):
        raise ValueError(f'{len(front)} bytes in front of the data do not hold {count} rounds')
    moments = struct.unpack_from(f'<{count + 1}q', front, _HEAD.size)
    idle = tuple((moment >> 1, bool(moment & 1)) for moment in moments[:-1])
    return DeviceEvent(TapKind(kind), moments[-1] >> 1, bool(moments[-1] & 1), idle, data)


class ScheduleMessage(NamedTuple):
    """
    A message of ``core/schedule``.

    :ivar complete: with it the schedule is complete up to its stamp.
    :ivar dropped: records that the core had no room for, since the taps were turned on.
    """

    complete: bool
    dropped: int
    records: Iterator[ScheduleRecord]


def schedule_cdr(records: bytes, complete: bool, dropped: int = 0) -> bytes:
    """Make a message of ``core/schedule``."""
    front = (_COMPLETE_DROPPED.pack(complete, min(dropped, _DROPPED_MOST)) if dropped
             else _COMPLETE.pack(complete))
    return array_cdr(front, records)


def parse_schedule(cdr: bytes | memoryview) -> ScheduleMessage:
    """
    Read a message of ``core/schedule``.

    :raises ValueError: it is none.
    """
    front, data = split_array(cdr)
    if len(data) % RECORD.size:
        raise ValueError(f'{len(data)} bytes are no whole number of records')
    if len(front) == _COMPLETE.size:
        complete, dropped = front == b'\1', 0
    elif len(front) == _COMPLETE_DROPPED.size:
        complete, dropped = _COMPLETE_DROPPED.unpack(front)
    else:
        raise ValueError(f'{len(front)} bytes stand in front of the records, not '
                         f'{_COMPLETE.size} or {_COMPLETE_DROPPED.size}')
    return ScheduleMessage(complete, dropped, map(ScheduleRecord._make, RECORD.iter_unpack(data)))
