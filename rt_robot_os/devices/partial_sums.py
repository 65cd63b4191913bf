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
Prefix sums: the sum of any part of a buffer in constant time, for checksums of frames.

Where many false starts stand close together, each with a long frame behind it, summing each of
those frames would cost a thousand times more than valid frames. Running sums of the whole buffer
are computed once, in some nanoseconds a byte; the sum of any part is then one subtraction.
"""

from __future__ import annotations

from typing import Final

import numpy as np

# Few and short frames are summed one by one, which is cheaper.
_FEW: Final = 2
_SHORT: Final = 512


class PartialSums:
    """
    Sums modulo 256; safe in the loop, keeps the sums of the last buffer.

    A part begins at index 1 or later: every frame has a byte before the summed ones.
    """

    def __init__(self) -> None:
        self._buffer = b''
        self._asked = 0
        self._first = b''
        self._second = b''

    def sum8(self, buffer: bytes, begin: int, end: int) -> int:
        """Return the sum of the bytes from ``begin``, at least 1, up to before ``end``."""
        if self._is_cheap(buffer, end - begin):
            return sum(buffer[begin:end]) & 0xFF
        first = self._first
        return first[end - 1] - first[begin - 1] & 0xFF

    def fletcher8(self, buffer: bytes, begin: int, end: int) -> tuple[int, int]:
        """Return the sum, and the sum of the sums up to each byte."""
        if self._is_cheap(buffer, end - begin):
            content = buffer[begin:end]
            # The second sum is that of the first n sums: each byte counts once for itself and
            # once for each byte behind it, modulo 256, which is what 8-bit numbers do.
            values = np.frombuffer(content, np.uint8)
            return sum(content) & 0xFF, int(np.dot(values, _WEIGHTS[_SHORT - values.size:]))
        first, second = self._first, self._second
        before = first[begin - 1]
        return (first[end - 1] - before & 0xFF,
                second[end - 1] - second[begin - 1] - (end - begin) * before & 0xFF)

    def _is_cheap(self, buffer: bytes, size: int) -> bool:
        """Return whether to sum the part alone; if not, the running sums are available."""
        if buffer is not self._buffer:
            self._buffer = buffer
            self._asked = 0
            self._first = b''
        self._asked += 1
        if self._asked <= _FEW and size <= _SHORT:
            return True
        if not self._first:
            # 8-bit numbers are added modulo 256 implicitly.
            first = np.cumsum(np.frombuffer(buffer, np.uint8), dtype=np.uint8)
            self._first = first.tobytes()
            self._second = np.cumsum(first, dtype=np.uint8).tobytes()
        return False


# ..., 3, 2, 1, modulo 256.
_WEIGHTS: Final = np.arange(_SHORT, 0, -1).astype(np.uint8)
