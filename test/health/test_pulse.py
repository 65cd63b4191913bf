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

"""Is the pulse of a wave that of the heart, or none."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.health.pulse_check.beats import ecg_beats
from rt_robot_os.features.health.pulse_check.beats import pulse_beats
from rt_robot_os.features.health.pulse_check.pulse_meter import ASYSTOLE_S
from rt_robot_os.features.health.pulse_check.pulse_meter import measure_recording
from rt_robot_os.features.health.pulse_check.pulse_meter import PulseMeter
from rt_robot_os.features.health.waveforms import read_record


def made(rate: float, rate_hz: float = 75.0, seconds: float = 14.0, echo: float = 0.4,
         breath: float = 0.3, noise: float = 0.02) -> tuple[Any, Any]:
    """Make a wave with an echo in each beat and breath in all of it; and when its beats are."""
    chance = np.random.default_rng(round(rate))
    beats = np.cumsum(60.0 / rate * (1.0 + 0.03 * chance.normal(size=round(seconds * rate / 50))))
    at = np.arange(round(seconds * rate_hz)) / rate_hz
    wave = breath * np.sin(1.5 * at) + noise * chance.normal(size=at.size)
    for begin, end in zip(beats, beats[1:]):
        length = end - begin
        wave += (1.0 + breath * np.sin(1.5 * begin)) * (
            np.exp(-((at - begin - 0.2 * length) / (0.09 * length + 0.02)) ** 2)
            + echo * np.exp(-((at - begin - 0.55 * length) / (0.13 * length)) ** 2))
    return wave, beats


@pytest.mark.parametrize('rate_hz', [75.0, 250.0])
def test_the_rate_is_that_of_the_beats_from_slow_to_fast(rate_hz: float) -> None:
    believed = 0
    for rate in range(35, 205, 5):
        wave, beats = made(rate, rate_hz)
        for found in measure_recording(wave, rate_hz, 2.0):
            if found.doubt:
                assert math.isnan(found.rate_per_min)
                continue
            believed += 1
            inside = beats[(beats >= found.time_s - 10.0) & (beats < found.time_s)]
            true = 60.0 * (inside.size - 1) / (inside[-1] - inside[0])
            assert found.rate_per_min == pytest.approx(true, abs=3.0)
    assert believed > 70


def test_the_pulse_of_a_real_wave_is_that_of_its_ecg(data_dir: Path) -> None:
    record = read_record(data_dir / 'vitals' / 'a103l.hea')
    wave, lead_ii, lead_v = (record.signals[n].samples for n in (2, 0, 1))
    apart = []
    for found in measure_recording(wave, record.rate_hz):
        end = round(found.time_s * record.rate_hz)
        hearts = [each for lead in (lead_ii, lead_v)
                  if not (each := ecg_beats(lead[end - 2500:end], record.rate_hz)).doubt]
        if not found.doubt and hearts:
            apart.append(abs(found.rate_per_min - hearts[-1].rate_per_min))
        assert found.still_s < ASYSTOLE_S  # the monitor's alarm was a false one
    assert len(apart) > 150
    assert max(apart) <= 3.0


def test_at_the_rate_of_an_oximeter_it_is_the_same(data_dir: Path) -> None:
    record = read_record(data_dir / 'vitals' / 'a103l.hea')
    wave = record.signals[2].samples
    slow = np.interp(np.arange(wave.size * 0.3) / 0.3, np.arange(wave.size), wave)
    pairs = list(zip(measure_recording(wave, 250.0, 5.0), measure_recording(slow, 75.0, 5.0)))
    both = [(a, b) for a, b in pairs if not (a.doubt or b.doubt)]
    assert len(both) > 45
    assert all(abs(a.rate_per_min - b.rate_per_min) < 2.0 for a, b in both)


def test_a_pause_is_seen_and_a_movement_or_a_sensor_that_came_off_is_none() -> None:
    wave, _ = made(70, seconds=30.0)
    sound = np.random.default_rng(1).normal(size=wave.size)
    foot = float(np.median(wave)) - 0.2

    def longest(change: Any) -> float:
        changed = wave.copy()
        changed[15 * 75:22 * 75] = change(np.arange(7 * 75))
        return max(each.still_s for each in measure_recording(changed, 75.0))

    assert max(each.still_s for each in measure_recording(wave, 75.0)) < 1.0
    # The pressure falls slowly, and nothing beats.
    assert longest(lambda at: foot - 0.0005 * at + 0.005 * sound[at]) > 6.0
    # Movement, the same number again and again, and far away: the wave says nothing of the heart.
    assert longest(lambda at: 5.0 * sound[at]) < ASYSTOLE_S
    assert longest(lambda at: np.full(at.size, foot)) < ASYSTOLE_S
    assert longest(lambda at: 20.0 + 0.005 * sound[at]) < ASYSTOLE_S


@pytest.mark.parametrize('wave, doubt', [
    (np.zeros(750), 'flat'), (np.full(750, np.nan), 'samples are missing'),
    (np.zeros(100), 'too short'),
    (np.random.default_rng(3).normal(size=750), ''),
    (np.clip(made(70)[0], None, -0.1)[:750], 'the converter is saturated')])
def test_what_is_no_pulse_has_a_reason(wave: Any, doubt: str) -> None:
    found = pulse_beats(wave, 75.0).doubt
    assert found == doubt if doubt else found


def test_the_wave_may_come_in_pieces_of_any_size() -> None:
    wave, _ = made(72, seconds=20.0)
    whole = PulseMeter(75.0)
    whole.add(wave)
    chance = np.random.default_rng(5)
    pieces = PulseMeter(75.0)
    at = 0
    while at < wave.size:
        size = int(chance.integers(0, 200))
        pieces.add(wave[at:at + size].tolist())
        at += size
    assert pieces.measure() == whole.measure()
    assert whole.measure().rate_per_min == pytest.approx(72.0, abs=3.0)
    whole.restart()
    assert whole.measure().doubt == 'too short'
    with pytest.raises(ValueError, match='8 Hz: the sampling rate of the wave must be 25 to'):
        PulseMeter(8.0)


# ---- gaps and second waves ----------------------------------------------------------------------

@pytest.mark.parametrize('rate_hz', [75.0, 250.0])
@pytest.mark.parametrize('begin_s', np.linspace(4.0, 5.0, 11))
def test_a_short_gap_costs_nothing_wherever_it_is(rate_hz: float, begin_s: float) -> None:
    wave, _ = made(72, rate_hz, 12.0)
    clean = pulse_beats(wave[:round(10 * rate_hz)], rate_hz)
    assert not clean.doubt
    begin = round(begin_s * rate_hz)
    wave[begin:begin + round(0.1 * rate_hz) - 1] = np.nan
    found = pulse_beats(wave[:round(10 * rate_hz)], rate_hz)
    assert not found.doubt
    assert found.rate_per_min == pytest.approx(clean.rate_per_min, abs=1.5)


def test_a_long_gap_or_many_short_ones_are_not_bridged() -> None:
    wave, _ = made(72, seconds=10.0)
    long = wave.copy()
    long[300:320] = np.nan
    many = wave.copy()
    many[::15] = np.nan
    assert [pulse_beats(each, 75.0).doubt for each in (long, many)] == 2 * ['samples are missing']


@pytest.mark.parametrize('gap', [1, 40])
def test_a_stop_is_seen_as_soon_with_samples_missing(gap: int) -> None:
    wave, _ = made(70, seconds=30.0)
    foot = float(np.median(wave)) - 0.2
    sound = np.random.default_rng(1).normal(size=15 * 75)
    wave[15 * 75:] = foot + 0.005 * sound
    late = min(each.time_s for each in measure_recording(wave, 75.0) if each.still_s >= ASYSTOLE_S)
    wave[15 * 75 - gap:15 * 75] = np.nan
    assert min(each.time_s for each in measure_recording(wave, 75.0)
               if each.still_s >= ASYSTOLE_S) == late


@pytest.mark.parametrize('rate_hz', [75.0, 250.0])
@pytest.mark.parametrize('rate', [45, 60, 75, 95])
@pytest.mark.parametrize('strength', [0.4, 0.55, 0.7])
def test_a_dicrotic_wave_is_no_beat(rate: int, strength: float, rate_hz: float) -> None:
    """A second rise 0.31 s after the first, as of a young person's finger."""
    at = np.arange(round(20.0 * rate_hz)) / rate_hz
    chance = np.random.default_rng(rate)
    wave = 0.01 * chance.normal(size=at.size) + 0.1 * np.sin(1.5 * at)
    beats = np.cumsum(60.0 / rate * (1.0 + 0.02 * chance.normal(size=60)))
    for begin in beats:
        wave += np.exp(-((at - begin) / 0.08) ** 2) + strength * np.exp(
            -((at - begin - 0.31) / 0.08) ** 2)
    found = list(measure_recording(wave, rate_hz))
    assert sum(not each.doubt for each in found) > 0.8 * len(found)
    for each in found:
        inside = beats[(beats >= each.time_s - 10.0) & (beats < each.time_s)]
        if not each.doubt:
            assert each.rate_per_min == pytest.approx(
                60.0 * (inside.size - 1) / (inside[-1] - inside[0]), abs=3.0)


