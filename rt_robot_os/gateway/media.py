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
Sends pictures and files to the server, on the connection `/robot/media`.

Live pictures are sent while a page shows the camera, one at a time: the newest one follows when
the server has acknowledged the last. Files of alarms follow in parts with lower priority, and
resume after an interruption at the server's offset.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
import json
from pathlib import Path
import time
from typing import Any
from typing import Final

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.gateway.connection import ClientConnection
from rt_robot_os.gateway.connection import keep_alive
from rt_robot_os.gateway.file_sender import FileSender
from rt_robot_os.gateway.part import GatewayContext
from rt_robot_os.gateway.part import Greeting
from rt_robot_os.gateway.part import Part
from rt_robot_os.gateway.part import Record
from rt_robot_os.gateway.pictures import CameraReader
from rt_robot_os.gateway.reading import Reads
from rt_robot_os.gateway.reading import Sample
from rt_robot_os.gateway.robot_link import utc_of
from rt_robot_os.gateway.server_clock import ServerClock
from rt_robot_os.gateway.spool import Spool
from rt_robot_os.link.client import TopicInfo
from rt_robot_os.linux.folders import observations_folder
from rt_robot_os.messages.cdr import string_in
from rt_robot_os.messages.texts.coded import codes_of
from rt_robot_os.messages.uplink.frames import FRAME_BYTES
from rt_robot_os.messages.uplink.importance import Importance
from rt_robot_os.messages.uplink.kinds import MEDIA_DOWN
from rt_robot_os.messages.uplink.kinds import read
from rt_robot_os.messages.uplink.media import CameraTrouble
from rt_robot_os.messages.uplink.media import ClockReply
from rt_robot_os.messages.uplink.media import ClockRequest
from rt_robot_os.messages.uplink.media import FileProgress
from rt_robot_os.messages.uplink.media import FileRefusal
from rt_robot_os.messages.uplink.media import MediaHello
from rt_robot_os.messages.uplink.media import PictureFrame
from rt_robot_os.messages.uplink.media import PictureReceived
from rt_robot_os.messages.uplink.media import WantedCameras
from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.messages.uplink.tasks import end

PATH: Final = '/robot/media'
OBSERVED: Final = 'agent/observed'
_PICTURES: Final = 'sensor_msgs/msg/CompressedImage'
_IMAGE: Final = '/image_raw/compressed'
_ALIVE_S: Final = 1.0
_CLOCK_S: Final = 5.0
_LOOK_S: Final = 60.0
_WAITING_MOST: Final = 256
_MB: Final = 1_000_000


