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

"""A vital sign of which several sensors tell: the best that has a value counts."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.health.vital_signs.sensor import Change
from rt_robot_os.features.health.vital_signs.sensor import SensorSource
from rt_robot_os.features.health.vital_signs.sensor import SILENT
from rt_robot_os.messages.signs import Sign
from rt_robot_os.modules.debounce import Debounce

GOOD: Final = 'good'
#: Two sensors contradict each other.
SUSPECT: Final = 'suspect'
#: There is a value, and it is too old.
STALE: Final = 'stale'
#: The sensor is not worn, or broken.
OFF: Final = 'off'
#: There has been nothing.
MISSING: Final = 'missing'
QUALITIES: Final = (GOOD, SUSPECT, STALE, OFF, MISSING)


class Reading(NamedTuple):
    """
    What is known of a sign at a moment.

    :ivar value: the last one; NaN when there is none.
    :ivar quality: one of :data:`QUALITIES`; only a good value is one to rely on.
    :ivar stamp_ns: when it was measured; -1 when there is none.
    :ivar source: the sensor that it is of; empty when there is none.
    """

    value: float
    quality: str
    stamp_ns: int
    source: str


class SignWatch:
    """
    A sign and its sensors; safe in the real-time loop.

    :ivar sign: which.
    :ivar sources: its sensors, the preferred first.
    """

    __slots__ = ('sign', 'sources', '_apart')

    def __init__(self, sign: Sign, sources: Sequence[SensorSource]) -> None:
        self.sign = sign
        self.sources = tuple(sources)
        times = sources[0].times
        self._apart = Debounce(times.off_ns, times.back_ns)

    def take(self, place: int, value: float, stamp_ns: int) -> bool:
        """
        Take a reading of a sensor; :meth:`advance` to the moment before it first.

        :return: whether it is a value that counts.
        """
        taken = self.sources[place].take(value, stamp_ns)
        if self.sign.apart and len(self.sources) > 1:
            clean = [each.value for each in self.sources if each.is_clean(stamp_ns)]
            # Compared with the one that counts; what is alone contradicts nobody.
            self._apart.put(any(abs(each - clean[0]) > self.sign.apart for each in clean[1:]),
                            stamp_ns)
        return taken

    def advance(self, now_ns: int) -> list[tuple[SensorSource, Change]]:
        """Let time pass; return the sensors that went off or are back, in order."""
        found = [(source, change) for source in self.sources for change in source.advance(now_ns)]
        self._apart.advance(now_ns)
        return sorted(found, key=lambda each: each[1].stamp_ns)

    @property
    def due_ns(self) -> float:
        """When :meth:`advance` has something to do if no reading comes; infinite for never."""
        return min(self._apart.due_ns, *(source.due_ns for source in self.sources))

    @property
    def is_contradicted(self) -> bool:
        """Return whether two of its sensors say what cannot both be."""
        return self._apart.on

    def reading(self, now_ns: int) -> Reading:
        """Return what is known of it."""
        chosen = next((each for each in self.sources if each.is_clean(now_ns)), None) or next(
            (each for each in self.sources if each.is_usable(now_ns)), None)
        if chosen is not None:
            quality = SUSPECT if self._apart.on else GOOD
            return Reading(chosen.value, quality, chosen.stamp_ns, chosen.name)
        last = max(self.sources, key=lambda each: each.stamp_ns)
        off = next((each for each in self.sources if each.trouble not in ('', SILENT)), None)
        if off is not None:
            return Reading(last.value, OFF, last.stamp_ns, off.name)
        if last.stamp_ns >= 0:
            return Reading(last.value, STALE, last.stamp_ns, last.name)
        return Reading(math.nan, MISSING, -1, '')
