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
The connections of the server: limits of their number and of their idle time.

When the table of connections is full, the one that has kept the server waiting longest is dropped
for a new one, so that ``/healthz`` and the page of an alarm always answer. Connections with a
WebSocket are authenticated by a token or a session; they are never dropped, and have a separate
limit.
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

#: Timeout for receiving a whole request, and for progress in reading a response.
PATIENCE_S: Final = 15.0
#: A peer that does not read its pending data is disconnected after this time.
STALLED_S: Final = 20.0
HANDSHAKE_S: Final = 10.0
#: Most connections during a TLS handshake, in addition to all others.
HANDSHAKES: Final = 500
#: Size of the system's send buffer: small, so that the newest data is chosen when there is space.
UNSENT_BYTES: Final = 32 << 10
_LOOK_S: Final = 1.0
_SPARE_FILES: Final = 500


class TooManyError(ConnectionError):
    """The table of connections is full, and none can be dropped."""


class Connections:
    """
    All connections; for the event loop alone.

    :param most: most requests open at a time.
    :ivar counts: connections that were dropped, too slow, did not read, or were refused.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self.counts = {'gave_way': 0, 'too_slow': 0, 'not_read': 0, 'turned_away': 0}
        self._idle: dict[HttpConnection, None] = {}
        self._open: set[HttpConnection] = set()
        self._handshakes = 0

    @property
    def open(self) -> int:  # noqa: A003
        """Return the number of connections without a WebSocket."""
        return len(self._open)

    def admit(self) -> None:
        """
        Admit a connection that is not established yet.

        :raises TooManyError: too many are not established.
        """
        if self._handshakes >= HANDSHAKES:
            self.counts['turned_away'] += 1
            raise TooManyError
        self._handshakes += 1

    def admitted(self) -> None:
        """Register that an admitted connection is established, or has failed."""
        self._handshakes -= 1

    def made(self, one: HttpConnection) -> None:
        """Add a connection; when there are too many the one idle for longest is dropped."""
        self._open.add(one)
        self.waits(one)
        if len(self._open) > self.most:
            # The new one is last in order: it is dropped only if all others are active.
            self.counts['gave_way'] += 1
            self._drop(next(iter(self._idle)))

    def waits(self, one: HttpConnection) -> None:
        """Register that the server waits for the peer."""
        if one in self._open:
            one.since_s = asyncio.get_running_loop().time()
            self._idle.pop(one, None)
            self._idle[one] = None

    def works(self, one: HttpConnection) -> None:
        """Register that the peer waits for the server."""
        self._idle.pop(one, None)

    def gone(self, one: HttpConnection) -> None:
        """Remove a connection."""
        self._open.discard(one)
        self._idle.pop(one, None)

    async def check_timeouts(self) -> None:
        """Disconnect peers that are too slow, each second until cancelled."""
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
        """Remove a failed handshake from the count."""
        if getattr(self, '_is_admitted', False):
            self._all.admitted()

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take it."""
        self._is_admitted = False
        self._all.admitted()
        super().connection_made(transport)
        self._all.made(self)

    def data_received(self, data: bytes) -> None:
        """Receive data of a request; when it is complete the peer waits for the server."""
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
        """Pause until the peer reads."""
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
    """A connection with a WebSocket; closed when its peer reads nothing."""

    _stalled: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Limit the send buffer, so that newer data need not wait behind old data."""
        super().connection_made(transport)
        found = transport.get_extra_info('socket')
        with suppress(AttributeError, OSError):
            found.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT_BYTES)

    def pause_writing(self) -> None:
        """Wait for the peer, with a time-out."""
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
    """The configuration of a server with limited connections."""

    def __init__(self, app: Any, all_: Connections, **options: Any) -> None:
        """
        Make it.

        :param all_: the table of connections.
        :param options: of uvicorn.
        """
        super().__init__(app, http=HttpConnection, ws=WebSockets, **options)
        self.all = all_


class Loop(asyncio.SelectorEventLoop):
    """An event loop with a short time-out of the TLS handshake."""

    async def create_server(self, *arguments: Any, **options: Any) -> asyncio.Server:
        """Listen, as every loop does."""
        if options.get('ssl') is not None:
            options.setdefault('ssl_handshake_timeout', HANDSHAKE_S)
        return await super().create_server(*arguments, **options)


def allow_files(wanted: int) -> int:
    """
    Raise the limit of open files to the need of the connections, if the system allows it.

    :return: the most connections.
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
