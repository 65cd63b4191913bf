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
Binary frames: a header in JSON and bytes, as pictures and files travel.

A frame is the length of its header (4 bytes, little-endian), the header, and the rest. The header
has a ``kind``; the classes stand in :mod:`rt_robot_os.messages.uplink.media`.
"""

from __future__ import annotations

from collections.abc import Mapping
import struct
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.messages.uplink.messages import encode

#: The longest frame that either side accepts.
FRAME_BYTES: Final = 4 << 20
#: Of a file, in one frame: what is more important waits no longer than for one of them.
PART_BYTES: Final = 64 << 10
_LENGTH: Final = struct.Struct('<I')


class UplinkFrame:
    """
    A frame; each class is a frozen dataclass that checks its limits in :meth:`from_frame`.

    :cvar KIND: its kind on the wire.
    :ivar payload: what follows the header.
    """

    KIND: ClassVar[str]
    payload: bytes | memoryview

    def header(self) -> dict[str, Any]:
        """Return the fields of its header."""
        raise NotImplementedError

    @classmethod
    def from_frame(cls, header: Mapping[str, Any], payload: memoryview) -> UplinkFrame:
        """
        Read it.

        :param header: as :func:`decode_frame` returns it; fields that are unknown are ignored.
        :raises ValueError: it is malformed.
        """
        raise NotImplementedError

    def to_bytes(self) -> bytes:
        """
        Write it.

        :raises ValueError: it would be too long.
        """
        return encode_frame(self.KIND, self.header(), self.payload)


def encode_frame(kind: str, header: Mapping[str, Any], payload: bytes | memoryview) -> bytes:
    """
    Write a frame.

    :raises ValueError: it would be too long.
    """
    head = encode(kind, header).encode()
    if _LENGTH.size + len(head) + len(payload) > FRAME_BYTES:
        raise ValueError(f'a frame with {len(payload)} bytes; {FRAME_BYTES} are the most, header '
                         'and all')
    return b''.join((_LENGTH.pack(len(head)), head, payload))


def decode_frame(frame: bytes) -> tuple[dict[str, Any], memoryview]:
    """
    Read a frame.

    :return: its header, with ``kind``, and the rest, a view.
    :raises ValueError: it is not a frame.
    """
    if not _LENGTH.size <= len(frame) <= FRAME_BYTES:
        raise ValueError(f'a frame of {len(frame)} bytes')
    length, = _LENGTH.unpack_from(frame)
    end = _LENGTH.size + length
    if end > len(frame):
        raise ValueError(f'a frame of {len(frame)} bytes with a header of {length}')
    return decode(frame[_LENGTH.size:end]), memoryview(frame)[end:]
