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
Detection of duplicate packets, and evaluation of the sequence numbers of an origin.

A packet may arrive more than once: a relay whose acknowledgement was lost sends it again, a node
without a route broadcasts it, and a sniffer receives every hop. A duplicate has the same content
as a recent packet of the same origin, except for the fields that change at each hop. Since the
content includes the sequence number and the reading, packets of another node with the same id, of
a rebooted node and after a wrap of the number are not duplicates.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

from rt_robot_os.base.units import NS_PER_S

#: Number of packets stored of each stream (one type from one origin).
MEMORY: Final = 64
STREAMS_MAXIMUM: Final = 4096
#: A number smaller than the last one by more than this is that of a rebooted node.
BACKWARDS: Final = 64
# Up to this age a repetition is always a duplicate.
_SURELY_NS: Final = 2 * NS_PER_S
# Number of late packets in order that show a reboot rather than a delayed relay.
_IN_ORDER: Final = 3
# Numbers below the first one of a stream that may arrive late.
_GRACE: Final = 8
_NO_DUPLICATE: Final = -2, 0, 0


class _Stream:
    """
    The packets of one type from one origin.

    :ivar seen: content -> time of arrival, oldest first.
    :ivar highest: number of its newest packet; -1 for none.
    :ivar before: highest number of the stream that the present one replaced; -1 for none.
    :ivar late: the last number below the highest, and the number of packets in order up to it.
    :ivar missing: count of numbers below the highest that may still arrive.
    :ivar unexplained: more of them arrived than were missing.
    :ivar old_duplicate: the last duplicate that was old: its number, the arrival of the first copy
        and its own.
    """

    __slots__ = ('seen', 'highest', 'before', 'late', 'missing', 'unexplained', 'old_duplicate')

    def __init__(self) -> None:
        self.seen: OrderedDict[int, int] = OrderedDict()
        self.highest = -1
        self.before = -1
        self.late = -2, 0
        self.missing = _GRACE
        self.unexplained = False
        self.old_duplicate = _NO_DUPLICATE

    def go_on(self, sequence: int) -> None:
        """Set a new highest number; forget the late packets."""
        self.highest = sequence
        self.late = -2, 0
        self.unexplained = False


class DuplicateFilter:
    """
    Detects duplicates, in bounded memory; safe in the loop.

    :ivar dropped: number of duplicates.
    :ivar jumps: gaps in the numbers of a stream.
    :ivar restarts: reboots: the number of a stream went back.
    :ivar shared_ids: packets of one origin with the same number and different content, or with
        two alternating sequences: two nodes have the same id.
    :ivar shared_id: the last such origin; -1 for none.
    :ivar forgotten: streams removed because there were too many.
    """

    def __init__(self, keep_ns: int) -> None:
        """
        Create an empty filter.

        :param keep_ns: how long a packet is stored; 0 disables the filter.
        """
        self.dropped = self.jumps = self.restarts = 0
        self.shared_ids = self.forgotten = 0
        self.shared_id = -1
        self._keep_ns = keep_ns
        self._streams: OrderedDict[tuple[int, int], _Stream] = OrderedDict()

    @property
    def streams(self) -> int:
        """Return the number of streams stored."""
        return len(self._streams)

    def is_duplicate(self, origin: int, am_type: int, content: int, sequence: int, bits: int,
                     now_ns: int) -> bool:
        """
        Add a packet, and return whether it is a duplicate.

        :param origin: node that made it; -1 if unknown.
        :param content: hash of what is the same at each hop; 0 for packets without duplicates.
        :param sequence: sequence number from the origin; -1 for none.
        :param bits: of that number; 0 when gaps in it mean nothing.
        """
        key = origin, am_type
        streams = self._streams
        known = streams.get(key)
        if known is None:
            if len(streams) >= STREAMS_MAXIMUM:
                streams.popitem(last=False)
                self.forgotten += 1
            known = streams[key] = _Stream()
        elif len(streams) > STREAMS_MAXIMUM // 2:
            streams.move_to_end(key)
        if content and self._keep_ns and self._is_repeated(known, content, sequence, now_ns):
            self.dropped += 1
            return True
        if bits and sequence >= 0 and self._keep_ns:
            self._count(origin, known, sequence, 1 << bits)
        return False

    def _is_repeated(self, known: _Stream, content: int, sequence: int, now_ns: int) -> bool:
        """Return whether the content is a repetition; if not, store it."""
        seen = known.seen
        came_ns = seen.get(content)
        if came_ns is not None and now_ns - came_ns < self._keep_ns:
            if now_ns - came_ns <= _SURELY_NS:
                return True
            number, before_ns, copied_ns = known.old_duplicate
            known.old_duplicate = sequence, came_ns, now_ns
            # Packets that a relay held back arrive in a burst. Packets in order and as slow as
            # the first time are from a rebooted node that measures the same.
            if sequence != number + 1 or 2 * (now_ns - copied_ns) < came_ns - before_ns:
                return True
        else:
            known.old_duplicate = _NO_DUPLICATE
        seen[content] = now_ns
        seen.move_to_end(content)
        if len(seen) > MEMORY:
            seen.popitem(last=False)
        return False

    def _count(self, origin: int, known: _Stream, sequence: int, numbers: int) -> None:
        """Evaluate the sequence number of a new packet."""
        highest = known.highest
        step = _step(highest, sequence, numbers) if highest >= 0 else 1
        if -BACKWARDS <= step <= 0:
            self._note_late(origin, known, sequence, step)
            return
        if known.unexplained:
            # Numbers that were not missing, between others that continue: two sequences.
            self._note_shared(origin)
        if step > BACKWARDS or step < 0:
            before, known.before = known.before, highest
            if before >= 0 and 0 < _step(before, sequence, numbers) <= BACKWARDS:
                self._note_shared(origin)
            elif step > 0:
                self.jumps += 1
            else:
                self.restarts += 1
            known.missing = _GRACE
        elif step > 1:
            self.jumps += 1
            known.missing = min(known.missing + step - 1, BACKWARDS)
        known.go_on(sequence)

    def _note_late(self, origin: int, known: _Stream, sequence: int, step: int) -> None:
        if step == 0:
            self._note_shared(origin)
            return
        number, count = known.late
        count = count + 1 if sequence == number + 1 else 1
        if count < _IN_ORDER:
            known.late = sequence, count
            known.unexplained = known.unexplained or not known.missing
            known.missing = max(0, known.missing - 1)
            return
        self.restarts += 1
        known.missing = _GRACE
        known.go_on(sequence)

    def _note_shared(self, origin: int) -> None:
        self.shared_ids += 1
        self.shared_id = origin


def _step(before: int, after: int, numbers: int) -> int:
    """Return the step of a number that wraps; more than half of its range is backwards."""
    step = (after - before) % numbers
    return step if step < numbers // 2 else step - numbers
