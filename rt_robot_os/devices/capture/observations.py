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
What a camera's process keeps of what it sees: the last seconds in a ring, stills, and clips.

The process that captures calls :meth:`Observations.take` with each picture and
:meth:`Observations.order` with each order. Compressing for a file, writing and ``fsync`` happen in
a thread of their own, so that the pictures go on meanwhile.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
import functools
from pathlib import Path
import queue
import threading
from typing import Any
from typing import Final
from typing import Protocol

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.capture.avi import Frame
from rt_robot_os.devices.capture.avi import write_avi
from rt_robot_os.devices.capture.observation_folder import ObservationFolder
from rt_robot_os.devices.capture.pattern import Pixels
from rt_robot_os.linux.folders import observations_folder

PICTURE: Final = 'picture'
CLIP: Final = 'clip'

_WAITING_MOST: Final = 8
_CLIPS_MOST: Final = 4
_STILL_QUALITY: Final = 92
_MB: Final = 1_000_000


class Seen(Protocol):
    """A picture that a camera has given."""

    @property
    def stamp_ns(self) -> int:
        """Return the moment of its capture on CLOCK_MONOTONIC."""

    def jpeg(self) -> bytes:
        """Return it compressed."""


class Eye(Protocol):
    """A camera, from the thread that captures."""

    def still(self) -> tuple[Pixels, int]:
        """
        Take a picture at full resolution.

        :return: red, green, blue, or grey; and its moment on CLOCK_MONOTONIC.
        :raises DeviceError: it cannot.
        """

    def packed(self, pixels: Pixels, quality: int) -> bytes:
        """Compress a picture of :meth:`still` to a JPEG."""


class ClipRing:
    """
    The pictures of the last seconds; what is too old, or too much, goes.

    :param seconds: as many are kept.
    :param most_bytes: and no more than this.
    :ivar crowded: pictures that went early, for want of bytes.
    """

    def __init__(self, seconds: float, most_bytes: int) -> None:
        self.crowded = 0
        self._keep_ns = round(seconds * NS_PER_S)
        self._most_bytes = most_bytes
        self._frames: deque[Frame] = deque()
        self._bytes = 0

    def add(self, frame: Frame) -> None:
        """Take a picture, the newest."""
        if self._keep_ns <= 0:
            return
        frames = self._frames
        frames.append(frame)
        self._bytes += len(frame.jpeg)
        while frames and frames[0].stamp_ns < frame.stamp_ns - self._keep_ns:
            self._bytes -= len(frames.popleft().jpeg)
        while self._bytes > self._most_bytes:
            self._bytes -= len(frames.popleft().jpeg)
            self.crowded += 1

    def since(self, from_ns: int) -> list[Frame]:
        """Return the pictures from a moment on."""
        return [frame for frame in self._frames if frame.stamp_ns >= from_ns]


@dataclass
class _Clip:
    order: Mapping[str, Any]
    end_ns: int
    frames: list[Frame]
    size: int = field(init=False)

    def __post_init__(self) -> None:
        self.size = sum(len(frame.jpeg) for frame in self.frames)


