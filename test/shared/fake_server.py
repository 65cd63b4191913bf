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

"""A server that a test scripts: it drops, refuses, stalls and cuts as it is told."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
import http
import threading
import time
from typing import Any

import pytest

from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.messages.uplink.messages import encode

pytest.importorskip('websockets', reason='websockets is not installed')

from websockets.asyncio.server import serve  # noqa: E402
from websockets.asyncio.server import Server  # noqa: E402
from websockets.asyncio.server import ServerConnection  # noqa: E402
from websockets.exceptions import ConnectionClosed  # noqa: E402

TOKEN = 'token-of-the-robot-0123456789'


class FakeServer:
    """
    Speak uplink in a thread of its own.

    :ivar stored: content of each record by (boot, seq), as often as it was taken.
    :ivar order: (boot, seq, importance) in the order in which they came for the first time.
    :ivar heard: all messages but records.
    :ivar lost: what the gateway said last of what gave way.
    :ivar drop_acks: so many batches are stored, and that is not said.
    :ivar refuse: so many batches are refused; those with one of ``bad`` always.
    :ivar bad: types of records that it never takes.
    :ivar stalled: nothing is read while it is set.
    :ivar says_taken: whether it gives credit for signals.
    :ivar status: of HTTP with which it answers who calls, in place of taking the connection.
    """

    def __init__(self, token: str = TOKEN, tls: Any = None) -> None:
        self.stored: dict[tuple[str, int], list[dict[str, Any]]] = {}
        self.order: list[tuple[str, int, int]] = []
        self.heard: list[dict[str, Any]] = []
        self.batches: list[list[dict[str, Any]]] = []
        self.lost: dict[str, int] = {}
        self.paths: list[str] = []
        self.drop_acks = self.refuse = self.status = 0
        self.bad: set[str] = set()
        self.says_taken = True
        self.stalled = False
        self.want_map = False
        self.connections = 0
        self.port = 0
        self._token = token
        self._tls = tls
        self._loop: asyncio.AbstractEventLoop | None = None
        self._sockets: set[ServerConnection] = set()
        self._others: set[ServerConnection] = set()
        self._ready = threading.Event()
        self._end: asyncio.Event | None = None
        self._thread: threading.Thread | None = None

    @property
    def url(self) -> str:
        return f'ws{"s" if self._tls else ""}://localhost:{self.port}'

    def start(self) -> FakeServer:
        self._ready.clear()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)
        self._thread.start()
        assert self._ready.wait(30.0)
        return self

    def stop(self) -> None:
        """End at once, as a killed one does; :meth:`start` begins again at the same port."""
        if self._loop is not None and self._end is not None:
            self._loop.call_soon_threadsafe(self._end.set)
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def cut(self) -> None:
        """Break all connections without a word."""
        self._later(lambda: [each.transport.abort()
                             for each in [*self._sockets, *self._others]])

    def send(self, kind: str, **content: Any) -> None:
        text = encode(kind, content)

        def go() -> None:
            for each in list(self._sockets):
                asyncio.ensure_future(each.send(text))

        self._later(go)

    def say(self, text: str | bytes) -> None:
        """Send what may be nonsense."""
        self._later(lambda: [asyncio.ensure_future(each.send(text))
                             for each in list(self._sockets)])

    def kinds(self, kind: str) -> list[dict[str, Any]]:
        return [each for each in list(self.heard) if each['kind'] == kind]

    def answers(self) -> dict[str, dict[str, Any]]:
        return {each['id']: each for each in self.kinds('answer')}

    def signals(self) -> dict[str, Any]:
        """Return the newest value of each signal."""
        found: dict[str, Any] = {}
        for each in self.kinds('live'):
            found.update({name: value for name, (_, value) in each['signals'].items()})
        return found

    def records(self, kind: str = '') -> list[dict[str, Any]]:
        return [each[0] for each in list(self.stored.values())
                if not kind or each[0]['type'] == kind]

    def _later(self, call: Any) -> None:
        assert self._loop is not None
        self._loop.call_soon_threadsafe(call)

    async def _run(self) -> None:
        self._loop, self._end = asyncio.get_running_loop(), asyncio.Event()
        async with serve(self._serve, 'localhost', self.port or None, ssl=self._tls,
                         process_request=self._check, compression=None, ping_interval=None,
                         max_size=1 << 22) as server:
            self.port = self._port(server)
            self._ready.set()
            await self._end.wait()
            for each in [*self._sockets, *self._others]:
                each.transport.abort()

    @staticmethod
    def _port(server: Server) -> int:
        return int(next(iter(server.sockets)).getsockname()[1])

    def _check(self, socket: ServerConnection, request: Any) -> Any:
        self.paths.append(request.path)
        if self.status:
            return socket.respond(http.HTTPStatus(self.status), 'no')
        if request.headers.get('Authorization') != f'Bearer {self._token}':
            return socket.respond(http.HTTPStatus.UNAUTHORIZED, 'no')
        return None

    async def _serve(self, socket: ServerConnection) -> None:
        if socket.request is not None and socket.request.path != '/robot/state':
            await self._serve_other(socket)
            return
        self.connections += 1
        self._sockets.add(socket)
        try:
            hello = decode(await socket.recv())
            self.heard.append(hello)
            if hello['kind'] == 'hello':
                await socket.send(encode('welcome', {
                    'utc_ns': time.time_ns(), 'want_map': self.want_map}))
            async for packet in socket:
                while self.stalled:
                    await asyncio.sleep(0.01)
                await self._take(socket, hello, decode(packet))
        except ConnectionClosed:
            pass
        finally:
            self._sockets.discard(socket)

    async def _serve_other(self, socket: ServerConnection) -> None:
        """Let a connection of a part's own be, and answer nothing on it."""
        self._others.add(socket)
        try:
            async for _ in socket:
                pass
        except ConnectionClosed:
            pass
        finally:
            self._others.discard(socket)

    async def _take(self, socket: ServerConnection, hello: dict[str, Any],
                    message: dict[str, Any]) -> None:
        if message['kind'] != 'records':
            self.heard.append(message)
            if message['kind'] == 'live' and self.says_taken:
                await socket.send(encode('taken', {'n': message['n']}))
            return
        records = message['records']
        self.batches.append(records)
        self.lost = message.get('lost', {})
        if self.refuse or any(each['type'] in self.bad for each in records):
            self.refuse = max(0, self.refuse - 1)
            await socket.send(encode('refused', {
                'batch': message['batch'], 'text': 'no', 'retry_s': 0.05}))
            return
        boot = message.get('boot', hello['boot'])
        for each in records:
            key = boot, each['seq']
            if key not in self.stored:
                self.order.append((boot, each['seq'], each['importance']))
            self.stored.setdefault(key, []).append(each)
        if self.drop_acks:
            self.drop_acks -= 1
            return
        await socket.send(encode('stored', {'batch': message['batch']}))


@contextmanager
def serving(server: FakeServer) -> Iterator[FakeServer]:
    """Have it listen on a free port meanwhile."""
    server.start()
    try:
        yield server
    finally:
        server.stop()
