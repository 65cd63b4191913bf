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

"""The signal formats of WFDB, against bytes that are made here in another way."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import struct

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from rt_robot_os.features.health.waveforms import read_record
from rt_robot_os.features.health.wfdb_formats import FORMATS


def packed_12(numbers: list[int]) -> bytes:
    """Write format 212 nibble by nibble."""
    found = bytearray()
    for place in range(0, len(numbers), 2):
        first, *rest = (number & 0xFFF for number in numbers[place:place + 2])
        second = rest[0] if rest else 0
        found += bytes((first & 0xFF, first >> 8 | second >> 8 << 4))
        if rest:
            found.append(second & 0xFF)
    return bytes(found)


WRITERS: dict[str, tuple[int, Callable[[list[int]], bytes]]] = {
    '16': (16, lambda numbers: struct.pack(f'<{len(numbers)}h', *numbers)),
    '61': (16, lambda numbers: struct.pack(f'>{len(numbers)}h', *numbers)),
    '80': (8, lambda numbers: bytes(number + 128 for number in numbers)),
    '160': (16, lambda numbers: struct.pack(f'<{len(numbers)}H', *(
        number + 32_768 for number in numbers))),
    '24': (24, lambda numbers: b''.join(
        number.to_bytes(3, 'little', signed=True) for number in numbers)),
    '32': (32, lambda numbers: struct.pack(f'<{len(numbers)}i', *numbers)),
    '212': (12, packed_12)}


@pytest.mark.parametrize('form', FORMATS)
@given(data=st.data())
def test_what_was_written_is_read(form: str, data: st.DataObject) -> None:
    bits, write = WRITERS[form]
    most = (1 << (bits - 1)) - 1
    numbers = data.draw(st.lists(st.integers(-most - 1, most), max_size=9))
    octets = np.frombuffer(write(numbers), dtype=np.uint8)
    assert FORMATS[form].decode(octets).tolist() == numbers
    assert FORMATS[form].missing == -most - 1


@pytest.mark.parametrize('form', FORMATS)
def test_a_record_of_each_format(form: str, tmp_path: Path) -> None:
    bits, write = WRITERS[form]
    rows = [(70, 97), (71, 96), (-(1 << (bits - 1)), 95)]
    (tmp_path / 'x.dat').write_bytes(write([number for row in rows for number in row]))
    sums = [sum(column) & 0xFFFF for column in zip(*rows)]
    (tmp_path / 'x.hea').write_text(
        f'x 2 1 3\nx.dat {form} 1/bpm {bits} 0 70 {sums[0]} 0 HR\n'
        f'x.dat {form} 1/% {bits} 0 97 {sums[1]} 0 SpO2\n')
    pulse, spo2 = read_record(tmp_path / 'x.hea').signals
    assert pulse.samples[:2].tolist() == [70.0, 71.0] and np.isnan(pulse.samples[2])
    assert spo2.samples.tolist() == [97.0, 96.0, 95.0]


@pytest.mark.parametrize('form', ['212', '16', '24', '80'])
def test_frames_with_several_samples_skew_and_an_offset(form: str, tmp_path: Path) -> None:
    """Four samples of the first signal in a frame, two of the second, one of the third, late."""
    bits, write = WRITERS[form]
    frames = [[10 * number + place for place in range(4)] + [-number, number] + [number - 1]
              for number in range(4)]
    numbers = [number for frame in frames for number in frame]
    (tmp_path / 'x.dat').write_bytes(b'head' + write(numbers))
    columns = ([number for frame in frames for number in frame[begin:end]]
               for begin, end in ((0, 4), (4, 6), (6, 7)))
    sums = [sum(column) & 0xFFFF for column in columns]
    (tmp_path / 'x.hea').write_text(
        f'x 3 25 4\nx.dat {form}x4+4 1 {bits} 0 0 {sums[0]} 0 II\n'
        f'x.dat {form}x2+4 1 {bits} 0 0 {sums[1]} 0 PLETH\n'
        f'x.dat {form}:1+4 1 {bits} 0 0 {sums[2]} 0 RESP\n')
    record = read_record(tmp_path / 'x.hea')
    fast, middle, slow = (each.samples for each in record.signals)
    assert record.rate_hz == 100.0
    assert fast.tolist() == [10.0 * number + place for number in range(4) for place in range(4)]
    assert middle.tolist() == [
        float(each) for number in range(4) for each in (-number, -number, number, number)]
    # Its first sample belongs to a frame before the record; at the end one is missing.
    assert slow[:12].tolist() == [float(number) for number in range(3) for _ in range(4)]
    assert np.isnan(slow[12:]).all() and slow.size == 16


def test_records_of_the_wfdb_package_are_read_alike(tmp_path: Path) -> None:
    wfdb = pytest.importorskip('wfdb', reason='the WFDB package is not installed')
    chance = np.random.default_rng(2)
    signals = [chance.integers(-900, 900, 4 * 50), chance.integers(-900, 900, 50)]
    record = wfdb.Record(
        record_name='own', n_sig=2, fs=125, sig_len=50, fmt=['212', '212'],
        file_name=['own.dat', 'own.dat'], samps_per_frame=[4, 1], adc_gain=[200.0, 100.0],
        baseline=[10, 0], units=['mV', 'NU'], adc_res=[12, 12], adc_zero=[0, 0],
        init_value=[int(each[0]) for each in signals], block_size=[0, 0],
        sig_name=['II', 'PLETH'], skew=[None, None], byte_offset=[None, None],
        checksum=[int(each.sum()) & 0xFFFF for each in signals], e_d_signal=signals)
    record.wrheader(write_dir=str(tmp_path))
    record.wr_dats(expanded=True, write_dir=str(tmp_path))
    there = wfdb.rdrecord(str(tmp_path / 'own'), smooth_frames=False)
    found = read_record(tmp_path / 'own.hea')
    assert found.rate_hz == 500.0
    assert found.signals[0].samples == pytest.approx(there.e_p_signal[0])
    assert found.signals[1].samples[::4] == pytest.approx(there.e_p_signal[1])