class Observations:
    """
    Keep what is ordered.

    :param settings: of the camera.
    :param eye: takes stills.
    :param answer: is called, from the thread that writes or from the one that captures, with what
        has become of an order.
    """

    def __init__(self, settings: Mapping[str, Any], eye: Eye,
                 answer: Callable[[dict[str, Any]], object]) -> None:
        self._settings = settings
        self._eye = eye
        self._answer = answer
        self._most_bytes = round(settings['clip_mb'] * _MB)
        self._ring = ClipRing(settings['clip_s'], self._most_bytes)
        self._period_ns = round(NS_PER_S / settings['clip_rate_hz'])
        self._next_ns = 0
        self._clips: list[_Clip] = []
        self._jobs: queue.Queue[tuple[Mapping[str, Any], Callable[[], dict[str, Any]]] | None]
        self._jobs = queue.Queue(_WAITING_MOST)
        self._folder: ObservationFolder | None = None
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    # ---- the thread that captures ------------------------------------------------------------

    def take(self, seen: Seen) -> None:
        """Take a picture for the ring, and for the clips that go on."""
        stamp_ns = seen.stamp_ns
        # A little early is in time: pictures and clips have rates of their own.
        late_ns = stamp_ns - self._next_ns + self._period_ns // 4
        if late_ns >= 0 and (self._settings['clip_s'] > 0 or self._clips):
            grid_ns = self._next_ns if late_ns < self._period_ns else stamp_ns
            self._next_ns = grid_ns + self._period_ns
            frame = Frame(stamp_ns, seen.jpeg())
            self._ring.add(frame)
            for clip in self._clips:
                if clip.size + len(frame.jpeg) <= self._most_bytes and stamp_ns <= clip.end_ns:
                    clip.frames.append(frame)
                    clip.size += len(frame.jpeg)
        for clip in [each for each in self._clips if stamp_ns >= each.end_ns]:
            self._clips.remove(clip)
            self._wait(clip.order, functools.partial(self._write_clip, clip))

    def order(self, order: Mapping[str, Any], now_ns: int) -> None:
        """Carry an order out, or begin to: ``order``, ``alarm``, ``subject``, times in s."""
        if order.get('order') == PICTURE:
            try:
                pixels, stamp_ns = self._eye.still()
            except DeviceError as error:
                self._fail(order, str(error))
                return
            self._wait(order, functools.partial(self._write_still, order, pixels, stamp_ns))
        elif order.get('order') == CLIP:
            if len(self._clips) >= _CLIPS_MOST:
                self._fail(order, f'{_CLIPS_MOST} clips are being taken already')
                return
            before_ns, after_ns = (round(order[key] * NS_PER_S) for key in ('before_s', 'after_s'))
            begun_ns = order.get('t_ns', now_ns)
            self._clips.append(_Clip(order, begun_ns + after_ns,
                                     self._ring.since(begun_ns - before_ns)))
        else:
            self._fail(order, f'nobody knows the order {str(order.get("order"))[:20]!r}')

    def close(self) -> None:
        """End: clips that go on are written as they are; waits a little for the disk."""
        for clip in self._clips:
            self._wait(clip.order, functools.partial(self._write_clip, clip))
        self._clips.clear()
        try:
            self._jobs.put_nowait(None)
        except queue.Full:
            return
        self._thread.join(2.0)

    def _wait(self, order: Mapping[str, Any], job: Callable[[], dict[str, Any]]) -> None:
        try:
            self._jobs.put_nowait((order, job))
        except queue.Full:
            self._fail(order, f'{_WAITING_MOST} files wait for the disk already')

    def _fail(self, order: Mapping[str, Any], problem: str) -> None:
        self._answer({**_told_of(order), 'problem': problem[:300]})

    # ---- the thread that writes --------------------------------------------------------------

    def _work(self) -> None:
        while (waiting := self._jobs.get()) is not None:
            order, job = waiting
            try:
                found = job()
            except (RtRobotError, ValueError) as error:
                self._fail(order, str(error))
            except Exception as error:  # of a library: the next order may fare better
                self._fail(order, f'{type(error).__name__}: {error}')
            else:
                self._answer({**_told_of(order), **found})

    def _keep(self, order: Mapping[str, Any], suffix: str, size: int, write: Any
              ) -> dict[str, Any]:
        if self._folder is None:
            settings = self._settings
            named = settings['observations_folder']
            self._folder = ObservationFolder(
                Path(named).expanduser() if named else observations_folder(),
                settings['observations_files'], round(settings['observations_mb'] * _MB))
        kept = self._folder.keep(
            (str(order.get('subject', '')), str(order.get('alarm', '')), str(order['order'])),
            suffix, size, write)
        return {'file': str(kept.path), 'bytes': kept.bytes, 'deleted': kept.deleted}

    def _write_still(self, order: Mapping[str, Any], pixels: Pixels, stamp_ns: int
                     ) -> dict[str, Any]:
        packed = self._eye.packed(pixels, _STILL_QUALITY)
        found = self._keep(order, '.jpg', len(packed), lambda file: file.write(packed))
        return {**found, 'width': pixels.shape[1], 'height': pixels.shape[0], 't_ns': stamp_ns}

    def _write_clip(self, clip: _Clip) -> dict[str, Any]:
        frames, settings = clip.frames, self._settings
        if not frames:
            raise DeviceError('no picture has come for the clip: look whether the camera gives '
                              'any, and whether clip_s is above 0')
        width, height = settings['width'], settings['height']
        rate_hz = min(settings['clip_rate_hz'], settings['output_rate_hz'])
        found = self._keep(clip.order, '.avi', clip.size, lambda file: write_avi(
            file, frames, width, height, rate_hz))
        return {**found, 'width': width, 'height': height, 't_ns': frames[0].stamp_ns,
                'end_ns': frames[-1].stamp_ns, 'frames': len(frames),
                'crowded': self._ring.crowded}


def _told_of(order: Mapping[str, Any]) -> dict[str, Any]:
    return {'id': order.get('id', 0), 'alarm': str(order.get('alarm', ''))[:64],
            'subject': str(order.get('subject', ''))[:64], 'kind': str(order.get('order'))[:20]}
