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
DuplicateFilter of packets that have come already, and what the numbers of an origin tell.

A packet may come more than once: a relay whose acknowledgement was lost sends it again, a node
without a route sends to all who hear it, and a sniffer hears every hop. A copy is what says the
same as a packet of the same origin that came shortly before, apart from what changes from hop to
hop. Since that includes the number of the packet and its reading, another node with the same id,
a node that begins anew and a number that begins again at 0 are not taken for copies.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Final

from rt_robot_os.base.units import NS_PER_S

#: Packets of each stream that are remembered: those of one type from one origin.
MEMORY: Final = 64
STREAMS_MAXIMUM: Final = 4096
#: A number that much smaller than the last is that of a node that has begun anew.
BACKWARDS: Final = 64
# Until then a copy is one whatever comes next.
_SURELY_NS: Final = 2 * NS_PER_S
# So many late ones in order are a stream that begins anew, not a relay that was held up.
_IN_ORDER: Final = 3
# Numbers below the first one of a row that may come late.
_GRACE: Final = 8
_NO_COPY: Final = -2, 0, 0


class _Stream:
    """
    What is known of the packets of one type from one origin.

    :ivar seen: content -> when it came, oldest first.
    :ivar highest: number of its newest packet; -1 none yet.
    :ivar before: that of the stream that the present one took the place of; -1 none.
    :ivar late: the last number below the highest, and how many came in order up to it.
    :ivar missing: how many numbers below the highest may still come.
    :ivar unexplained: more of them came than were missing.
    :ivar old_copy: the last one that was an old copy: its number, when the first came and when it.
    """

    __slots__ = ('seen', 'highest', 'before', 'late', 'missing', 'unexplained', 'old_copy')

    def __init__(self) -> None:
        self.seen: OrderedDict[int, int] = OrderedDict()
        self.highest = -1
        self.before = -1
        self.late = -2, 0
        self.missing = _GRACE
        self.unexplained = False
        self.old_copy = _NO_COPY

    def go_on(self, sequence: int) -> None:
        """Have a new highest number, behind which nothing is late yet."""
        self.highest = sequence
        self.late = -2, 0
        self.unexplained = False


class DuplicateFilter:
    """
    Leave out copies, in bounded memory; safe in the loop.

    :ivar copies: packets that were left out.
    :ivar jumps: times that numbers of a stream were missing.
    :ivar restarts: times that one began anew, its number having gone back.
    :ivar shared_ids: times that one origin said two things under one number, or two rows of
        numbers came from it in turn: two nodes have one id.
    :ivar shared_id: the last such origin; -1 none.
    :ivar forgotten: streams that were forgotten because there were too many.
    """

    def __init__(self, keep_ns: int) -> None:
        """
        Begin with an empty memory.

        :param keep_ns: how long a packet is remembered; 0 leaves nothing out.
        """
        self.copies = self.jumps = self.restarts = 0
        self.shared_ids = self.forgotten = 0
        self.shared_id = -1
        self._keep_ns = keep_ns
        self._streams: OrderedDict[tuple[int, int], _Stream] = OrderedDict()

    @property
    def streams(self) -> int:
        """Return the number of streams that are remembered."""
        return len(self._streams)

    def is_copy(self, origin: int, am_type: int, content: int, sequence: int, bits: int,
                now_ns: int) -> bool:
        """
        Take a packet, and return whether it is a copy of one before.

        :param origin: who made it; -1 unknown.
        :param content: a number for what stays the same from hop to hop; 0 has no copies.
        :param sequence: the number that the origin gave it; -1 none.
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
        if content and self._keep_ns and self._seen(known, content, sequence, now_ns):
            self.copies += 1
            return True
        if bits and sequence >= 0 and self._keep_ns:
            self._count(origin, known, sequence, 1 << bits)
        return False

    def _seen(self, known: _Stream, content: int, sequence: int, now_ns: int) -> bool:
        """Return whether it came before; if not, remember it."""
        seen = known.seen
        came_ns = seen.get(content)
        if came_ns is not None and now_ns - came_ns < self._keep_ns:
            if now_ns - came_ns <= _SURELY_NS:
                return True
            number, before_ns, copied_ns = known.old_copy
            known.old_copy = sequence, came_ns, now_ns
            # What a relay held back comes at once. What comes in order and as slowly as the first
            # time is a node that has begun anew and measures the same.
            if sequence != number + 1 or 2 * (now_ns - copied_ns) < came_ns - before_ns:
                return True
        else:
            known.old_copy = _NO_COPY
        seen[content] = now_ns
        seen.move_to_end(content)
        if len(seen) > MEMORY:
            seen.popitem(last=False)
        return False

    def _count(self, origin: int, known: _Stream, sequence: int, numbers: int) -> None:
        """Note what the number of a packet tells that is new."""
        highest = known.highest
        step = _step(highest, sequence, numbers) if highest >= 0 else 1
        if -BACKWARDS <= step <= 0:
            self._note_late(origin, known, sequence, step)
            return
        if known.unexplained:
            # Numbers that were not missing came between others that go on: two rows of them.
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
    """Return how far a number that begins again has gone; more than half of its way is back."""
    step = (after - before) % numbers
    return step if step < numbers // 2 else step - numbers
