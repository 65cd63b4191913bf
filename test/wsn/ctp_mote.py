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


"""A node with the Collection Tree Protocol, and neighbours that say what a test wants."""

from __future__ import annotations

from fake_node import FakeNode
from fake_node import Sent
from rt_robot_os.features.wsn.packets.ctp import CtpBeacon
from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.routing.ctp import Ctp
from rt_robot_os.features.wsn.routing.ctp_rules import CtpRules
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Received

ME = 5


class Mote:
    """A node with CTP, and who stands about it."""

    def __init__(self, root: bool = False, rules: CtpRules = CtpRules()) -> None:
        self.node = FakeNode(ME)
        self.ctp = Ctp(self.node, root, rules)
        self.ctp.start()
        self._sequences: dict[int, int] = {}

    def beacon(self, source: int, etx: int, times: int = 1, parent: int = 0, options: int = 0,
               lqi: int = 100) -> None:
        """Hear beacons of a neighbour."""
        for _ in range(times):
            sequence = self._sequences.get(source, 0)
            self._sequences[source] = sequence + 1
            payload = CtpBeacon(sequence & 0xFF, options, parent, etx).pack()
            self.ctp.receive(Received(BROADCAST, source, CtpBeacon.AM_TYPE, payload, lqi, -80))

    def data(self, number: int, etx: int = 100, origin: int = 9, hops: int = 0) -> None:
        """Take a data packet from a child."""
        payload = CtpData(0, hops, etx, origin, number & 0xFF, 0x93, b'hello').pack()
        self.ctp.receive(Received(ME, origin, CtpData.AM_TYPE, payload, 100, -80))

    def think(self) -> None:
        """Let the node choose its parent; what it tells is thrown away."""
        self.node.run_binary_ms(8192)
        self.told()

    def told(self) -> list[CtpBeacon]:
        """Send the beacon that waits, if one does."""
        sender = self.node.senders[0]
        return [CtpBeacon.unpack(sender.done().payload)] if sender.frame else []

    def on_air(self) -> Sent | None:
        """Return the data frame that is on its way."""
        return self.node.senders[1].frame

    def through(self, acknowledged: bool = True) -> CtpData:
        """Let the data frame be through."""
        return CtpData.unpack(self.node.senders[1].done(acknowledged).payload)

    def with_parent(self) -> Mote:
        """Take the root, number 0, as parent, over a perfect link."""
        self.beacon(0, 0, 3)
        self.think()
        assert self.ctp.parent == 0
        return self
