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

"""One end of a connection with texts and frames, as `/robot/media` and `/camera` are."""

from __future__ import annotations

from contextlib import ExitStack
import json
from typing import Any

from rt_robot_os.messages.uplink.frames import decode_frame
from rt_robot_os.messages.uplink.frames import encode_frame
from rt_robot_os.messages.uplink.messages import encode
from websockets.sync.client import connect


class MediaPeer:
    """
    A connection.

    :param headers: such as a cookie or a token.
    """

    def __init__(self, address: str, path: str, headers: dict[str, str] | None = None) -> None:
        """Connect."""
        self._stack = ExitStack()
        self.socket = self._stack.enter_context(connect(
            f'ws://{address}{path}', compression=None, proxy=None, additional_headers=headers))

    def say(self, kind: str, **content: Any) -> None:
        """Send a text."""
        self.socket.send(encode(kind, content))

    def frame(self, kind: str, payload: bytes, **header: Any) -> None:
        """Send a frame."""
        self.socket.send(encode_frame(kind, header, payload))

    def next(self, kind: str) -> dict[str, Any]:  # noqa: A003
        """Return the next text or frame of a kind; the rest of a frame is its ``payload``."""
        while True:
            found = self.socket.recv(20.0)
            if isinstance(found, bytes):
                header, payload = decode_frame(found)
                if header['kind'] == kind:
                    return {**header, 'payload': bytes(payload)}
            elif (message := json.loads(found))['kind'] == kind:
                return dict(message)

    def close(self) -> None:
        """Disconnect."""
        self._stack.close()
