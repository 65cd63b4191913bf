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
The connections with pictures: `/robot/media` of robots, `/camera` of browsers.

They are separate from `/robot/state` and `/live`, so that no alarm ever waits behind a picture.
Each browser has its own task, so that a slow one delays no other.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Coroutine
from collections.abc import Mapping
from contextlib import suppress
import time
from typing import Any
from typing import Final

from fastapi import WebSocket
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.texts.coded import codes_of
from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.messages.uplink.messages import encode
from rt_robot_os.messages.uplink.tasks import end
from rt_robot_os.monitor.live.pictures import Gallery
from rt_robot_os.monitor.live.pictures import Key
from rt_robot_os.monitor.live.pictures import Viewer
from rt_robot_os.monitor.live.robot_media import RobotMedia
from rt_robot_os.monitor.live.robot_state import RobotState
from rt_robot_os.monitor.media_store import MediaStore
from starlette.websockets import WebSocketDisconnect

#: A browser that does not acknowledge a picture within this time is gone or inactive.
ANSWER_S: Final = 30.0
VIEWERS_MOST: Final = 200
_TEXT_MOST: Final = 4096
_NAME_MOST: Final = 64
_CLEANUP_S: Final = 3600.0


def may_view_cameras(people: frozenset[str] | None, robot: RobotState | None) -> bool:
    """
    Return whether a user may watch the cameras of a robot.

    :param people: people the user may see; None for everybody.
    :param robot: None when it is unknown.
    :return: a camera shows all people present, so the user needs a grant for all residents.
        Cameras of a robot without residents are for users who may see everyone.
    """
    return robot is not None and (people is None or (
        robot.people is not None and frozenset() < robot.people <= people))


class MediaHub:
    """
    The cameras and their viewers; for the event loop alone.

    :param files: the store for files of alarms.
    :ivar robots: the connection of each robot that has one.
    """

    def __init__(self, files: MediaStore) -> None:
        self.files = files
        self.gallery = Gallery(self._wanted_changed)
        self.robots: dict[str, RobotMedia] = {}
        self._closing: dict[str, Callable[[], None]] = {}

    def _wanted_changed(self, robot: str) -> None:
        if robot in self.robots:
            self.robots[robot].wanted_changed()

    def connect(self, media: RobotMedia, end: Callable[[], None]) -> None:
        """Register a robot's connection; the previous one is ended by its ``end``."""
        before = self._closing.get(media.robot)
        self.robots[media.robot], self._closing[media.robot] = media, end
        if before is not None:
            before()

    def disconnect(self, media: RobotMedia) -> None:
        """Remove a connection, unless there is a newer one."""
        if self.robots.get(media.robot) is media:
            del self.robots[media.robot], self._closing[media.robot]

    async def run_cleanup(self) -> None:
        """Delete files that have expired, now and each hour; for a task of its own."""
        while True:
            await asyncio.to_thread(self.files.expire)
            await asyncio.sleep(_CLEANUP_S)

    def revoke(self, what: Any) -> None:
        """End the connection of a robot whose token was revoked."""
        end = self._closing.get(what.id)
        if end is not None:
            end()

    def status(self) -> dict[str, Any]:
        """Return the counters."""
        counts, viewers = self.files.counts(), self.gallery.viewers
        return {'robots': len(self.robots), 'viewers': len(viewers),
                'pictures': self.gallery.pictures,
                'sent': sum(viewer.sent for viewer in viewers),
                'skipped': sum(viewer.skipped for viewer in viewers),
                'odd': sum(each.odd for each in self.robots.values()),
                'files': counts.files, 'bytes': counts.bytes, 'made_room': counts.made_room,
                'expired': counts.expired, 'refused': counts.refused}


async def serve_robot(websocket: WebSocket, robot: str, hub: MediaHub) -> None:
    """Serve an accepted connection of a robot until it ends."""
    media = RobotMedia(robot, hub.gallery, hub.files, websocket.send_text)
    ended = asyncio.Event()
    hub.connect(media, ended.set)
    try:
        await _until_one_ends(_receive(websocket, media), media.tell_wanted(), ended.wait())
    finally:
        hub.disconnect(media)


async def _receive(websocket: WebSocket, media: RobotMedia) -> None:
    while True:
        message = await websocket.receive()
        if message['type'] == 'websocket.disconnect':
            return
        content = message.get('bytes')
        await media.take(content if content is not None else message.get('text') or '')


