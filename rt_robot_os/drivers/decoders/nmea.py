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
NMEA 0183 framing: ``$``, at most 200 characters, ``*``, the XOR of what is between, a line end.

The standard ends a line with CR LF and limits it to 82 characters. Receivers in use send longer
ones, and recordings often have lost their CR, so a bare LF ends a line too.
"""

from __future__ import annotations

import re
from typing import Final
from typing import NamedTuple

MAX_SENTENCE: Final = 200

_LINE: Final = re.compile(rb'\$([ -#%-)+-~]+)\*([0-9A-Fa-f]{2})\r?\n').fullmatch


class NmeaFrame(NamedTuple):
    """
    One sentence with a good checksum.

    :ivar sentence: its bytes, from ``$`` to the line end.
    :ivar address: what stands before the first comma, such as ``GPGGA``.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    sentence: bytes
    address: str
    end: int


class NmeaDecoder:
    """
    Find the sentences in a stream of bytes; safe in the loop, keeps less than 200 bytes.

    :ivar frames: valid sentences so far.
    :ivar rejected_bytes: bytes that belong to no valid sentence.
    :ivar rejected_frames: sentences whose checksum was wrong.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.rejected_bytes = 0
        self.rejected_frames = 0
        self._pending = b''

    @property
    def pending_bytes(self) -> int:
        """Give the number of bytes that wait for the rest of their sentence."""
        return len(self._pending)

    def reset(self) -> None:
        """Reject what is pending: the stream starts anew."""
        self.rejected_bytes += len(self._pending)
        self._pending = b''

    def feed(self, data: bytes) -> list[NmeaFrame]:
        """
        Take the next bytes of the stream.

        :return: the sentences that they complete, in order; the same however the stream is cut.
        """
        held = len(self._pending)
        buffer = self._pending + data
        size = len(buffer)
        frames: list[NmeaFrame] = []
        used = 0
        at = buffer.find(b'$')
        while at >= 0:
            end = buffer.find(b'\n', at, at + MAX_SENTENCE) + 1
            # A second `$` before the line end: the first sentence was cut off.
            next_at = buffer.find(b'$', at + 1, end or at + MAX_SENTENCE)
            if next_at < 0:
                if end:
                    address = self._address(buffer[at:end])
                    if address is not None:
                        frames.append(NmeaFrame(buffer[at:end], address, end - held))
                        used += end - at
                elif size - at < MAX_SENTENCE:
                    break
                next_at = buffer.find(b'$', end or at + MAX_SENTENCE)
            at = next_at
        self._pending = buffer[at:] if at >= 0 else b''
        self.rejected_bytes += size - len(self._pending) - used
        self.frames += len(frames)
        return frames

    def _address(self, line: bytes) -> str | None:
        """Give the address of a valid sentence, None when it is not valid."""
        match = _LINE(line)
        if match is None:
            return None
        content, checksum = match.groups()
        if xor(content) != int(checksum, 16):
            self.rejected_frames += 1
            return None
        return content.partition(b',')[0].decode('ascii')


def xor(content: bytes) -> int:
    """Give the NMEA checksum of what stands between ``$`` and ``*``."""
    result = 0
    for byte in content:
        result ^= byte
    return result
