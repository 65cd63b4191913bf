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

"""A server of the monitor in a thread of this process, on a free port of loopback."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import json
import threading
import time
from typing import Any

from rt_robot_os.monitor.server import listen
from rt_robot_os.monitor.server import make_server
from rt_robot_os.monitor.services import Services
from websockets.sync.client import ClientConnection
from websockets.sync.client import connect


@contextmanager
def served(services: Services) -> Iterator[str]:
    """Serve; give its address without the scheme, such as ``127.0.0.1:40123``."""
    server = make_server(services)
    listening = listen(services.settings)
    thread = threading.Thread(target=server.run, args=([listening],), daemon=True)
    thread.start()
    while not server.started and thread.is_alive():
        time.sleep(0.002)
    try:
        yield f'127.0.0.1:{listening.getsockname()[1]}'
    finally:
        server.should_exit = True
        thread.join(20)
        listening.close()


class Page:
    """The live connection of a browser."""

    def __init__(self, address: str, **options: Any) -> None:
        self._connecting = connect(f'ws://{address}/live', compression=None, proxy=None,
                                   **options)

    def __enter__(self) -> Page:
        """Connect."""
        self.socket: ClientConnection = self._connecting.__enter__()
        return self

    def __exit__(self, *what: Any) -> None:
        """Close it."""
        self._connecting.__exit__(*what)

    def say(self, **message: Any) -> None:
        """Send a message."""
        self.socket.send(json.dumps(message))

    def next(self, kind: str, patience_s: float = 20.0,  # noqa: A003
             **content: Any) -> dict[str, Any]:
        """Return the next message of a kind, with such a content."""
        while True:
            found: dict[str, Any] = json.loads(self.socket.recv(patience_s))
            if found['kind'] == kind and content.items() <= found.items():
                return found
