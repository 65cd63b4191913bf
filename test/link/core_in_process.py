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

"""A core under the virtual clock with its link open, and a client that may send anything."""

from __future__ import annotations

from pathlib import Path
import socket
from typing import Any
from typing import Generic
from typing import TypeVar

from rt_robot_os.core.app import Core
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.settings import load

MS = 1_000_000
S = 1_000_000_000
PARTS = ('sent', 'full', 'lost', 'skipped', 'limited', 'waiting')


class RawClient:
    """
    A socket to a core.

    :ivar ended: the core has closed it.
    """

    def __init__(self, path: Path) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.socket.connect(str(path))
        self.socket.setblocking(False)
        self.number = 0
        self.ended = False

    def send(self, packet: bytes) -> None:
        try:
            self.socket.send(packet)
        except OSError:
            self.ended = True

    def request(self, do: str, **arguments: Any) -> None:
        self.number += 1
        self.send(encode_json(PacketKind.REQUEST, {'id': self.number, 'do': do, **arguments}))

    def close(self) -> None:
        self.socket.close()


ClientT = TypeVar('ClientT', bound=RawClient)


class CoreInProcess(Generic[ClientT]):
    """A core whose time passes only when a test lets it."""

    def __init__(self, folder: Path, yaml: str) -> None:
        folder.joinpath('robot.yaml').write_text(yaml)
        self.path = folder / 'robot.sock'
        self.core = Core(load([folder / 'robot.yaml']), self.path,
                         clock=VirtualClock(start_ns=100 * S))
        self.core.link.open()
        self.clients: list[ClientT] = []

    def run(self, duration_ns: int = 20 * MS) -> None:
        self.core.kernel.run(duration_ns)

    def reports(self) -> list[str]:
        """Give the texts of all reports so far."""
        return [report.text for report in self.core.reports.since(0)[2]]

    def mirror_of(self, client: str, topic: str) -> dict[str, int]:
        """Give the counters of a client's mirror."""
        for each in self.core.link.statistics():
            if each.name == client:
                for mirror in each.as_json()['mirrors']:
                    if mirror['topic'] == topic:
                        return dict(mirror)
        return {}

    def close(self) -> None:
        for client in self.clients:
            client.close()
        self.core.close()
