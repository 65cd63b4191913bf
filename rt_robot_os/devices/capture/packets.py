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
The protocol between a device of the core and its capture process.

A SOCK_SEQPACKET socket; the first byte of a packet is its kind. The core begins with ``OPEN``: the
settings, as JSON, and the memory file for the frames (SCM_RIGHTS). The worker answers ``READY``,
then sends a ``FRAME`` for each slot that it has filled; the core returns the slot with a
``RELEASE``. A ``PROBLEM`` is the worker's last packet: the reason, as text. A ``REQUEST`` demands
a picture or a clip in a file, an ``OBSERVED`` is its result; both are JSON.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
import json
import struct
from typing import Any
from typing import Final

VERSION: Final = 1
PACKET_BYTES_MAXIMUM: Final = 16 * 1024
_FRAME: Final = struct.Struct('<BxxxIqQIIQQff')
_RELEASE: Final = struct.Struct('<BxxxI')


class PacketKind(IntEnum):
    """What a packet is."""

    OPEN = 1
    READY = 2
    FRAME = 3
    RELEASE = 4
    PROBLEM = 5
    REQUEST = 6
    OBSERVED = 7


@dataclass(frozen=True)
class CapturedFrame:
    """
    An image or a block of sound in a slot.

    :ivar stamp_ns: when it was captured, on CLOCK_MONOTONIC.
    :ivar seq: its number, counted by the worker; missing numbers were lost.
    :ivar first: bytes of the first part in the slot: the image or the block itself.
    :ivar second: bytes of the part after it: the compressed image.
    :ivar dropped: number of frames so far without a free slot.
    :ivar overruns: number of losses so far in the source itself.
    :ivar rms_db: level of sound below full scale.
    :ivar peak_db: of its highest peak.
    """

    slot: int
    stamp_ns: int
    seq: int
    first: int
    second: int = 0
    dropped: int = 0
    overruns: int = 0
    rms_db: float = 0.0
    peak_db: float = 0.0

    def encode(self) -> bytes:
        """Make the packet."""
        return _FRAME.pack(PacketKind.FRAME, self.slot, self.stamp_ns, self.seq, self.first,
                           self.second, self.dropped, self.overruns, self.rms_db, self.peak_db)


def parse_frame(packet: bytes | memoryview) -> CapturedFrame | None:
    """Decode a ``FRAME``; None if it is another packet."""
    if len(packet) != _FRAME.size or packet[0] != PacketKind.FRAME:
        return None
    return CapturedFrame(*_FRAME.unpack(packet)[1:])


def encode_release(slot: int) -> bytes:
    """Encode the release of a slot."""
    return _RELEASE.pack(PacketKind.RELEASE, slot)


def parse_release(packet: bytes | memoryview) -> int | None:
    """Decode the released slot; None if it is another packet."""
    if len(packet) != _RELEASE.size or packet[0] != PacketKind.RELEASE:
        return None
    slot: int = _RELEASE.unpack(packet)[1]
    return slot


def encode_json(kind: PacketKind, content: dict[str, Any]) -> bytes:
    """Encode a packet with JSON."""
    return bytes([kind]) + json.dumps({**content, 'version': VERSION}).encode()


def parse_json(packet: bytes | memoryview) -> dict[str, Any]:
    """
    Decode the JSON of a packet.

    :raises ValueError: there is none, or its version is another.
    """
    content = json.loads(bytes(packet[1:]))
    if not isinstance(content, dict) or content.get('version') != VERSION:
        raise ValueError(f'not a packet of version {VERSION}')
    return content


def problem(text: str) -> bytes:
    """Encode the reason why nothing can be captured."""
    return bytes([PacketKind.PROBLEM]) + text.encode('utf-8', 'replace')[:4000]
