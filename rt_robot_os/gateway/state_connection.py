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
The connection ``/robot/state``: the greeting, then queued data, the most important first.

One task sends: first answers and heartbeats, then records, then signals, so that an alarm never
waits behind a signal. Few records and signals are in flight at a time, so that new ones wait only
for a moment.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from typing import Any
from typing import Final
from typing import Protocol

from rt_robot_os.gateway.connection import ClientConnection
from rt_robot_os.gateway.connection import keep_alive
from rt_robot_os.gateway.connection import Renewal
from rt_robot_os.gateway.connection import ServerConnection
from rt_robot_os.gateway.part import Part
from rt_robot_os.gateway.settings import GatewaySettings
from rt_robot_os.messages.uplink.greeting import RobotHello
from rt_robot_os.messages.uplink.greeting import ServerWelcome
from rt_robot_os.messages.uplink.kinds import read
from rt_robot_os.messages.uplink.kinds import STATE_DOWN
from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.messages.uplink.tasks import end

PATH: Final = '/robot/state'
#: Most queued messages of parts.
QUEUE: Final = 256
_LOOK_S: Final = 0.02
_ALIVE_S: Final = 1.0
_WELCOME_S: Final = 5.0


class TextSource(Protocol):
    """The source of records or signals for the sender."""

    def next_text(self) -> str | None:
        """Return the next message; None when none may be sent now."""


class StateConnection:
    """
    Talk with the server about state.

    :param hello: returns the greeting.
    :param tell: reports a problem in a line of text.
    :ivar connected: whether the server has returned the greeting.
    :ivar sent: sent messages.
    :ivar heard: received messages.
    :ivar unknown: messages of an unknown kind.
    :ivar malformed: messages that were malformed.
    :ivar full: messages of parts that were dropped because the queue was full.
    """

    def __init__(self, settings: GatewaySettings, hello: Callable[[], RobotHello],
                 tell: Callable[[str], None]) -> None:
        self.connected = False
        self.sent = self.heard = self.unknown = self.malformed = self.full = 0
        self.connection = ServerConnection(settings, PATH, self._talk, tell)
        self._settings = settings
        self._hello = hello
        self._tell = tell
        self._parts: tuple[Part, ...] = ()
        self._by_class: dict[type[UplinkMessage], Part] = {}
        self._sources: tuple[TextSource, ...] = ()
        self._queue: deque[str] = deque()
        self._newest: dict[str, str] = {}
        self._wake: asyncio.Event | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._told: set[str] = set()

    # ---- for parts ---------------------------------------------------------------------------

    def send(self, message: UplinkMessage) -> bool:
        """Queue a message ahead of records and signals; False when it is dropped. Any thread."""
        if not self.connected:
            return False
        if len(self._queue) >= QUEUE:
            self.full += 1
            return False
        self._queue.append(message.to_json())
        self.wake()
        return True

    def send_newest(self, message: UplinkMessage) -> None:
        """Queue a message, replacing a queued one of its kind. Any thread."""
        if self.connected:
            self._newest[message.KIND] = message.to_json()
            self.wake()

    def wake(self) -> None:
        """Wake the sender. Any thread."""
        loop, wake = self._loop, self._wake
        if loop is not None and wake is not None:
            with suppress(RuntimeError):  # it has ended
                loop.call_soon_threadsafe(wake.set)

    # ---- in the loop -------------------------------------------------------------------------

    async def run(self, parts: Iterable[Part], sources: Iterable[TextSource]) -> None:
        """Stay connected until cancelled."""
        self._parts = tuple(parts)
        self._by_class = {each: part for part in self._parts for each in part.receives}
        self._sources = tuple(sources)
        self._loop, self._wake = asyncio.get_running_loop(), asyncio.Event()
        await self.connection.run()

    async def _talk(self, socket: ClientConnection) -> None:
        hello = self._hello()
        await socket.send(hello.to_json())
        try:
            await asyncio.wait_for(self._await_welcome(socket), _WELCOME_S)
        except asyncio.TimeoutError:
            raise TimeoutError from None  # before Python 3.11 another
        self.connected = True
        for part in self._parts:
            part.met_server()
        tasks = [asyncio.ensure_future(each) for each in (
            self._send(socket), self._hear(socket),
            keep_alive(socket, _ALIVE_S, self._settings.silence_s), self._watch(hello))]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for each in done:
                each.result()
        finally:
            self.connected = False
            await end(tasks)
            self._queue.clear()
            self._newest.clear()
            for part in self._parts:
                part.lost_server()

    async def _await_welcome(self, socket: ClientConnection) -> None:
        while True:
            message = self._read(await socket.recv())
            if isinstance(message, ServerWelcome):
                self._hand_over(message)
                return

    async def _watch(self, hello: RobotHello) -> None:
        """
        End when the greeting has changed, so that it is sent again.

        :raises Renewal: always.
        """
        # A changed map is sent separately.
        while replace(self._hello(), utc_ns=hello.utc_ns, map=hello.map) == hello:
            await asyncio.sleep(_ALIVE_S)
        raise Renewal

    async def _send(self, socket: ClientConnection) -> None:
        wake = self._wake
        assert wake is not None  # run() made it
        while True:
            text = self._next()
            if text is not None:
                await socket.send(text)
                self.sent += 1
                continue
            with suppress(asyncio.TimeoutError):
                await asyncio.wait_for(wake.wait(), _LOOK_S)
            wake.clear()

    def _next(self) -> str | None:
        if self._queue:
            return self._queue.popleft()
        if self._newest:
            return self._newest.pop(next(iter(self._newest)))
        for source in self._sources:
            text = source.next_text()
            if text is not None:
                return text
        return None

    async def _hear(self, socket: ClientConnection) -> None:
        async for packet in socket:
            message = self._read(packet)
            if message is not None:
                self._hand_over(message)

    def _read(self, packet: str | bytes) -> UplinkMessage | None:
        """Read a message; None for one that is unknown or malformed, which is counted."""
        self.heard += 1
        kind = ''
        try:
            content = decode(packet)
            kind = content['kind']
            message = read(STATE_DOWN, content)
        except ValueError as error:
            self._refuse(f'{kind}: {error}' if kind else str(error))
            part = self._by_class.get(STATE_DOWN[kind]) if kind else None
            if part is not None:
                part.reject(kind)
            return None
        self.unknown += message is None
        return message

    def _hand_over(self, message: UplinkMessage) -> None:
        part = self._by_class.get(type(message))
        if part is None:
            self.unknown += not isinstance(message, ServerWelcome)
            return
        try:
            part.receive(message)
        except ValueError as error:
            self._refuse(f'{message.KIND}: {error}')

    def _refuse(self, why: str) -> None:
        self.malformed += 1
        if why not in self._told and len(self._told) < QUEUE:
            self._told.add(why)
            self._tell(f'from the server: {why[:200]}')

    def statistics(self) -> dict[str, Any]:
        """Return its counters."""
        return {'connected': self.connected, 'connections': self.connection.connections,
                'attempts': self.connection.attempts, 'problem': self.connection.problem,
                'sent': self.sent, 'heard': self.heard, 'unknown': self.unknown,
                'malformed': self.malformed, 'full': self.full}
