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

"""Requests to an ASGI application in this process, without a network or a client library."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
import itertools
import json
from typing import Any
from typing import NamedTuple
from urllib.parse import quote
from urllib.parse import urlencode

_ADDRESSES = itertools.count(1)


class Response(NamedTuple):
    """What came back."""

    status: int
    headers: dict[str, str]
    body: bytes

    def json(self) -> Any:
        """Return what it is as JSON."""
        return json.loads(self.body)


def request(app: Any, method: str, path: str, headers: Mapping[str, str] | None = None,
            query: Mapping[str, Any] | None = None, content: Any = None,
            raw: bytes | None = None) -> Response:
    """
    Ask for something, each time from another address.

    :param path: not quoted.
    :param content: is sent as JSON; ``raw`` as it is.
    """
    body = raw if raw is not None else b'' if content is None else json.dumps(content).encode()
    number = next(_ADDRESSES)
    scope = {
        'type': 'http', 'asgi': {'version': '3.0', 'spec_version': '2.3'}, 'http_version': '1.1',
        'method': method, 'scheme': 'http', 'path': path,
        'raw_path': quote(path, errors='surrogatepass').encode(), 'root_path': '',
        'query_string': urlencode(query or {}, errors='surrogatepass').encode(),
        'headers': [(name.lower().encode(), value.encode()) for name, value in {
            'host': 'localhost', 'content-type': 'application/json',
            'content-length': str(len(body)), **(headers or {})}.items()],
        'client': (f'10.{number >> 16}.{number >> 8 & 255}.{number & 255}', 5000),
        'server': ('localhost', 80), 'state': {}}
    sent: list[dict[str, Any]] = []
    messages = iter([{'type': 'http.request', 'body': body, 'more_body': False}])

    async def receive() -> dict[str, Any]:
        found = next(messages, None)
        if found is None:
            await asyncio.Event().wait()
        return found or {}

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    async def serve() -> None:
        await asyncio.wait_for(app(scope, receive, send), 30)

    asyncio.run(serve())
    begin = sent[0]
    return Response(begin['status'],
                    {name.decode(): value.decode() for name, value in begin['headers']},
                    b''.join(each.get('body', b'') for each in sent[1:]))
