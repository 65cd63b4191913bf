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

"""Sends files in parts: each is offered, then sent from the server's offset until complete."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from collections.abc import Callable
from collections.abc import Mapping
import time
from typing import Any
from typing import Final

from rt_robot_os.gateway.spool import Spool
from rt_robot_os.messages.uplink.frames import PART_BYTES
from rt_robot_os.messages.uplink.media import FileOffer
from rt_robot_os.messages.uplink.media import FilePart
from rt_robot_os.messages.uplink.media import FileProgress
from rt_robot_os.messages.uplink.media import FileRefusal

Send = Callable[[str | bytes], Awaitable[None]]
_ANSWER_S: Final = 30.0
_TRIES: Final = 4
_WAIT_MOST_S: Final = 300.0


class FileSender:
    """
    Send the waiting files one after the other.

    :param tell: takes lines for people.
    :ivar sent: files that the server has.
    """

    def __init__(self, spool: Spool, tell: Callable[[str], None]) -> None:
        self.sent = 0
        self._spool = spool
        self._tell = tell
        self._new = asyncio.Event()
        self._answers: asyncio.Queue[FileProgress | FileRefusal] = asyncio.Queue(16)
        self._not_before: dict[str, float] = {}
        self._tries: dict[str, int] = {}

    def wake(self) -> None:
        """Check for new files."""
        self._new.set()

    def begin(self) -> None:
        """Start a new connection: answers of the last one no longer count."""
        while not self._answers.empty():
            self._answers.get_nowait()

    def receive(self, message: FileProgress | FileRefusal) -> None:
        """Receive an answer of the server."""
        if self._answers.full():
            self._answers.get_nowait()
        self._answers.put_nowait(message)

    async def run(self, send: Send) -> None:
        """
        Send until cancelled.

        :raises ConnectionError: the server does not answer.
        """
        while True:
            self._new.clear()
            now_s = time.monotonic()
            due = [item for item in self._spool.waiting()
                   if self._not_before.get(item['id'], 0.0) <= now_s]
            if due:
                await self._send_file(send, due[0])
                continue
            later = [self._not_before.get(item['id'], 0.0) for item in self._spool.waiting()]
            try:
                await asyncio.wait_for(self._new.wait(),
                                       max(0.1, min(later) - now_s) if later else None)
            except (asyncio.TimeoutError, TimeoutError):
                pass

    async def _send_file(self, send: Send, item: Mapping[str, Any]) -> None:
        name, size = item['id'], item['size']
        await send(FileOffer(name, item['sha256'], size).to_json())
        while True:
            answer = await self._answer(name)
            if isinstance(answer, FileRefusal):
                self._refused(name, item, answer)
                return
            if answer.offset >= size:
                self._forget(name)
                self.sent += 1
                await asyncio.to_thread(self._spool.done, name)
                return
            try:
                part = await asyncio.to_thread(self._spool.part, item, answer.offset,
                                               PART_BYTES)
            except OSError:
                part = b''
            if not part:
                self._tell(f'{item["file"]} is gone before it was sent')
                self._forget(name)
                self._spool.done(name, given_up=True)
                return
            await send(FilePart(name, answer.offset, part).to_bytes())

    async def _answer(self, name: str) -> FileProgress | FileRefusal:
        while True:
            try:
                answer = await asyncio.wait_for(self._answers.get(), _ANSWER_S)
            except (asyncio.TimeoutError, TimeoutError):
                raise ConnectionResetError(
                    f'no answer from the server about a file for {_ANSWER_S:g} s'
                ) from None
            if answer.id == name:
                return answer

    def _refused(self, name: str, item: Mapping[str, Any], answer: FileRefusal) -> None:
        retry_s = min(_WAIT_MOST_S, answer.retry_s)
        tries = self._tries[name] = self._tries.get(name, 0) + 1
        # Wait without limit for a full disk of the server, but not for a hash that is wrong
        # repeatedly.
        if retry_s <= 0 or (retry_s < 5.0 and tries >= _TRIES):
            self._tell(f'{item["file"]} is refused by the server: {answer.text}')
            self._forget(name)
            self._spool.done(name, given_up=True)
            return
        if tries == 1:
            self._tell(f'{item["file"]} is to wait {retry_s:g} s: {answer.text}')
        self._not_before[name] = time.monotonic() + retry_s

    def _forget(self, name: str) -> None:
        self._tries.pop(name, None)
        self._not_before.pop(name, None)
