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

"""Middleware of the whole server: security headers, body size limit, rate limit."""

from __future__ import annotations

import json
from typing import Any
from typing import Final

from fastapi import FastAPI
from rt_robot_os.messages.texts.coded import codes_of
from rt_robot_os.monitor.security.headers import headers_for
from rt_robot_os.monitor.security.limits import network_of
from rt_robot_os.monitor.security.limits import Rate
from starlette.datastructures import Headers
from starlette.types import ASGIApp
from starlette.types import Message
from starlette.types import Receive
from starlette.types import Scope
from starlette.types import Send

#: Longest body of a request.
BODY_BYTES: Final = 1 << 20
_TOO_LONG: Final = (413, 'the request is too long', f'at most {BODY_BYTES} bytes')
#: Request rate of one address, which may be a whole ward behind a router; files of the page do not
#: count.
PER_S: Final = 200.0
BURST: Final = 2000
#: Key in the scope of a WebSocket: functions to call when it has ended.
ENDED_CALLBACKS: Final = 'rt_robot_os.ended'


def protect(app: FastAPI, *, per_s: float = PER_S, burst: int = BURST) -> Rate:
    """
    Add it to an app; call it last, so that it is the outermost middleware.

    :param per_s: requests an address may send, ``burst`` at once.
    :return: the rate limiter.
    """
    rate = Rate(per_s, burst)
    app.add_middleware(Protection, rate=rate)
    return rate


class _TooLongError(Exception):
    """The body is longer than its Content-Length or than the limit."""


class Protection:
    """Plain ASGI middleware: it costs a request some microseconds, and a WebSocket nothing."""

    def __init__(self, app: ASGIApp, rate: Rate) -> None:
        self._app = app
        self.rate = rate

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request."""
        if scope['type'] not in ('http', 'websocket'):
            await self._app(scope, receive, send)
            return
        host = scope['client'][0] if scope.get('client') else ''
        is_free = scope['type'] == 'http' and not scope['path'].startswith('/api/')
        wait = 0.0 if is_free else self.rate.take(network_of(host))
        if wait and scope['type'] == 'websocket':
            await send({'type': 'websocket.close', 'code': 4429, 'reason': 'too many requests'})
            return
        if scope['type'] == 'websocket':
            ended = scope[ENDED_CALLBACKS] = []
            try:
                await self._app(scope, receive, send)
            finally:
                for each in ended:
                    each()
            return
        headers = Headers(scope=scope)
        more = headers_for(scope['path'], scope['scheme'] == 'https', headers.get('host', ''))

        async def add(message: Message) -> None:
            if message['type'] == 'http.response.start':
                own = {name.lower() for name, _ in message.get('headers', ())}
                message['headers'] = [*message.get('headers', ()), *(
                    each for each in more if each[0] not in own)]
            await send(message)

        if wait:
            await _refuse(add, 429, 'too many requests from this address', 'wait a moment',
                          [(b'retry-after', str(int(wait) + 1).encode())])
            return
        await self._with_short_body(scope, headers, receive, add)

    async def _with_short_body(self, scope: Scope, headers: Headers, receive: Receive,
                               send: Send) -> None:
        said = headers.get('content-length', '0')
        if not said.isdecimal() or len(said) > 18 or int(said) > BODY_BYTES:
            await _refuse(send, *_TOO_LONG)
            return
        count = 0
        is_too_long = has_begun = is_refused = False

        async def counted() -> Message:
            nonlocal count, is_too_long
            message = await receive()
            count += len(message.get('body', b''))
            if count > BODY_BYTES:
                is_too_long = True
                raise _TooLongError
            return message

        async def watched(message: Message) -> None:
            nonlocal has_begun, is_refused
            if is_refused:
                return
            if is_too_long and not has_begun:  # the framework reports a bad request
                is_refused = True
                await _refuse(send, *_TOO_LONG)
                return
            has_begun = True
            await send(message)

        try:
            await self._app(scope, counted, watched)
        except _TooLongError:
            if not has_begun and not is_refused:
                await _refuse(send, *_TOO_LONG)


async def _refuse(send: Send, status: int, text: str, remedy: str,
                  more: list[tuple[bytes, bytes]] | None = None) -> None:
    detail: dict[str, Any] = {'text': text, 'remedy': remedy}
    body: dict[str, Any] = {'detail': {**detail, 'codes': codes_of(detail, detail)}}
    content = json.dumps(body).encode()
    await send({'type': 'http.response.start', 'status': status, 'headers': [
        (b'content-type', b'application/json'), (b'content-length', str(len(content)).encode()),
        (b'connection', b'close'), *(more or [])]})
    await send({'type': 'http.response.body', 'body': content})