class BrowserMedia:
    """
    One browser's connection.

    :param session: its session.
    :param may_view_cameras: returns whether the user may now see the pictures of a robot.
    :param note: writes to the audit that the user begins to watch a camera; may block.
    """

    def __init__(self, websocket: WebSocket, gallery: Gallery, session: str,
                 may_view_cameras: Callable[[str], bool], note: Callable[[Key], object]) -> None:
        self.odd = 0
        self._note = note
        self.session = session
        self._ending: tuple[int, str] | None = None
        self._ended = asyncio.Event()
        self._websocket = websocket
        self._gallery = gallery
        self._may_look = may_view_cameras
        self._wake = asyncio.Event()
        self._viewer: Viewer = gallery.open_viewer(self._wake.set)

    def close(self, code: int, text: str) -> None:
        """End it."""
        if self._ending is None:
            self._ending = code, text
            self._ended.set()

    async def serve(self) -> None:
        """Serve it until it ends."""
        try:
            await _until_one_ends(self._receive(), self._send(), self._ended.wait())
            if self._ending is not None:
                with suppress(RuntimeError):  # the browser has disconnected
                    await self._websocket.close(*self._ending)
        finally:
            self._gallery.close_viewer(self._viewer)

    async def _receive(self) -> None:
        while True:
            text = await self._websocket.receive_text()
            try:
                if len(text) > _TEXT_MOST:
                    raise ValueError('too long')
                await self._take(decode(text))
            except (KeyError, TypeError, ValueError):
                self.odd += 1

    async def _take(self, message: dict[str, Any]) -> None:
        kind = message['kind']
        if kind == 'clock':
            await self._websocket.send_text(encode('clock', {
                't': float(message['t']), 'utc_ns': time.time_ns()}))
            return
        key: Key = str(message['robot'])[:_NAME_MOST], str(message['camera'])[:_NAME_MOST]
        if kind == 'taken':
            self._viewer.taken(key, int(message['n']))
        elif kind == 'leave':
            self._viewer.leave(key)
        elif kind == 'look':
            await self._look(key, float(message.get('rate_hz', 10.0)))
        else:
            self.odd += 1

    async def _look(self, key: Key, rate_hz: float) -> None:
        if not self._may_look(key[0]):
            # The same answer for a robot that does not exist.
            await self._gone(key, 'there is no such camera, or you may not look through it')
            return
        is_new = key not in self._viewer.keys()
        try:
            self._viewer.watch(key, rate_hz if rate_hz == rate_hz else 0.0)
        except ValueError as error:
            await self._gone(key, str(error))
            return
        if is_new:
            await asyncio.to_thread(self._note, key)

    async def _gone(self, key: Key, text: str, codes: Mapping[str, Any] | None = None) -> None:
        said = {'text': text, 'codes': codes or {}}
        await self._websocket.send_text(encode('gone', {
            'robot': key[0], 'camera': key[1], 'text': text, 'codes': codes_of(said, ('text',))}))

    async def _send(self) -> None:
        while True:
            now_ns = time.monotonic_ns()
            picture, wait_ns = self._viewer.next_picture(now_ns)
            if picture is not None:
                if not self._may_look(picture.key[0]):  # new residents or fewer rights
                    self._viewer.leave(picture.key)
                    await self._gone(picture.key, 'you may not look through it any more')
                    continue
                await self._websocket.send_bytes(picture.frame)
                continue
            trouble = self._viewer.next_trouble()
            if trouble is not None:
                key, why = trouble
                await self._gone(key, str(why['text']), why['codes'])
                continue
            if self._viewer.waiting(now_ns) > ANSWER_S * NS_PER_S:
                self.close(4408, 'pictures were left without an answer')
                return
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._wake.wait(),
                                       wait_ns / NS_PER_S if wait_ns else ANSWER_S)
            self._wake.clear()


async def _until_one_ends(*parts: Coroutine[Any, Any, Any]) -> None:
    tasks = [asyncio.ensure_future(each) for each in parts]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        await end(tasks)
        for found in await asyncio.gather(*tasks, return_exceptions=True):
            if isinstance(found, Exception) and not isinstance(
                    found, WebSocketDisconnect | RuntimeError):
                raise found
