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
The format of the taps: bytes read by devices, and times of jobs, recorded for replay.

Both are ``std_msgs/msg/UInt8MultiArray``. Its ``layout.data_offset`` is the number of bytes at the
beginning of ``data`` that are a header of the tap. In ``device/imu/bytes`` the bytes behind the
header are exactly those that the port returned.

The header of the bytes of a device, little-endian:

====== ======= ==========================================================
offset size    meaning
====== ======= ==========================================================
0      1       what happened, see :class:`TapKind`
1      1       0
2      2       number n of earlier rounds that read nothing
4      8 n     the time of each of them, then the time of this event (8 more)
====== ======= ==========================================================

A time is nanoseconds on CLOCK_MONOTONIC times two, plus one if the round wrote before it read.

The header of the schedule is one byte: 1 when it is complete up to the stamp of the message, 0
when more messages with the same stamp follow. After records were dropped, four more bytes follow:
their number since the taps were turned on. The schedule is a sequence of records of 16 bytes:
number of the task, number of the topic (or ``A_JOB``), number of the sample (or length of the job
in ns), time of the publication (or start of the job). With ``WENT_ON`` for a topic it is the time
at which a coroutine continued after an await, possibly several times in a job.
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
    """The event: bytes were read, more bytes of the same read, the port was opened, it failed."""

    READ = 0
    MORE = 1
    OPENED = 2
    FAILED = 3


class DeviceEvent(NamedTuple):
    """
    An event of a device.

    :ivar at_ns: on CLOCK_MONOTONIC.
    :ivar command: whether that round wrote before it read.
    :ivar idle: the rounds since the last event that read nothing: time and command.
    """

    kind: TapKind
    at_ns: int
    command: bool
    idle: tuple[tuple[int, bool], ...]
    data: bytes


class ScheduleRecord(NamedTuple):
    """
    A job, a publication, or the continuation of a coroutine.

    :ivar task: number of the task, ``NO_TASK`` for none.
    :ivar topic: number of the topic, ``A_JOB`` for a job, ``WENT_ON`` for a coroutine.
    :ivar number: of the sample; for a job its duration in ns.
    :ivar at_ns: of the publication; for a job its start.
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
    """Return the device whose bytes a topic holds; empty for other topics."""
    parts = topic.split('/')
    return parts[1] if len(parts) == 3 and topic == device_topic(parts[1]) else ''


def array_cdr(front: bytes, data: bytes) -> bytes:
    """Make a UInt8MultiArray of a header and the data."""
    return _CDR.pack(_ENCAPSULATION, 0, len(front), len(front) + len(data)) + front + data


def device_front(kind: TapKind, moment: int, idle: Sequence[int]) -> bytes:
    """Make the header of the bytes of a device, from doubled times."""
    return _HEAD.pack(kind, len(idle)) + struct.pack(f'<{len(idle) + 1}q', *idle, moment)


def split_array(cdr: bytes | memoryview) -> tuple[bytes, bytes]:
    """
    Return the header and the data.

    :raises ValueError: it is not a UInt8MultiArray of a tap.
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
    Parse a message of ``device/<name>/bytes``.

    :raises ValueError: it is not valid.
    """
    front, data = split_array(cdr)
    if len(front) < _HEAD.size:
        raise ValueError('the header is missing')
    kind, count = _HEAD.unpack_from(front)
    if len(front) != _HEAD.size + 8 * (count + 1):
        raise ValueError(f'a header of {len(front)} bytes does not hold {count} rounds')
    moments = struct.unpack_from(f'<{count + 1}q', front, _HEAD.size)
    idle = tuple((moment >> 1, bool(moment & 1)) for moment in moments[:-1])
    return DeviceEvent(TapKind(kind), moments[-1] >> 1, bool(moments[-1] & 1), idle, data)


class ScheduleMessage(NamedTuple):
    """
    A message of ``core/schedule``.

    :ivar complete: with it the schedule is complete up to its stamp.
    :ivar dropped: records that the core dropped since the taps were turned on.
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
    Parse a message of ``core/schedule``.

    :raises ValueError: it is not valid.
    """
    front, data = split_array(cdr)
    if len(data) % RECORD.size:
        raise ValueError(f'{len(data)} bytes are not a multiple of {RECORD.size}')
    if len(front) == _COMPLETE.size:
        complete, dropped = front == b'\1', 0
    elif len(front) == _COMPLETE_DROPPED.size:
        complete, dropped = _COMPLETE_DROPPED.unpack(front)
    else:
        raise ValueError(f'a header of {len(front)} bytes: it must have {_COMPLETE.size} or '
                         f'{_COMPLETE_DROPPED.size}')
    return ScheduleMessage(complete, dropped, map(ScheduleRecord._make, RECORD.iter_unpack(data)))
