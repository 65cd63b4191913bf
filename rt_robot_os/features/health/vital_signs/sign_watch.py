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

"""A vital sign with several sensors: the most preferred one with a value counts."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.health.vital_signs.sensor import SensorChange
from rt_robot_os.features.health.vital_signs.sensor import SignSensor
from rt_robot_os.features.health.vital_signs.sensor import SILENT
from rt_robot_os.messages.signs import Sign
from rt_robot_os.modules.debounce import Debounce

GOOD: Final = 'good'
#: Two sensors contradict each other.
SUSPECT: Final = 'suspect'
#: The last value is too old.
STALE: Final = 'stale'
#: The sensor is not worn, or broken.
OFF: Final = 'off'
#: There has been no value.
MISSING: Final = 'missing'
QUALITIES: Final = (GOOD, SUSPECT, STALE, OFF, MISSING)


class SignReading(NamedTuple):
    """
    Value and quality of a sign at a time.

    :ivar value: the last one; NaN without one.
    :ivar quality: one of :data:`QUALITIES`; only a good value is reliable.
    :ivar stamp_ns: time of the measurement; -1 without one.
    :ivar source: name of the sensor; empty without one.
    """

    value: float
    quality: str
    stamp_ns: int
    source: str


class SignWatch:
    """
    A sign and its sensors; safe in the real-time loop.

    :ivar sign: the sign.
    :ivar sources: its sensors, the preferred first.
    """

    __slots__ = ('sign', 'sources', '_apart')

    def __init__(self, sign: Sign, sources: Sequence[SignSensor]) -> None:
        self.sign = sign
        self.sources = tuple(sources)
        times = sources[0].times
        self._apart = Debounce(times.off_ns, times.back_ns)

    def update(self, place: int, value: float, stamp_ns: int) -> bool:
        """
        Process a reading of a sensor, after :meth:`advance` with the time before it.

        :return: whether it counts as a value.
        """
        is_value = self.sources[place].update(value, stamp_ns)
        if self.sign.apart and len(self.sources) > 1:
            clean = [each.value for each in self.sources if each.is_clean(stamp_ns)]
            # Compared with the preferred one.
            self._apart.put(any(abs(each - clean[0]) > self.sign.apart for each in clean[1:]),
                            stamp_ns)
        return is_value

    def advance(self, now_ns: int) -> list[tuple[SignSensor, SensorChange]]:
        """Process the deadlines until a time; return the sensors that changed, in order."""
        found = [(source, change) for source in self.sources for change in source.advance(now_ns)]
        self._apart.advance(now_ns)
        return sorted(found, key=lambda each: each[1].stamp_ns)

    @property
    def due_ns(self) -> float:
        """Time of the next deadline; infinite without one."""
        return min(self._apart.due_ns, *(source.due_ns for source in self.sources))

    @property
    def is_contradicted(self) -> bool:
        """Return whether two of its sensors contradict each other."""
        return self._apart.on

    def reading(self, now_ns: int) -> SignReading:
        """Return its value and quality."""
        chosen = next((each for each in self.sources if each.is_clean(now_ns)), None) or next(
            (each for each in self.sources if each.is_usable(now_ns)), None)
        if chosen is not None:
            quality = SUSPECT if self._apart.on else GOOD
            return SignReading(chosen.value, quality, chosen.stamp_ns, chosen.name)
        last = max(self.sources, key=lambda each: each.stamp_ns)
        off = next((each for each in self.sources if each.trouble not in ('', SILENT)), None)
        if off is not None:
            return SignReading(last.value, OFF, last.stamp_ns, off.name)
        if last.stamp_ns >= 0:
            return SignReading(last.value, STALE, last.stamp_ns, last.name)
        return SignReading(math.nan, MISSING, -1, '')
