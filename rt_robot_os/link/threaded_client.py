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

"""A connection to a core that a thread reads, and that is made again whenever it is lost."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from pathlib import Path
import threading
from typing import Final

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.client import LinkClient
from rt_robot_os.link.client import LinkSilent
from rt_robot_os.link.reconnecting_client import ReconnectingClient

_PUMP_S: Final = 0.05


class ThreadedClient:
    """
    Stay connected, in a thread of its own.

    :param path: of the core's socket.
    :param name: what the core calls this client.
    :param on_connect: called by the thread with each new connection; when it raises LinkError the
        connection is given up and made again.
    :param tell: takes a line of text when a connection is lost, and when there is one again.
    :param after_pump: called by the thread each time after it has read.
    """

    def __init__(self, path: Path, name: str, on_connect: Callable[[LinkClient], None],
                 tell: Callable[[str], None],
                 after_pump: Callable[[LinkClient], None] = lambda client: None) -> None:
        self._after_pump = after_pump
        self._link = ReconnectingClient(path, name, on_connect, tell)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name='link', daemon=True)

    @property
    def client(self) -> LinkClient | None:
        """Return the connection; None while there is none."""
        return self._link.client

    def start(self) -> None:
        """Read from now on."""
        self._thread.start()

    def stop(self) -> None:
        """Disconnect; may be called twice."""
        self._ending.set()
        if self._thread.is_alive():
            self._thread.join()
        self._link.close()

    def _run(self) -> None:
        while not self._ending.is_set():
            self._link.pump(_PUMP_S)
            client = self._link.client
            if client is not None:
                self._after_pump(client)


def advertise(client: LinkClient, topics: Iterable[str], tell: Callable[[str], None]
              ) -> dict[str, int]:
    """
    Publish topics from now on; one that the core does not grant is reported to ``tell``.

    :return: the channels, by topic.
    :raises LinkSilent: the core is busy: the connection is to be made again.
    """
    channels = {}
    for topic in topics:
        try:
            channels[topic] = client.advertise(topic)
        except LinkSilent:
            raise
        except LinkError as error:  # a module of the core publishes it
            tell(f'{topic}: {error}')
    return channels


def run_of(client: LinkClient) -> str:
    """Return what names a core: another one has another name."""
    return f'{client.core.get("pid")}-{client.core.get("start_ns")}'
