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
Detection of heart beats in a few seconds of a waveform, and of their reliability.

A beat is where the wave rises: the *slope sum*, the sum of the rises of the last 128 ms, is high
at the foot of each pulse and low elsewhere (Zong et al., "An open-source algorithm to detect
onset of arterial blood pressure pulses", Computers in Cardiology 2003). In an ECG the falls count
as well. Where a beat is missing the search is repeated with a lower threshold (Pan and Tompkins,
"A real-time QRS detection algorithm", IEEE Trans. Biomed. Eng. 32(3), 1985). The dicrotic wave,
the second rise of a pulse when the aortic valve closes, is not a beat: it follows one within
0.42 s and is weaker than both its neighbours.

The beats are reliable when they are a plausible pulse and similar (Orphanidou et al.,
"Signal-quality indices for the electrocardiogram and photoplethysmogram", IEEE J. Biomed. Health
Inform. 19(3), 2015): a plausible rate, no gap above 3 s, no interval more than 2.2 times
another, and a mean correlation with their own mean of at least 0.86 (0.66 of an ECG).
"""

from __future__ import annotations

from typing import Final
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]

SLOPE_S: Final = 0.128
#: Least interval of two beats: 240 a minute.
REFRACTORY_S: Final = 0.25
#: Threshold of a beat, as a share of the usual slope sum.
THRESHOLD: Final = 0.5
#: After a longer interval, as a multiple of the usual one, a beat of half the threshold counts.
SEARCH_BACK: Final = 1.66
#: Longest time from a beat to its dicrotic wave: ejection of the left ventricle takes 0.42 s
#: minus 1.7 ms for each beat a minute (Weissler et al., Circulation 37(2), 1968).
DICROTIC_S: Final = 0.42
#: Largest dicrotic wave, as a share of the beats on both sides.
DICROTIC_SHARE: Final = 0.8
#: A dicrotic wave may be stronger in an interval of at most this multiple of the usual one.
DIVIDED: Final = 1.25
#: Share of the usual interval; a weak first beat that is nearer to the next does not count.
EARLY: Final = 0.8
#: Longest gap in the samples that is interpolated, and largest share of all gaps.
BRIDGED_S: Final = 0.1
BRIDGED_SHARE: Final = 0.05
#: A rise this many times the usual one is a movement.
STRONGEST: Final = 3.0
LONGEST_GAP_S: Final = 3.0
MOST_RATIO: Final = 2.2
SLOWEST_PER_MIN: Final = 25.0
FASTEST_PER_MIN: Final = 240.0
ALIKE_PULSE: Final = 0.86
ALIKE_ECG: Final = 0.66

# Moving average against noise of the converter; for a pulse only, a QRS is faster.
_SMOOTH_PULSE_S: Final = 0.04
# Length of a part of the window that contains a beat, unless there is a gap.
_PART_S: Final = 2.0
_FEWEST_BEATS: Final = 3
# Largest difference between the period of the wave and the interval of beats, as a share.
_PERIOD_SHARE: Final = 0.08
# Start and end of a beat around its steepest point, as shares of the interval.
_BEFORE: Final = 0.3
_AFTER: Final = 0.6
# Share of samples at one extreme from which the converter is saturated. A coarsely quantised wave
# has many samples at its foot.
_CLIPPED: Final = 0.5


class Beats(NamedTuple):
    """
    Beats of a window.

    :ivar at_s: shape (n,), time of each beat, in s from the start of the window.
    :ivar rate_per_min: of the beats; NaN with fewer than two.
    :ivar alike: mean correlation of the beats, -1 to 1; NaN if not computed.
    :ivar doubt: why they are unreliable; empty: they are reliable.
    """

    at_s: Floats
    rate_per_min: float
    alike: float
    doubt: str


def pulse_beats(wave: Floats, rate_hz: float) -> Beats:
    """
    Find the beats in a pulse wave.

    :param wave: shape (n,), some seconds, in any unit, systole upwards; NaN: no sample,
        interpolated up to :data:`BRIDGED_S`.
    :param rate_hz: samples a second, 25 or more.
    """
    return _beats(wave, rate_hz, False)


def ecg_beats(wave: Floats, rate_hz: float) -> Beats:
    """
    Find the beats in an ECG.

    :param wave: shape (n,), some seconds of a lead; NaN: no sample.
    :param rate_hz: samples a second, 100 or more.
    """
    return _beats(wave, rate_hz, True)


def _beats(wave: Floats, rate_hz: float, ecg: bool) -> Beats:
    nothing = np.empty(0)
    if wave.size < 2 * _PART_S * rate_hz:
        return Beats(nothing, np.nan, np.nan, 'too short')
    if not ecg:
        wave = bridged(wave, rate_hz)
    if not np.isfinite(wave).all():
        return Beats(nothing, np.nan, np.nan, 'samples are missing')
    low, high = float(wave.min()), float(wave.max())
    if low == high:
        return Beats(nothing, np.nan, np.nan, 'flat')
    sums = slope_sum(wave, rate_hz, ecg)
    found = _peaks(sums, rate_hz, ecg)
    at_s = found / rate_hz
    rate = np.nan
    if found.size > 1:
        rate = 60.0 * (found.size - 1) / (at_s[-1] - at_s[0])
    clipped = max(np.count_nonzero(wave == low), np.count_nonzero(wave == high))
    if clipped > _CLIPPED * wave.size:
        return Beats(at_s, rate, np.nan, 'the converter is saturated')
    doubt = _implausible(at_s, wave.size / rate_hz) or _disturbed(sums, found, ecg)
    if doubt:
        return Beats(at_s, rate, np.nan, doubt)
    alike = similarity(wave, found)
    least = ALIKE_ECG if ecg else ALIKE_PULSE
    # A NaN counts as unreliable.
    return Beats(at_s, rate, alike, '' if alike >= least else 'the beats are not similar')


def bridged(wave: Floats, rate_hz: float) -> Floats:
    """
    Interpolate short gaps linearly.

    :param wave: shape (n,), NaN where a sample is missing.
    :return: the wave; gaps that are too long or too many stay NaN.
    """
    missing = ~np.isfinite(wave)
    if not missing.any() or missing.mean() > BRIDGED_SHARE:
        return wave
    edges = np.diff(np.concatenate(([False], missing, [False])).astype(np.int8))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    whole = wave.copy()
    there = np.flatnonzero(~missing)
    for begin, end in zip(begins.tolist(), ends.tolist()):
        # At least one sample, also at the slowest rate.
        if end - begin <= max(BRIDGED_S * rate_hz, 1.0):
            whole[begin:end] = np.interp(np.arange(begin, end), there, wave[there])
    return whole


def slope_sum(wave: Floats, rate_hz: float, ecg: bool = False) -> Floats:
    """
    Return the sum of the rises of the last 128 ms; for an ECG of the falls as well.

    :param wave: shape (n,).
    :return: shape (n,).
    """
    if not ecg:
        wave = _moving_average(wave, max(round(_SMOOTH_PULSE_S * rate_hz), 1))
    steps = np.diff(wave, prepend=wave[0])
    rises = np.abs(steps) if ecg else np.maximum(steps, 0.0)
    count = max(round(SLOPE_S * rate_hz), 1)
    total = np.concatenate(([0.0], np.cumsum(rises)))
    sums: Floats = total[1:].copy()
    sums[count:] -= total[1:-count]
    return sums


def usual_peak(sums: Floats, rate_hz: float) -> float:
    """Return the usual slope sum of a beat: the median of the maxima of each 2 s."""
    part = max(round(_PART_S * rate_hz), 1)
    whole = sums[sums.size % part:]
    return float(np.median(whole.reshape(-1, part).max(axis=1)))


def _peaks(sums: Floats, rate_hz: float, ecg: bool) -> Indices:
    """Return the indices of the peaks of the slope sum, one for each beat."""
    inner = sums[1:-1]
    least = THRESHOLD * usual_peak(sums, rate_hz)
    weak = np.flatnonzero(
        (inner >= sums[:-2]) & (inner > sums[2:]) & (inner >= least / 2)) + 1
    apart = REFRACTORY_S * rate_hz
    kept: list[int] = []
    for place in weak[sums[weak] >= least].tolist():
        if not kept or place - kept[-1] >= apart:
            kept.append(place)
        elif sums[place] > sums[kept[-1]]:
            kept[-1] = place
    if not ecg:
        kept = _without_dicrotic(kept, sums, DICROTIC_S * rate_hz)
    return _searched_back(kept, weak, sums, apart)


def _without_dicrotic(places: list[int], sums: Floats, within: float) -> list[int]:
    """Remove dicrotic waves: soon after a beat, and weaker than both neighbours."""
    places = _without_weak(places, sums, within, DICROTIC_SHARE, np.inf)
    if len(places) < _FEWEST_BEATS:
        return places
    usual = float(np.median(np.diff(places)))
    first, second = places[:2]
    if second - first < EARLY * usual and sums[first] < DICROTIC_SHARE * sums[second]:
        places = places[1:]  # its beat was before the window
    return _without_weak(places, sums, within, 1.0, DIVIDED * usual)


def _without_weak(places: list[int], sums: Floats, within: float, share: float, longest: float
                  ) -> list[int]:
    kept = places[:1]
    for place, following in zip(places[1:], [*places[2:], None]):
        before = kept[-1]
        if following is None:
            weak = share < 1.0 and sums[place] < share * sums[before]
        else:
            weak = following - before <= longest and sums[place] < share * min(
                sums[before], sums[following])
        if place - before > within or not weak:
            kept.append(place)
    return kept


def _searched_back(kept: list[int], weak: Indices, sums: Floats, apart: float) -> Indices:
    """Add the strongest weak peak in intervals that are too long, since breathing hides beats."""
    places = np.array(kept, dtype=np.intp)
    if places.size < _FEWEST_BEATS:
        return places
    longest = SEARCH_BACK * float(np.median(np.diff(places)))
    added = []
    for first, last in zip(kept, kept[1:]):
        while last - first > longest:
            inside = weak[(weak >= first + apart) & (weak <= last - apart)]
            if not inside.size:
                break
            strongest = int(inside[np.argmax(sums[inside])])
            added.append(strongest)
            first = strongest
    return np.sort(np.concatenate((places, np.array(added, dtype=np.intp))))


def _implausible(at_s: Floats, window_s: float) -> str:
    if at_s.size < _FEWEST_BEATS:
        return 'too few beats'
    gaps = np.diff(at_s)
    if max(gaps.max(), at_s[0], window_s - at_s[-1]) > LONGEST_GAP_S:
        return f'no beat for more than {LONGEST_GAP_S:g} s'
    rate = 60.0 / float(gaps.mean())
    if not SLOWEST_PER_MIN <= rate <= FASTEST_PER_MIN:
        return 'an implausible rate'
    if gaps.max() > MOST_RATIO * gaps.min():
        return 'an irregular rhythm, or artefacts'
    return ''


def _disturbed(sums: Floats, places: Indices, ecg: bool) -> str:
    if not ecg and sums.max() > STRONGEST * float(np.median(sums[places])):
        return 'a movement'
    interval = (places[-1] - places[0]) / (places.size - 1)
    if abs(period(sums, interval) - interval) > _PERIOD_SHARE * interval:
        return 'missing or false beats'
    return ''


def period(sums: Floats, interval: float) -> float:
    """
    Return the period of a wave in samples: the peak of its autocorrelation.

    :param interval: its approximate value; the search range is 0.5 to 1.9 times that.
    """
    size = 1 << (2 * sums.size - 1).bit_length()
    spectrum = np.fft.rfft(sums - sums.mean(), size)
    alike = np.fft.irfft(spectrum * spectrum.conj(), size)[:sums.size]
    # Fewer samples overlap at a longer lag.
    alike /= np.arange(sums.size, 0, -1)
    first, last = int(interval / 2), min(int(1.9 * interval), sums.size - 1)
    return float(first + np.argmax(alike[first:last + 1]))


def similarity(wave: Floats, places: Indices) -> float:
    """Return the mean correlation of the beats with their mean; NaN with fewer than three."""
    interval = float(np.median(np.diff(places)))
    before, after = round(_BEFORE * interval), round(_AFTER * interval)
    whole = [place for place in places.tolist()
             if place >= before and place + after < wave.size]
    if len(whole) < _FEWEST_BEATS:
        return float('nan')
    beats = np.stack([wave[place - before:place + after] for place in whole])
    # The line from the first to the last sample of each is breathing, not pulse.
    line = np.linspace(0.0, 1.0, before + after)
    beats = beats - beats[:, :1] - (beats[:, -1:] - beats[:, :1]) * line
    beats -= beats.mean(axis=1, keepdims=True)
    size = np.linalg.norm(beats, axis=1)
    if not size.all():
        return float('nan')
    unit = beats / size[:, np.newaxis]
    mean = unit.mean(axis=0)
    return float((unit @ mean).mean() / np.linalg.norm(mean))


def _moving_average(wave: Floats, count: int) -> Floats:
    if count < 2:
        return wave
    padded = np.pad(wave, (count // 2, count - 1 - count // 2), mode='edge')
    total = np.concatenate(([0.0], np.cumsum(padded)))
    return (total[count:] - total[:-count]) / count
