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

"""Recordings of monitors that a simulated pulse oximeter plays in a loop."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.health.pulse_check.beats import slope_sum
from rt_robot_os.features.health.pulse_check.pulse_meter import measure_recording
from rt_robot_os.features.health.pulse_check.pulse_meter import WINDOW_S
from rt_robot_os.features.health.waveforms import read_record

Floats = npt.NDArray[np.float64]

_MINUTE_S: Final = 60.0
_PULSES: Final = ('PULSE', 'HR')
_SPO2: Final = 'SpO2'
_PLETH: Final = ('PLETH', 'PPG')
# Percentiles of the wave that are scaled to 0 and 1.
_PERCENT: Final = (1.0, 99.0)
_REFRACTORY_S: Final = 0.25


class Numerics:
    """Pulse and saturation, a pair for each row; 0 means no value."""

    def __init__(self, times_s: Floats, pulses: Floats, saturations: Floats) -> None:
        """Store the rows; the last row lasts as long as the first."""
        self._times_s, self._pulses, self._saturations = times_s, pulses, saturations
        first_s = float(times_s[1] - times_s[0]) if times_s.size > 1 else _MINUTE_S
        self.length_s = float(times_s[-1] - times_s[0]) + first_s

    @classmethod
    def load(cls, path: str) -> Numerics:
        """
        Read the rows.

        :raises ConfigError: the file cannot be read, or has other columns.
        """
        try:
            with Path(path).open(encoding='utf-8', newline='') as file:
                rows = list(csv.DictReader(line for line in file if not line.startswith('#')))
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError([f'{path}: {error}: name a CSV file']) from error
        columns = rows[0].keys() if rows else ()
        pulse = next((each for each in _PULSES if each in columns), None)
        if pulse is None or _SPO2 not in columns or 'minute' not in columns:
            raise ConfigError([f'{path}: must have the columns minute, {" or ".join(_PULSES)} and '
                               f'{_SPO2}'])
        try:
            table = np.array([[float(row[key] or 0.0) for key in ('minute', pulse, _SPO2)]
                              for row in rows])
        except (TypeError, ValueError) as error:
            raise ConfigError([f'{path}: {error}: each cell must be a number or empty']) from error
        if not np.isfinite(table).all() or (np.diff(table[:, 0]) <= 0.0).any():
            raise ConfigError([f'{path}: the minutes must increase, and all numbers be finite'])
        return cls(table[:, 0] * _MINUTE_S, table[:, 1], table[:, 2])

    def at(self, time_s: float) -> tuple[float, float]:
        """Return pulse and saturation at a time since the start."""
        wanted = float(self._times_s[0]) + time_s % self.length_s
        row = int(np.searchsorted(self._times_s, wanted, side='right')) - 1
        return float(self._pulses[row]), float(self._saturations[row])


class Wave:
    """A waveform at the rate of the device, from 0 to 1, with its beats and its pulse rate."""

    def __init__(self, samples: Floats, rate_hz: float) -> None:
        """
        Detect the beats.

        :param samples: shape (n,), finite, at the rate of the device.
        """
        low, high = np.percentile(samples, _PERCENT)
        self._samples = (samples - low) / max(high - low, 1e-12)
        self._rate_hz = rate_hz
        self._pulses = [each.rate_per_min for each in measure_recording(samples, rate_hz)]
        self._beats = self._steep(slope_sum(samples, rate_hz))

    @classmethod
    def load(cls, path: str, rate_hz: float) -> Wave:
        """
        Read the signal PLETH of a record, and resample it.

        :raises ConfigError: the record cannot be read, or has no such signal.
        """
        record = read_record(path)
        signal = record.signal(*_PLETH)
        if signal is None:
            raise ConfigError([f'{path} has no signal {_PLETH[0]}, only '
                               f'{", ".join(each.name for each in record.signals)}'])
        samples = signal.samples
        known = np.flatnonzero(np.isfinite(samples))
        if known.size < WINDOW_S * record.rate_hz:
            raise ConfigError([f'{path}: its waveform is shorter than {WINDOW_S:g} s'])
        count = int(samples.size / record.rate_hz * rate_hz)
        at = np.arange(count) * (record.rate_hz / rate_hz)
        return cls(np.interp(at, known, samples[known]), rate_hz)

    def at(self, time_s: float) -> tuple[float, bool]:
        """Return the sample at a time since the start, and whether it is a beat."""
        index = round(time_s * self._rate_hz) % self._samples.size
        return float(self._samples[index]), bool(self._beats[index])

    def pulse_per_min(self, time_s: float) -> float:
        """Return the pulse in the seconds before a time; 0 where the wave shows none."""
        second = int(time_s % (self._samples.size / self._rate_hz) - WINDOW_S)
        if not self._pulses:
            return 0.0
        found = self._pulses[min(max(second, 0), len(self._pulses) - 1)]
        return found if math.isfinite(found) else 0.0

    def _steep(self, sums: Floats) -> npt.NDArray[np.bool_]:
        """Return where the wave rises most in each beat, which is where the device signals it."""
        half = int(_REFRACTORY_S * self._rate_hz)
        around = np.lib.stride_tricks.sliding_window_view(
            np.pad(sums, half), 2 * half + 1).max(axis=1)
        steep: npt.NDArray[np.bool_] = (sums == around) & (sums > np.median(around) / 2)
        return steep
