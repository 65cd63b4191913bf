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

"""
The sink's post room: packets are sorted by importance before anything in them is decoded.

Each class has a queue of its own, bounded, so that a flood of one neither delays nor displaces
another. What is most important is handed on first.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from collections.abc import Sequence
from typing import Final

from rt_robot_os.devices.device import SamplePublisher
from rt_robot_os.devices.device import Value
from rt_robot_os.features.wsn.sink.duplicates import DuplicateFilter
from rt_robot_os.features.wsn.sink.flow_limit import FlowLimit
from rt_robot_os.features.wsn.sink.importance import Classifier
from rt_robot_os.features.wsn.sink.packet_header import HeaderReader
from rt_robot_os.features.wsn.sink.packet_header import LYING
from rt_robot_os.features.wsn.sink.packet_header import NOT_AM
from rt_robot_os.features.wsn.sink.packet_header import PacketHeader
from rt_robot_os.features.wsn.sink.packet_header import TRUNCATED

#: No names of classes.
SHARED, CLAIMED, FOREIGN, FLOODED = 'shared id', 'claims no cost', 'foreign group', 'flooded'
_TYPES_TOLD: Final = 8


class Sorting:
    """
    Sort packets, leave out copies, keep them by class and hand them on; safe in the loop.

    :ivar copies: what leaves out copies, with its counters.
    :ivar taken: packets of each class that were good, copies left out.
    :ivar lost: packets of each class for which its queue had no room, always the oldest.
    :ivar ignored: packets that were not handed on for what they are, copies included.
    :ivar foreign: packets of other groups.
    :ivar foreign_group: group of the last one; -1 none.
    :ivar truncated: packets that end within their header.
    :ivar lying: packets whose length byte says something else than how long they are.
    :ivar misfit: the last of those two.
    :ivar not_am: packets under TinyOS 2.x that are no active messages.
    :ivar free_of_charge: beacons of others than the root that claim to be at no cost from it.
    :ivar claimant: who sent the last one; -1 nobody.
    :ivar limit: the bound on what one node sends in the important classes, with its counters.
    :ivar last_ns: when that was last which a person has to look after, by ``SHARED``,
        ``CLAIMED``, ``FOREIGN``, ``FLOODED``, or the class that lost a packet.
    :ivar sink_resets: times that the sink itself began anew, as its numbers tell.
    """

    def __init__(self, look: HeaderReader, classifier: Classifier, copies: DuplicateFilter,
                 limit: FlowLimit, *, room: int, groups: Collection[int],
                 known_types: Collection[int], root: int) -> None:
        """
        Begin with empty queues.

        :param room: packets that wait in each class at most.
        :param groups: that are taken; empty takes all.
        :param known_types: those that are not counted as unknown.
        :param root: address of the sink.
        """
        self._look = look
        self._classifier = classifier
        self.copies = copies
        self.limit = limit
        self._room = room
        self._groups = frozenset(groups)
        self._known_types = frozenset(known_types)
        self._root = root
        count = len(classifier.classes)
        self._queues: tuple[deque[tuple[bytes, int]], ...] = tuple(deque() for _ in range(count))
        self.taken = [0] * count
        self.lost = [0] * count
        self.waiting = 0
        self.waiting_bytes = 0
        self.ignored = 0
        self.foreign = self.truncated = self.lying = self.not_am = self.free_of_charge = 0
        self.foreign_group = self.claimant = -1
        self.misfit = b''
        self._unknown: dict[int, int] = {}
        self._root_restarts = 0
        self.last_ns: dict[str, int] = {}

    @property
    def classes(self) -> tuple[str, ...]:
        """Return the names of the classes, the most important first."""
        return self._classifier.classes

    @property
    def unknown(self) -> int:
        """Return the number of packets of unknown types; they are handed on all the same."""
        return sum(self._unknown.values())

    @property
    def sink_resets(self) -> int:
        """Return how often the sink itself began anew, as its numbers tell."""
        return self._root_restarts

    def add(self, packet: bytes, arrival_ns: int) -> bool:
        """
        PacketHeader at a packet and put it into the queue of its class.

        :return: whether it is one to be handed on.
        """
        look = self._look(packet)
        if look.problem or (self._groups and look.group not in self._groups):
            self._refuse(look, packet, arrival_ns)
            return False
        if look.am_type not in self._known_types:
            self._unknown[look.am_type] = self._unknown.get(look.am_type, 0) + 1
        if look.sequence >= 0 or look.content:
            copies = self.copies
            restarts, shared = copies.restarts, copies.shared_ids
            if copies.is_copy(look.origin, look.am_type, look.content, look.sequence, look.bits,
                              arrival_ns):
                self.ignored += 1
                return False
            if copies.restarts != restarts and look.origin == self._root:
                self._root_restarts += 1
            if copies.shared_ids != shared:
                self.last_ns[SHARED] = arrival_ns
        if look.free_of_charge >= 0 and look.free_of_charge != self._root:
            self.free_of_charge += 1
            self.claimant = look.free_of_charge
            self.last_ns[CLAIMED] = arrival_ns
        place = self._classifier.place(look.am_type, look.kind, look.origin, look.group)
        # The last class is the rest: it has its own queue, and nothing waits for it.
        if place < len(self._queues) - 1 and not self.limit.accepts(
                look.origin, look.relay, arrival_ns):
            self.ignored += 1
            self.last_ns[FLOODED] = arrival_ns
            return False
        self._put(place, packet, arrival_ns)
        return True

    def publish(self, publishers: Sequence[SamplePublisher], most: int) -> int:
        """
        Publish what waits, the most important class first and in each the oldest.

        :param publishers: one for each class.
        :param most: packets that are published at most; the others wait on.
        :return: how many were published.
        """
        left = most
        for place, queue in enumerate(self._queues):
            publisher = publishers[place]
            while queue and left:
                packet, arrival_ns = queue.popleft()
                self.waiting -= 1
                self.waiting_bytes -= len(packet)
                left -= 1
                publisher.fill(memoryview(packet))
                publisher.publish(arrival_ns)
        return most - left

    def report(self) -> dict[str, Value]:
        """Return the counters by name, for statistics and diagnostics."""
        copies = self.copies
        found: dict[str, Value] = {'duplicates': copies.copies}
        for place, name in enumerate(self.classes):
            found[f'packets_{name}'] = self.taken[place]
            found[f'lost_{name}'] = self.lost[place]
            found[f'waiting_{name}'] = len(self._queues[place])
        found.update({
            'streams': copies.streams, 'sequence_jumps': copies.jumps,
            'restarted_nodes': copies.restarts, 'sink_resets': self.sink_resets,
            'shared_ids': copies.shared_ids, 'forgotten_streams': copies.forgotten,
            'foreign_groups': self.foreign, 'unknown_types': self.unknown,
            'unknown_by_type': self.unknown_by_type(), 'truncated_headers': self.truncated,
            'lying_lengths': self.lying, 'no_active_messages': self.not_am,
            'cost_0_claims': self.free_of_charge, 'over_rate': self.limit.refused})
        return found

    def unknown_by_type(self) -> str:
        """Return how many packets there were of unknown types, the commonest first."""
        ranked = sorted(self._unknown.items(), key=lambda each: (-each[1], each[0]))
        told = ', '.join(f'{am_type:#04x}: {count}' for am_type, count in ranked[:_TYPES_TOLD])
        more = len(ranked) - _TYPES_TOLD
        return f'{told}, {more} more' if more > 0 else told

    def _refuse(self, look: PacketHeader, packet: bytes, arrival_ns: int) -> None:
        self.ignored += 1
        if look.problem == TRUNCATED:
            self.truncated += 1
            self.misfit = packet
        elif look.problem == LYING:
            self.lying += 1
            self.misfit = packet
        elif look.problem == NOT_AM:
            self.not_am += 1
        else:
            self.foreign += 1
            self.foreign_group = look.group
            self.last_ns[FOREIGN] = arrival_ns

    def _put(self, place: int, packet: bytes, arrival_ns: int) -> None:
        queue = self._queues[place]
        if len(queue) >= self._room:
            self.waiting -= 1
            self.waiting_bytes -= len(queue.popleft()[0])
            self.lost[place] += 1
            self.last_ns[self.classes[place]] = arrival_ns
        self.taken[place] += 1
        self.waiting += 1
        self.waiting_bytes += len(packet)
        queue.append((packet, arrival_ns))
