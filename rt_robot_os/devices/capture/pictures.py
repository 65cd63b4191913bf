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
Sources of pictures: a pattern, a folder, or a source of OpenCV.

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
# Pictures until a camera has changed its resolution.
_SETTLING: Final = 4
_SUFFIXES: Final = ('.bmp', '.jpeg', '.jpg', '.pgm', '.png', '.ppm', '.tif', '.tiff')


class PictureSource(Protocol):
    """
    A source of pictures.

    :ivar bgr: its pictures are blue, green, red.
    """

    bgr: bool

    def grab(self) -> tuple[Pixels, int] | None:
        """
        Wait for the next picture.

        :return: it and its time on CLOCK_MONOTONIC; None after the last one.
        :raises DeviceError: no more picture arrives, or one cannot be read.
        """

    def still(self, width: int, height: int) -> tuple[Pixels, int]:
        """
        Take one picture of another size, or of the nearest possible one, and continue as before.

        :raises DeviceError: no picture arrives.
        """

    def rewind(self) -> None:
        """Restart; called only for a source with an end."""

    def close(self) -> None:
        """Close it."""


class FrameTimer:
    """The periodic times of a source without a rate of its own."""

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = round(NS_PER_S / rate_hz)
        self._next_ns = time.monotonic_ns()

    def wait(self) -> int:
        """Wait for the next time; missed ones are skipped."""
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
        """Return the next picture at its time."""
        moment_ns = self._timer.wait()
        return self._pattern.frame(next(self._numbers)), moment_ns

    def still(self, width: int, height: int) -> tuple[Pixels, int]:
        """Return the pattern in that size."""
        return Pattern(width, height).frame(next(self._numbers)), time.monotonic_ns()

    def rewind(self) -> None:
        """Do nothing: it has no end."""

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
        """Draw the view of the camera at its time."""
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
            raise DeviceError('the simulator has written no scene: restart the robot')
        return scene

    def rewind(self) -> None:
        """Do nothing: it has no end."""

    def close(self) -> None:
        """Nothing is open."""


class PictureFolder:
    """The pictures of a folder in the order of their names, with numbers in numerical order."""

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
            raise DeviceError(f'{folder} contains no pictures: their names must end with '
                              f'{", ".join(_SUFFIXES)}')
        self._paths = sorted(found, key=_natural)
        self._place = 0
        self._timer = FrameTimer(settings['output_rate_hz'])

    def grab(self) -> tuple[Pixels, int] | None:
        """Read the next picture at its time."""
        if self._place == len(self._paths):
            return None
        path = self._paths[self._place]
        self._place += 1
        return self._read(path), self._timer.wait()

    def still(self, width: int, height: int) -> tuple[Pixels, int]:
        """Read the last picture once more, in its own size."""
        return self._read(self._paths[max(0, self._place - 1)]), time.monotonic_ns()

    def _read(self, path: Path) -> Pixels:
        try:
            with self._open(path) as picture:
                return np.asarray(picture.convert('RGB'))
        except Exception as error:  # the reader may raise anything for a corrupt file
            raise DeviceError(f'{path} is not a readable picture ({error}): repair it or remove '
                              'it from the folder') from error

    def rewind(self) -> None:
        """Restart with the first picture."""
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
        except ImportError as error:  # a missing library of the system
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
        # The newest picture, not a buffered one.
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)

    def grab(self) -> tuple[Pixels, int] | None:
        """Wait for the next picture; its time is when the Linux driver had it."""
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
        Take a picture of another size, for which a camera changes its resolution and back.

        A camera that does not support it uses another size; one that then sends nothing is
        reopened after its timeout.
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
                raise DeviceError(f'{self._port} sends no picture of {width}x{height}: set '
                                  'still_width and still_height to a supported size (v4l2-ctl '
                                  '--list-formats-ext)')
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
        """Restart with the first picture of the file."""
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
        return ('cannot be opened for capture: another program uses it (fuser -v shows which), or '
                'it is not a capture device (v4l2-ctl --list-devices; a camera often has two)')
    return ('is not a video that OpenCV can read: is it complete, and is its codec supported '
            '(ffprobe)?')


def _why_nothing(live: bool) -> str:
    if live:
        return ('sends no picture: it was unplugged, another program uses it, or it does not '
                'support this size and rate (v4l2-ctl --list-formats-ext)')
    return 'contains no picture that OpenCV can read: is it complete?'


def open_source(settings: Mapping[str, Any], scene: SceneMemory | None = None) -> PictureSource:
    """
    Open the source that the port names.

    :param scene: the scene of a simulated camera.
    :raises DeviceError: it cannot be opened.
    """
    port = settings['port']
    if port == 'synthetic':
        return SyntheticPictures(settings) if scene is None else RoomPictures(settings, scene)
    if os.path.isdir(port):
        return PictureFolder(settings)
    return OpenCvCapture(settings)