def test_recordings_of_wristbands_and_fingers_agree_with_other_programs() -> None:
    """The recordings that come with HeartPy; beats as HeartPy and NeuroKit2 find them."""
    heartpy = pytest.importorskip('heartpy', reason='HeartPy is not installed')
    neurokit = pytest.importorskip('neurokit2', reason='NeuroKit2 is not installed')
    wave, _ = heartpy.load_exampledata(0)
    found = list(measure_recording(np.asarray(wave, dtype=float), 100.0))
    _, measures = heartpy.process(wave, 100.0)
    assert all(not each.doubt for each in found)
    assert np.median([each.rate_per_min for each in found]) == pytest.approx(
        measures['bpm'], abs=2.0)
    # Eleven minutes of a wrist, with movements.
    wave, when = heartpy.load_exampledata(2)
    rate_hz = heartpy.get_samplerate_datetime(when, timeformat='%Y-%m-%d %H:%M:%S.%f')
    _, there = neurokit.ppg_process(wave, sampling_rate=round(rate_hz))
    peaks = there['PPG_Peaks'] / rate_hz
    apart = []
    for each in measure_recording(np.asarray(wave, dtype=float), rate_hz):
        inside = peaks[(peaks >= each.time_s - 10.0) & (peaks < each.time_s)]
        if not each.doubt and inside.size > 2:
            apart.append(abs(each.rate_per_min
                             - 60.0 * (inside.size - 1) / (inside[-1] - inside[0])))
    assert len(apart) > 400
    assert np.median(apart) < 0.5 and np.count_nonzero(np.array(apart) > 5.0) < 10


