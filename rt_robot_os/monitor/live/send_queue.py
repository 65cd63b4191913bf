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
The outgoing queue of a WebSocket: first all urgent messages, then the newest live data.

One task writes, so that a slow peer does not delay others. Live data is encoded just before it is
sent: no old data is queued for a slow peer.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from contextlib import suppress
import logging
from typing import Final

from fastapi import WebSocket
from starlette.websockets import WebSocketDisconnect

#: A peer that reads nothing while this many urgent messages wait is disconnected: it reconnects
#: and gets the whole state, which is less than what it missed.
URGENT_MOST: Final = 1000
URGENT_BYTES: Final = 2 << 20
#: Close codes.
OVERRUN: Final = 1013
DEFECT: Final = 1011
_LOG: Final = logging.getLogger('monitor')


class SendQueue:
    """
    The sending side of a connection.

    :param websocket: an accepted one.
    :ivar sent: messages passed to the network.
    """

    def __init__(self, websocket: WebSocket) -> None:
        self._websocket = websocket
        self._urgent: deque[str] = deque()
        self._urgent_size = 0
        self._now: dict[str, str] = {}
        self._ready: dict[Callable[[], str | None], None] = {}
        self._wake = asyncio.Event()
        self._close: tuple[int, str] | None = None
        self.sent = 0

    @property
    def waiting(self) -> int:
        """Return the number of queued urgent messages."""
        return len(self._urgent)

    @property
    def closing(self) -> bool:
        """Return whether it is to be closed."""
        return self._close is not None

    def send(self, text: str) -> bool:
        """
        Send a message in order, without dropping it.

        :return: False when the peer does not read any more; it is closed then.
        """
        if self._urgent and (len(self._urgent) >= URGENT_MOST
                             or self._urgent_size + len(text) > URGENT_BYTES):
            self.close(OVERRUN, 'too slow: too many urgent messages are queued')
            return False
        self._urgent.append(text)
        self._urgent_size += len(text)
        self._wake.set()
        return True

    def send_urgent(self, key: str, text: str) -> None:
        """Send a message before all queued ones; it replaces a queued one with the same key."""
        self._now.pop(key, None)
        self._now[key] = text
        self._wake.set()

    def offer(self, make: Callable[[], str | None]) -> None:
        """Queue a function that makes a message when it is sent, once even if offered again."""
        self._ready[make] = None
        self._wake.set()

    def withdraw(self, make: Callable[[], str | None]) -> None:
        """Withdraw a queued function."""
        self._ready.pop(make, None)

    def close(self, code: int, reason: str) -> None:
        """Close it; queued messages are dropped."""
        if self._close is None:
            self._close = (code, reason)
            self._wake.set()

    async def run(self) -> None:
        """Send until it is closed."""
        try:
            while self._close is None:
                await self._wake.wait()
                self._wake.clear()
                await self._send_all()
            await self._websocket.close(*self._close)
        except (WebSocketDisconnect, RuntimeError):
            pass  # the peer has disconnected: the reading task notices
        except Exception:
            _LOG.exception('a connection is closed because of a defect')
            with suppress(WebSocketDisconnect, RuntimeError):
                await self._websocket.close(DEFECT, 'a defect of the server; its log says more')

    async def _send_all(self) -> None:
        while self._close is None:
            if self._now:
                text = self._now.pop(next(iter(self._now)))
            elif self._urgent:
                text = self._urgent.popleft()
                self._urgent_size -= len(text)
            elif self._ready:
                make = next(iter(self._ready))
                del self._ready[make]
                found = make()
                if found is None:
                    continue
                text = found
            else:
                return
            await self._websocket.send_text(text)
            self.sent += 1
