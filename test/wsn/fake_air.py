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

"""Nodes without radios that hear each other: each frame takes 2 ms, and none are in the way."""

from __future__ import annotations

from collections.abc import Callable

from fake_node import FakeNode
from fake_node import Sent
from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Node
from rt_robot_os.features.wsn.routing.protocol import Received
from rt_robot_os.features.wsn.routing.protocol import Router

FRAME_NS = 2_000_000


class FakeAir:
    """
    A network in which the test says who hears whom.

    :ivar lqi: by sender and receiver; who is not there does not hear.
    :ivar deaf: pairs of sender and receiver where the receiver gets nothing for now.
    :ivar sent: all frames with who sent them.

    :param make: makes the protocol of a node: the node, and whether it is the root.
    """

    def __init__(self, make: Callable[[Node, bool], Router],
                 lqi: dict[tuple[int, int], int]) -> None:
        self.lqi = dict(lqi)
        self.deaf: set[tuple[int, int]] = set()
        self.sent: list[tuple[int, Sent]] = []
        addresses = sorted({address for pair in lqi for address in pair})
        self.nodes = {address: FakeNode(address, address) for address in addresses}
        self.routers = {address: make(node, address == 0)
                        for address, node in self.nodes.items()}
        self.time_ns = 0
        for router in self.routers.values():
            router.start()

    def run(self, seconds: float) -> None:
        """Let time pass."""
        end_ns = self.time_ns + round(seconds * 1e9)
        while self.time_ns < end_ns:
            self.time_ns = min(end_ns, self.time_ns + FRAME_NS)
            for node in self.nodes.values():
                node.run_until(self.time_ns)
            for address, node in self.nodes.items():
                for sender in [one for one in node.senders if one.frame is not None]:
                    assert sender.frame is not None
                    sender.done(self._heard(address, sender.frame))

    def _heard(self, source: int, frame: Sent) -> bool:
        """Let all have a frame that hear it; tell whether it was acknowledged."""
        self.sent.append((source, frame))
        acknowledged = False
        for (one, to), lqi in self.lqi.items():
            if one != source or (one, to) in self.deaf:
                continue
            if frame.destination in (to, BROADCAST):
                self.routers[to].receive(Received(
                    frame.destination, -1, frame.am_type, frame.payload, lqi, -70))
                acknowledged |= frame.acknowledge and (to, source) not in self.deaf
        return acknowledged

    def frames(self, am_type: int) -> list[tuple[int, Sent]]:
        """Return the frames of a type with who sent them."""
        return [one for one in self.sent if one[1].am_type == am_type]

    def route(self, address: int) -> list[int]:
        """Return the nodes on the way to the root, the first one included."""
        way = [address]
        while len(way) <= len(self.nodes):
            parent = self.routers[way[-1]].parent
            if parent is None:
                break
            way.append(parent)
        return way


def both_ways(lqi: dict[tuple[int, int], int]) -> dict[tuple[int, int], int]:
    """Let links be heard in both directions."""
    return {**lqi, **{(to, source): value for (source, to), value in lqi.items()}}
