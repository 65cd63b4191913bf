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
The synthetic picture: colour bars that move, and the number of the frame in its pixels.

The number is 32 squares along the upper edge, black or white, the highest bit first. It survives
JPEG, so that a test, or a person, can identify each frame and detect missing ones.
"""

from __future__ import annotations

from typing import Any
from typing import Final

import numpy as np

Pixels = np.ndarray[Any, np.dtype[np.uint8]]

BITS: Final = 32
_BARS: Final = np.array([
    (255, 255, 255), (255, 255, 0), (0, 255, 255), (0, 255, 0), (255, 0, 255), (255, 0, 0),
    (0, 0, 255), (40, 40, 40)], np.uint8)
_STEP: Final = 4  # pixels from frame to frame


class Pattern:
    """
    The pictures of one size.

    :param width: in pixels, from 32.
    :param height: in pixels.
    """

    def __init__(self, width: int, height: int) -> None:
        self.width = width
        self.square = width // BITS
        # Twice as wide: each picture is a part of it, shifted with each frame.
        row = _BARS[np.arange(2 * width) * len(_BARS) // width % len(_BARS)]
        shade = np.linspace(1.0, 0.4, height)[:, None, None]
        self._wide = (row[None] * shade).astype(np.uint8)

    def frame(self, number: int) -> Pixels:
        """Return a picture of red, green and blue bytes."""
        start = number * _STEP % self.width
        picture: Pixels = self._wide[:, start:start + self.width].copy()
        bits = (number >> np.arange(BITS - 1, -1, -1)) & 1
        edge = np.repeat(bits * 255, self.square).astype(np.uint8)
        picture[:self.square, :len(edge)] = edge[None, :, None]
        return picture


def number_of(picture: Pixels) -> int:
    """
    Decode the number of a picture, of any encoding.

    :param picture: height x width, with or without channels.
    """
    square = picture.shape[1] // BITS
    middle = picture[square // 2, square // 2:square * BITS:square]
    level = middle if middle.ndim == 1 else middle.mean(axis=1)
    return sum(int(bit) << BITS - 1 - place for place, bit in enumerate(level > 127))
