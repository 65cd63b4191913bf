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
The packets of the link.

One packet, one datagram of a SOCK_SEQPACKET socket. It begins with 24 bytes, little-endian:

====== ==== ========================================================================
offset size meaning
====== ==== ========================================================================
0      1    kind, see :class:`Kind`
1      1    protocol version
2      2    channel: number of a topic; 0 otherwise
4      4    samples of this topic that this client did not get so far, modulo 2**32
8      8    stamp on CLOCK_MONOTONIC in nanoseconds, signed
16     8    sequence number of the sample in its topic, or of the request that is answered
====== ==== ========================================================================

An answer may take several packets: all but the last have channel 1. A packet of it that would be
long goes in parts, with the same header: all but the last have 2 added to their channel.

Samples that go out at the same moment share a ``BATCH``: after its header, whose sequence number
counts them, each of them as a ``DATA`` packet of its own, its length before it in 8 bytes, and
zeros behind it up to a multiple of 8. The core sends it; clients send ``DATA`` alone.

A sample that is too long for a packet lies in a memory file that both sides have mapped; the core
makes it. For a mirror it sends the file once in a ``MEMORY`` packet (SCM_RIGHTS), then a ``SLOT``
packet for each sample; the client answers each with ``GIVE_BACK``. A slot belongs to the client in
between. For a large topic that the client advertises it sends the file in a ``ROOM`` packet; its
slots belong to the client at first, which sends a ``SLOT`` packet for each sample, and the core
answers with ``GIVE_BACK`` when it has taken it. A ``DATA`` packet of that topic must not come
while the core has a slot: it would overtake.

With the answer to ``hello`` comes a ``LIFE`` packet with the page of :mod:`.sign_of_life`
(SCM_RIGHTS).

========= ======================================================= =========
kind      after the header                                        sent by
========= ======================================================= =========
MEMORY    number of the memory, of its slots; bytes of a slot     core
ROOM      as ``MEMORY``                                           core
SLOT      number of the memory, of the slot; bytes of the sample  both
GIVE_BACK number of the memory, of the slot                       both
========= ======================================================= =========

After it: CDR for ``DATA``, JSON for ``REQUEST``, ``REPLY`` and ``REPORT``, a record of
:mod:`rt_robot_os.link.task_records` for ``TASK``, nothing for ``BEAT``.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from enum import IntEnum
import json
import struct
from typing import Any
from typing import NamedTuple

from rt_robot_os.base.errors import LinkError

VERSION = 5
HEADER = struct.Struct('<BBHIqQ')
HEADER_BYTES = HEADER.size
RECORD = struct.Struct('<Q')
# A sample's length and its header, packed at once.
RECORD_HEAD = struct.Struct(RECORD.format + HEADER.format[1:])
MEMORY = struct.Struct('<IIQ')
SLOT = struct.Struct('<IIQ')
GIVE_BACK = struct.Struct('<II')
REQUEST_BYTES_MAXIMUM = 16_384
# A datagram must fit the socket buffer, which ordinary users cannot raise above about 208 KiB.
PACKET_BYTES_MAXIMUM = 128 * 1024
# A longer sample goes through a memory file.
SAMPLE_BYTES_MAXIMUM = PACKET_BYTES_MAXIMUM // 2
# Of a long answer: no task can start during a system call, so it is kept short.
PART_BYTES = 16 * 1024
MORE, CONTINUED = 1, 2
# A request needs few; each level of nesting costs the reader of it stack and time.
BRACKETS_MAXIMUM = 256
_AT_ONCE = 16


class Kind(IntEnum):
    """What a packet is."""

    DATA = 1
    REQUEST = 2
    REPLY = 3
    BEAT = 4
    REPORT = 5
    TASK = 6
    MEMORY = 7
    SLOT = 8
    GIVE_BACK = 9
    BATCH = 10
    LIFE = 11
    ROOM = 12


class Header(NamedTuple):
    """The first 24 bytes of a packet."""

    kind: int
    version: int
    channel: int
    missed: int
    stamp_ns: int
    seq: int


def header(kind: Kind, channel: int = 0, missed: int = 0, stamp_ns: int = 0,
           seq: int = 0) -> bytes:
    """Make the first 24 bytes of a packet."""
    return HEADER.pack(kind, VERSION, channel, missed & 0xFFFFFFFF, stamp_ns, seq)


def parse_header(packet: bytes | memoryview) -> Header:
    """
    Read the first 24 bytes of a packet.

    :raises LinkError: it is too short, or of another version.
    """
    if len(packet) < HEADER_BYTES:
        raise LinkError(f'a packet of {len(packet)} bytes is no packet of the link')
    parsed = Header(*HEADER.unpack_from(packet))
    if parsed.version != VERSION:
        raise LinkError(f'the other side speaks version {parsed.version} of the link, this one '
                        f'{VERSION}; use one release of rt_robot_os on both sides')
    return parsed


def encode_json(kind: Kind, content: dict[str, Any], *, seq: int = 0, more: bool = False,
                default: Callable[[Any], Any] | None = None) -> bytes:
    """
    Make a packet that carries JSON; preemptible, however long the content is.

    :param seq: the request that it answers.
    :param more: further packets of the same answer follow.
    :param default: gives a plain value for one that JSON does not know.
    """
    return header(kind, MORE * more, seq=seq) + _json(content, default).encode()


def _json(value: Any, default: Callable[[Any], Any] | None) -> str:
    """Encode piece by piece: a native call for all of a long one would hold up every task."""
    if isinstance(value, dict) and (len(value) > _AT_ONCE or any(
            isinstance(item, dict | list | tuple) and len(item) > _AT_ONCE
            for item in value.values())):
        return '{' + ','.join(f'{json.dumps(str(key))}:{_json(item, default)}'
                              for key, item in value.items()) + '}'
    if isinstance(value, list | tuple) and len(value) > _AT_ONCE:
        return '[' + ','.join(_json(item, default) for item in value) + ']'
    return json.dumps(value, separators=(',', ':'), default=default)


def in_parts(packet: bytes) -> Iterator[bytes]:
    """Divide a packet of an answer that is too long to be sent at once."""
    if len(packet) <= PART_BYTES:
        yield packet
        return
    kind, _, channel, _, _, seq = HEADER.unpack_from(packet)
    for start in range(HEADER_BYTES, len(packet), PART_BYTES - HEADER_BYTES):
        end = start + PART_BYTES - HEADER_BYTES
        more = CONTINUED if end < len(packet) else 0
        yield header(kind, channel | more, seq=seq) + packet[start:end]


def decode_request(packet: bytes) -> dict[str, Any]:
    """
    Read the JSON of a request, which may be anybody's.

    :raises LinkError: it is no JSON object, or nested as no request is.
    """
    if packet.count(b'[') + packet.count(b'{') > BRACKETS_MAXIMUM:
        raise LinkError(f'a request has more than {BRACKETS_MAXIMUM} brackets')
    return decode_json(packet)


def decode_json(packet: bytes | memoryview) -> dict[str, Any]:
    """
    Read the JSON of a packet.

    :raises LinkError: it is no JSON object.
    """
    try:
        content = json.loads(bytes(packet[HEADER_BYTES:]))
    except (ValueError, RecursionError) as error:
        raise LinkError(f'a packet holds no JSON: {error}') from error
    if not isinstance(content, dict):
        raise LinkError(f'a packet holds {type(content).__name__} where an object is expected')
    return content
