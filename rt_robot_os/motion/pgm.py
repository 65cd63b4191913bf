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
Portable grey maps, the pictures of ROS maps: P5 (binary) and P2 (text).

Source: the format's specification in netpbm's pgm(5).
"""

from __future__ import annotations

import re
from typing import Final

import numpy as np
import numpy.typing as npt

Grey = npt.NDArray[np.uint16]

# As many cells as 500 m x 500 m have at 5 cm; more is a mistake in the header.
MOST_PIXELS: Final = 100_000_000
_HIGHEST: Final = 65535

# Magic, width, height, highest value; any of them may be followed by a comment; one white space.
_GAP: Final = rb'(?:\s|#[^\n]*\n)+'
_HEADER: Final = re.compile(
    rb'(P[25])' + _GAP + rb'(\d{1,9})' + _GAP + rb'(\d{1,9})' + _GAP
    + rb'(\d{1,5})(?:[ \t]*#[^\n]*)?[ \t\r\n\v\f]')
_COMMENT: Final = re.compile(rb'#[^\n]*')
_OTHERS: Final = {b'\x89PNG': 'PNG', b'BM': 'BMP', b'GIF8': 'GIF', b'\xff\xd8': 'JPEG',
                  b'P1': 'PBM', b'P4': 'PBM', b'P3': 'PPM', b'P6': 'PPM'}


def read_pgm(data: bytes) -> tuple[Grey, int]:
    """
    Read a picture.

    :param data: the whole file.
    :return: the values, of shape (height, width) with the top row first, and the highest value
        that there may be (white).
    :raises ValueError: with the problem and its remedy.
    """
    match = _HEADER.match(data)
    if match is None:
        other = next((name for start, name in _OTHERS.items() if data.startswith(start)), '')
        found = f'it is a {other}' if other else 'its header is missing'
        raise ValueError(f'is not a PGM of kind P5 or P2: {found}; convert it, such as with '
                         '"convert map.png map.pgm" of ImageMagick')
    kind, width, height, highest = match[1], int(match[2]), int(match[3]), int(match[4])
    if not width * height:
        raise ValueError(f'is empty: {width} x {height} pixels')
    if width * height > MOST_PIXELS:
        raise ValueError(f'{width} x {height} pixels are more than {MOST_PIXELS}')
    if not 0 < highest <= _HIGHEST:
        raise ValueError(f'its highest value is {highest}: it must be from 1 to {_HIGHEST}')
    read = _binary if kind == b'P5' else _text
    pixels = read(data, match.end(), width * height, highest)
    if (largest := int(pixels.max())) > highest:
        raise ValueError(f'has a pixel of {largest}, above its highest value, {highest}')
    return pixels.reshape(height, width), highest


def write_pgm(pixels: npt.NDArray[np.uint8]) -> bytes:
    """
    Write a picture as P5 with values up to 255.

    :param pixels: of shape (height, width), the top row first.
    """
    height, width = pixels.shape
    return f'P5\n{width} {height}\n255\n'.encode() + pixels.tobytes()


def _binary(data: bytes, start: int, count: int, highest: int) -> Grey:
    kind = np.dtype('>u2' if highest > 255 else 'u1')
    there = (len(data) - start) // kind.itemsize
    if there < count:
        raise ValueError(f'is cut off: {there} of {count} pixels')
    return np.frombuffer(data, kind, count, start).astype(np.uint16)


def _text(data: bytes, start: int, count: int, highest: int) -> Grey:
    words = _COMMENT.sub(b'', data[start:]).split()
    if len(words) < count:
        raise ValueError(f'is cut off: {len(words)} of {count} pixels')
    wrong = next((word for word in words[:count] if not (word.isdigit() and len(word) < 10)), None)
    if wrong is not None:
        raise ValueError(f'has {wrong[:20].decode("ascii", "replace")!r} where a pixel must be')
    return np.minimum(np.array(words[:count], dtype=np.int64), _HIGHEST).astype(np.uint16)
