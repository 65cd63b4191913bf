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

"""A protocol as simple as can be, to test the network with: a tree of the first beacon heard."""

from __future__ import annotations

from rt_robot_os.features.wsn.routing.protocol import BROADCAST
from rt_robot_os.features.wsn.routing.protocol import Node
from rt_robot_os.features.wsn.routing.protocol import Received
from rt_robot_os.features.wsn.routing.protocol import Router

BEACON = 1
DATA = 2
PERIOD_NS = 10_000_000_000
TRIES = 6


class FirstHeard(Router):
    """The node whose beacon comes first is the parent; data are tried a few times."""

    def __init__(self, node: Node, root: bool) -> None:
        self.node = node
        self.root = root
        self.parent = None
        self.cost = 0
        self.hops = 0
        self.counters = {'queue_full': 0, 'given_up': 0}
        self._queue: list[bytes] = []
        self._tries = 0
        self._timer = node.timer(self._beacon)
        self._beacons = node.sender(lambda acked: None)
        self._data = node.sender(self._sent)

    def start(self) -> None:
        self.parent = None
        if self.root:
            self._beacon()

    def stop(self) -> None:
        self._timer.stop()
        self._queue.clear()

    def _beacon(self) -> None:
        place = self.hops.to_bytes(2, 'big') + self.node.address.to_bytes(2, 'big')
        self._beacons.send(BROADCAST, BEACON, place, False)
        self._timer.start(PERIOD_NS)

    def receive(self, frame: Received) -> None:
        if frame.am_type == BEACON:
            if not self.root and self.parent is None:
                self.hops = int.from_bytes(frame.payload[:2], 'big') + 1
                self.parent = int.from_bytes(frame.payload[2:], 'big')
                self.node.note('parent', self.parent)
                self._timer.start(int(self.node.random.random() * 50_000_000))
        elif self.root:
            origin = int.from_bytes(frame.payload[:2], 'big')
            self.node.deliver(DATA, frame.payload, origin, frame.payload[2:])
        else:
            self._forward(frame.payload)

    def originate(self, application: bytes) -> bool:
        return self._forward(self.node.address.to_bytes(2, 'big') + application)

    def _forward(self, payload: bytes) -> bool:
        if self.parent is None or len(self._queue) > 8:
            self.counters['queue_full'] += 1
            return False
        self._queue.append(payload)
        if not self._data.busy:
            self._next()
        return True

    def _next(self) -> None:
        self._data.send(self.parent, DATA, self._queue[0], True)

    def _sent(self, acked: bool) -> None:
        if not self._queue:
            return
        self._tries += 1
        if acked or self._tries >= TRIES:
            self.counters['given_up'] += not acked
            self._queue.pop(0)
            self._tries = 0
        if self._queue:
            self._next()
