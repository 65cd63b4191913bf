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
Xbus messages, which Xsens (Movella) motion trackers speak: ``FA FF MID LEN payload CS``.

LEN 0xFF means that the length follows in two bytes. The sum of all bytes after the preamble 0xFA,
CS included, is 0 modulo 256. 0xFA may appear in the payload, so a message counts only with a good
sum, otherwise the decoder slides on by one byte.
"""

from __future__ import annotations

from typing import Final
from typing import NamedTuple

PREAMBLE: Final = b'\xfa\xff'
EXTENDED: Final = 0xFF
# A header found by chance holds up what follows until its length is there: keep that short.
MAX_PAYLOAD: Final = 2048

_HEADER: Final = 4
_LONG_HEADER: Final = 6


class XbusFrame(NamedTuple):
    """
    One message with a good sum.

    :ivar mid: its identifier.
    :ivar payload: what it holds.
    :ivar size: bytes of the whole message.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    mid: int
    payload: bytes
    size: int
    end: int


class XbusDecoder:
    """
    Find the messages in a stream of bytes; safe in the loop, keeps at most about 2 KiB.

    :ivar frames: valid messages so far.
    :ivar rejected_bytes: bytes that belong to no valid message.
    :ivar rejected_frames: headers whose message had a wrong sum.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.rejected_bytes = 0
        self.rejected_frames = 0
        self._pending = b''

    @property
    def pending_bytes(self) -> int:
        """Give the number of bytes that wait for the rest of their message."""
        return len(self._pending)

    def reset(self) -> None:
        """Reject what is pending: the stream starts anew."""
        self.rejected_bytes += len(self._pending)
        self._pending = b''

    def feed(self, data: bytes) -> list[XbusFrame]:
        """
        Take the next bytes of the stream.

        :return: the messages that they complete, in order; the same however the stream is cut.
        """
        held = len(self._pending)
        buffer = self._pending + data if held else data
        size = len(buffer)
        frames: list[XbusFrame] = []
        used = at = 0
        while True:
            found = buffer.find(PREAMBLE, at)
            if found < 0:
                at = size - 1 if at < size and buffer[-1] == PREAMBLE[0] else size
                break
            at = found
            begin = at + _HEADER
            if begin > size:
                break
            length = buffer[at + 3]
            if length == EXTENDED:
                begin = at + _LONG_HEADER
                if begin > size:
                    break
                length = buffer[at + 4] << 8 | buffer[at + 5]
                if length > MAX_PAYLOAD:
                    at += 1
                    continue
            end = begin + length + 1
            if end > size:
                break
            if sum(buffer[at + 1:end]) & 0xFF:
                self.rejected_frames += 1
                at += 1
                continue
            frames.append(XbusFrame(buffer[at + 2], buffer[begin:end - 1], end - at, end - held))
            used += end - at
            at = end
        self.rejected_bytes += at - used
        self._pending = buffer[at:]
        self.frames += len(frames)
        return frames
