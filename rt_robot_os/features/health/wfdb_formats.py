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

"""Decoders of the WFDB signal formats with samples of a fixed width."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[np.int64]


class Format(NamedTuple):
    """
    A signal format.

    :ivar missing: the value of a missing sample.
    :ivar decode: decodes bytes to numbers; an incomplete sample at the end is ignored.
    """

    missing: int
    decode: Callable[[npt.NDArray[np.uint8]], Integers]


def _whole(kind: str, offset: int = 0) -> Callable[[npt.NDArray[np.uint8]], Integers]:
    """Return a decoder of samples of one, two or four bytes."""
    def decode(octets: npt.NDArray[np.uint8]) -> Integers:
        width = np.dtype(kind).itemsize
        return octets[:octets.size // width * width].view(kind).astype(np.int64) + offset
    return decode


def _three_bytes(octets: npt.NDArray[np.uint8]) -> Integers:
    rows = octets[:octets.size // 3 * 3].reshape(-1, 3).astype(np.int64)
    return _signed(rows[:, 0] | rows[:, 1] << 8 | rows[:, 2] << 16, 24)


def _twelve_bits(octets: npt.NDArray[np.uint8]) -> Integers:
    """Decode format 212: two samples in three bytes, the upper bits of both in the middle one."""
    odd = octets.size % 3 == 2  # a last sample without its neighbour has two bytes
    padded = np.append(octets, np.uint8(0)) if odd else octets
    rows = padded[:padded.size // 3 * 3].reshape(-1, 3).astype(np.int64)
    pairs = np.column_stack((rows[:, 0] | (rows[:, 1] & 0x0F) << 8,
                             rows[:, 2] | (rows[:, 1] & 0xF0) << 4)).ravel()
    return _signed(pairs[:-1] if odd else pairs, 12)


def _signed(numbers: Integers, bits: int) -> Integers:
    return numbers - ((numbers >> (bits - 1)) << bits)


#: By number, as headers name them.
FORMATS: Final[Mapping[str, Format]] = MappingProxyType({
    '16': Format(-1 << 15, _whole('<i2')), '61': Format(-1 << 15, _whole('>i2')),
    '80': Format(-1 << 7, _whole('u1', -128)), '160': Format(-1 << 15, _whole('<u2', -32_768)),
    '24': Format(-1 << 23, _three_bytes), '32': Format(-1 << 31, _whole('<i4')),
    '212': Format(-1 << 11, _twelve_bits)})
