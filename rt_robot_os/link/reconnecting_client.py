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

"""A connection to a core that is restored whenever it is lost, for long-running programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import time
from typing import Final

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.client import HINT
from rt_robot_os.link.client import LinkClient
from rt_robot_os.link.client import LinkSilent

_RETRY_S: Final = 0.2
_BEAT_S: Final = 0.5


class ReconnectingClient:
    """
    Keep a connection to a core, and reconnect after it is lost.

    :param path: of the core's socket.
    :param name: of this client in the statistics of the core.
    :param on_connect: called with each new connection, before anything is read from it; when it
        raises LinkError the connection is closed and tried again.
    :param log: called with a line of text when the connection is lost and when it is restored.
    :ivar client: the connection; None while there is none.
    :ivar connections: the number of connections so far.
    """

    def __init__(self, path: Path, name: str, on_connect: Callable[[LinkClient], None],
                 log: Callable[[str], None]) -> None:
        self.client: LinkClient | None = None
        self.connections = 0
        self._path = path
        self._name = name
        self._on_connect = on_connect
        self._log = log
        self._logged = ''
        self._beat_s = 0.0

    def pump(self, timeout_s: float) -> bool:
        """
        Read what arrives, after connecting if necessary.

        :param timeout_s: about how long it takes at most.
        :return: whether there is a connection.
        """
        try:
            client = self.client or self._connect()
            client.pump(timeout_s)
            if time.monotonic() - self._beat_s > _BEAT_S:
                self._beat_s = time.monotonic()
                client.beat()
            return True
        except LinkError as error:
            if isinstance(error, LinkSilent) and self.client is not None:
                return True  # the core is busy with higher priorities; it will read again
            self.close()
            if str(error) != self._logged:
                self._logged = str(error)
                self._log(f'{str(error).removesuffix(HINT)}; waiting for it')
            time.sleep(min(_RETRY_S, timeout_s))
            return False

    def _connect(self) -> LinkClient:
        client = LinkClient(self._path, self._name)
        try:
            self._on_connect(client)
        except BaseException:
            client.close()
            raise
        self.client = client
        self.connections += 1
        if self._logged:
            self._log(f'connected to the core (pid {client.core.get("pid")})')
        self._logged = ''
        return client

    def close(self) -> None:
        """Disconnect; may be called twice."""
        client, self.client = self.client, None
        if client is not None:
            client.close()
