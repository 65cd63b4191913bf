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

"""Small servers of the tests: HTTP and SMTP, on ports of their own."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager
from contextlib import suppress
from http.server import BaseHTTPRequestHandler
from http.server import ThreadingHTTPServer
import json
import socketserver
import threading
from typing import Any


@contextmanager
def serving(server: socketserver.BaseServer) -> Iterator[socketserver.BaseServer]:
    """Serve while it is needed."""
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class Web(ThreadingHTTPServer):
    """
    A web server.

    :ivar posts: what came: path, headers, content.
    :ivar answer: makes the answer; it gets the handler.
    """

    daemon_threads = True
    block_on_close = False

    def __init__(self) -> None:
        self.posts: list[tuple[str, dict[str, str], Any]] = []
        self.status = 204
        self.headers: dict[str, str] = {}
        self.reason = 'fine'
        self.wait = threading.Event()
        self.wait.set()
        self.drip: Callable[[], bytes] | None = None
        super().__init__(('127.0.0.1', 0), _Handler)

    @property
    def url(self) -> str:
        return f'http://127.0.0.1:{self.server_address[1]}'


class _Handler(BaseHTTPRequestHandler):
    server: Web

    def do_POST(self) -> None:  # noqa: N802
        data = self.rfile.read(int(self.headers['Content-Length']))
        self.server.posts.append((self.path, dict(self.headers), json.loads(data)))
        self.server.wait.wait(60.0)
        if self.server.drip is not None:
            with suppress(OSError):
                while self.server.drip is not None:
                    self.wfile.write(self.server.drip())
                    self.wfile.flush()
                    threading.Event().wait(0.01)  # slowly: so much at once would be a long line
            return
        with suppress(OSError):
            self.send_response(self.server.status, self.server.reason)
            for name, value in self.server.headers.items():
                self.send_header(name, value)
            self.end_headers()

    def log_message(self, *arguments: Any) -> None:  # noqa: D102
        pass


class Post(socketserver.ThreadingTCPServer):
    """
    A mail server that speaks just enough SMTP.

    :ivar mails: what came: sender, receivers, message.
    :ivar refuse: the answer to MAIL in place of yes.
    """

    daemon_threads = True
    block_on_close = False
    allow_reuse_address = True

    def __init__(self) -> None:
        self.mails: list[tuple[str, list[str], str]] = []
        self.refuse = ''
        self.refused: set[str] = set()
        self.greet = True
        super().__init__(('127.0.0.1', 0), _Smtp)


class _Smtp(socketserver.StreamRequestHandler):
    server: Post

    def handle(self) -> None:
        if not self.server.greet:
            self.rfile.readline()
            return
        self._say('220 here')
        sender, receivers = '', []
        while line := self.rfile.readline().decode().strip():
            verb = line.upper()
            if verb.startswith('EHLO'):
                self._say('250-here')
                self._say('250 AUTH PLAIN LOGIN')
            elif verb.startswith('AUTH'):
                self._say('235 yes' if not self.server.refuse else self.server.refuse)
            elif verb.startswith('MAIL'):
                sender = line.partition(':')[2].split()[0]
                self._say(self.server.refuse or '250 yes')
            elif verb.startswith('RCPT'):
                receiver = line.partition(':')[2].strip('<>')
                known = receiver not in self.server.refused
                receivers += [receiver] if known else []
                self._say('250 yes' if known else '550 who is that')
            elif verb.startswith('DATA'):
                self._say('354 go on')
                lines = []
                while (text := self.rfile.readline().decode().rstrip('\r\n')) != '.':
                    lines.append(text)
                self.server.mails.append((sender, receivers, '\n'.join(lines)))
                self._say('250 taken')
            else:
                self._say('250 yes')

    def _say(self, text: str) -> None:
        self.wfile.write(text.encode() + b'\r\n')
