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
Observations of a camera's process: the last seconds in a ring, stills, and clips.

The capture thread calls :meth:`Observations.add` with each picture and
:meth:`Observations.request` with each request. Compressing for a file, writing and ``fsync``
happen in a separate thread, so that capturing continues meanwhile.
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
from rt_robot_os.devices.capture.avi import AviFrame
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


class CapturedPicture(Protocol):
    """A picture of a camera."""

    @property
    def stamp_ns(self) -> int:
        """Return the time of its capture on CLOCK_MONOTONIC."""

    def jpeg(self) -> bytes:
        """Return it compressed."""


class StillCamera(Protocol):
    """A camera, used by the capture thread."""

    def still(self) -> tuple[Pixels, int]:
        """
        Take a picture at full resolution.

        :return: red, green, blue, or grey; and its time on CLOCK_MONOTONIC.
        :raises DeviceError: it cannot.
        """

    def packed(self, pixels: Pixels, quality: int) -> bytes:
        """Compress a picture of :meth:`still` to a JPEG."""


class ClipRing:
    """
    The pictures of the last seconds, within a limit of bytes; the oldest are dropped.

    :param seconds: how long a picture is kept.
    :param most_bytes: limit of the total size.
    :ivar dropped_early: pictures dropped because of the limit of bytes.
    """

    def __init__(self, seconds: float, most_bytes: int) -> None:
        self.dropped_early = 0
        self._keep_ns = round(seconds * NS_PER_S)
        self._most_bytes = most_bytes
        self._frames: deque[AviFrame] = deque()
        self._bytes = 0

    def add(self, frame: AviFrame) -> None:
        """Add the newest picture."""
        if self._keep_ns <= 0:
            return
        frames = self._frames
        frames.append(frame)
        self._bytes += len(frame.jpeg)
        while frames and frames[0].stamp_ns < frame.stamp_ns - self._keep_ns:
            self._bytes -= len(frames.popleft().jpeg)
        while self._bytes > self._most_bytes:
            self._bytes -= len(frames.popleft().jpeg)
            self.dropped_early += 1

    def since(self, from_ns: int) -> list[AviFrame]:
        """Return the pictures from a time on."""
        return [frame for frame in self._frames if frame.stamp_ns >= from_ns]


@dataclass
class _Clip:
    request: Mapping[str, Any]
    end_ns: int
    frames: list[AviFrame]
    size: int = field(init=False)

    def __post_init__(self) -> None:
        self.size = sum(len(frame.jpeg) for frame in self.frames)


