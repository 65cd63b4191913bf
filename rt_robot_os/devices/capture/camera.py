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
The frames of a camera: the pictures of a source, in the configured size and encoding.

Pillow compresses them; it is imported where it is needed.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from dataclasses import dataclass
import io
from typing import Any

import numpy as np

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.needs import lacking
from rt_robot_os.devices.capture.pattern import Pixels
from rt_robot_os.devices.capture.pictures import open_source
from rt_robot_os.devices.capture.pictures import PictureSource
from rt_robot_os.devices.capture.scene_memory import SceneMemory


@dataclass(frozen=True)
class CameraPicture:
    """A captured picture."""

    pixels: Pixels
    stamp_ns: int
    seq: int
    maker: CameraFrames

    def store(self, slot: memoryview) -> tuple[int, int]:
        """Write the pixels and the compressed picture, as configured."""
        first = second = 0
        if self.maker.raw:
            first = self.pixels.nbytes
            np.frombuffer(slot, np.uint8, first)[:] = self.pixels.reshape(-1)
        if self.maker.compression:
            packed = self.maker.compressed(self.pixels, self.seq)
            if len(packed) <= len(slot) - first:
                second = len(packed)
                slot[first:first + second] = packed
        return first, second

    def jpeg(self) -> bytes:
        """Return it as a JPEG; the stored one if it is a JPEG."""
        return self.maker.jpeg(self.seq, self.pixels)

    def levels(self) -> tuple[float, float]:
        """Return 0: a picture has no sound."""
        return 0.0, 0.0


class CameraFrames:
    """
    The pictures of a source in the configured size and encoding.

    :ivar overruns: 0, because a camera's Linux driver does not report dropped pictures.
    """

    def __init__(self, source: PictureSource, settings: Mapping[str, Any]) -> None:
        self.overruns = 0
        self._source = source
        self._settings = settings
        self._encoding = settings['encoding']
        self.raw = bool(settings['topic'])
        self.compression = settings['compression'] if settings['compressed_topic'] else ''
        self._last: tuple[int, bytes] = (-1, b'')
        observes = settings.get('observe_topic', '')
        if self.compression or observes:
            problem = lacking('compressing pictures', 'pillow')
            if problem:
                raise DeviceError(f'{problem}; or set compressed_topic and observe_topic to '
                                  'nothing')
            from PIL import Image
            self._image = Image

    def frames(self) -> Iterator[CameraPicture]:
        """Yield picture after picture."""
        settings = self._settings
        wanted = (settings['height'], settings['width'])
        seq = 0
        while True:
            grabbed = self._source.grab()
            if grabbed is None:
                if not settings['loop']:
                    raise DeviceError(f'{settings["port"]} is at its end: set loop: true to '
                                      'repeat it')
                self._source.rewind()
                continue
            pixels, stamp_ns = grabbed
            if pixels.shape[:2] != wanted:
                raise DeviceError(f'{settings["port"]} gives {pixels.shape[1]}x{pixels.shape[0]} '
                                  f'pixels, not {wanted[1]}x{wanted[0]}: set width and height, '
                                  'and the size in the calibration, to that size')
            yield CameraPicture(self._encoded(pixels), stamp_ns, seq, self)
            seq += 1

    def _encoded(self, pixels: Pixels) -> Pixels:
        if self._encoding == 'mono8':
            if pixels.ndim == 2:
                return pixels
            weights = np.array([29, 150, 77] if self._source.bgr else [77, 150, 29], np.uint16)
            grey: Pixels = (pixels.astype(np.uint16) @ weights >> 8).astype(np.uint8)
            return grey
        if pixels.ndim == 2:
            pixels = np.repeat(pixels[:, :, None], 3, axis=2)
        if self._source.bgr != (self._encoding == 'bgr8'):
            pixels = pixels[:, :, ::-1]
        return np.ascontiguousarray(pixels)

    def compressed(self, pixels: Pixels, seq: int) -> bytes:
        """Compress a picture for its topic; the last JPEG is kept for :meth:`jpeg`."""
        if self.compression == 'jpeg':
            return self.jpeg(seq, pixels)
        packed = io.BytesIO()
        self._image.fromarray(self._rgb(pixels)).save(packed, 'PNG', compress_level=1)
        return packed.getvalue()

    def jpeg(self, seq: int, pixels: Pixels) -> bytes:
        """Compress a picture to a JPEG, once."""
        if self._last[0] != seq:
            self._last = seq, self.packed(self._rgb(pixels), self._settings['quality'])
        return self._last[1]

    def _rgb(self, pixels: Pixels) -> Pixels:
        return np.ascontiguousarray(pixels[:, :, ::-1]) if self._encoding == 'bgr8' else pixels

    def packed(self, pixels: Pixels, quality: int) -> bytes:
        """Compress red, green, blue, or grey, to a JPEG; any thread may."""
        packed = io.BytesIO()
        self._image.fromarray(pixels).save(packed, 'JPEG', quality=quality)
        return packed.getvalue()

    def still(self) -> tuple[Pixels, int]:
        """
        Take a picture at full resolution, between two periodic ones.

        :return: red, green, blue, or grey; and its time.
        :raises DeviceError: it cannot.
        """
        settings = self._settings
        pixels, stamp_ns = self._source.still(settings['still_width'] or settings['width'],
                                              settings['still_height'] or settings['height'])
        if self._source.bgr and pixels.ndim == 3:
            pixels = np.ascontiguousarray(pixels[:, :, ::-1])
        return pixels, stamp_ns

    def close(self) -> None:
        """Close the source."""
        self._source.close()


def open_camera(settings: Mapping[str, Any], scene: SceneMemory | None = None) -> CameraFrames:
    """
    Open the source of a camera's settings.

    :param scene: the scene of a simulated camera.
    :raises DeviceError: it cannot be opened, or a library is missing.
    """
    return CameraFrames(open_source(settings, scene), settings)