class Media(Part):
    """
    Pictures and files; see the module.

    :ivar pictures: sent pictures.
    :ivar too_long: pictures that do not fit into a frame.
    """

    def __init__(self, context: GatewayContext) -> None:
        super().__init__(context)
        settings = context.settings
        named = settings.observations_folder
        self.pictures = self.too_long = self._unheard = 0
        self._cameras: dict[str, str] = {}
        self._loop: asyncio.AbstractEventLoop | None = None
        self._wake = asyncio.Event()
        self._greet = asyncio.Event()
        self._troubles: dict[str, str] = {}
        self._trouble = asyncio.Event()
        self._told: deque[dict[str, Any]] = deque()
        self._new = asyncio.Event()
        self._spool = Spool(context.folder / 'media',
                            Path(named).expanduser() if named else observations_folder(),
                            round(settings.media_mb * _MB))
        self._files = FileSender(self._spool, context.tell)
        self._reader = CameraReader(context.robot.path, self._woken, context.tell, self._troubled)
        self._wanted: dict[str, float] = {}
        self._awaited: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        context.connect(PATH, self._talk)

    # ---- what the gateway calls --------------------------------------------------------------

    def reads(self) -> tuple[Reads, ...]:
        """Return the topic that announces files."""
        return (Reads(OBSERVED, self._observed, every=True),)

    def hello(self) -> Greeting:
        """Return the names of the cameras."""
        return Greeting(('camera',) if self._cameras else (), tuple(sorted(self._cameras)))

    def met_robot(self, topics: Mapping[str, TopicInfo]) -> None:
        """Find the cameras of the robot."""
        wanted = self.context.settings.cameras
        found = [name for name, info in topics.items()
                 if (name in wanted if wanted else info.type_name == _PICTURES)]
        self._cameras = {camera_name(topic): topic for topic in found}
        self._reader.found(self._cameras)
        self._call(self._greet.set)

    async def run(self) -> None:
        """Store files that are announced, until cancelled."""
        self._loop = asyncio.get_running_loop()
        try:
            for told in await asyncio.to_thread(list, self._spool.missed()):
                await self._keep(told)
            while True:
                while self._told:
                    await self._keep(self._told.popleft())
                await self._new.wait()
                self._new.clear()
        finally:
            self._reader.close()

    def statistics(self) -> Mapping[str, Any]:
        """Return its counters."""
        return {'pictures': self.pictures, 'pictures_skipped': self._reader.skipped,
                'pictures_odd': self._reader.odd + self.too_long,
                'files_sent': self._files.sent, 'files_waiting': len(self._spool.waiting()),
                'files_bytes': self._spool.count_bytes(), 'files_lost': self._spool.given_up,
                'files_odd': self._spool.odd + self._unheard}

    # ---- files -------------------------------------------------------------------------------

    def _observed(self, sample: Sample) -> None:
        """Receive the announcement of a file; in the link's thread."""
        told = json.loads(string_in(sample.cdr))
        if not isinstance(told, dict) or not told.get('file'):
            return
        if len(self._told) >= _WAITING_MOST:
            self._unheard += 1  # its file is found at the next start, by its name
            return
        stamp_ns = told.get('t_ns', sample.stamp_ns)
        if isinstance(stamp_ns, int):
            told['t_ns'] = utc_of(stamp_ns)
        self._told.append(told)
        self._call(self._new.set)

    def _call(self, call: Callable[[], object]) -> None:
        """Schedule a call in the loop, if there is one; from any thread."""
        loop = self._loop
        if loop is not None:
            with suppress(RuntimeError):  # it has ended
                loop.call_soon_threadsafe(call)

    async def _keep(self, told: Mapping[str, Any]) -> None:
        try:
            item = await asyncio.to_thread(self._spool.take, told)
        except RecordingError as error:
            self.context.tell(str(error))
            return
        if item is not None:
            self.context.keep(Record(Importance.MEDIA, 'media', item, item['t_ns']))
            self._files.wake()

    # ---- one connection ----------------------------------------------------------------------

    async def _talk(self, socket: ClientConnection) -> None:
        clock = ServerClock()
        self._awaited.clear()
        self._greet.set()
        self._files.begin()
        tasks = [asyncio.ensure_future(each) for each in (
            self._hear_all(socket, clock), self._say_hello(socket), self._ask(socket, clock),
            self._show(socket, clock), self._say_troubles(socket), self._files.run(socket.send),
            keep_alive(socket, _ALIVE_S, self.context.settings.silence_s))]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for each in done:
                each.result()
        finally:
            await end(tasks)
            self._want({})

    async def _say_hello(self, socket: ClientConnection) -> None:
        while True:
            await self._greet.wait()
            self._greet.clear()
            await socket.send(MediaHello(tuple(sorted(self._cameras))).to_json())

    async def _say_troubles(self, socket: ClientConnection) -> None:
        while True:
            await self._trouble.wait()
            self._trouble.clear()
            while self._troubles:
                camera, text = self._troubles.popitem()
                codes = codes_of({'text': text}, ('text',))
                await socket.send(CameraTrouble(camera, text, codes).to_json())

    async def _ask(self, socket: ClientConnection, clock: ServerClock) -> None:
        while True:
            await socket.send(ClockRequest(time.monotonic_ns()).to_json())
            # With few answers a single bad one has a large influence.
            await asyncio.sleep(_CLOCK_S if clock.answers > 3 else _CLOCK_S / 25)

    async def _hear_all(self, socket: ClientConnection, clock: ServerClock) -> None:
        async for packet in socket:
            with suppress(ValueError):
                self._receive(read(MEDIA_DOWN, decode(packet)), clock)

    def _receive(self, message: UplinkMessage | None, clock: ServerClock) -> None:
        if isinstance(message, PictureReceived):
            if self._awaited.get(message.camera) == message.n:
                del self._awaited[message.camera]
                self._wake.set()
        elif isinstance(message, WantedCameras):
            most = self.context.settings.camera_hz
            self._want({name: min(most, rate) for name, rate in message.cameras.items()})
        elif isinstance(message, ClockReply):
            clock.heard(message.t, message.utc_ns, time.monotonic_ns())
        elif isinstance(message, (FileProgress, FileRefusal)):
            self._files.receive(message)

    # ---- pictures ----------------------------------------------------------------------------

    def _want(self, rates: Mapping[str, float]) -> None:
        self._wanted = {name: rate for name, rate in rates.items() if rate > 0}
        self._reader.want(self._wanted)

    def _troubled(self, camera: str, why: str) -> None:
        """Store why a camera has no pictures; in the thread that reads cameras."""
        self._call(partial(self._note_trouble, camera, why))

    def _note_trouble(self, camera: str, why: str) -> None:
        self._troubles[camera] = why
        self._trouble.set()

    def _woken(self) -> None:
        """Notify that there is a picture; in the thread that reads cameras."""
        self._call(self._wake.set)

    async def _show(self, socket: ClientConnection, clock: ServerClock) -> None:
        while True:
            await self._wake.wait()
            self._wake.clear()
            for name in list(self._wanted):
                if name not in self._awaited:
                    await self._show_one(socket, clock, name)

    async def _show_one(self, socket: ClientConnection, clock: ServerClock, name: str) -> None:
        seen = self._reader.take(name)
        if seen is None:
            return
        if len(seen.jpeg) > FRAME_BYTES - 1024:
            self.too_long += 1
            return
        n = self._counts[name] = self._counts.get(name, 0) + 1
        self._awaited[name] = n
        now_ns = time.monotonic_ns()
        await socket.send(PictureFrame(
            name, n, seen.jpeg, time.time_ns() - (now_ns - seen.stamp_ns),
            max(0, now_ns - seen.stamp_ns), clock.server_ns(seen.stamp_ns)).to_bytes())
        self.pictures += 1


def camera_name(topic: str) -> str:
    """Return the name of a camera: ``camera`` of camera/image_raw/compressed."""
    return topic.removesuffix(_IMAGE).removesuffix('/compressed') or topic
