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
Counts received, lost and duplicate packets of a node by their sequence numbers.

A missing packet is lost, unless it arrives late. A number that was received recently with the same
content is a duplicate. Numbers that restart indicate a reboot: two packets have to confirm it, so
that a single stray one has no effect. Two sequences that continue in parallel are two nodes with
the same id. Everything is bounded, and safe in the real-time loop.
"""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.units import NS_PER_S

# Size of the receive window, a power of two.
WINDOW: Final = 64
_ALL: Final = (1 << WINDOW) - 1
#: Largest age of the first copy of a duplicate, and of a packet that is late.
LATE_NS: Final = 30 * NS_PER_S
# Number of packets over which the period is averaged; a few may be a burst.
_AVERAGED: Final = 32
_SETTLED: Final = 8
_ROUGHLY: Final = 2
# Tolerance of numbers ahead of the time that has passed, since packets wait in queues.
_AHEAD: Final = {8: 112}
# Largest first number after a reboot while the period is unknown.
_NEAR_0: Final = 16
# Length of the queue that a node sends after an interruption.
_IN_ORDER: Final = 4
# Largest step of a replaced sequence that continues.
_GOES_ON: Final = 8
# Continuations of a replaced sequence until it is that of another node.
_TWIN: Final = 3
# Repeated numbers in a row, at the period of the node, until they count as a reboot.
_REPEATED: Final = 3

NEW: Final = 0
DUPLICATE: Final = 1
LATE: Final = 2
_FOREIGN: Final = 3


class _Stream:
    """A sequence of numbers; ``highest`` and ``first`` are unwrapped."""

    __slots__ = ('bits', 'first', 'highest', 'seen', 'last_ns', 'began_ns', 'since_ns', 'lost',
                 'period_ns', 'prints', 'times', 'anchors', 'witnessed')

    def __init__(self, number: int, bits: int, fingerprint: int, now_ns: int, since_ns: int
                 ) -> None:
        self.bits = bits
        self.first = self.highest = number
        self.seen = 1
        self.last_ns = self.began_ns = now_ns
        self.since_ns = since_ns  # start of listening, or the end of another sequence
        self.lost = 0
        self.period_ns = 0
        self.prints = [0] * WINDOW
        self.times = [0] * WINDOW
        self.anchors = [(number, now_ns)]
        self.witnessed = True
        self._mark(number, fingerprint, now_ns)

    def offer(self, number: int, fingerprint: int, now_ns: int, most: int = 1 << 32) -> int:
        """Add a number if it fits and is not further ahead than ``most``."""
        ahead = self._ahead(number, now_ns)
        if ahead > most:
            return _FOREIGN
        if ahead > 0:
            self._advance(ahead, fingerprint, now_ns)
            return NEW
        if ahead <= -WINDOW:
            return _FOREIGN
        place = self.highest + ahead
        if self.seen >> -ahead & 1:
            slot = place & WINDOW - 1
            same = self.prints[slot] == fingerprint and now_ns - self.times[slot] <= LATE_NS
            return DUPLICATE if same else _FOREIGN
        if place < 0 or now_ns - self._next_ns(-ahead) > LATE_NS:
            return _FOREIGN
        if place < self.first:
            self.lost += self.first - place - 1
            self.first = place
        else:
            self.lost -= 1
        self.seen |= 1 << -ahead
        self._mark(place, fingerprint, now_ns)
        return LATE

    def lead(self) -> int:
        """Return the losses before the first number received, since the start of listening."""
        return self.first if self.period_ns and self.witnessed else 0

    def _ahead(self, number: int, now_ns: int) -> int:
        """Return the distance from the highest number; after a long silence it has wrapped."""
        size = 1 << self.bits
        forward = number - self.highest & size - 1
        half = size >> 1
        passed = (now_ns - self.last_ns) // self.period_ns if self.period_ns else 0
        if 2 * passed > half and len(self.anchors) > _SETTLED:
            ahead = forward + size * ((passed - forward + half) // size)
            if abs(passed - ahead) <= self._tolerance(passed):
                return ahead
            if passed > half:
                return -WINDOW  # a reboot, of this node or another one
        if forward > half + min(passed, half // 4):
            return forward - size
        if self.bits == 8 and self._began_again(number, forward, passed):
            return -WINDOW
        return forward if forward <= (
            _AHEAD.get(self.bits, WINDOW) + passed + passed // 2) else -WINDOW

    def _began_again(self, number: int, forward: int, passed: int) -> bool:
        """Distinguish a reboot from a loss where both explain a number of 8 bits."""
        return (number < self.highest & 0xFF and forward > _IN_ORDER and number <= passed + 2
                and bool(self.period_ns) and abs(forward - passed) > self._tolerance(passed))

    def _tolerance(self, passed: int) -> int:
        """Return the tolerance of a number predicted from the time and the estimated period."""
        return 4 + 3 * passed // max(1, self.highest - self.anchors[0][0])

    def _advance(self, ahead: int, fingerprint: int, now_ns: int) -> None:
        self.lost += ahead - 1
        self.highest += ahead
        self.seen = (self.seen << ahead | 1) & _ALL if ahead < WINDOW else 1
        self.last_ns = now_ns
        self._mark(self.highest, fingerprint, now_ns)
        anchors = self.anchors
        settled = len(anchors) > _SETTLED
        if len(anchors) > _AVERAGED:
            del anchors[0]
        anchors.append((self.highest, now_ns))
        if len(anchors) <= _ROUGHLY:
            return
        number, then_ns = anchors[0]
        self.period_ns = max(1, (now_ns - then_ns) // (self.highest - number))
        if not settled:
            self._witness()

    def inherit(self, period_ns: int) -> None:
        """Use the period of the previous sequence until its own is known."""
        if not self.period_ns:
            self.period_ns = period_ns
            self._witness()

    def _witness(self) -> None:
        passed_ns = self.began_ns - self.since_ns
        self.witnessed = (2 * self.first - 3) * self.period_ns <= 2 * passed_ns

    def _next_ns(self, back: int) -> int:
        """Return the arrival time of the next higher number received."""
        higher = self.seen & (1 << back) - 1
        return self.times[self.highest - higher.bit_length() + 1 & WINDOW - 1]

    def _mark(self, place: int, fingerprint: int, now_ns: int) -> None:
        slot = place & WINDOW - 1
        self.prints[slot] = fingerprint
        self.times[slot] = now_ns


class SequenceAccount:
    """
    The packets of one node.

    :param bits: of its counter: 8, 16 or 32.
    :param since_ns: start of listening: packets that the node sent since then are lost when they
        did not arrive, if its numbers show that it started later.
    :ivar received: packets received, without duplicates.
    :ivar duplicates: packets received again.
    :ivar late: packets received after later ones.
    :ivar reboots: restarts of the numbers.
    :ivar jumps: steps of the numbers that are larger than the time that had passed explains.
    :ivar strays: numbers that do not fit any others.
    :ivar twins: two sequences continued in parallel: two nodes have this id.
    :ivar twin_ns: time of the last packet that showed it.
    """

    __slots__ = ('bits', 'received', 'duplicates', 'late', 'reboots', 'jumps', 'strays', 'twins',
                 'twin_ns', '_closed_lost', '_since_ns', '_main', '_other', '_candidate',
                 '_other_hits', '_repeated', '_repeat', '_repeat_ns')

    def __init__(self, bits: int, since_ns: int) -> None:
        self.bits = bits
        self.received = self.duplicates = self.late = 0
        self.reboots = self.jumps = self.strays = 0
        self.twins = False
        self.twin_ns = -1
        self._closed_lost = 0
        self._since_ns = since_ns
        self._main: _Stream | None = None
        self._other: _Stream | None = None
        self._candidate: _Stream | None = None
        self._other_hits = 0
        self._repeated = 0
        self._repeat = -1
        self._repeat_ns = 0

    def add(self, number: int, fingerprint: int, now_ns: int, renewed: bool = False) -> int:
        """
        Count a packet.

        :param number: of the packet, from 0; only the lowest ``bits`` are used.
        :param fingerprint: hash of the content, equal for duplicates.
        :param renewed: another field of the packet shows that the node has rebooted.
        :return: NEW, DUPLICATE or LATE.
        """
        number &= (1 << self.bits) - 1
        main = self._main
        if main is not None and renewed and (
                self._other is None or now_ns - self._other.last_ns > LATE_NS):
            self._repeated = 0
            self.received += 1
            self._switch(_Stream(number, self.bits, fingerprint, now_ns, main.last_ns))
            return NEW
        if main is None:
            self._main = _Stream(number, self.bits, fingerprint, now_ns, self._since_ns)
            self.received += 1
            return NEW
        lost = main.lost
        found = main.offer(number, fingerprint, now_ns)
        if found == DUPLICATE:
            return self._again(main, number, fingerprint, now_ns)
        if main.lost > lost and self._candidate is not None:
            self._claim(main, self._candidate, now_ns)
        if found == _FOREIGN:
            found = self._offer_others(main, number, fingerprint, now_ns)
        self._repeated = 0
        if found == DUPLICATE:
            self.duplicates += 1
            return DUPLICATE
        self.received += 1
        if found == LATE:
            self.late += 1
        return found

    @property
    def lost(self) -> int:
        """Return the number of packets lost, according to the numbers received."""
        streams = (self._main, self._other)
        return self._closed_lost + sum(each.lost + each.lead() for each in streams if each)

    @property
    def delivery(self) -> float:
        """Return the share received; 1 before the first packet."""
        sent = self.received + self.lost
        return self.received / sent if sent else 1.0

    @property
    def period_ns(self) -> int:
        """Return the usual time between packets; 0 while unknown."""
        return self._main.period_ns if self._main else 0

    @property
    def highest(self) -> int:
        """Return the last number; -1 before the first."""
        return self._main.highest & (1 << self.bits) - 1 if self._main else -1

    def _offer_others(self, main: _Stream, number: int, fingerprint: int, now_ns: int) -> int:
        other, candidate = self._other, self._candidate
        if other is not None and now_ns - other.last_ns > max(LATE_NS, 4 * other.period_ns):
            self._close(other)
        elif other is not None:
            found = other.offer(number, fingerprint, now_ns, _GOES_ON)
            if found != _FOREIGN:
                if found == NEW:
                    self._went_on(now_ns)
                return found
        if candidate is not None:
            found = candidate.offer(number, fingerprint, now_ns)
            if found == DUPLICATE:
                return found
            if found != _FOREIGN:
                self._switch(candidate)
                return found
            self.strays += 1
        self._candidate = _Stream(number, self.bits, fingerprint, now_ns, main.last_ns)
        return NEW

    def _claim(self, main: _Stream, candidate: _Stream, now_ns: int) -> None:
        """Drop the candidate where it fits the gap that has just been found."""
        number = candidate.first
        if candidate.first == candidate.highest and main.offer(
                number, candidate.prints[number & WINDOW - 1], now_ns, 0) == LATE:
            self._candidate = None

    def _went_on(self, now_ns: int) -> None:
        """Note that a replaced sequence continues."""
        self._other_hits += 1
        if self._other_hits >= _TWIN:
            self.twin_ns = now_ns
        if self._other_hits == _TWIN and not self.twins:
            self.twins = True
            self.reboots = max(0, self.reboots - 1)

    def _switch(self, candidate: _Stream) -> None:
        """Continue with the candidate, which two packets have confirmed."""
        main = self._main
        assert main is not None
        self._close(self._other)
        if self._jumped(main, candidate):
            self.jumps += 1
            candidate.since_ns = candidate.began_ns  # the numbers between were never sent
        else:
            self.reboots += 1
        candidate.inherit(main.period_ns)
        self._other, self._main, self._candidate = main, candidate, None
        self._other_hits = 0

    def _close(self, stream: _Stream | None) -> None:
        """Keep the losses of a sequence that has ended."""
        if stream is not None:
            self._closed_lost += stream.lost + stream.lead()
        self._other = None

    def _jumped(self, main: _Stream, candidate: _Stream) -> bool:
        size = 1 << self.bits
        forward = candidate.first - main.highest & size - 1
        began_again = main.period_ns and candidate.first * main.period_ns <= (
            candidate.began_ns - candidate.since_ns + 2 * main.period_ns)
        return forward <= size >> 1 and not began_again and candidate.first > _NEAR_0

    def _again(self, main: _Stream, number: int, fingerprint: int, now_ns: int) -> int:
        """Count a duplicate, or detect a reboot after which a node repeats the same data."""
        follows = number == self._repeat + 1 and 2 * (now_ns - self._repeat_ns) > main.period_ns
        if number != self._repeat:
            self._repeated = self._repeated + 1 if follows and main.period_ns else 1
            self._repeat, self._repeat_ns = number, now_ns
        self.duplicates += 1
        # Duplicates arrive soon; and after a wrap small numbers are large ones.
        if self._repeated < _REPEATED or number + 1 - _REPEATED > _REPEATED or (
                now_ns - main.last_ns < (_REPEATED + 1) * main.period_ns
                or main.highest >> self.bits):
            return DUPLICATE
        again = _Stream(number + 1 - _REPEATED, self.bits, fingerprint,
                        now_ns - (_REPEATED - 1) * main.period_ns, main.last_ns)
        for each in range(number + 2 - _REPEATED, number + 1):
            again.offer(each, fingerprint, now_ns)
        self.duplicates -= _REPEATED
        self.received += _REPEATED
        self._repeated = 0
        self._switch(again)
        return NEW
