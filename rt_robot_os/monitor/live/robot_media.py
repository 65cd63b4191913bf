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
The messages of a robot on its second connection, `/robot/media`: pictures, and files in parts.

A picture is acknowledged on arrival: the robot has one in flight, and then sends the newest one.
Files come in parts, each acknowledged with the received length, so that both sides know where to
resume after an interruption.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from collections.abc import Callable
import time
from typing import Final

from rt_robot_os.messages.uplink.frames import encode_frame
from rt_robot_os.messages.uplink.frames import UplinkFrame
from rt_robot_os.messages.uplink.kinds import MEDIA_UP
from rt_robot_os.messages.uplink.kinds import read
from rt_robot_os.messages.uplink.kinds import read_frame
from rt_robot_os.messages.uplink.media import CameraTrouble
from rt_robot_os.messages.uplink.media import ClockReply
from rt_robot_os.messages.uplink.media import ClockRequest
from rt_robot_os.messages.uplink.media import FileOffer
from rt_robot_os.messages.uplink.media import FilePart
from rt_robot_os.messages.uplink.media import FileProgress
from rt_robot_os.messages.uplink.media import FileRefusal
from rt_robot_os.messages.uplink.media import MediaHello
from rt_robot_os.messages.uplink.media import PictureFrame
from rt_robot_os.messages.uplink.media import PictureReceived
from rt_robot_os.messages.uplink.media import WantedCameras
from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.monitor.live.memory_use import memory_of
from rt_robot_os.monitor.live.pictures import Gallery
from rt_robot_os.monitor.live.pictures import ViewedPicture
from rt_robot_os.monitor.media_store import FileRefused
from rt_robot_os.monitor.media_store import MediaStore
from rt_robot_os.monitor.media_store import Offered

Send = Callable[[str], Awaitable[None]]
_OFFERS_MOST: Final = 4
#: Largest size of the codes for missing pictures of a camera.
_CODES_BYTES: Final = 4000
_AGE_MOST_NS: Final = 600 * 1_000_000_000


class RobotMedia:
    """
    One connection of a robot.

    :param robot: its id.
    :param send: sends the robot a text message.
    :ivar cameras: the cameras that it has announced.
    :ivar odd: messages that were malformed or unknown.
    """

    def __init__(self, robot: str, gallery: Gallery, files: MediaStore, send: Send) -> None:
        self.robot = robot
        self.cameras: tuple[str, ...] = ()
        self.odd = 0
        self._gallery = gallery
        self._files = files
        self._send = send
        self._offers: dict[str, Offered] = {}
        self._wanted: dict[str, float] | None = None
        self._want = asyncio.Event()

    async def take(self, message: str | bytes) -> None:
        """Process a received message: a text, or a frame."""
        now_ns = time.time_ns()
        try:
            if isinstance(message, str):
                await self._text(read(MEDIA_UP, decode(message)), now_ns)
            else:
                await self._frame(read_frame(message), now_ns)
        except ValueError:
            self.odd += 1

    async def _text(self, message: UplinkMessage | None, now_ns: int) -> None:
        if isinstance(message, MediaHello):
            self.cameras = message.cameras
            self.wanted_changed()
        elif isinstance(message, ClockRequest):
            await self._send(ClockReply(message.t, now_ns).to_json())
        elif isinstance(message, CameraTrouble):
            self._trouble(message)
        elif isinstance(message, FileOffer):
            await self._offer(message.id, Offered(message.sha256, message.size))
        else:
            self.odd += 1

    async def _frame(self, frame: UplinkFrame | None, now_ns: int) -> None:
        if isinstance(frame, PictureFrame):
            await self._picture(frame, now_ns)
        elif isinstance(frame, FilePart):
            await self._part(frame)
        else:
            self.odd += 1

    # ---- pictures ----------------------------------------------------------------------------

    async def _picture(self, picture: PictureFrame, now_ns: int) -> None:
        camera = picture.camera
        await self._send(PictureReceived(camera, picture.n).to_json())
        if camera not in self.cameras or bytes(picture.payload[:3]) != b'\xff\xd8\xff':
            self.odd += 1  # browsers get only JPEG pictures of announced cameras
            return
        key = self.robot, camera
        number = self._gallery.next_n(key)
        frame = encode_frame('picture', {
            'robot': self.robot, 'camera': camera, 'n': number,
            'utc_ns': captured_ns(picture, now_ns), 'width': picture.width,
            'height': picture.height}, picture.payload)
        self._gallery.put(ViewedPicture(key, number, frame))

    def _trouble(self, trouble: CameraTrouble) -> None:
        """Forward the device's reason why a camera has no pictures."""
        if trouble.camera not in self.cameras:
            self.odd += 1
            return
        is_small = memory_of(trouble.codes, _CODES_BYTES) <= _CODES_BYTES
        self._gallery.trouble((self.robot, trouble.camera), {
            'text': trouble.text, 'codes': trouble.codes if is_small else {}})

    def wanted_changed(self) -> None:
        """Notify that the watched cameras have changed."""
        self._want.set()

    async def tell_wanted(self) -> None:
        """Send the robot the requested cameras whenever they change; for a separate task."""
        while True:
            await self._want.wait()
            self._want.clear()
            wanted = {name: rate for name, rate in self._gallery.wanted(self.robot).items()
                      if name in self.cameras}
            if wanted != self._wanted:
                self._wanted = wanted
                await self._send(WantedCameras(wanted).to_json())

    # ---- files -------------------------------------------------------------------------------

    async def _offer(self, name: str, offered: Offered) -> None:
        try:
            offset = await asyncio.to_thread(self._files.begin, self.robot, offered)
        except FileRefused as error:
            await self._refuse(name, error)
            return
        if offset < offered.size:
            while len(self._offers) >= _OFFERS_MOST:
                del self._offers[next(iter(self._offers))]
            self._offers[name] = offered
        await self._send(FileProgress(name, offset).to_json())

    async def _part(self, part: FilePart) -> None:
        name = part.id
        offered = self._offers.get(name)
        if offered is None:
            await self._refuse(name, FileRefused('it was not offered on this connection', 1.0))
            return
        try:
            there = await asyncio.to_thread(self._files.add, self.robot, offered, part.offset,
                                            part.payload)
        except FileRefused as error:
            self._offers.pop(name, None)
            await self._refuse(name, error)
            return
        if there >= offered.size:
            self._offers.pop(name, None)
        await self._send(FileProgress(name, there).to_json())

    async def _refuse(self, name: str, error: FileRefused) -> None:
        await self._send(FileRefusal(name, str(error), error.retry_s).to_json())


def captured_ns(picture: PictureFrame, now_ns: int) -> int:
    """
    Return the capture time of a picture by the clock of the server.

    The robot's own time of day (``utc_ns``) may be wrong by years, and is not used.

    :param now_ns: its time of arrival.
    """
    at_least = now_ns - min(picture.age_ns, _AGE_MOST_NS)
    stated = picture.server_ns
    # It must be before the arrival, and not by years; otherwise the clocks have drifted apart.
    if stated and now_ns - _AGE_MOST_NS < stated <= now_ns:
        return min(stated, at_least)
    return at_least