class Observations:
    """
    Store requested pictures and clips.

    :param settings: of the camera.
    :param camera: takes stills.
    :param answer: called with the result of a request, from the writing thread or from the capture
        thread.
    """

    def __init__(self, settings: Mapping[str, Any], camera: StillCamera,
                 answer: Callable[[dict[str, Any]], object]) -> None:
        self._settings = settings
        self._camera = camera
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

    # ---- the capture thread -----------------------------------------------------------------

    def add(self, seen: CapturedPicture) -> None:
        """Add a picture to the ring, and to the clips in progress."""
        stamp_ns = seen.stamp_ns
        # A little early is accepted: pictures and clips have different rates.
        late_ns = stamp_ns - self._next_ns + self._period_ns // 4
        if late_ns >= 0 and (self._settings['clip_s'] > 0 or self._clips):
            grid_ns = self._next_ns if late_ns < self._period_ns else stamp_ns
            self._next_ns = grid_ns + self._period_ns
            frame = AviFrame(stamp_ns, seen.jpeg())
            self._ring.add(frame)
            for clip in self._clips:
                if clip.size + len(frame.jpeg) <= self._most_bytes and stamp_ns <= clip.end_ns:
                    clip.frames.append(frame)
                    clip.size += len(frame.jpeg)
        for clip in [each for each in self._clips if stamp_ns >= each.end_ns]:
            self._clips.remove(clip)
            self._wait(clip.request, functools.partial(self._write_clip, clip))

    def request(self, request: Mapping[str, Any], now_ns: int) -> None:
        """Execute a request, or start to: ``order``, ``alarm``, ``subject``, times in s."""
        if request.get('order') == PICTURE:
            try:
                pixels, stamp_ns = self._camera.still()
            except DeviceError as error:
                self._fail(request, str(error))
                return
            self._wait(request, functools.partial(self._write_still, request, pixels, stamp_ns))
        elif request.get('order') == CLIP:
            if len(self._clips) >= _CLIPS_MOST:
                self._fail(request, f'{_CLIPS_MOST} clips are being recorded already')
                return
            before_ns, after_ns = (round(request[key] * NS_PER_S)
                                   for key in ('before_s', 'after_s'))
            begun_ns = request.get('t_ns', now_ns)
            self._clips.append(_Clip(request, begun_ns + after_ns,
                                     self._ring.since(begun_ns - before_ns)))
        else:
            self._fail(request, f'unknown request {str(request.get("order"))[:20]!r}')

    def close(self) -> None:
        """End: clips in progress are written up to now; waits briefly for the disk."""
        for clip in self._clips:
            self._wait(clip.request, functools.partial(self._write_clip, clip))
        self._clips.clear()
        try:
            self._jobs.put_nowait(None)
        except queue.Full:
            return
        self._thread.join(2.0)

    def _wait(self, request: Mapping[str, Any], job: Callable[[], dict[str, Any]]) -> None:
        try:
            self._jobs.put_nowait((request, job))
        except queue.Full:
            self._fail(request, f'{_WAITING_MOST} files are waiting to be written already')

    def _fail(self, request: Mapping[str, Any], problem: str) -> None:
        self._answer({**_identity_of(request), 'problem': problem[:300]})

    # ---- the writing thread ------------------------------------------------------------------

    def _work(self) -> None:
        while (waiting := self._jobs.get()) is not None:
            request, job = waiting
            try:
                found = job()
            except (RtRobotError, ValueError) as error:
                self._fail(request, str(error))
            except Exception as error:  # an error of a library: the next request may succeed
                self._fail(request, f'{type(error).__name__}: {error}')
            else:
                self._answer({**_identity_of(request), **found})

    def _store(self, request: Mapping[str, Any], suffix: str, size: int, write: Any
               ) -> dict[str, Any]:
        if self._folder is None:
            settings = self._settings
            named = settings['observations_folder']
            self._folder = ObservationFolder(
                Path(named).expanduser() if named else observations_folder(),
                settings['observations_files'], round(settings['observations_mb'] * _MB))
        kept = self._folder.store(
            (str(request.get('subject', '')), str(request.get('alarm', '')),
             str(request['order'])),
            suffix, size, write)
        return {'file': str(kept.path), 'bytes': kept.bytes, 'deleted': kept.deleted}

    def _write_still(self, request: Mapping[str, Any], pixels: Pixels, stamp_ns: int
                     ) -> dict[str, Any]:
        packed = self._camera.packed(pixels, _STILL_QUALITY)
        found = self._store(request, '.jpg', len(packed), lambda file: file.write(packed))
        return {**found, 'width': pixels.shape[1], 'height': pixels.shape[0], 't_ns': stamp_ns}

    def _write_clip(self, clip: _Clip) -> dict[str, Any]:
        frames, settings = clip.frames, self._settings
        if not frames:
            raise DeviceError('no picture has arrived for the clip: check that the camera sends '
                              'pictures, and that clip_s is above 0')
        width, height = settings['width'], settings['height']
        rate_hz = min(settings['clip_rate_hz'], settings['output_rate_hz'])
        found = self._store(clip.request, '.avi', clip.size, lambda file: write_avi(
            file, frames, width, height, rate_hz))
        return {**found, 'width': width, 'height': height, 't_ns': frames[0].stamp_ns,
                'end_ns': frames[-1].stamp_ns, 'frames': len(frames),
                'crowded': self._ring.dropped_early}


def _identity_of(request: Mapping[str, Any]) -> dict[str, Any]:
    return {'id': request.get('id', 0), 'alarm': str(request.get('alarm', ''))[:64],
            'subject': str(request.get('subject', ''))[:64],
            'kind': str(request.get('order'))[:20]}
