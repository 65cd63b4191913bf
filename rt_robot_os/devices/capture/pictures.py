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
Where pictures come from: a pattern, a folder, or what OpenCV can open.

Pillow reads pictures; OpenCV opens cameras, video files and streams. Both are imported where they
are needed: a robot without a camera needs neither.
"""

from __future__ import annotations

from collections.abc import Mapping
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

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.needs import require
from rt_robot_os.devices.capture.pattern import Pattern
from rt_robot_os.devices.capture.pattern import Pixels
from rt_robot_os.devices.capture.scene_memory import SceneMemory

NS_PER_S: Final = 1_000_000_000
# Pictures until a camera that was switched over shows what it is to.
_SETTLING: Final = 4
_SUFFIXES: Final = ('.bmp', '.jpeg', '.jpg', '.pgm', '.png', '.ppm', '.tif', '.tiff')


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

    def still(self, width: int, height: int) -> tuple[Pixels, int]:
        """
        Take one picture of another size, or the nearest that there is, and go on as before.

        :raises DeviceError: there is none.
        """

    def rewind(self) -> None:
        """Begin anew; only a source with an end is asked to."""

    def close(self) -> None:
        """Close it."""


class FrameTimer:
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
        self._timer = FrameTimer(settings['output_rate_hz'])
        self._numbers = itertools.count()

    def grab(self) -> tuple[Pixels, int] | None:
        """Make the next picture at its moment."""
        moment_ns = self._timer.wait()
        return self._pattern.frame(next(self._numbers)), moment_ns

    def still(self, width: int, height: int) -> tuple[Pixels, int]:
        """Make the pattern in that size."""
        return Pattern(width, height).frame(next(self._numbers)), time.monotonic_ns()

    def rewind(self) -> None:
        """Go on: it has no end."""

    def close(self) -> None:
        """Nothing is open."""


class RoomPictures:
    """The room of the simulated world."""

    bgr = False

    def __init__(self, settings: Mapping[str, Any], scene: SceneMemory) -> None:
        # Late: a real camera needs neither.
        from rt_robot_os.devices.camera.camera_info import load_calibration
        from rt_robot_os.devices.camera.camera_info import uncalibrated
        from rt_robot_os.devices.capture.room_view import RoomView
        width, height, url = settings['width'], settings['height'], settings['camera_info']
        calibration = (load_calibration(url, width, height) if url else
                       uncalibrated(width, height))
        self._make = RoomView
        self._size, self._k = (width, height), calibration.k
        self._view = RoomView(width, height, calibration.k)
        self._scene = scene
        self._timer = FrameTimer(settings['output_rate_hz'])

    def grab(self) -> tuple[Pixels, int] | None:
        """Draw what is before the camera at its moment."""
        moment_ns = self._timer.wait()
        return self._view.picture(self._shown()), moment_ns

    def still(self, width: int, height: int) -> tuple[Pixels, int]:
        """Draw it in that size, with the same field of view."""
        across, down = width / self._size[0], height / self._size[1]
        k = [*self._k]
        for place, scale in ((0, across), (2, across), (4, down), (5, down)):
            k[place] *= scale
        view = self._make(width, height, tuple(k), fine=True)
        return view.picture(self._shown()), time.monotonic_ns()

    def _shown(self) -> Mapping[str, Any]:
        scene = self._scene.read()
        if scene is None:
            raise DeviceError('the simulated world has not shown itself: start the robot anew')
        return scene

    def rewind(self) -> None:
        """Go on: it has no end."""

    def close(self) -> None:
        """Nothing is open."""


class PictureFolder:
    """The pictures of a folder in the order of their names, numbers in them counted as such."""

    bgr = False

    def __init__(self, settings: Mapping[str, Any]) -> None:
        require(f'{settings["port"]}: a folder of pictures', 'pillow', error=DeviceError)
        from PIL import Image
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
        self._timer = FrameTimer(settings['output_rate_hz'])

    def grab(self) -> tuple[Pixels, int] | None:
        """Read the next picture at its moment."""
        if self._place == len(self._paths):
            return None
        path = self._paths[self._place]
        self._place += 1
        return self._read(path), self._timer.wait()

    def still(self, width: int, height: int) -> tuple[Pixels, int]:
        """Read the last picture once more: it has the size that it has."""
        return self._read(self._paths[max(0, self._place - 1)]), time.monotonic_ns()

    def _read(self, path: Path) -> Pixels:
        try:
            with self._open(path) as picture:
                return np.asarray(picture.convert('RGB'))
        except Exception as error:  # a corrupt file raises whatever its reader stumbles over
            raise DeviceError(f'{path} is no picture that can be read ({error}): mend it or take '
                              'it out of the folder') from error

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
        require(f'{port}: this picture source', 'opencv-python-headless', error=DeviceError)
        try:
            import cv2
        except ImportError as error:  # a library of the system that it needs
            raise DeviceError(f'{port}: OpenCV cannot be imported: {error}') from error
        self._port = port
        self._settings = settings
        self._last: Pixels | None = None
        self._live = is_camera(port)
        self._cv2 = cv2
        self._timer = None if self._live or '://' in port else FrameTimer(
            settings['output_rate_hz'])
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
        if self._timer is not None:
            moment_ns = self._timer.wait()
        self._last = np.asarray(picture, np.uint8)
        return self._last, moment_ns

    def still(self, width: int, height: int) -> tuple[Pixels, int]:
        """
        Take a picture of another size: a camera is switched over for it and back, others are not.

        A camera that cannot gives the size that it can; one that then gives nothing is opened anew
        by whoever finds that out.
        """
        if not self._live or (width, height) == (self._settings['width'],
                                                 self._settings['height']):
            if self._last is None:
                self.grab()
            if self._last is None:
                raise DeviceError(f'{self._port} {_why_nothing(self._live)}')
            return self._last, time.monotonic_ns()
        self._resize(width, height)
        try:
            for _ in range(_SETTLING):  # the first ones are dark, or of the old size
                good, picture = self._capture.read()
                moment_ns = time.monotonic_ns()
            if not good or picture is None:
                raise DeviceError(f'{self._port} gives no picture of {width}x{height}: set '
                                  'still_width and still_height to what it can do '
                                  '(v4l2-ctl --list-formats-ext)')
            return np.asarray(picture, np.uint8), moment_ns
        finally:
            usual = self._settings['width'], self._settings['height']
            self._resize(*usual)
            for _ in range(_SETTLING):
                good, picture = self._capture.read()
                if good and picture is not None and picture.shape[1::-1] == usual:
                    break

    def _resize(self, width: int, height: int) -> None:
        self._capture.set(self._cv2.CAP_PROP_FRAME_WIDTH, width)
        self._capture.set(self._cv2.CAP_PROP_FRAME_HEIGHT, height)

    def rewind(self) -> None:
        """Begin with the first picture of the file."""
        self._capture.set(self._cv2.CAP_PROP_POS_FRAMES, 0)
        self._any = False

    def close(self) -> None:
        """Close the camera."""
        self._capture.release()


def is_camera(port: str) -> bool:
    """Return whether a path is a device and not a file."""
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


def open_source(settings: Mapping[str, Any], scene: SceneMemory | None = None) -> PictureSource:
    """
    Open what the port names.

    :param scene: what a simulated camera is before.
    :raises DeviceError: it cannot be opened.
    """
    port = settings['port']
    if port == 'synthetic':
        return SyntheticPictures(settings) if scene is None else RoomPictures(settings, scene)
    if os.path.isdir(port):
        return PictureFolder(settings)
    return OpenCvCapture(settings)
