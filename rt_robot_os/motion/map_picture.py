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
Pictures of maps: PGM, and with Pillow PNG and BMP, read as map_server reads them.

Source: the rules of nav2_map_server for colours and transparency. A colour counts as the mean of
red, green and blue. What is transparent: in mode trinary opacity is averaged in as a fourth
colour, in mode scale a pixel that is not fully opaque is unknown, in mode raw it is ignored.
"""

from __future__ import annotations

from importlib import import_module
import io
from typing import Any
from typing import Final
from typing import NamedTuple
import warnings
import zlib

import numpy as np
import numpy.typing as npt

from rt_robot_os.motion.pgm import Grey
from rt_robot_os.motion.pgm import MOST_PIXELS
from rt_robot_os.motion.pgm import read_pgm
from rt_robot_os.motion.pgm import write_pgm

#: Formats in which maps can be saved; the first is the default.
PICTURES: Final = ('.pgm', '.png')

_WITH_PILLOW: Final = {b'\x89PNG\r\n\x1a\n': 'PNG', b'BM': 'BMP'}
_ROWS_AT_ONCE: Final = 512
_DEEP: Final = 65535


class MapPicture(NamedTuple):
    """
    A picture of a map.

    :ivar grey: of shape (height, width), the top row first: from 0, black, to ``highest``, white.
    :ivar highest: the value of white.
    :ivar unknown: pixels that are unknown regardless of their grey, of the same shape; None: none.
    """

    grey: Grey
    highest: int
    unknown: npt.NDArray[np.bool_] | None = None


def read_picture(data: bytes, mode: str) -> MapPicture:
    """
    Read a picture; its format is detected from its content.

    :param data: the whole file.
    :param mode: of the map: ``trinary``, ``scale`` or ``raw``.
    :raises ValueError: with the problem and its remedy.
    """
    kind = next((name for start, name in _WITH_PILLOW.items() if data.startswith(start)), '')
    if not kind:
        return MapPicture(*read_pgm(data))
    pillow = _pillow(f'is a {kind}')
    try:
        with warnings.catch_warnings():
            # Pillow warns of large pictures; the bound here is MOST_PIXELS.
            warnings.simplefilter('ignore', pillow.DecompressionBombWarning)
            with pillow.open(io.BytesIO(data), formats=(kind,)) as image:
                width, height = image.size
                if width * height > MOST_PIXELS:
                    raise ValueError(f'{width} x {height} pixels are more than {MOST_PIXELS}')
                image.load()
                return _greys(image, mode)
    except pillow.DecompressionBombError as error:
        raise ValueError(f'is too large, the most is {MOST_PIXELS} pixels: {error}') from None
    except (OSError, SyntaxError, EOFError, zlib.error, OverflowError) as error:
        # The text of an unidentified image names an object, not the file.
        why = 'its header is not understood' if 'identify' in str(error) else error
        raise ValueError(f'is a damaged {kind}: {why}') from None


def write_picture(pixels: npt.NDArray[np.uint8], suffix: str) -> bytes:
    """
    Write a picture with values up to 255.

    :param pixels: of shape (height, width), the top row first.
    :param suffix: of the file, one of ``PICTURES``.
    :raises ValueError: a PNG is requested and Pillow is not installed, or the suffix is another.
    """
    if suffix == '.pgm':
        return write_pgm(pixels)
    if suffix not in PICTURES:
        raise ValueError(f'{suffix!r} cannot be written: use {" or ".join(PICTURES)}')
    file = io.BytesIO()
    _pillow('is to be a PNG').fromarray(np.ascontiguousarray(pixels)).save(file, 'PNG')
    return file.getvalue()


def _pillow(what: str) -> Any:
    try:
        return import_module('PIL.Image')
    except ImportError:
        raise ValueError(f'{what}, and Pillow is not installed: pip install pillow, or use a PGM'
                         ) from None


def _greys(image: Any, mode: str) -> MapPicture:
    """Return the greys of a loaded picture."""
    if image.mode.startswith('I') or image.mode == 'F':  # 16 bits of grey
        return MapPicture(np.clip(np.asarray(image), 0, _DEEP).astype(np.uint16), _DEEP)
    has_alpha = image.mode in ('LA', 'PA', 'RGBA', 'La', 'RGBa') or 'transparency' in image.info
    if image.mode in ('1', 'L') and not has_alpha:
        return MapPicture(np.asarray(image.convert('L')).astype(np.uint16), 255)
    width, height = image.size
    with_opacity = has_alpha and mode == 'trinary'
    grey = np.empty((height, width), np.uint16)
    unknown = np.zeros((height, width), np.bool_) if has_alpha and mode == 'scale' else None
    # In pieces: four bytes a pixel of the whole picture would be needed twice.
    for top in range(0, height, _ROWS_AT_ONCE):
        rows = slice(top, min(top + _ROWS_AT_ONCE, height))
        piece = image.crop((0, rows.start, width, rows.stop))
        pixels = np.asarray(piece.convert('RGBA' if has_alpha else 'RGB'))
        pixels[..., :4 if with_opacity else 3].sum(axis=2, dtype=np.uint16, out=grey[rows])
        if unknown is not None:
            unknown[rows] = pixels[..., 3] != 255
    return MapPicture(grey, 255 * (4 if with_opacity else 3), unknown)
