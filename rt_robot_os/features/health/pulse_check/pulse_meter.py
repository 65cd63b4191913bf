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
Pulse rate of the waveform of a pulse oximeter, live or recorded.

It is independent of the rate that the device computes from the same wave. Where the wave is
unreliable there is no rate, but a reason; see
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

#: The criteria of reliable beats were published for ten seconds.
WINDOW_S: Final = 10.0
#: No QRS complex for so long is an asystole (PhysioNet/Computing in Cardiology Challenge 2015).
ASYSTOLE_S: Final = 4.0
SLOWEST_RATE_HZ: Final = 25.0
FASTEST_RATE_HZ: Final = 1000.0

# Largest rises of a wave without a pulse, as a share of those of a pulse.
_STILL: Final = THRESHOLD / 2
# Least length of the wave after a gap that shows whether there is a pulse.
_LEAST_S: Final = 1.0


class PulseMeasurement(NamedTuple):
    """
    Result of the last seconds of a wave.

    :ivar time_s: of the last sample, since the first.
    :ivar rate_per_min: NaN when it is unreliable.
    :ivar doubt: why it is unreliable; empty: it is reliable.
    :ivar alike: mean correlation of the beats, -1 to 1; NaN if not computed.
    :ivar beats: number of detected beats, reliable or not.
    :ivar still_s: duration without a pulse in a wave that had reliable ones before; 0: there is
        one, or that is unknown.
    """

    time_s: float
    rate_per_min: float
    doubt: str
    alike: float
    beats: int
    still_s: float


class PulseMeter:
    """
    Measure the pulse in a wave that arrives in pieces; stores the last ten seconds.

    A measurement takes about 0.3 ms: not for each sample.
    """

    def __init__(self, rate_hz: float, window_s: float = WINDOW_S) -> None:
        """
        Start without a sample.

        :param rate_hz: samples a second.
        :param window_s: length of the wave that is evaluated.
        :raises ValueError: the rate is out of range.
        """
        if not SLOWEST_RATE_HZ <= rate_hz <= FASTEST_RATE_HZ:
            raise ValueError(f'{rate_hz:g} Hz: the sampling rate of the wave must be '
                             f'{SLOWEST_RATE_HZ:g} to {FASTEST_RATE_HZ:g} Hz')
        self.rate_hz = rate_hz
        self._wave = np.empty(round(window_s * rate_hz))
        self.restart()

    def restart(self) -> None:
        """Forget the wave: the next samples do not continue it."""
        self._count = self._seen = 0
        # Of the last reliable seconds: the slope sum of a beat, and the range of the wave.
        self._usual = 0.0
        self._range = (0.0, 0.0)

    def add(self, samples: Sequence[float] | npt.NDArray[np.generic]) -> None:
        """Add samples, in any unit, systole upwards; NaN where one is missing."""
        new = np.asarray(samples, dtype=np.float64)[-self._wave.size:]
        kept = min(self._count, self._wave.size - new.size)
        # Newest last, contiguous.
        self._wave[:kept] = self._wave[self._count - kept:self._count]
        self._wave[kept:kept + new.size] = new
        self._count = kept + new.size
        self._seen += len(samples)

    def measure(self) -> PulseMeasurement:
        """Evaluate the last seconds."""
        wave = self._wave[:self._count]
        time_s = self._seen / self.rate_hz
        if self._count < self._wave.size:
            return PulseMeasurement(time_s, math.nan, 'too short', math.nan, 0, 0.0)
        found = pulse_beats(wave, self.rate_hz)
        still_s = 0.0
        if not found.doubt:
            whole = bridged(wave, self.rate_hz)
            self._usual = usual_peak(slope_sum(whole, self.rate_hz), self.rate_hz)
            self._range = (float(np.nanmin(wave)), float(np.nanmax(wave)))
        elif self._usual:
            still_s = self._still_s(_newest(bridged(wave, self.rate_hz)))
        return PulseMeasurement(
            time_s, math.nan if found.doubt else float(found.rate_per_min), found.doubt,
            float(found.alike), found.at_s.size, still_s)

    def _still_s(self, wave: Floats) -> float:
        """Return for how long at its end a wave of the same range has had no pulse."""
        if wave.size < _LEAST_S * self.rate_hz:
            return 0.0
        low, high = self._range
        room = high - low
        sums = slope_sum(wave, self.rate_hz)
        if sums.max() > STRONGEST * self._usual:
            return 0.0  # a movement: no pause until the wave has settled
        rising = np.flatnonzero(sums >= _STILL * self._usual)
        still = wave.size - 1 - int(rising[-1]) if rising.size else wave.size
        end = wave[wave.size - still:]
        # A sensor that came off has another range, or repeats the same number.
        stuck = np.count_nonzero(np.diff(end) == 0.0)
        if not end.size or end.min() < low - room or end.max() > high + room or (
                2 * stuck >= end.size):
            return 0.0
        return still / self.rate_hz


def _newest(wave: Floats) -> Floats:
    """Return the part after the last gap."""
    missing = np.flatnonzero(~np.isfinite(wave))
    return wave[missing[-1] + 1:] if missing.size else wave


def measure_recording(wave: Floats, rate_hz: float, every_s: float = 1.0
                      ) -> Iterator[PulseMeasurement]:
    """
    Measure a recorded wave as if it were live.

    :param wave: shape (n,), in any unit, systole upwards; NaN where a sample is missing.
    :param every_s: time between two measurements.
    :return: a measurement for the first whole window, then each ``every_s``.
    :raises ValueError: the rate is out of range.
    """
    meter = PulseMeter(rate_hz)
    window = round(WINDOW_S * rate_hz)
    meter.add(wave[:window])
    at, step = window, max(round(every_s * rate_hz), 1)
    while at <= wave.size:
        yield meter.measure()
        meter.add(wave[at:at + step])
        at += step
