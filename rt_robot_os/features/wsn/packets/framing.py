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
Frames on the serial line of a mote, of TinyOS 1.x and 2.x.

``7E P [token] packet CRC 7E``: flags as in RFC 1662; 7E and 7D between them are sent as 7D and the
byte with bit 5 inverted. The CRC-16 (polynomial 0x1021, initial value 0, low byte first) covers
the bytes before it. P is the type of the frame, see :data:`TINYOS_1` and :data:`TINYOS_2`.
"""

from __future__ import annotations

from binascii import crc_hqx
import re
from typing import Final
from typing import NamedTuple

FLAG: Final = 0x7E
ESCAPE: Final = 0x7D
UNKNOWN_PROTOCOL: Final = 0xFF
#: Bytes from P to the end of the CRC, unescaped; the hosts of TinyOS reject longer frames.
LONGEST: Final = 256
SHORTEST: Final = 4
_LONGEST_ESCAPED: Final = 2 * LONGEST

_FLAG: Final = b'\x7e'
_ESCAPE: Final = b'\x7d'
_ESCAPED: Final = re.compile(rb'\x7d(.)', re.DOTALL)


class Protocols(NamedTuple):
    """
    Values of P of one generation of TinyOS.

    :ivar name: of the generation, in decoders and settings.
    :ivar ack: an acknowledgement: one byte follows, the token of the received frame.
    :ivar acked: a packet that requests an acknowledgement, after its token.
    :ivar plain: a packet without an acknowledgement.
    """

    name: str
    ack: int
    acked: int
    plain: int


TINYOS_1: Final = Protocols('tinyos1', 0x40, 0x41, 0x42)
TINYOS_2: Final = Protocols('tinyos2', 0x43, 0x44, 0x45)
#: P -> generation.
PROTOCOLS: Final = {value: each for each in (TINYOS_1, TINYOS_2) for value in each[1:]}
_WITH_TOKEN: Final = frozenset({TINYOS_1.ack, TINYOS_1.acked, TINYOS_2.ack, TINYOS_2.acked})


class Frame(NamedTuple):
    """
    A valid frame.

    :ivar protocol: P.
    :ivar token: of an acknowledgement, or of a packet that requests one; -1 in others.
    :ivar packet: the content: a TOS_Msg, or a dispatch byte and an active message; also the
        bytes after an unknown P.
    :ivar end: index just after its closing flag in the chunk that completed it.
    :ivar size: its bytes on the line; a flag shared by two frames belongs to the first one.
    """

    protocol: int
    token: int
    packet: bytes
    end: int
    size: int


def frame(protocol: int, body: bytes) -> bytes:
    """
    Return a frame with both flags: a mote of TinyOS 1.x rejects shared ones.

    :param protocol: P.
    :param body: the packet, after its token where the protocol has one.
    :raises ValueError: the frame is too long.
    """
    content = bytes((protocol,)) + body
    if len(content) + 2 > LONGEST:
        raise ValueError(f'a frame of {len(content) + 2} bytes: at most {LONGEST}; send a shorter '
                         'packet')
    content += crc_hqx(content, 0).to_bytes(2, 'little')
    escaped = content.replace(_ESCAPE, b'\x7d\x5d').replace(_FLAG, b'\x7d\x5e')
    return _FLAG + escaped + _FLAG


def unescaped(data: bytes) -> bytes | None:
    """Return bytes before escaping; None when they end within an escape."""
    count = data.count(_ESCAPE)
    if not count:
        return data
    if count == data.count(b'\x7d\x5d') + data.count(b'\x7d\x5e'):
        # The usual ones; each 7D starts an escape, so no replacement creates another.
        return data.replace(b'\x7d\x5e', _FLAG).replace(b'\x7d\x5d', _ESCAPE)
    if _ends_in_escape(data):
        return None
    return _ESCAPED.sub(lambda found: bytes((found[1][0] ^ 0x20,)), data)


def read_content(content: bytes, end: int = 0, size: int = 0) -> Frame | None:
    """
    Check and parse a frame without flags and escapes, from P to the CRC.

    :return: None when it is too short, too long, or its CRC is wrong.
    """
    if not SHORTEST <= len(content) <= LONGEST or (
            crc_hqx(content[:-2], 0) != content[-2] | content[-1] << 8):
        return None
    protocol = content[0]
    if protocol in _WITH_TOKEN:
        return Frame(protocol, content[1], content[2:-2], end, size)
    return Frame(protocol, -1, content[1:-2], end, size)


def _ends_in_escape(data: bytes) -> bool:
    """Return whether the last byte starts an escape; 7D 7D is a complete one."""
    return (len(data) - len(data.rstrip(_ESCAPE))) % 2 == 1


class FrameReader:
    """
    Finds the frames in a byte stream, of both generations; safe in the real-time loop.

    A 7E is always a flag, also after noise that ends in an escape: it ends the bytes before it and
    starts the next frame. Two frames may share one. At the start of the stream a frame needs no
    opening flag; an invalid one there is not counted as rejected, because it may be the end of a
    truncated frame.

    Each byte is part of a frame, rejected, or pending; flags of an idle line are rejected bytes.

    :ivar frames: number of valid frames.
    :ivar rejected_bytes: number of bytes outside valid frames.
    :ivar rejected_frames: number of invalid frames between two flags: a wrong CRC, an escape
        before the closing flag, more than ``LONGEST`` bytes. Fewer than ``SHORTEST`` are not
        counted.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.rejected_bytes = 0
        self.rejected_frames = 0
        # From a flag outside a frame, or from the byte after the closing flag of a frame.
        self._pending = b''
        self._synced = False
        self._skipping = False

    @property
    def pending_bytes(self) -> int:
        """Return the number of bytes of an incomplete frame."""
        return len(self._pending)

    def reset(self) -> None:
        """Reject pending bytes: the stream restarts."""
        self.rejected_bytes += len(self._pending)
        self._pending = b''
        self._synced = self._skipping = False

    def feed(self, data: bytes) -> list[Frame]:
        """
        Process the next bytes of the stream; never raises.

        :return: the frames that they complete, in order; independent of the chunks of the stream.
        """
        held = len(self._pending)
        buffer = self._pending + data
        found: list[Frame] = []
        begin = 0
        # The flag at the start of the pending bytes was processed before.
        content = 1 if buffer[:1] == _FLAG else 0
        if content and not held:
            self._note_flag()
        flag = buffer.find(_FLAG, max(content, held))
        while flag >= 0:
            frame = self._frame(buffer[content:flag], flag + 1 - held, flag + 1 - begin)
            if frame is None:
                self.rejected_bytes += flag - begin
                begin = flag
            else:
                found.append(frame)
                begin = flag + 1
            content = flag + 1
            self._note_flag()
            flag = buffer.find(_FLAG, content)
        if self._skipping or len(buffer) - content > _LONGEST_ESCAPED:
            if not self._skipping and self._synced:
                self.rejected_frames += 1
            self._skipping = True
            self.rejected_bytes += len(buffer) - begin
            begin = len(buffer)
        self._pending = buffer[begin:]
        self.frames += len(found)
        return found

    def _note_flag(self) -> None:
        self._synced = True
        self._skipping = False

    def _frame(self, content: bytes, end: int, size: int) -> Frame | None:
        """Check and parse the bytes between two flags."""
        if not content or self._skipping:
            return None
        body = unescaped(content) if len(content) <= _LONGEST_ESCAPED else None
        if body is not None and len(body) < SHORTEST:
            return None
        found = None if body is None else read_content(body, end, size)
        if found is None:
            self.rejected_frames += self._synced
        return found
