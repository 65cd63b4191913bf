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
Selects the sentence of a satellite receiver that becomes the fix: several contain the position.

Sentences are merged by epoch, identified by their UTC time of day, and each epoch gives one fix.
GGA contains most, then GNS, RMC and GLL; the best kind that the receiver sends is the *source*:

- The sentence of the source is published when it arrives. So is a sentence of a better kind, and
  one of a talker that was absent in the previous epoch. All others are held.
- An epoch without its source ends when the next one begins, or after two seconds. Then the best
  held sentence is published, late but with its own stamp, and its kind becomes the source. So no
  epoch is lost when a receiver changes its sentences or its talker.
- A better kind becomes the source when two consecutive epochs have it. One that arrives once a
  minute gives the fix of its epoch only.
- Sentences held before the first GGA are dropped: the port was opened in the middle of an epoch.
- Of two talkers (``GPGGA``, ``GLGGA``) the first is the source. If it has no fix and the other has
  one, the other becomes the source; so does GNS if GGA contradicts its own fix with 0 satellites.
- The same kind of sentence again starts a new epoch, even if the clock does not advance, as in
  some receivers before they know the time. A sentence of the previous epoch is late and not used.

gpsd also merges the sentences of a cycle by their time stamps.
"""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.nmea.fix import claims_fix
from rt_robot_os.devices.nmea.fix import is_quality_of_fix
from rt_robot_os.devices.nmea.sentences import PositionSentence

_RANKS: Final = {'GGA': 0, 'GNS': 1, 'RMC': 2, 'GLL': 3}
_LONGEST_CYCLE_NS: Final = 2 * NS_PER_S
# Limit of talkers and kinds of an epoch; more are noise.
_MOST_HELD: Final = 16

# Talker and kind.
_Key = tuple[str, str]
# A sentence and its arrival.
Timed = tuple[PositionSentence, int]


class NmeaFixSource:
    """Choose the sentences that become fixes; safe in the loop, holds 16 of them at most."""

    def __init__(self) -> None:
        self._source: _Key | None = None
        # Of the previous epoch, and of this one.
        self._before: frozenset[_Key] = frozenset()
        self._before_ns: int | None = None
        self._time_ns: int | None = None
        self._keys: set[_Key] = set()
        self._held: list[Timed] = []
        self._given: PositionSentence | None = None

    def restart(self) -> None:
        """Reset everything: the stream restarts."""
        self._source = None
        self._before = frozenset()
        self._before_ns = None
        self._begin()

    @property
    def is_known(self) -> bool:
        """Return whether the source is known."""
        return self._source is not None

    def take(self, sentence: PositionSentence, arrival_ns: int) -> list[Timed]:
        """
        Receive the next sentence.

        :return: the sentences that become fixes now, in order; empty if it is held or not used.
        """
        key = (sentence.talker, sentence.kind)
        time_ns = sentence.time_ns
        if time_ns is not None and time_ns == self._before_ns and self._time_ns != time_ns:
            return []
        found: list[Timed] = []
        if self._is_next(key, time_ns):
            if self._source is not None or key[1] != 'GGA':
                found = self._end()
            self._begin()
        if self._source is None and key[1] == 'GGA':
            self._source = key
        if self._time_ns is None:
            self._time_ns = time_ns
        self._keys.add(key)
        if self._given is None:
            if not self._is_wanted(key, sentence):
                self._held.append((sentence, arrival_ns))
                return found
        elif not self._corrects(sentence):
            return found
        else:
            self._source = key
        self._given = sentence
        self._held.clear()
        return [*found, (sentence, arrival_ns)]

    def idle(self, now_ns: int) -> list[Timed]:
        """Return the held sentence if neither the source nor the next epoch arrives."""
        if self._held and now_ns - self._held[0][1] > _LONGEST_CYCLE_NS:
            return self._end()
        return []

    def _begin(self) -> None:
        self._time_ns = None
        self._keys = set()
        self._held = []
        self._given = None

    def _is_next(self, key: _Key, time_ns: int | None) -> bool:
        """Return whether a sentence begins the next epoch."""
        if key in self._keys or len(self._keys) >= _MOST_HELD:
            return True
        return None not in (time_ns, self._time_ns) and time_ns != self._time_ns

    def _is_wanted(self, key: _Key, sentence: PositionSentence) -> bool:
        """Return whether the first fix of an epoch need not wait for a better sentence."""
        if self._source is None or key == self._source:
            return key == self._source
        rank, of_source = _RANKS[key[1]], _RANKS[self._source[1]]
        if rank == of_source and key in self._before:
            return False  # one of two talkers; the source may still arrive
        return rank <= of_source and claims_fix(sentence)

    def _corrects(self, sentence: PositionSentence) -> bool:
        """Return whether a sentence has a fix and the published one of its epoch has none."""
        given = self._given
        if given is None or claims_fix(given) or not claims_fix(sentence):
            return False
        if _RANKS[sentence.kind] == _RANKS[given.kind]:
            return True
        return is_quality_of_fix(given.quality) and bool(sentence.satellites)

    def _end(self) -> list[Timed]:
        """End an epoch: publish the held sentence if none was published, and choose the source."""
        found: list[Timed] = []
        if self._given is None and self._held:
            found = [min(self._held, key=lambda each: (
                not claims_fix(each[0]), _RANKS[each[0].kind]))]
            self._given = found[0][0]
            self._source = (self._given.talker, self._given.kind)
        elif self._source is not None and self._keys:
            best = min(self._keys, key=lambda each: _RANKS[each[1]])
            if self._source not in self._keys:
                self._source = best
            elif best in self._before and _RANKS[best[1]] < _RANKS[self._source[1]]:
                self._source = best
        self._held = []
        self._before, self._before_ns = frozenset(self._keys), self._time_ns
        return found
