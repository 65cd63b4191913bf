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
Sorts the packets of a sink by importance before they are decoded.

Each class has a bounded queue of its own, so that a flood of one neither delays nor displaces
another. The most important packets are published first.
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
from rt_robot_os.features.wsn.sink.packet_header import NOT_AM
from rt_robot_os.features.wsn.sink.packet_header import PacketHeader
from rt_robot_os.features.wsn.sink.packet_header import TRUNCATED
from rt_robot_os.features.wsn.sink.packet_header import WRONG_LENGTH

#: Keys of ``Sorting.last_ns`` besides the classes.
SHARED, CLAIMED, FOREIGN, FLOODED = 'shared id', 'claims no cost', 'foreign group', 'flooded'
_TYPES_TOLD: Final = 8


class Sorting:
    """
    Sort packets, drop duplicates, queue them by class and publish them; safe in the loop.

    :ivar duplicates: the filter of duplicates, with its counters.
    :ivar taken: valid packets of each class, without duplicates.
    :ivar lost: packets of each class that its full queue lost, always the oldest.
    :ivar ignored: packets that are not published, duplicates included.
    :ivar foreign: packets of other groups.
    :ivar foreign_group: group of the last one; -1 none.
    :ivar truncated: packets shorter than their header.
    :ivar wrong_length: packets whose length byte does not match their length.
    :ivar misfit: the last of those two.
    :ivar not_am: packets under TinyOS 2.x that are not active messages.
    :ivar zero_cost_claims: beacons of other nodes than the root that advertise a cost of 0.
    :ivar claimant: sender of the last one; -1 for none.
    :ivar limit: the rate limit of each node in the important classes, with its counters.
    :ivar last_ns: time of the last event that needs attention, by ``SHARED``,
        ``CLAIMED``, ``FOREIGN``, ``FLOODED``, or the class that lost a packet.
    :ivar sink_resets: reboots of the sink itself, according to its sequence numbers.
    """

    def __init__(self, read_header: HeaderReader, classifier: Classifier,
                 duplicates: DuplicateFilter, limit: FlowLimit, *, room: int,
                 groups: Collection[int], known_types: Collection[int], root: int) -> None:
        """
        Create empty queues.

        :param room: capacity of each queue.
        :param groups: accepted AM groups; empty for all.
        :param known_types: types that are not counted as unknown.
        :param root: address of the sink.
        """
        self._read_header = read_header
        self._classifier = classifier
        self.duplicates = duplicates
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
        self.foreign = self.truncated = self.wrong_length = self.not_am = self.zero_cost_claims = 0
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
        """Return the number of packets of unknown types; they are published, too."""
        return sum(self._unknown.values())

    @property
    def sink_resets(self) -> int:
        """Return the number of reboots of the sink itself."""
        return self._root_restarts

    def add(self, packet: bytes, arrival_ns: int) -> bool:
        """
        Put a packet into the queue of its class.

        :return: whether it will be published.
        """
        header = self._read_header(packet)
        if header.problem or (self._groups and header.group not in self._groups):
            self._refuse(header, packet, arrival_ns)
            return False
        if header.am_type not in self._known_types:
            self._unknown[header.am_type] = self._unknown.get(header.am_type, 0) + 1
        if header.sequence >= 0 or header.content:
            duplicates = self.duplicates
            restarts, shared = duplicates.restarts, duplicates.shared_ids
            if duplicates.is_duplicate(header.origin, header.am_type, header.content,
                                       header.sequence, header.bits, arrival_ns):
                self.ignored += 1
                return False
            if duplicates.restarts != restarts and header.origin == self._root:
                self._root_restarts += 1
            if duplicates.shared_ids != shared:
                self.last_ns[SHARED] = arrival_ns
        if header.zero_cost >= 0 and header.zero_cost != self._root:
            self.zero_cost_claims += 1
            self.claimant = header.zero_cost
            self.last_ns[CLAIMED] = arrival_ns
        place = self._classifier.place(header.am_type, header.kind, header.origin, header.group)
        # The last class has no rate limit: its queue delays no other.
        if place < len(self._queues) - 1 and not self.limit.accepts(
                header.origin, header.relay, arrival_ns):
            self.ignored += 1
            self.last_ns[FLOODED] = arrival_ns
            return False
        self._put(place, packet, arrival_ns)
        return True

    def publish(self, publishers: Sequence[SamplePublisher], most: int) -> int:
        """
        Publish queued packets, the most important class first and the oldest of each first.

        :param publishers: one for each class.
        :param most: largest number of packets to publish.
        :return: number of packets published.
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
        duplicates = self.duplicates
        found: dict[str, Value] = {'duplicates': duplicates.dropped}
        for place, name in enumerate(self.classes):
            found[f'packets_{name}'] = self.taken[place]
            found[f'lost_{name}'] = self.lost[place]
            found[f'waiting_{name}'] = len(self._queues[place])
        found.update({
            'streams': duplicates.streams, 'sequence_jumps': duplicates.jumps,
            'restarted_nodes': duplicates.restarts, 'sink_resets': self.sink_resets,
            'shared_ids': duplicates.shared_ids, 'forgotten_streams': duplicates.forgotten,
            'foreign_groups': self.foreign, 'unknown_types': self.unknown,
            'unknown_by_type': self.unknown_by_type(), 'truncated_headers': self.truncated,
            'lying_lengths': self.wrong_length, 'no_active_messages': self.not_am,
            'cost_0_claims': self.zero_cost_claims, 'over_rate': self.limit.refused})
        return found

    def unknown_by_type(self) -> str:
        """Return the number of packets of each unknown type, the most frequent first."""
        ranked = sorted(self._unknown.items(), key=lambda each: (-each[1], each[0]))
        told = ', '.join(f'{am_type:#04x}: {count}' for am_type, count in ranked[:_TYPES_TOLD])
        more = len(ranked) - _TYPES_TOLD
        return f'{told}, {more} more' if more > 0 else told

    def _refuse(self, header: PacketHeader, packet: bytes, arrival_ns: int) -> None:
        self.ignored += 1
        if header.problem == TRUNCATED:
            self.truncated += 1
            self.misfit = packet
        elif header.problem == WRONG_LENGTH:
            self.wrong_length += 1
            self.misfit = packet
        elif header.problem == NOT_AM:
            self.not_am += 1
        else:
            self.foreign += 1
            self.foreign_group = header.group
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
