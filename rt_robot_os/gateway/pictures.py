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
The newest picture of each camera, from the core: read only while a page shows it.

They have a separate connection and thread, so that a picture never delays an alarm. While no page
shows a camera there is no connection, and no work for the core.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from pathlib import Path
import threading
import time
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link import LinkClient
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.reconnecting_client import ReconnectingClient
from rt_robot_os.messages.cdr import CdrReader

_LOOK_S: Final = 0.1
#: Time without a picture after which the device is asked for the reason.
_TROUBLE_S: Final = 2.0
_JPEG: Final = b'\xff\xd8\xff'


class CameraPicture(NamedTuple):
    """
    A picture.

    :ivar stamp_ns: its capture, on CLOCK_MONOTONIC.
    """

    stamp_ns: int
    jpeg: bytes


def jpeg_in(cdr: bytes | memoryview) -> bytes:
    """
    Return the picture in a ``sensor_msgs/msg/CompressedImage``.

    :raises ValueError: there is none, or it is not a JPEG.
    """
    reader = CdrReader(bytes(cdr))
    reader.skip(4, 8)  # the stamp
    reader.text()
    reader.text()
    length = reader.count()
    start = reader.skip(1, length)
    found = bytes(cdr[start:start + length])
    if found[:3] != _JPEG:
        raise ValueError('no JPEG: set compression of the camera to jpeg')
    return found


class CameraReader:
    """
    Read the requested cameras.

    :param path: of the core's socket.
    :param wake: called by the reading thread when there is a picture.
    :param tell: takes lines for people.
    :param trouble: takes, by the thread that reads, why a camera gives no picture: its name, and
        what its device says; an empty text when there are pictures again.
    :ivar skipped: pictures that a newer one replaced.
    :ivar odd: samples that were not pictures.
    """

    def __init__(self, path: Path, wake: Callable[[], None], tell: Callable[[str], None],
                 trouble: Callable[[str, str], None] = lambda name, why: None) -> None:
        self.skipped = self.odd = 0
        self._topics: Mapping[str, str] = {}
        self._wake = wake
        self._tell = tell
        self._told: set[str] = set()
        self._trouble = trouble
        self._troubles: dict[str, str] = {}
        self._seen_s: dict[str, float] = {}
        self._asked_s = 0.0
        self._client = ReconnectingClient(path, 'gateway cameras', self._connected, tell)
        self._changed = threading.Event()
        self._closing = False
        self._wanted: Mapping[str, float] = {}
        self._mirrored: dict[str, tuple[str, int, float]] = {}
        self._newest: dict[str, CameraPicture] = {}
        self._thread = threading.Thread(target=self._run, name='cameras', daemon=True)
        self._thread.start()

    def found(self, topics: Mapping[str, str]) -> None:
        """Set the topics of compressed pictures, by camera name; thread-safe."""
        self._topics = dict(topics)
        self._changed.set()

    def want(self, rates: Mapping[str, float]) -> None:
        """Read these cameras from now on, at these rates; thread-safe."""
        self._wanted = dict(rates)
        for name in [name for name in list(self._newest) if name not in self._wanted]:
            self._newest.pop(name, None)
        for name in [name for name in list(self._seen_s) if name not in self._wanted]:
            self._seen_s.pop(name, None)
        for name in [name for name in list(self._troubles) if name not in self._wanted]:
            self._troubles.pop(name, None)  # it is reported again to the next viewer
        self._changed.set()

    def take(self, name: str) -> CameraPicture | None:
        """Return the newest picture that was not returned before; thread-safe."""
        return self._newest.pop(name, None)

    def close(self) -> None:
        """End; may be called twice."""
        self._closing = True
        self._changed.set()
        self._thread.join(5.0)

    # ---- the thread that reads ---------------------------------------------------------------

    def _run(self) -> None:
        while not self._closing:
            if not self._wanted:
                self._client.close()
                self._mirrored = {}
                self._changed.wait()
            self._changed.clear()
            while self._wanted and not self._changed.is_set():
                self._client.pump(_LOOK_S)
                self._look_for_trouble()
            if self._wanted and self._client.client is not None:
                try:
                    self._mirror(self._client.client)
                except LinkError:
                    self._client.close()
        self._client.close()

    def _connected(self, client: LinkClient) -> None:
        self._mirrored = {}
        self._troubles.clear()
        client.on_data = self._take
        self._mirror(client)

    def _mirror(self, client: LinkClient) -> None:
        wanted = dict(self._wanted)
        for name in [name for name in self._mirrored if name not in wanted]:
            client.request('unmirror', topic=self._mirrored.pop(name)[0])
        for name, rate_hz in wanted.items():
            topic = self._topics.get(name, '')
            if topic not in client.topics:
                self._say(f'camera {name}: the robot has no topic of it with compressed '
                          'pictures: set compressed_topic of the camera')
            elif self._mirrored.get(name, ('', 0, 0.0))[2] != rate_hz:
                channel = client.mirror(topic, 'latest', rate_hz)
                self._mirrored[name] = topic, channel, rate_hz

    def _take(self, head: Header, cdr: memoryview) -> None:
        for name, (_, channel, _) in self._mirrored.items():
            if channel == head.channel:
                try:
                    found = CameraPicture(head.stamp_ns, jpeg_in(cdr))
                except ValueError as error:
                    self.odd += 1
                    self._say(f'camera {name}: {error}')
                    return
                self.skipped += name in self._newest
                self._newest[name] = found
                self._seen_s[name] = time.monotonic()
                self._wake()
                return

    def _look_for_trouble(self) -> None:
        """Ask the core periodically why cameras have no pictures."""
        now_s, client = time.monotonic(), self._client.client
        if client is None or now_s - self._asked_s < _TROUBLE_S:
            return
        self._asked_s = now_s
        wanted = list(self._wanted)
        late = [name for name in wanted
                if now_s - self._seen_s.get(name, -_TROUBLE_S) >= _TROUBLE_S]
        try:
            reasons = {str(each.get('name')): str(each.get('reason') or '')
                       for each in client.statistics().devices} if late else {}
        except LinkError:
            return  # busy; it is asked again
        for name in wanted:
            why = reasons.get(name.partition('/')[0], '') if name in late else ''
            if why != self._troubles.get(name, ''):
                self._troubles[name] = why
                self._trouble(name, why)

    def _say(self, line: str) -> None:
        if line not in self._told:
            self._told.add(line)
            self._tell(line)
