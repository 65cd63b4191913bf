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
The work of a decoder, counted instead of timed: equal bytes give equal numbers.

A step is a line of Python, or eight bytes that are sliced, searched or summed. That is coarse, but
a decoder that processes the same bytes repeatedly differs by factors of a hundred.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Sequence
import random
import sys
from types import FrameType
from typing import Any
from typing import Final

_BYTES_PER_STEP: Final = 8
# Size of the chunks of a port.
_CHUNK: Final = 256


class Meter:
    """Counts lines of Python and bytes, without the lines of this file."""

    def __init__(self) -> None:
        self.lines = 0
        self.bytes = 0

    @property
    def steps(self) -> float:
        """Return the work."""
        return self.lines + self.bytes / _BYTES_PER_STEP

    def trace(self, frame: FrameType, event: str, arg: object) -> Any:
        """Count executed lines; for ``sys.settrace``."""
        if frame.f_code.co_filename == __file__:
            return None
        if event != 'return':
            self.lines += 1
        return self.trace


class WatchedBytes(bytes):
    """Bytes that count slicing, searching and summing."""

    meter: Meter

    def __add__(self, other: Any) -> bytes:
        """Stay counted after concatenation behind other bytes."""
        return watched(bytes(self) + other, self.meter)

    def __radd__(self, other: bytes) -> bytes:
        """Stay counted after concatenation before other bytes."""
        return watched(other + bytes(self), self.meter)

    def __getitem__(self, index: Any) -> Any:
        """Count a slice."""
        found = bytes.__getitem__(self, index)
        if isinstance(found, bytes):
            self.meter.bytes += len(found)
        return found

    def __iter__(self) -> Iterator[int]:
        """Count all bytes: an iteration usually runs to the end."""
        self.meter.bytes += len(self)
        return bytes.__iter__(self)

    def __contains__(self, wanted: Any) -> bool:
        """Count what is searched."""
        self.meter.bytes += len(self)
        return bytes.__contains__(self, wanted)

    def find(self, wanted: Any, start: Any = 0, end: Any = None) -> int:
        """Count what is searched."""
        limit = len(self) if end is None else min(end, len(self))
        found = bytes.find(self, wanted, start, limit)
        self.meter.bytes += max((found if found >= 0 else limit) - start, 0)
        return found


def watched(data: bytes, meter: Meter) -> WatchedBytes:
    """Return bytes that count the operations on them."""
    made = WatchedBytes(data)
    made.meter = meter
    return made


def steps_per_byte(decoder: Any, data: bytes) -> float:
    """Feed a decoder in chunks and return the steps per byte."""
    meter = Meter()
    before = sys.gettrace()
    sys.settrace(meter.trace)
    try:
        for at in range(0, len(data), _CHUNK):
            decoder.feed(watched(data[at:at + _CHUNK], meter))
    finally:
        sys.settrace(before)
    return meter.steps / len(data)


def costliest_input(decoder: Callable[[], Any], seeds: Sequence[bytes], size: int, rounds: int,
                    ) -> tuple[float, bytes]:
    """
    Search for the bytes with the highest cost when repeated.

    :param decoder: makes a decoder.
    :param seeds: start of the search.
    :param size: of the input of each run, in bytes.
    :param rounds: number of changes to the costliest so far.
    :return: steps per byte, and the repeated bytes.
    """
    chance = random.Random(1)
    alphabet = bytes(sorted(set(b''.join(seeds)) | {0, 0xFF}))

    def cost(piece: bytes) -> tuple[float, bytes]:
        return steps_per_byte(decoder(), (piece * (size // len(piece) + 1))[:size]), piece

    found = sorted((cost(seed) for seed in dict.fromkeys(seeds) if seed), reverse=True)[:4]
    for _ in range(rounds):
        piece = _changed(chance, chance.choice(found)[1], chance.choice(found)[1], alphabet)
        if piece and all(piece != known for _, known in found):
            found = sorted((*found, cost(piece)), reverse=True)[:4]
    return found[0]


def _changed(chance: random.Random, piece: bytes, other: bytes, alphabet: bytes) -> bytes:
    """Return a piece with a byte replaced, inserted or removed, or two pieces in sequence."""
    at = chance.randrange(len(piece))
    byte = bytes((chance.choice(alphabet),))
    return chance.choice((piece[:at] + byte + piece[at + 1:], piece[:at] + byte + piece[at:],
                          piece[:at] + piece[at + 1:], piece[:at + 1], piece + other))[:64]
