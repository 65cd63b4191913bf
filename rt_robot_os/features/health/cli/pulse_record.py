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

"""Evaluation of one recorded waveform: its pulse rate, and the difference to its ECG."""

from __future__ import annotations

from collections import Counter
import math
from pathlib import Path
import re
from typing import Any
from typing import Final

import numpy as np
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.health.pulse_check.beats import ecg_beats
from rt_robot_os.features.health.pulse_check.pulse_meter import ASYSTOLE_S
from rt_robot_os.features.health.pulse_check.pulse_meter import measure_recording
from rt_robot_os.features.health.pulse_check.pulse_meter import PulseMeasurement
from rt_robot_os.features.health.pulse_check.pulse_meter import WINDOW_S
from rt_robot_os.features.health.waveforms import read_record
from rt_robot_os.features.health.waveforms import Record
from rt_robot_os.features.health.waveforms import Signal

#: Pulse and ECG agree up to this difference.
MOST_PER_MIN: Final = 3.0
#: Names of signals with a pulse wave, the preferred first.
PULSE_NAMES: Final = ('PLETH', 'PPG', 'ABP', 'ART')
# Names of ECG leads in records.
_LEAD: Final = re.compile(r'(I|II|III|V\d?|MCL\d?|aV[RLF]|ECG.*)', re.IGNORECASE).fullmatch


def evaluate_record(path: Path, name: str = '') -> dict[str, Any]:
    """
    Measure the pulse of a record each second.

    :param path: of its header.
    :param name: signal to measure; empty: the first of :data:`PULSE_NAMES` in the record.
    :return: a result that can be written as JSON.
    :raises ConfigError: the record cannot be read, or has no such signal.
    """
    record = read_record(path)
    wave = record.signal(*((name,) if name else PULSE_NAMES))
    if wave is None:
        there = ', '.join(each.name for each in record.signals)
        raise ConfigError([f'{path} has no signal {name or " or ".join(PULSE_NAMES)}, only '
                           f'{there}'])
    try:
        found = list(measure_recording(wave.samples, record.rate_hz))
    except ValueError as error:
        raise ConfigError([f'{path}: {error}']) from None
    leads = [each for each in record.signals if _LEAD(each.name)]
    seconds = [_second(each, record, leads) for each in found]
    rates = [each.rate_per_min for each in found if not each.doubt]
    apart = [each['difference_per_min'] for each in seconds
             if each['difference_per_min'] is not None]
    pause_s = max((each.still_s for each in found), default=0.0)
    return {
        'record': record.name, 'comments': list(record.comments), 'signal': wave.name,
        'leads': [each.name for each in leads], 'rate_hz': record.rate_hz,
        'length_s': wave.samples.size / record.rate_hz, 'window_s': WINDOW_S,
        'seconds': len(found), 'believed': len(rates),
        'pulse_per_min': _span(rates),
        'doubts': dict(Counter(each.doubt for each in found if each.doubt).most_common()),
        'compared': {
            'windows': len(apart), 'mean_per_min': float(np.mean(apart)) if apart else None,
            'most_per_min': max(apart, default=None),
            'beyond': sum(each > MOST_PER_MIN for each in apart)},
        'longest_pause_s': pause_s, 'asystole': pause_s >= ASYSTOLE_S, 'each_second': seconds}


def _span(rates: list[float]) -> dict[str, float] | None:
    if not rates:
        return None
    return {'least': min(rates), 'median': float(np.median(rates)), 'most': max(rates)}


def _second(pulse: PulseMeasurement, record: Record, leads: list[Signal]) -> dict[str, Any]:
    ecg_per_min = ecg_rate(pulse.time_s, record.rate_hz, leads)
    rate = None if pulse.doubt else pulse.rate_per_min
    return {
        'time_s': pulse.time_s, 'pulse_per_min': rate, 'doubt': pulse.doubt or None,
        'alike': pulse.alike if math.isfinite(pulse.alike) else None, 'beats': pulse.beats,
        'still_s': pulse.still_s, 'ecg_per_min': ecg_per_min,
        'difference_per_min': (
            None if rate is None or ecg_per_min is None else abs(rate - ecg_per_min))}


def ecg_rate(time_s: float, rate_hz: float, leads: list[Signal]) -> float | None:
    """
    Return the ECG rate in the window that ends at a time; None when it is unreliable.

    It is reliable where the beats of a lead are similar, and all such leads agree.
    """
    end = round(time_s * rate_hz)
    found = [ecg_beats(each.samples[max(end - round(WINDOW_S * rate_hz), 0):end], rate_hz)
             for each in leads]
    rates = [float(each.rate_per_min) for each in found if not each.doubt]
    if not rates or max(rates) - min(rates) > MOST_PER_MIN:
        return None
    return sum(rates) / len(rates)
