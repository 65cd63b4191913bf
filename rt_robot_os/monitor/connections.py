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
The connections of the server: how many there may be, and how long one may keep it waiting.

Many idle connections cost a table and a little memory: when the table is full, the one that has
kept the server waiting longest is dropped for a new one, so that ``/healthz`` and an alarm's page
answer all the while. Those with a WebSocket have shown a token or a session; they are never
dropped, and have a limit of their own.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
import resource
import socket
import sys
from typing import Any
from typing import Final

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

#: A request must have come whole, and an answer be read on, within that.
PATIENCE_S: Final = 15.0
#: A peer that reads nothing of what waits for it is cut off after that.
STALLED_S: Final = 20.0
HANDSHAKE_S: Final = 10.0
#: Connections in the middle of a TLS handshake that may be open besides all others.
HANDSHAKES: Final = 500
#: Bytes that the system keeps of what is sent: what is newer is chosen when there is room again.
UNSENT_BYTES: Final = 32 << 10
_LOOK_S: Final = 1.0
_SPARE_FILES: Final = 500


class TooManyError(ConnectionError):
    """There are as many connections as there may be, and none that can be dropped."""


class Connections:
    """
    All connections; for the event loop alone.

    :param most: how many requests may be open at a time.
    :ivar counts: those that were dropped, were too slow, did not read, were turned away.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self.counts = {'gave_way': 0, 'too_slow': 0, 'not_read': 0, 'turned_away': 0}
        self._idle: dict[HttpConnection, None] = {}
        self._open: set[HttpConnection] = set()
        self._handshakes = 0

    @property
    def open(self) -> int:  # noqa: A003
        """Return how many there are without a WebSocket."""
        return len(self._open)

    def admit(self) -> None:
        """
        Let a connection in that is not made yet.

        :raises TooManyError: too many have not been made.
        """
        if self._handshakes >= HANDSHAKES:
            self.counts['turned_away'] += 1
            raise TooManyError
        self._handshakes += 1

    def admitted(self) -> None:
        """Note that one which was admitted is made, or never will be."""
        self._handshakes -= 1

    def made(self, one: HttpConnection) -> None:
        """Take a new connection; when there are too many the idlest is dropped."""
        self._open.add(one)
        self.waits(one)
        if len(self._open) > self.most:
            # Its own turn comes last: all others do something.
            self.counts['gave_way'] += 1
            self._drop(next(iter(self._idle)))

    def waits(self, one: HttpConnection) -> None:
        """Note that the server waits for the peer."""
        if one in self._open:
            one.since_s = asyncio.get_running_loop().time()
            self._idle.pop(one, None)
            self._idle[one] = None

    def works(self, one: HttpConnection) -> None:
        """Note that the peer waits for the server."""
        self._idle.pop(one, None)

    def gone(self, one: HttpConnection) -> None:
        """Forget a connection."""
        self._open.discard(one)
        self._idle.pop(one, None)

    async def check_timeouts(self) -> None:
        """Cut off those that are too slow, each second until cancelled."""
        while True:
            await asyncio.sleep(_LOOK_S)
            now = asyncio.get_running_loop().time()
            for each in [each for each in self._idle if now - each.since_s > PATIENCE_S]:
                self.counts['too_slow'] += 1
                self._drop(each)

    def _drop(self, one: HttpConnection) -> None:
        self.gone(one)
        one.transport.abort()


class HttpConnection(H11Protocol):
    """A connection with requests, until it becomes a WebSocket."""

    def __init__(self, config: uvicorn.Config, *arguments: Any, **more: Any) -> None:
        assert isinstance(config, Config)
        super().__init__(config, *arguments, **more)
        self._all = config.all
        self.since_s = 0.0
        self._is_admitted = True
        self._all.admit()

    def __del__(self) -> None:
        """Count no more a handshake that came to nothing."""
        if getattr(self, '_is_admitted', False):
            self._all.admitted()

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take it."""
        self._is_admitted = False
        self._all.admitted()
        super().connection_made(transport)
        self._all.made(self)

    def data_received(self, data: bytes) -> None:
        """Take what came of a request; once it is whole the peer waits for us."""
        super().data_received(data)
        if self.cycle is not None and not self.cycle.more_body:
            self._all.works(self)
        if self.transport.get_protocol() is not self:
            self._all.gone(self)  # it is a WebSocket now

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        if not self.transport.is_closing() and self.cycle.response_complete:
            self._all.waits(self)

    def pause_writing(self) -> None:
        """Wait until the peer reads."""
        super().pause_writing()
        self._all.waits(self)

    def resume_writing(self) -> None:
        """Go on."""
        super().resume_writing()
        self._all.works(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._all.gone(self)
        super().connection_lost(exc)


class WebSockets(WebSocketsSansIOProtocol):
    """A connection with a WebSocket; cut off when its peer reads nothing."""

    _stalled: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep little of what is sent, so that what is newer need not wait behind it."""
        super().connection_made(transport)
        found = transport.get_extra_info('socket')
        with suppress(AttributeError, OSError):
            found.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT_BYTES)

    def pause_writing(self) -> None:
        """Wait for the peer, but not for ever."""
        super().pause_writing()
        if self._stalled is None:
            self._stalled = self.loop.call_later(STALLED_S, self._cut_off)

    def resume_writing(self) -> None:
        """Go on."""
        super().resume_writing()
        self._keep()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._keep()
        super().connection_lost(exc)

    def _keep(self) -> None:
        if self._stalled is not None:
            self._stalled.cancel()
            self._stalled = None

    def _cut_off(self) -> None:
        self._stalled = None
        if isinstance(self.config, Config):
            self.config.all.counts['not_read'] += 1
        self.transport.abort()


class Config(uvicorn.Config):
    """The configuration of a server whose connections are looked after."""

    def __init__(self, app: Any, all_: Connections, **options: Any) -> None:
        """
        Make it.

        :param all_: its connections.
        :param options: of uvicorn.
        """
        super().__init__(app, http=HttpConnection, ws=WebSockets, **options)
        self.all = all_


class Loop(asyncio.SelectorEventLoop):
    """An event loop that waits shortly for the handshake of TLS."""

    async def create_server(self, *arguments: Any, **options: Any) -> asyncio.Server:
        """Listen, as every loop does."""
        if options.get('ssl') is not None:
            options.setdefault('ssl_handshake_timeout', HANDSHAKE_S)
        return await super().create_server(*arguments, **options)


def allow_files(wanted: int) -> int:
    """
    Let this process open as many files as its connections need, where the system allows it.

    :return: how many connections there may be.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    needed = wanted + HANDSHAKES + _SPARE_FILES
    top = needed if hard == resource.RLIM_INFINITY else min(needed, hard)
    if soft != resource.RLIM_INFINITY and soft < top:
        with suppress(ValueError, OSError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (top, hard))
            soft = top
    if soft == resource.RLIM_INFINITY or soft >= needed:
        return wanted
    found = max(10, soft - HANDSHAKES - _SPARE_FILES)
    print(f'monitor: at most {found} connections at a time: this process may open {soft} files '
          '(ulimit -n)', file=sys.stderr, flush=True)
    return found