# ---- records ----------------------------------------------------------------------------------

def write(folder: Path, header: str, samples: bytes) -> Path:
    (folder / 'x.hea').write_text(header)
    (folder / 'x.dat').write_bytes(samples)
    return folder / 'x.hea'


def test_a_record_is_read_in_its_units(tmp_path: Path) -> None:
    raw = np.array([[100, -32768], [300, 20]], dtype='<i2')
    path = write(tmp_path, '# note\nx 2 125/1 2\nx.dat 16+2 100(50)/mV 16 0 100 400 0 II\n'
                 'x.dat 16+2 10/NU 16 10 -32768 -32748 0 PLETH\n#more', b'\0\0' + raw.tobytes())
    record = read_record(path)
    assert (record.name, record.rate_hz, record.comments) == ('x', 125.0, ('note', 'more'))
    assert record.signals[0].samples.tolist() == [0.5, 2.5]
    pleth = record.signal('pleth')
    assert pleth is not None and pleth.unit == 'NU'
    assert math.isnan(pleth.samples[0]) and pleth.samples[1] == 1.0


@pytest.mark.parametrize('header, message', [
    ('x 1 125 2\nx.dat 310 200 10 0 0 0 0 II', 'format 310: only 16, 61'),
    ('x 1 125 2\nx.dat 16x99999 200 16 0 0 0 0 II', '99999 samples in a frame, at most'),
    ('x 1 125 2\nx.dat 310x4 200 16 0 0 0 0 II', 'format 310x4: only 16'),
    ('x 1 125 9\nx.dat 16 200 16 0 0 3 0 II', 'has 2 samples .* announces 9: it is truncated'),
    ('x 1 125 2\nx.dat 16 200 16 0 0 4 0 II', 'checksum 3, its header 4: it is damaged'),
    ('x 2 125 2\nx.dat 16 200 16 0 0 3 0 II', 'it has 1 of 2 announced signals'),
    ('x/2 1 125 2\n', 'several segments'), ('', 'its first line'), ('x 1 abc\n', 'not numbers'),
    ('x 1 125 2\ny.dat 16 200 16 0 0 3 0 II', 'must be in the same folder')])
def test_a_record_that_is_damaged_or_another_is_told(
        tmp_path: Path, header: str, message: str) -> None:
    path = write(tmp_path, header, np.array([1, 2], dtype='<i2').tobytes())
    with pytest.raises(ConfigError, match=message):
        read_record(path)


def test_without_a_header_there_is_no_record(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='name the header of a WFDB record'):
        read_record(tmp_path / 'nothing.mat')
