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
from rt_robot_os.health.waveforms import read_record
from rt_robot_os.health.wfdb_formats import FORMATS


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
