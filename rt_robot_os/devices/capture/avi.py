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
Moving pictures as a file: JPEGs one after another in an AVI (Motion JPEG).

The JPEGs of the camera are stored unmodified, and every player supports the format. AVI has one
rate for a whole file; a missing picture is an empty frame, for which players repeat the previous
one, so that times are correct to a frame.
"""

from __future__ import annotations

from collections.abc import Sequence
import struct
from typing import BinaryIO
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S

#: Sizes in a RIFF file have 32 bits, and all players support half of that.
LONGEST_BYTES: Final = 1 << 30

_MAIN_HEADER: Final = struct.Struct('<IIIIIIIIII16x')
_STREAM_HEADER: Final = struct.Struct('<4s4sIHHIIIIIIIIhhhh')
_BITMAP: Final = struct.Struct('<IiiHH4sIiiII')
_INDEX: Final = struct.Struct('<4sIII')
_CHUNK: Final = struct.Struct('<4sI')
_HAS_INDEX: Final = 0x10
_KEY_FRAME: Final = 0x10
_VIDEO: Final = b'00dc'
_MOST_FRAMES: Final = 100_000


class AviFrame(NamedTuple):
    """A picture and its moment."""

    stamp_ns: int
    jpeg: bytes


def laid_out(frames: Sequence[AviFrame], rate_hz: float) -> list[bytes]:
    """
    Return a picture, or nothing, for each period of a rate, from the first to the last frame.

    Of several pictures in one period the last is used.
    """
    if not frames:
        return []
    places: dict[int, bytes] = {}
    for frame in frames:
        place = round((frame.stamp_ns - frames[0].stamp_ns) * rate_hz / NS_PER_S)
        places[min(place, _MOST_FRAMES)] = frame.jpeg
    return [places.get(place, b'') for place in range(max(places) + 1)]


def write_avi(file: BinaryIO, frames: Sequence[AviFrame], width: int, height: int, rate_hz: float
              ) -> int:
    """
    Write a file.

    :param frames: at least one, in the order of their stamps.
    :param rate_hz: frame rate of the file.
    :return: number of its frames, including empty ones.
    :raises OSError: it cannot be written.
    :raises ValueError: there is no picture, or more than :data:`LONGEST_BYTES`.
    """
    pictures = laid_out(frames, rate_hz)
    longest = max(map(len, pictures), default=0)
    movie = 4 + sum(_CHUNK.size + _padded(each) for each in pictures)
    if not longest or movie > LONGEST_BYTES:
        raise ValueError(f'{len(pictures)} pictures of {movie} bytes cannot be stored as AVI')
    header = _header(len(pictures), longest, width, height, rate_hz)
    index = _INDEX.size * len(pictures)
    file.write(b'RIFF' + struct.pack(
        '<I', 4 + len(header) + _CHUNK.size + movie + _CHUNK.size + index) + b'AVI ' + header)
    file.write(_CHUNK.pack(b'LIST', movie) + b'movi')
    rows, at = [], 4
    for each in pictures:
        file.write(_CHUNK.pack(_VIDEO, len(each)))
        file.write(each + b'\0' * (_padded(each) - len(each)))
        rows.append(_INDEX.pack(_VIDEO, _KEY_FRAME, at, len(each)))
        at += _CHUNK.size + _padded(each)
    file.write(_CHUNK.pack(b'idx1', index) + b''.join(rows))
    return len(pictures)


def _padded(picture: bytes) -> int:
    return len(picture) + len(picture) % 2


def _list(kind: bytes, content: bytes) -> bytes:
    return _CHUNK.pack(b'LIST', 4 + len(content)) + kind + content


def _header(count: int, longest: int, width: int, height: int, rate_hz: float) -> bytes:
    scale, rate = 1000, round(1000 * rate_hz)
    main = _MAIN_HEADER.pack(round(1e6 / rate_hz), round(longest * rate_hz), 0, _HAS_INDEX, count,
                             0, 1, longest, width, height)
    stream = _STREAM_HEADER.pack(b'vids', b'MJPG', 0, 0, 0, 0, scale, rate, 0, count, longest,
                                 0xFFFFFFFF, 0, 0, 0, width, height)
    bitmap = _BITMAP.pack(_BITMAP.size, width, height, 1, 24, b'MJPG', 3 * width * height, 0, 0,
                          0, 0)
    return _list(b'hdrl', _CHUNK.pack(b'avih', len(main)) + main + _list(
        b'strl', _CHUNK.pack(b'strh', len(stream)) + stream
        + _CHUNK.pack(b'strf', len(bitmap)) + bitmap))
