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
Which sentence of a satellite receiver becomes the fix, for many say where it is, several times.

GGA says most, then GNS, RMC and GLL; the best kind that the receiver sends is the *source*, and
the others are not used for the position. What it sends shows within one cycle:

- GGA is the source as soon as it comes. Sentences of the other kinds are held until one of them
  comes a second time, for then a whole cycle has been seen; at the latest after two seconds. Those
  of the best kind are given then, late but with their own moments.
- One fix an epoch, which its UTC time of day names: what becomes the source later gives no fix of
  a time that has one. The same sentence again is a new epoch even where the clock stands still,
  as it does in some receivers before they know the time.
- Of two talkers (``GPGGA``, ``GLGGA``) the first is the source. Where it has no fix and the other
  has one, the other takes over.
- A source that has not come for ten cycles is gone; what is left is looked at anew.
"""

from __future__ import annotations

from typing import Final

from rt_robot_os.devices.nmea.fix import claims_fix
from rt_robot_os.devices.nmea.sentences import PositionSentence
from rt_robot_os.units import NS_PER_S

_RANKS: Final = {'GGA': 0, 'GNS': 1, 'RMC': 2, 'GLL': 3}
_GONE_CYCLES: Final = 10
_LONGEST_CYCLE_NS: Final = 2 * NS_PER_S
# Talkers come and go only in noise.
_MOST_HELD: Final = 16

# Talker and kind.
_Key = tuple[str, str]
# A sentence and its arrival.
Timed = tuple[PositionSentence, int]


class FixSource:
    """Choose the sentences that become fixes; safe in the loop, keeps 16 of them at most."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget everything: the stream starts anew."""
        self._source: _Key | None = None
        self._held: list[Timed] = []
        # How often each other sentence came since the source did.
        self._others: dict[_Key, int] = {}
        self._given: PositionSentence | None = None

    @property
    def is_known(self) -> bool:
        """Return whether the receiver has shown what it sends."""
        return self._source is not None

    def take(self, sentence: PositionSentence, arrival_ns: int) -> list[Timed]:
        """
        Take the next sentence.

        :return: what becomes a fix now, in order; empty when it is held or not used.
        """
        key = (sentence.talker, sentence.kind)
        if key == self._source:
            self._others.clear()
            return self._give([(sentence, arrival_ns)])
        if self._takes_over(sentence):
            self._adopt(key)
            return self._give([(sentence, arrival_ns)])
        self._others[key] = count = self._others.get(key, 0) + 1
        if self._source is not None:
            if count < _GONE_CYCLES:
                if len(self._others) > _MOST_HELD:
                    self._others.clear()
                return []
            self._source = None
            self._others = {key: 1}
        self._held.append((sentence, arrival_ns))
        if self._others[key] > 1 or len(self._held) >= _MOST_HELD:
            return self._decide()
        return []

    def idle(self, now_ns: int) -> list[Timed]:
        """Return what was held when no second sentence comes."""
        if self._held and now_ns - self._held[0][1] > _LONGEST_CYCLE_NS:
            return self._decide()
        return []

    def _takes_over(self, sentence: PositionSentence) -> bool:
        """Return whether a sentence is better than those of the source, if there is one."""
        rank = _RANKS[sentence.kind]
        if self._source is None:
            return rank == 0
        of_source = _RANKS[self._source[1]]
        if rank != of_source:
            return rank < of_source
        given = self._given
        return given is not None and not claims_fix(given) and claims_fix(sentence)

    def _decide(self) -> list[Timed]:
        held, self._held = self._held, []
        best = min((s for s, _ in held), key=lambda s: _RANKS[s.kind])
        key = (best.talker, best.kind)
        self._adopt(key)
        return self._give([(s, at) for s, at in held if (s.talker, s.kind) == key])

    def _adopt(self, key: _Key) -> None:
        self._source = key
        self._held = []
        self._others.clear()

    def _give(self, found: list[Timed]) -> list[Timed]:
        """Leave out what another sentence has told of the same epoch."""
        fresh = []
        for sentence, arrival_ns in found:
            given = self._given
            if given is None or sentence.time_ns is None or given.time_ns != sentence.time_ns \
                    or (given.talker, given.kind) == (sentence.talker, sentence.kind) \
                    or claims_fix(sentence) and not claims_fix(given):
                self._given = sentence
                fresh.append((sentence, arrival_ns))
        return fresh
