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
ones, recordings often have lost their CR, and some programs make CR CR LF of it: all three end a
line.
"""

from __future__ import annotations

from functools import reduce
import operator
import re
from typing import Final
from typing import NamedTuple

from rt_robot_os.drivers.framing import FrameDecoder

# "$X*58\n" is the shortest.
MIN_SENTENCE: Final = 6
MAX_SENTENCE: Final = 200

# A sentence, or what the end of the buffer has left of one.
SENTENCE: Final = rb'\$(?:[ -#%-)+-~]+(?:\*(?:[0-9A-Fa-f]{2}(?:\r{0,2}(?:\n|\Z))|' \
                  rb'[0-9A-Fa-f]?\Z)|\Z)|\Z)'
_MATCH: Final = re.compile(SENTENCE).match
_LINE_FEED: Final = 10


class NmeaFrame(NamedTuple):
    """
    One sentence with a good checksum.

    :ivar sentence: its bytes, from ``$`` to the line end.
    :ivar content: what stands between ``$`` and ``*``.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    sentence: bytes
    content: str
    end: int

    @property
    def address(self) -> str:
        """Give what stands before the first comma, such as ``GPGGA``."""
        return self.content.partition(',')[0]


def sentence_end(buffer: bytes, at: int) -> int:
    """
    Say where the sentence that begins at an index ends.

    :return: index just after its line end, one behind the buffer while it may go on, or 0 when
        none begins here. Too long a sentence is for the caller to notice.
    """
    match = _MATCH(buffer, at)
    if match is None:
        return 0
    end = match.end()
    if buffer[end - 1] == _LINE_FEED:
        return end
    return at + MAX_SENTENCE if len(buffer) - at < MAX_SENTENCE else 0


def checked(sentence: bytes) -> bytes | None:
    """Give what is between ``$`` and ``*``, None when the checksum behind it is another."""
    content, _, checksum = sentence[1:].partition(b'*')
    return content if xor(content) == int(checksum[:2], 16) else None


def xor(content: bytes) -> int:
    """Give the NMEA checksum of what stands between ``$`` and ``*``."""
    return reduce(operator.xor, content, 0)


class NmeaDecoder(FrameDecoder[NmeaFrame]):
    """Find the sentences in a stream of bytes; safe in the loop, keeps less than 200 bytes."""

    STARTS = b'$'
    SHORTEST = MIN_SENTENCE
    LONGEST = MAX_SENTENCE
    PATTERN = SENTENCE

    end = staticmethod(sentence_end)

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> NmeaFrame | None:
        """Read a sentence with a good checksum."""
        sentence = buffer[at:end]
        content = checked(sentence)
        if content is None:
            return None
        return NmeaFrame(sentence, content.decode('ascii'), arrived)
