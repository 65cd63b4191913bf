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

A packet is one datagram of a SOCK_SEQPACKET socket. It begins with 24 bytes, little-endian:

====== ==== ========================================================================
offset size meaning
====== ==== ========================================================================
0      1    kind, see :class:`PacketKind`
1      1    protocol version
2      2    channel: number of a topic; 0 otherwise
4      4    samples of this topic that this client has missed so far, modulo 2**32
8      8    stamp on CLOCK_MONOTONIC in nanoseconds, signed
16     8    sequence number of the sample in its topic, or of the request that is answered
====== ==== ========================================================================

An answer may need several packets: all but the last have channel 1. A long packet of an answer is
divided into parts with the same header: all but the last have 2 added to their channel.

Samples that are sent together share a ``BATCH``: after its header, whose sequence number is their
count, each of them follows as a ``DATA`` packet, preceded by its length in 8 bytes and padded with
zeros to a multiple of 8. Only the core sends it; clients send ``DATA``.

A sample that is too long for a packet is in a memory file of the core that both sides have mapped.
For a mirror the core sends the file once in a ``MEMORY`` packet (SCM_RIGHTS), then a ``SLOT``
packet for each sample; the client answers each with ``GIVE_BACK``. In between the slot belongs to
the client. For a large topic that the client advertises the core sends the file in an ``UPLOAD``
packet. Its slots belong to the client at first, which sends a ``SLOT`` packet for each sample; the
core answers with ``GIVE_BACK`` when it has published it. A ``DATA`` packet of that topic must not
be sent while the core holds a slot: it would overtake the sample in the slot.

With the answer to ``hello`` comes a ``LIVENESS`` packet with the page of :mod:`.liveness`
(SCM_RIGHTS).

========= ======================================================= =========
kind      after the header                                        sent by
========= ======================================================= =========
MEMORY    number of the memory, of its slots; bytes of a slot     core
UPLOAD    as ``MEMORY``                                           core
SLOT      number of the memory, of the slot; bytes of the sample  both
GIVE_BACK number of the memory, of the slot                       both
========= ======================================================= =========

After the header of the other kinds: CDR for ``DATA``, JSON for ``REQUEST``, ``REPLY`` and
``REPORT``, a record of :mod:`rt_robot_os.link.task_records` for ``TASK``, nothing for ``BEAT``.
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
# The length and the header of a sample, packed in one call.
RECORD_HEAD = struct.Struct(RECORD.format + HEADER.format[1:])
MEMORY = struct.Struct('<IIQ')
SLOT = struct.Struct('<IIQ')
GIVE_BACK = struct.Struct('<II')
REQUEST_BYTES_MAXIMUM = 16_384
# A datagram must fit the socket buffer, which ordinary users cannot raise above about 208 KiB.
PACKET_BYTES_MAXIMUM = 128 * 1024
# A longer sample goes through a memory file.
SAMPLE_BYTES_MAXIMUM = PACKET_BYTES_MAXIMUM // 2
# The part of a long answer: no task can start during a system call, so it is kept short.
PART_BYTES = 16 * 1024
MORE, CONTINUED = 1, 2
# A request needs few; each level of nesting costs the parser stack and time.
BRACKETS_MAXIMUM = 256
_AT_ONCE = 16


class PacketKind(IntEnum):
    """The kind of a packet."""

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
    LIVENESS = 11
    UPLOAD = 12


class Header(NamedTuple):
    """The first 24 bytes of a packet."""

    kind: int
    version: int
    channel: int
    missed: int
    stamp_ns: int
    seq: int


def header(kind: PacketKind, channel: int = 0, missed: int = 0, stamp_ns: int = 0,
           seq: int = 0) -> bytes:
    """Make the first 24 bytes of a packet."""
    return HEADER.pack(kind, VERSION, channel, missed & 0xFFFFFFFF, stamp_ns, seq)


def parse_header(packet: bytes | memoryview) -> Header:
    """
    Parse the first 24 bytes of a packet.

    :raises LinkError: the packet is too short, or of another version.
    """
    if len(packet) < HEADER_BYTES:
        raise LinkError(f'a packet of {len(packet)} bytes is too short for the link')
    parsed = Header(*HEADER.unpack_from(packet))
    if parsed.version != VERSION:
        raise LinkError(f'the other side uses version {parsed.version} of the link, this side '
                        f'{VERSION}; use the same release of rt_robot_os on both sides')
    return parsed


def encode_json(kind: PacketKind, content: dict[str, Any], *, seq: int = 0, more: bool = False,
                default: Callable[[Any], Any] | None = None) -> bytes:
    """
    Make a packet with JSON; preemptible, however long the content is.

    :param seq: number of the request that it answers.
    :param more: further packets of the same answer follow.
    :param default: converts a value that JSON does not know.
    """
    return header(kind, MORE * more, seq=seq) + _json(content, default).encode()


def _json(value: Any, default: Callable[[Any], Any] | None) -> str:
    """Encode piece by piece: one native call for a long value would delay every task."""
    if isinstance(value, dict) and (len(value) > _AT_ONCE or any(
            isinstance(item, dict | list | tuple) and len(item) > _AT_ONCE
            for item in value.values())):
        return '{' + ','.join(f'{json.dumps(str(key))}:{_json(item, default)}'
                              for key, item in value.items()) + '}'
    if isinstance(value, list | tuple) and len(value) > _AT_ONCE:
        return '[' + ','.join(_json(item, default) for item in value) + ']'
    return json.dumps(value, separators=(',', ':'), default=default)


def in_parts(packet: bytes) -> Iterator[bytes]:
    """Divide a packet of an answer that is too long to be sent in one call."""
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
    Parse the JSON of a request, which may come from an untrusted client.

    :raises LinkError: it is not a JSON object, or nested too deeply.
    """
    if packet.count(b'[') + packet.count(b'{') > BRACKETS_MAXIMUM:
        raise LinkError(f'a request has more than {BRACKETS_MAXIMUM} brackets')
    return decode_json(packet)


def decode_json(packet: bytes | memoryview) -> dict[str, Any]:
    """
    Parse the JSON of a packet.

    :raises LinkError: it is not a JSON object.
    """
    try:
        content = json.loads(bytes(packet[HEADER_BYTES:]))
    except (ValueError, RecursionError) as error:
        raise LinkError(f'a packet does not hold JSON: {error}') from error
    if not isinstance(content, dict):
        raise LinkError(f'a packet holds {type(content).__name__} where an object is expected')
    return content
