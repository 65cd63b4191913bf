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
A sensor of a vital sign: which of its readings are values, and whether it is worn.

A reading of 0 or an implausible one is not a value. Without values for a time the sensor is off.
A sensor with interruptions, such as a loose clip, stays off until it has measured without a
break for a time.
"""

from __future__ import annotations

from collections import deque
import math
from typing import Final
from typing import NamedTuple

from rt_robot_os.messages.signs import Sign

OFF: Final = 'off'
IMPLAUSIBLE: Final = 'implausible'
SILENT: Final = 'silent'

_NS_PER_S: Final = 1_000_000_000
# Largest time between two readings that can be a jump.
_JUMP_WINDOW_NS: Final = 30 * _NS_PER_S
# A jump that lasts this long counts as a value.
_JUMP_NS: Final = 10 * _NS_PER_S
# A slow sensor is silent after this many of its own periods.
_SILENT_PERIODS: Final = 3
_LONGEST_SILENCE_NS: Final = 3600 * _NS_PER_S


class SensorTimeouts(NamedTuple):
    """
    Timeouts of a sensor, in ns.

    :ivar stale_ns: age at which a value is stale.
    :ivar off_ns: time without a value after which a sensor is off.
    :ivar back_ns: time with values only after which it is back.
    """

    stale_ns: int
    off_ns: int
    back_ns: int


class SensorChange(NamedTuple):
    """
    A sensor went off, or is back.

    :ivar stamp_ns: time of the change.
    :ivar trouble: why it is off: ``off``, ``implausible``, ``silent``; empty: it is back.
    """

    stamp_ns: int
    trouble: str


class SignSensor:
    """
    A sensor of a sign; safe in the real-time loop.

    :ivar name: of the sensor or the node, for people.
    :ivar value: the last value; NaN before the first.
    :ivar stamp_ns: time of the last value; -1 before the first.
    :ivar trouble: why the sensor is off; empty when it is not.
    :ivar said_off: number of readings that mean that it is off.
    :ivar implausible: number of implausible readings.
    :ivar jumped: number of readings too far from the last value to be accepted immediately.
    :ivar late: number of readings older than the one before; they are ignored.
    """

    __slots__ = ('sign', 'name', 'times', 'value', 'stamp_ns', 'trouble', 'readings', 'said_off',
                 'implausible', 'jumped', 'late', '_received_ns', '_nothing_ns', '_nothing',
                 '_good_ns', '_jump', '_jump_ns', '_periods')

    def __init__(self, sign: Sign, name: str, times: SensorTimeouts, since_ns: int) -> None:
        """
        Start without a value.

        :param since_ns: start of the timeout.
        """
        self.sign = sign
        self.name = name
        self.times = times
        self.value = math.nan
        self.stamp_ns = -1
        self.trouble = ''
        self.readings = self.said_off = self.implausible = 0
        self.jumped = self.late = 0
        self._received_ns = since_ns
        self._nothing_ns = self._good_ns = self._jump_ns = -1
        self._nothing = ''
        self._jump = math.nan
        self._periods: deque[int] = deque(maxlen=_SILENT_PERIODS)

    def update(self, value: float, stamp_ns: int) -> bool:
        """
        Process a reading; the caller has called :meth:`advance` with the time before it.

        :return: whether it counts as a value.
        """
        if stamp_ns < self._received_ns:
            self.late += 1
            return False
        self.readings += 1
        if self.readings > 1 and stamp_ns > self._received_ns:
            self._periods.append(stamp_ns - self._received_ns)
        self._received_ns = stamp_ns
        if self.sign.is_off(value):
            self.said_off += 1
            self._without_value(OFF, stamp_ns)
            return False
        if not self.sign.is_plausible(value):
            self.implausible += 1
            self._without_value(IMPLAUSIBLE, stamp_ns)
            return False
        if self._jumps(value, stamp_ns):
            self.jumped += 1
            self._without_value(IMPLAUSIBLE, stamp_ns)
            return False
        self._jump_ns = -1
        self.value, self.stamp_ns = value, stamp_ns
        if self._nothing_ns >= 0 and self._good_ns < 0:
            self._good_ns = stamp_ns
        return True

    def advance(self, now_ns: int) -> list[SensorChange]:
        """Process the deadlines until a time; return the changes, in order."""
        found: list[SensorChange] = []
        while (due_ns := self.due_ns) <= now_ns:
            stamp_ns = int(due_ns)
            if self._good_ns >= 0 and stamp_ns == self._good_ns + self.times.back_ns:
                self._nothing_ns = self._good_ns = -1
                if self.trouble:
                    self.trouble = ''
                    found.append(SensorChange(stamp_ns, ''))
                continue
            if self._nothing_ns < 0 or self._good_ns >= 0:
                self._nothing_ns, self._nothing = self._received_ns, SILENT
                self._good_ns = -1
            self.trouble = self._nothing
            found.append(SensorChange(stamp_ns, self.trouble))
        return found

    @property
    def due_ns(self) -> float:
        """Time of the next deadline; infinite without one."""
        due_ns = math.inf
        if self._good_ns >= 0:
            due_ns = self._good_ns + self.times.back_ns
        elif self._nothing_ns >= 0 and not self.trouble:
            due_ns = self._nothing_ns + self.times.off_ns
        if self.sign.is_continuous and not self.trouble:
            due_ns = min(due_ns, self._received_ns + self._silence_ns())
        return due_ns

    def is_clean(self, now_ns: int) -> bool:
        """Return whether its last reading is a value that is not stale, and it is not off."""
        return self._nothing_ns < 0 and self.is_usable(now_ns)

    def is_usable(self, now_ns: int) -> bool:
        """
        Return whether it has a value that is not stale, and it is not off.

        The last value of a silent sensor counts until it is stale.
        """
        return (self.trouble in ('', SILENT) and self.stamp_ns >= 0
                and now_ns - self.stamp_ns <= self.times.stale_ns)

    def _without_value(self, kind: str, stamp_ns: int) -> None:
        if self._nothing_ns < 0:
            self._nothing_ns = stamp_ns
        self._nothing = kind
        self._good_ns = -1

    def _jumps(self, value: float, stamp_ns: int) -> bool:
        """Return whether a value is too far from the last to be accepted without another."""
        limit = self.sign.jump
        if not limit or self.trouble or self.stamp_ns < 0 or abs(value - self.value) <= limit or (
                stamp_ns - self.stamp_ns > _JUMP_WINDOW_NS):
            return False
        if self._jump_ns < 0 or abs(value - self._jump) > limit:
            self._jump_ns = stamp_ns
        self._jump = value
        return stamp_ns - self._jump_ns < _JUMP_NS

    def _silence_ns(self) -> int:
        """Return its timeout, which depends on its period."""
        if len(self._periods) < _SILENT_PERIODS:
            return self.times.stale_ns
        limit_ns = max(self.times.off_ns, _SILENT_PERIODS * min(self._periods))
        return min(limit_ns, max(_LONGEST_SILENCE_NS, self.times.off_ns))
