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
The files of the page, served from memory: compressed once, with an ETag of their content.

Under ``/v/HASH/``, to which ``/`` leads, a browser caches them for ever: another release has
another hash. Under their plain names they are revalidated each time, with a short answer when they
are unchanged.
"""

from __future__ import annotations

import gzip
import hashlib
import mimetypes
from pathlib import Path
from typing import Final
from typing import NamedTuple

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import Receive
from starlette.types import Scope
from starlette.types import Send

_INDEX: Final = 'index.html'
#: Types for editors and tsc, which browsers do not use.
_TYPES_ENDING: Final = '.d.ts'
_VERSIONED: Final = 'v'
_TYPES: Final = {'.js': 'text/javascript', '.json': 'application/json', '.svg': 'image/svg+xml',
                 '.css': 'text/css', '.html': 'text/html'}
_FOR_EVER: Final = 'public, max-age=31536000, immutable'
#: Cached, but revalidated each time.
_ASKED_FOR: Final = 'no-cache'
#: Smaller files are not compressed.
_PACKED_BYTES: Final = 200


class PageFile(NamedTuple):
    """
    A file of the page.

    :ivar packed: compressed by gzip; empty when that is not shorter.
    """

    type: str  # noqa: A003
    content: bytes
    packed: bytes
    tag: str


class PageFiles:
    """
    An ASGI application that serves the files of a folder; GET and HEAD.

    :ivar version: the hash of all of them.
    """

    def __init__(self, folder: Path) -> None:
        contents = {path.relative_to(folder).as_posix(): path.read_bytes()
                    for path in sorted(folder.rglob('*'))
                    if path.is_file() and '__pycache__' not in path.parts
                    and not path.name.endswith(_TYPES_ENDING)}
        total = hashlib.sha256()
        for name, content in contents.items():
            total.update(f'{name} {len(content)}\n'.encode() + content)
        self.version = total.hexdigest()[:16]
        contents[_INDEX] = self._led_on(contents[_INDEX])
        self._files = {name: _page_file(name, content) for name, content in contents.items()}

    def _led_on(self, index: bytes) -> bytes:
        """Make all references in the first file point to this version."""
        for attribute in (b'href="', b'src="'):
            index = index.replace(attribute, attribute + f'{_VERSIONED}/{self.version}/'.encode())
        return index

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope['type'] != 'http':
            raise HTTPException(404)
        await self._answer(Request(scope))(scope, receive, send)

    def _answer(self, request: Request) -> Response:
        if request.method not in ('GET', 'HEAD'):
            raise HTTPException(405, 'files of the page are only read', {'Allow': 'GET, HEAD'})
        name, is_lasting = self._named(request.scope['path'].lstrip('/'))
        found = self._files.get(name)
        if found is None:
            raise HTTPException(404, 'there is no such file')
        headers = {'ETag': found.tag, 'Vary': 'Accept-Encoding',
                   'Cache-Control': _FOR_EVER if is_lasting else _ASKED_FOR}
        if found.tag in request.headers.get('if-none-match', ''):
            return Response(status_code=304, headers=headers)
        body = found.content
        if found.packed and 'gzip' in request.headers.get('accept-encoding', ''):
            body, headers['Content-Encoding'] = found.packed, 'gzip'
        return Response(body, headers=headers, media_type=found.type)

    def _named(self, path: str) -> tuple[str, bool]:
        """Return the requested file, and whether it may be cached for ever."""
        head, _, rest = path.partition('/')
        if head != _VERSIONED:
            return path or _INDEX, False
        version, _, name = rest.partition('/')
        # A page opened before an update gets the present file.
        return name, version == self.version


def _page_file(name: str, content: bytes) -> PageFile:
    suffix = Path(name).suffix
    kind = _TYPES.get(suffix) or mimetypes.guess_type(name)[0] or 'application/octet-stream'
    packed = gzip.compress(content, 9, mtime=0) if len(content) >= _PACKED_BYTES else b''
    digest = hashlib.sha256(content).hexdigest()[:24]
    return PageFile(kind, content, packed if len(packed) < len(content) else b'', f'W/"{digest}"')
