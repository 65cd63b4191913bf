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
What a camera's process captures: a pattern, a folder of pictures, or what OpenCV can open.

Pillow reads pictures and compresses them; OpenCV opens cameras, video files and streams. Both are
imported where they are needed: a robot without a camera needs neither.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from dataclasses import dataclass
import io
import itertools
import os
from pathlib import Path
import re
import stat
import time
from typing import Any
from typing import Final
from typing import Protocol

import numpy as np

from rt_robot_os.drivers.capture.pattern import Pattern
from rt_robot_os.drivers.capture.pattern import Pixels
from rt_robot_os.errors import DeviceError

NS_PER_S: Final = 1_000_000_000
CHANNELS: Final = {'rgb8': 3, 'bgr8': 3, 'mono8': 1}
COMPRESSIONS: Final = ('jpeg', 'png')
_SUFFIXES: Final = ('.bmp', '.jpeg', '.jpg', '.pgm', '.png', '.ppm', '.tif', '.tiff')
_NO_PILLOW: Final = 'Pillow is not installed: pip install pillow'
_NO_OPENCV: Final = ('OpenCV is not installed: pip install opencv-python-headless, or apt install '
                     'python3-opencv')


class PictureSource(Protocol):
    """
    Where pictures come from.

    :ivar bgr: its pictures are blue, green, red.
    """

    bgr: bool

    def grab(self) -> tuple[Pixels, int] | None:
        """
        Wait for the next picture.

        :return: it and its moment on CLOCK_MONOTONIC; None after the last one.
        :raises DeviceError: there is none any more, or it cannot be read.
        """

    def rewind(self) -> None:
        """Begin anew; only a source with an end is asked to."""

    def close(self) -> None:
        """Let go of it."""


class Grid:
    """The moments of a source that has no rate of its own."""

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = round(NS_PER_S / rate_hz)
        self._next_ns = time.monotonic_ns()

    def wait(self) -> int:
        """Wait for the next moment; those that are over are left out."""
        now_ns = time.monotonic_ns()
        late = max(0, now_ns - self._next_ns) // self._period_ns
        self._next_ns += late * self._period_ns
        time.sleep(max(0, self._next_ns - now_ns) / NS_PER_S)
        moment_ns = self._next_ns
        self._next_ns += self._period_ns
        return moment_ns


class SyntheticPictures:
    """The moving pattern."""

    bgr = False

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self._pattern = Pattern(settings['width'], settings['height'])
        self._grid = Grid(settings['output_rate_hz'])
        self._numbers = itertools.count()

    def grab(self) -> tuple[Pixels, int] | None:
        """Make the next picture at its moment."""
        moment_ns = self._grid.wait()
        return self._pattern.frame(next(self._numbers)), moment_ns

    def rewind(self) -> None:
        """Go on: it has no end."""

    def close(self) -> None:
        """Nothing is open."""


class PictureFolder:
    """The pictures of a folder in the order of their names, numbers in them counted as such."""

    bgr = False

    def __init__(self, settings: Mapping[str, Any]) -> None:
        try:
            from PIL import Image
        except ImportError as error:
            raise DeviceError(f'{settings["port"]}: {_NO_PILLOW}') from error
        self._open = Image.open
        folder = Path(settings['port'])
        try:
            found = [p for p in folder.iterdir() if p.suffix.lower() in _SUFFIXES]
        except OSError as error:
            raise DeviceError(f'{folder}: {error.strerror}: check its permissions') from error
        if not found:
            raise DeviceError(f'{folder} holds no pictures: it takes files that end with '
                              f'{", ".join(_SUFFIXES)}')
        self._paths = sorted(found, key=_natural)
        self._place = 0
        self._grid = Grid(settings['output_rate_hz'])

    def grab(self) -> tuple[Pixels, int] | None:
        """Read the next picture at its moment."""
        if self._place == len(self._paths):
            return None
        path = self._paths[self._place]
        self._place += 1
        try:
            with self._open(path) as picture:
                pixels = np.asarray(picture.convert('RGB'))
        except Exception as error:  # a corrupt file raises whatever its reader stumbles over
            raise DeviceError(f'{path} is no picture that can be read ({error}): mend it or take '
                              'it out of the folder') from error
        return pixels, self._grid.wait()

    def rewind(self) -> None:
        """Begin with the first picture."""
        self._place = 0

    def close(self) -> None:
        """Nothing stays open."""


def _natural(path: Path) -> list[tuple[int, str]]:
    return [(int(part), '') if part.isdigit() else (-1, part)
            for part in re.split(r'(\d+)', path.name) if part]


