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
The pulse rate as the waveform of a pulse oximeter shows it, while it comes or from a recording.

It is a second opinion on what the device says: found in another way, from the same finger. Where
the wave cannot be believed there is no rate, with the reason; see
:mod:`rt_robot_os.features.health.pulse_check.beats`.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
import math
from typing import Final
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from rt_robot_os.features.health.pulse_check.beats import bridged
from rt_robot_os.features.health.pulse_check.beats import pulse_beats
from rt_robot_os.features.health.pulse_check.beats import slope_sum
from rt_robot_os.features.health.pulse_check.beats import STRONGEST
from rt_robot_os.features.health.pulse_check.beats import THRESHOLD
from rt_robot_os.features.health.pulse_check.beats import usual_peak

Floats = npt.NDArray[np.float64]

#: Ten seconds are what the rules for good beats were made for.
WINDOW_S: Final = 10.0
#: No QRS complex for so long is an asystole (PhysioNet/Computing in Cardiology Challenge 2015).
ASYSTOLE_S: Final = 4.0
SLOWEST_RATE_HZ: Final = 25.0
FASTEST_RATE_HZ: Final = 1000.0

# The rises of a wave without a pulse, as a share of those of a pulse.
_STILL: Final = THRESHOLD / 2
# After a gap, a piece of so much tells whether there is a pulse.
_LEAST_S: Final = 1.0


class Pulse(NamedTuple):
    """
    What the last seconds of a wave show.

    :ivar time_s: of the last sample, since the first.
    :ivar rate_per_min: NaN when it cannot be believed.
    :ivar doubt: why not; empty: it is believed.
    :ivar alike: how much the beats look like each other, -1 to 1; NaN when that was not looked at.
    :ivar beats: how many were seen, believed or not.
    :ivar still_s: so long there was no pulse in a wave that showed good ones before; 0: there is
        one, or the wave cannot tell.
    """

    time_s: float
    rate_per_min: float
    doubt: str
    alike: float
    beats: int
    still_s: float


class PulseMeter:
    """
    Measure the pulse in a wave that comes piece by piece; keeps the last ten seconds.

    A look takes about 0.3 ms: not for each sample.
    """

    def __init__(self, rate_hz: float, window_s: float = WINDOW_S) -> None:
        """
        Begin without a sample.

        :param rate_hz: samples a second.
        :param window_s: so much of the wave is looked at.
        :raises ValueError: the rate cannot be.
        """
        if not SLOWEST_RATE_HZ <= rate_hz <= FASTEST_RATE_HZ:
            raise ValueError(f'{rate_hz:g} Hz: a wave of {SLOWEST_RATE_HZ:g} to '
                             f'{FASTEST_RATE_HZ:g} samples a second is needed')
        self.rate_hz = rate_hz
        self._wave = np.empty(round(window_s * rate_hz))
        self.restart()

    def restart(self) -> None:
        """Forget the wave: what comes does not follow on it."""
        self._count = self._seen = 0
        # Of the last seconds that were believed: the slope sum of a beat, and how far the wave
        # reached down and up.
        self._usual = 0.0
        self._reach = (0.0, 0.0)

    def add(self, samples: Sequence[float] | npt.NDArray[np.generic]) -> None:
        """Take the next samples, in any unit, systole upwards; NaN where there is none."""
        new = np.asarray(samples, dtype=np.float64)[-self._wave.size:]
        kept = min(self._count, self._wave.size - new.size)
        # Newest last: what is looked at is one piece.
        self._wave[:kept] = self._wave[self._count - kept:self._count]
        self._wave[kept:kept + new.size] = new
        self._count = kept + new.size
        self._seen += len(samples)

    def look(self) -> Pulse:
        """Return what the last seconds show."""
        wave = self._wave[:self._count]
        time_s = self._seen / self.rate_hz
        if self._count < self._wave.size:
            return Pulse(time_s, math.nan, 'too short', math.nan, 0, 0.0)
        found = pulse_beats(wave, self.rate_hz)
        still_s = 0.0
        if not found.doubt:
            whole = bridged(wave, self.rate_hz)
            self._usual = usual_peak(slope_sum(whole, self.rate_hz), self.rate_hz)
            self._reach = (float(np.nanmin(wave)), float(np.nanmax(wave)))
        elif self._usual:
            still_s = self._still_s(_newest(bridged(wave, self.rate_hz)))
        return Pulse(time_s, math.nan if found.doubt else float(found.rate_per_min), found.doubt,
                     float(found.alike), found.at_s.size, still_s)

    def _still_s(self, wave: Floats) -> float:
        """Return for how long at the end nothing rises in a wave that is no other than before."""
        if wave.size < _LEAST_S * self.rate_hz:
            return 0.0
        low, high = self._reach
        room = high - low
        sums = slope_sum(wave, self.rate_hz)
        if sums.max() > STRONGEST * self._usual:
            return 0.0  # somebody moves: what follows on that is no pause before it settles
        rising = np.flatnonzero(sums >= _STILL * self._usual)
        still = wave.size - 1 - int(rising[-1]) if rising.size else wave.size
        end = wave[wave.size - still:]
        # A sensor that came off is somewhere else, or says the same number all the time.
        stuck = np.count_nonzero(np.diff(end) == 0.0)
        if not end.size or end.min() < low - room or end.max() > high + room or (
                2 * stuck >= end.size):
            return 0.0
        return still / self.rate_hz


def _newest(wave: Floats) -> Floats:
    """Return what came after the last gap."""
    missing = np.flatnonzero(~np.isfinite(wave))
    return wave[missing[-1] + 1:] if missing.size else wave


def course(wave: Floats, rate_hz: float, every_s: float = 1.0) -> Iterator[Pulse]:
    """
    Measure a recorded wave as one that comes.

    :param wave: shape (n,), in any unit, systole upwards; NaN where there is none.
    :param every_s: time between two looks.
    :return: a measurement for each whole window, then each ``every_s``.
    :raises ValueError: the rate cannot be.
    """
    meter = PulseMeter(rate_hz)
    window = round(WINDOW_S * rate_hz)
    meter.add(wave[:window])
    at, step = window, max(round(every_s * rate_hz), 1)
    while at <= wave.size:
        yield meter.look()
        meter.add(wave[at:at + step])
        at += step
