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
What a robot says on its second connection, `/robot/media`: pictures, and files in parts.

A picture is taken when it comes, and the robot told so at once: it has one on its way, and sends
the newest next. Files are taken part by part, each acknowledged with how much there is, so that
after a break both know where to go on.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from collections.abc import Callable
from collections.abc import Mapping
import time
from typing import Any
from typing import Final

from rt_robot_os.messages.uplink.frames import decode_frame
from rt_robot_os.messages.uplink.frames import encode_frame
from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.messages.uplink.messages import encode
from rt_robot_os.monitor.live.memory_use import memory_of
from rt_robot_os.monitor.live.pictures import Gallery
from rt_robot_os.monitor.live.pictures import Picture
from rt_robot_os.monitor.media_store import FileRefused
from rt_robot_os.monitor.media_store import MediaStore
from rt_robot_os.monitor.media_store import Offered

Send = Callable[[str], Awaitable[None]]
_OFFERS_MOST: Final = 4
#: Of why a camera gives no picture, and of the codes beside it.
_WHY_MOST: Final = 300
_CODES_BYTES: Final = 4000
_NAME_MOST: Final = 64
_CAMERAS_MOST: Final = 32
_AGE_MOST_NS: Final = 600 * 1_000_000_000


class RobotMedia:
    """
    One connection of a robot.

    :param robot: its id.
    :param send: sends it a text.
    :ivar cameras: which it has said it has.
    :ivar odd: messages that nobody understood.
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
        """Take what has come: a text, or a frame."""
        now_ns = time.time_ns()
        try:
            if isinstance(message, str):
                await self._text(decode(message), now_ns)
            else:
                header, payload = decode_frame(message)
                await self._frame(header, payload, now_ns)
        except (KeyError, TypeError, ValueError):
            self.odd += 1

    async def _text(self, message: dict[str, Any], now_ns: int) -> None:
        kind = message['kind']
        if kind == 'hello':
            names = [str(name)[:_NAME_MOST] for name in message['cameras']]
            self.cameras = tuple(names[:_CAMERAS_MOST])
            self.wanted_changed()
        elif kind == 'clock':
            await self._send(encode('clock', {'t': _whole(message['t']), 'utc_ns': now_ns}))
        elif kind == 'trouble':
            self._trouble(str(message['camera']), str(message['text'])[:_WHY_MOST],
                          message.get('codes'))
        elif kind == 'offer':
            await self._offer(str(message['id'])[:_NAME_MOST], Offered(
                str(message['sha256']), _whole(message['size'])))
        else:
            self.odd += 1

    async def _frame(self, header: dict[str, Any], payload: memoryview, now_ns: int) -> None:
        if header['kind'] == 'picture':
            await self._picture(header, payload, now_ns)
        elif header['kind'] == 'part':
            await self._part(str(header['id']), _whole(header['offset']), payload)
        else:
            self.odd += 1

    # ---- pictures ----------------------------------------------------------------------------

    async def _picture(self, header: Mapping[str, Any], payload: memoryview, now_ns: int) -> None:
        camera, n = str(header['camera']), _whole(header['n'])
        await self._send(encode('taken', {'camera': camera, 'n': n}))
        if camera not in self.cameras or bytes(payload[:3]) != b'\xff\xd8\xff':
            self.odd += 1  # browsers get what a camera of this robot gives, as JPEG, or nothing
            return
        key = self.robot, camera
        number = self._gallery.next_n(key)
        frame = encode_frame('picture', {
            'robot': self.robot, 'camera': camera, 'n': number,
            'utc_ns': captured_ns(header, now_ns), 'width': _whole(header.get('width', 0)),
            'height': _whole(header.get('height', 0))}, payload)
        self._gallery.put(Picture(key, number, frame))

    def _trouble(self, camera: str, text: str, codes: object) -> None:
        """Take why a camera gives no picture, as its device says it."""
        if camera not in self.cameras:
            self.odd += 1
            return
        is_small = isinstance(codes, dict) and memory_of(codes, _CODES_BYTES) <= _CODES_BYTES
        self._gallery.trouble((self.robot, camera), {
            'text': text, 'codes': codes if is_small else {}})

    def wanted_changed(self) -> None:
        """Note that somebody looks at something else."""
        self._want.set()

    async def tell_wanted(self) -> None:
        """Tell the robot what is wanted, whenever that changes; for a task of its own."""
        while True:
            await self._want.wait()
            self._want.clear()
            wanted = {name: rate for name, rate in self._gallery.wanted(self.robot).items()
                      if name in self.cameras}
            if wanted != self._wanted:
                self._wanted = wanted
                await self._send(encode('want', {'cameras': wanted}))

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
        await self._send(encode('have', {'id': name, 'offset': offset}))

    async def _part(self, name: str, offset: int, payload: memoryview) -> None:
        offered = self._offers.get(name)
        if offered is None:
            await self._refuse(name, FileRefused('it was not offered on this connection', 1.0))
            return
        try:
            there = await asyncio.to_thread(self._files.add, self.robot, offered, offset, payload)
        except FileRefused as error:
            self._offers.pop(name, None)
            await self._refuse(name, error)
            return
        if there >= offered.size:
            self._offers.pop(name, None)
        await self._send(encode('have', {'id': name, 'offset': there}))

    async def _refuse(self, name: str, error: FileRefused) -> None:
        await self._send(encode('refused', {'id': name, 'text': str(error),
                                            'retry_s': error.retry_s}))


def captured_ns(header: Mapping[str, Any], now_ns: int) -> int:
    """
    Return when a picture was captured, by the clock of the server.

    :param header: ``server_ns`` is that, as far as the robot knows the server's clock;
        ``age_ns`` how old it was when it was sent, by the robot's steady clock. The robot's own
        time of day (``utc_ns``) may be wrong by years, and is not used.
    :param now_ns: when it came.
    """
    at_least = now_ns - min(max(0, _whole(header.get('age_ns', 0))), _AGE_MOST_NS)
    stated = _whole(header.get('server_ns', 0))
    # Sent before it came, and not years before: else the two clocks have parted since.
    if stated and now_ns - _AGE_MOST_NS < stated <= now_ns:
        return min(stated, at_least)
    return at_least


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 63:
        raise ValueError('not a whole number')
    return value