class OpenCvCapture:
    """A camera, a video file or a stream, by OpenCV."""

    bgr = True

    def __init__(self, settings: Mapping[str, Any]) -> None:
        port = settings['port']
        try:
            import cv2
        except ImportError as error:
            raise DeviceError(f'{port}: {_NO_OPENCV}') from error
        self._port = port
        self._live = is_camera(port)
        self._cv2 = cv2
        self._grid = None if self._live or '://' in port else Grid(settings['output_rate_hz'])
        self._capture = cv2.VideoCapture(port, cv2.CAP_V4L2 if self._live else cv2.CAP_ANY)
        if not self._capture.isOpened():
            raise DeviceError(f'{port} {_why_closed(self._live)}')
        if self._live:
            self._set_up(settings)
        self._any = False

    def _set_up(self, settings: Mapping[str, Any]) -> None:
        cv2, capture = self._cv2, self._capture
        if settings['pixel_format']:
            capture.set(cv2.CAP_PROP_FOURCC,
                        cv2.VideoWriter_fourcc(*settings['pixel_format'].ljust(4)[:4]))
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, settings['width'])
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, settings['height'])
        capture.set(cv2.CAP_PROP_FPS, settings['output_rate_hz'])
        # The newest picture, not one that waited.
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)

    def grab(self) -> tuple[Pixels, int] | None:
        """Wait for the next picture; its moment is when the driver had it."""
        good = self._capture.grab()
        moment_ns = time.monotonic_ns()
        picture = None
        if good:
            good, picture = self._capture.retrieve()
        if not good or picture is None:
            if not self._live and self._any:
                return None
            raise DeviceError(f'{self._port} {_why_nothing(self._live)}')
        self._any = True
        if self._grid is not None:
            moment_ns = self._grid.wait()
        return np.asarray(picture, np.uint8), moment_ns

    def rewind(self) -> None:
        """Begin with the first picture of the file."""
        self._capture.set(self._cv2.CAP_PROP_POS_FRAMES, 0)
        self._any = False

    def close(self) -> None:
        """Let go of the camera."""
        self._capture.release()


def is_camera(port: str) -> bool:
    """Say whether a path is a device and not a file."""
    try:
        return stat.S_ISCHR(os.stat(port).st_mode)
    except OSError:
        return False


def _why_closed(live: bool) -> str:
    if live:
        return ('cannot be opened for capture: another program has it (fuser -v shows which), or '
                'it is no capture device (v4l2-ctl --list-devices; a camera often has two)')
    return 'is no video that OpenCV can read: is it whole, and is its codec known (ffprobe)?'


def _why_nothing(live: bool) -> str:
    if live:
        return ('gives no picture: it was unplugged, another program has it, or it cannot do this '
                'size and rate (v4l2-ctl --list-formats-ext)')
    return 'holds no picture that OpenCV can read: is it whole?'


def open_source(settings: Mapping[str, Any]) -> PictureSource:
    """
    Open what the port names.

    :raises DeviceError: it cannot be opened.
    """
    port = settings['port']
    if port == 'synthetic':
        return SyntheticPictures(settings)
    if os.path.isdir(port):
        return PictureFolder(settings)
    return OpenCvCapture(settings)


@dataclass(frozen=True)
class Picture:
    """A picture that is wanted."""

    pixels: Pixels
    stamp_ns: int
    seq: int
    maker: CameraFrames

    def store(self, slot: memoryview) -> tuple[int, int]:
        """Write pixels and compressed picture, as far as they are wanted."""
        first = second = 0
        if self.maker.raw:
            first = self.pixels.nbytes
            np.frombuffer(slot, np.uint8, first)[:] = self.pixels.reshape(-1)
        if self.maker.compression:
            packed = self.maker.compressed(self.pixels)
            if len(packed) <= len(slot) - first:
                second = len(packed)
                slot[first:first + second] = packed
        return first, second

    def levels(self) -> tuple[float, float]:
        """Give nothing: it is silent."""
        return 0.0, 0.0


class CameraFrames:
    """
    The pictures of a source in the size and encoding that the settings say.

    :ivar overruns: 0; what a camera's driver drops it does not tell.
    """

    def __init__(self, source: PictureSource, settings: Mapping[str, Any]) -> None:
        self.overruns = 0
        self._source = source
        self._settings = settings
        self._encoding = settings['encoding']
        self.raw = bool(settings['topic'])
        self.compression = settings['compression'] if settings['compressed_topic'] else ''
        if self.compression:
            try:
                from PIL import Image
            except ImportError as error:
                raise DeviceError(f'{_NO_PILLOW}, or set compressed_topic to nothing') from error
            self._image = Image

    def frames(self) -> Iterator[Picture]:
        """Give picture after picture."""
        settings = self._settings
        wanted = (settings['height'], settings['width'])
        seq = 0
        while True:
            grabbed = self._source.grab()
            if grabbed is None:
                if not settings['loop']:
                    raise DeviceError(f'{settings["port"]} is at its end: set loop: true to begin '
                                      'anew')
                self._source.rewind()
                continue
            pixels, stamp_ns = grabbed
            if pixels.shape[:2] != wanted:
                raise DeviceError(f'{settings["port"]} gives {pixels.shape[1]}x{pixels.shape[0]} '
                                  f'pixels, not {wanted[1]}x{wanted[0]}: set width and height, '
                                  'and the size in the calibration, to what it gives')
            yield Picture(self._encoded(pixels), stamp_ns, seq, self)
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

    def compressed(self, pixels: Pixels) -> bytes:
        """Compress a picture."""
        packed = io.BytesIO()
        rgb = np.ascontiguousarray(pixels[:, :, ::-1]) if self._encoding == 'bgr8' else pixels
        options = ({'quality': self._settings['quality']} if self.compression == 'jpeg'
                   else {'compress_level': 1})
        self._image.fromarray(rgb).save(packed, self.compression.upper(), **options)
        return packed.getvalue()

    def close(self) -> None:
        """Let go of the source."""
        self._source.close()


def open_camera(settings: Mapping[str, Any]) -> CameraFrames:
    """
    Open what a camera's settings ask for.

    :raises DeviceError: it cannot be opened, or a library is missing.
    """
    return CameraFrames(open_source(settings), settings)
