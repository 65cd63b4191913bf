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
Frames on the serial line of a mote, as TinyOS 1.x and 2.x have them.

``7E P [token] packet CRC 7E``: flags as in RFC 1662; 7E and 7D between them are sent as 7D and the
byte with bit 5 turned over. The CRC-16 (polynomial 0x1021, begins with 0, low byte first) is over
what stands before it. P says what it is, see :data:`TINYOS_1` and :data:`TINYOS_2`.
"""

from __future__ import annotations

from binascii import crc_hqx
import re
from typing import Final
from typing import NamedTuple

FLAG: Final = 0x7E
ESCAPE: Final = 0x7D
UNKNOWN_PROTOCOL: Final = 0xFF
#: Bytes from P to the end of the CRC, not escaped; the hosts of TinyOS take no longer frame.
LONGEST: Final = 256
SHORTEST: Final = 4
_LONGEST_ESCAPED: Final = 2 * LONGEST

_FLAG: Final = b'\x7e'
_ESCAPE: Final = b'\x7d'
_ESCAPED: Final = re.compile(rb'\x7d(.)', re.DOTALL)


class Protocols(NamedTuple):
    """
    What P is in one generation of TinyOS.

    :ivar name: of the generation, as decoders and settings have it.
    :ivar ack: one byte follows, the token of the frame that has arrived.
    :ivar acked: a packet for which an acknowledgement is wanted; a token stands before it.
    :ivar plain: a packet for which none is wanted.
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
    :ivar token: of an acknowledgement, or of a packet that wants one; -1 in others.
    :ivar packet: what is left: a TOS_Msg, or a dispatch byte and an active message; also what
        stands behind a P that is none of TinyOS'.
    :ivar end: index just after its closing flag in the chunk that completed it.
    :ivar size: its bytes on the line; a flag that two frames share is of the first one.
    """

    protocol: int
    token: int
    packet: bytes
    end: int
    size: int


def frame(protocol: int, body: bytes) -> bytes:
    """
    Write a frame with both flags: a mote of TinyOS 1.x takes no shared one.

    :param protocol: P.
    :param body: what follows: the packet, behind its token where the protocol has one.
    :raises ValueError: it is longer than what others read.
    """
    content = bytes((protocol,)) + body
    if len(content) + 2 > LONGEST:
        raise ValueError(f'a frame of {len(content) + 2} bytes: more than {LONGEST} are read by '
                         'nobody; send less at once')
    content += crc_hqx(content, 0).to_bytes(2, 'little')
    escaped = content.replace(_ESCAPE, b'\x7d\x5d').replace(_FLAG, b'\x7d\x5e')
    return _FLAG + escaped + _FLAG


def unescaped(data: bytes) -> bytes | None:
    """Return bytes as they were before escaping; None when they end within an escape."""
    count = data.count(_ESCAPE)
    if not count:
        return data
    if count == data.count(b'\x7d\x5d') + data.count(b'\x7d\x5e'):
        # The usual ones; each 7D begins an escape, so none of the replacements makes another.
        return data.replace(b'\x7d\x5e', _FLAG).replace(b'\x7d\x5d', _ESCAPE)
    if _ends_in_escape(data):
        return None
    return _ESCAPED.sub(lambda found: bytes((found[1][0] ^ 0x20,)), data)


def read_content(content: bytes, end: int = 0, size: int = 0) -> Frame | None:
    """
    Check and read a frame without its flags and escapes, from P to the CRC.

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
    """Return whether the last byte begins an escape; 7D 7D is a whole one."""
    return (len(data) - len(data.rstrip(_ESCAPE))) % 2 == 1


class FrameReader:
    """
    Find the frames in a stream of bytes, of both generations; safe in the real-time loop.

    A 7E is always a flag, also behind noise that ends in an escape: it ends what stood before it
    and begins what follows. Two frames may share one. Where the stream begins, a frame does not
    need its opening flag; what is no frame there is not counted as a rejected one, since it may
    be the end of one that was cut.

    Each byte fed is in a frame, rejected, or pending; flags of an idle line are rejected bytes.

    :ivar frames: valid frames so far.
    :ivar rejected_bytes: bytes that belong to no valid frame.
    :ivar rejected_frames: what stood between two flags and was no frame: a wrong CRC, an escape
        before the closing flag, more than ``LONGEST`` bytes. Fewer than ``SHORTEST`` are not
        counted.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.rejected_bytes = 0
        self.rejected_frames = 0
        # From the flag that belongs to no frame, or from what stands behind one that does.
        self._pending = b''
        self._synced = False
        self._passing_over = False

    @property
    def pending_bytes(self) -> int:
        """Return the number of bytes that wait for the rest of their frame."""
        return len(self._pending)

    def reset(self) -> None:
        """Reject what is pending: the stream starts anew."""
        self.rejected_bytes += len(self._pending)
        self._pending = b''
        self._synced = self._passing_over = False

    def feed(self, data: bytes) -> list[Frame]:
        """
        Take the next bytes of the stream; never raises.

        :return: the frames that they complete, in order; the same however the stream is cut.
        """
        held = len(self._pending)
        buffer = self._pending + data
        found: list[Frame] = []
        begin = 0
        # The flag at the beginning of what is pending has been seen before.
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
        if self._passing_over or len(buffer) - content > _LONGEST_ESCAPED:
            if not self._passing_over and self._synced:
                self.rejected_frames += 1
            self._passing_over = True
            self.rejected_bytes += len(buffer) - begin
            begin = len(buffer)
        self._pending = buffer[begin:]
        self.frames += len(found)
        return found

    def _note_flag(self) -> None:
        self._synced = True
        self._passing_over = False

    def _frame(self, content: bytes, end: int, size: int) -> Frame | None:
        """Check and read what stands between two flags."""
        if not content or self._passing_over:
            return None
        body = unescaped(content) if len(content) <= _LONGEST_ESCAPED else None
        if body is not None and len(body) < SHORTEST:
            return None
        found = None if body is None else read_content(body, end, size)
        if found is None:
            self.rejected_frames += self._synced
        return found
