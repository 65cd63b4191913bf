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

"""What is between a page and the live connection of its server."""

from __future__ import annotations

from typing import Any


class Network:
    """
    A network that can be cut, and behind which the server can freeze.

    :param page: of Playwright; before it opens the address.
    """

    def __init__(self, page: Any) -> None:
        self.is_up = True
        self.is_frozen = False
        self._open: list[Any] = []
        page.route_web_socket(lambda url: url.endswith('/live'), self._connect)

    def cut(self) -> None:
        """Cut it."""
        self.is_up = False
        for each in self._open:
            each.close()
        self._open.clear()

    def freeze(self) -> None:
        """Let nothing through in either direction, as behind a server that was stopped."""
        self.is_frozen = True

    def _connect(self, socket: Any) -> None:
        if not self.is_up:
            socket.close()
        elif not self.is_frozen:
            server = socket.connect_to_server()
            socket.on_message(lambda text: self.is_frozen or server.send(text))
            server.on_message(lambda text: self.is_frozen or socket.send(text))
            self._open.append(socket)
