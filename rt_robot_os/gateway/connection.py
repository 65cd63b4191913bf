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
A reconnecting connection to the server: WebSocket, TLS, a token.

The next attempt begins while the last one still waits: on a network that drops all packets, a
single attempt would notice the return of the network only seconds later.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from collections.abc import Callable
from contextlib import suppress
import inspect
from pathlib import Path
import random
import ssl
import time
from typing import Any
from typing import Final

from rt_robot_os.base.errors import StartError
from rt_robot_os.gateway.refusals import is_refusal
from rt_robot_os.gateway.refusals import reason_of
from rt_robot_os.gateway.settings import GatewaySettings
from rt_robot_os.gateway.token import read_token
from rt_robot_os.messages.uplink.frames import FRAME_BYTES
from websockets.asyncio.client import ClientConnection
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed
from websockets.exceptions import InvalidStatus
from websockets.exceptions import WebSocketException

Talk = Callable[[ClientConnection], Awaitable[None]]

#: Pause after an attempt that failed immediately; doubled up to the longest.
FIRST_S: Final = 0.05
LONGEST_S: Final = 1.0
#: Pause after an attempt that still waits, and the timeout of each.
OVERLAP_S: Final = 1.0
ATTEMPT_S: Final = 8.0
#: Pause after a refusal of the server: an operator has to change something first.
REFUSED_S: Final = 5.0
#: After a connection of at least this duration the pause is short again.
GOOD_S: Final = 5.0
_CLOSE_S: Final = 0.5
# A robot's proxy settings are for its users; websockets supports proxies from version 15 on.
_DIRECT: Final[dict[str, Any]] = (
    {'proxy': None} if 'proxy' in inspect.signature(connect.__init__).parameters else {})


class Renewal(Exception):
    """A talk requests a new connection; this is not an error."""


class ServerConnection:
    """
    Stay connected.

    :param path: of the server, such as ``/robot/state``.
    :param talk: called with each connection; a new one is made when it returns, raises
        :class:`Renewal`, or the connection is lost.
    :param tell: takes a line of text when a connection is lost or refused, once for each reason.
    :ivar connections: number of connections so far.
    :ivar attempts: number of attempts.
    :ivar problem: why there is no connection; empty while there is one.
    """

    def __init__(self, settings: GatewaySettings, path: str, talk: Talk,
                 tell: Callable[[str], None]) -> None:
        self.connections = self.attempts = 0
        self.problem = 'not connected yet'
        self._settings = settings
        self._url = settings.server.rstrip('/') + path
        self._talk = talk
        self._tell = tell
        self._told = ''
        self._wait_s = FIRST_S

    async def run(self) -> None:
        """Connect and talk until cancelled."""
        while True:
            socket = await self._open()
            self.connections += 1
            self.problem = self._told = ''
            began_s = time.monotonic()
            why: Exception | None = None
            renewed = False
            try:
                await self._talk(socket)
            except Renewal:
                renewed = True
            except (ConnectionClosed, OSError, ValueError) as error:
                why = error
            finally:
                await _end(socket)
            if renewed:
                self.problem = 'the server is greeted again'
            else:
                self._note(reason_of(why, self._settings) if why else 'the connection has ended')
            if time.monotonic() - began_s > GOOD_S:
                self._wait_s = FIRST_S
            await self._pause(is_refusal(why))

    async def _open(self) -> ClientConnection:
        """Try until there is a connection; waiting attempts overlap."""
        waiting: set[asyncio.Task[ClientConnection]] = set()
        try:
            while True:
                self.attempts += 1
                waiting.add(asyncio.ensure_future(self._attempt()))
                done, waiting = await asyncio.wait(
                    waiting, timeout=OVERLAP_S, return_when=asyncio.FIRST_COMPLETED)
                errors = [each.exception() for each in done]
                for each, error in zip(done, errors):
                    if error is None:
                        return each.result()
                for error in errors:
                    self._note(reason_of(error, self._settings))
                if done:
                    await self._pause(any(map(is_refusal, errors)))
        finally:
            for each in waiting:
                each.cancel()
                each.add_done_callback(_drop)

    async def _attempt(self) -> ClientConnection:
        settings = self._settings
        headers = {'Authorization': f'Bearer {read_token(settings.token_file)}'}
        secure: dict[str, Any] = {}
        if self._url.startswith('wss:'):
            secure['ssl'] = _tls(settings.ca_file)
        return await connect(
            self._url, additional_headers=headers, open_timeout=ATTEMPT_S, ping_interval=None,
            close_timeout=_CLOSE_S, max_size=FRAME_BYTES, compression=None,
            user_agent_header=None, **secure, **_DIRECT)

    async def _pause(self, refused: bool) -> None:
        """Wait before the next attempt, with jitter so that robots do not retry simultaneously."""
        wait_s = REFUSED_S if refused else self._wait_s
        self._wait_s = min(LONGEST_S, 2 * self._wait_s)
        await asyncio.sleep(wait_s * random.uniform(0.5, 1.0))

    def _note(self, why: str) -> None:
        self.problem = why
        if why != self._told:
            self._told = why
            self._tell(f'{self._url}: {why}; trying again')


async def keep_alive(socket: ClientConnection, every_s: float, patience_s: float) -> None:
    """
    Send a ping to the other end, and abort the connection when no answer comes.

    Closing it would wait for an answer as well.
    """
    while True:
        answer = await socket.ping()
        try:
            await asyncio.wait_for(answer, patience_s)
        except asyncio.TimeoutError:
            socket.transport.abort()
            raise ConnectionResetError(f'no answer from the server for {patience_s:g} s') from None
        await asyncio.sleep(every_s)


async def _end(socket: ClientConnection) -> None:
    with suppress(OSError, WebSocketException):
        await socket.close()


def _drop(task: asyncio.Task[ClientConnection]) -> None:
    """End a connection that was established too late."""
    if not task.cancelled() and task.exception() is None:
        task.result().transport.abort()


def _tls(ca_file: str) -> ssl.SSLContext:
    try:
        path = str(Path(ca_file).expanduser()) if ca_file else None
        return ssl.create_default_context(cafile=path)
    except (OSError, ssl.SSLError) as error:
        raise StartError(f'ca_file {ca_file} cannot be used: {error}') from error


__all__ = ['ClientConnection', 'InvalidStatus', 'keep_alive', 'Renewal', 'ServerConnection',
           'Talk']
