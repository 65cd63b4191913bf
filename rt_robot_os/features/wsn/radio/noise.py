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
Noise at a node: one value in dBm for each ms.

All nodes share one long series, each with its own offset, so that the noise is a list access. The
series is a recorded trace, a series generated from a trace by closest pattern matching (each value
follows the same last 20 values as in the trace), or generated from a few parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
import gzip
from pathlib import Path
from random import Random
from typing import Final

NS_PER_SAMPLE: Final = 1_000_000
#: Number of values, after which the series repeats: 262 s.
SERIES_LENGTH: Final = 1 << 18
#: TOSSIM stores the patterns of a trace for each node, hundreds of bytes a value, so that its runs
#: use only the first seconds of a long trace; comparisons use as many.
TOSSIM_LEARNS: Final = 3000

_HISTORY: Final = 20
_BIN_DB: Final = 5
_LOWEST_DBM: Final = -115
_HIGHEST_DBM: Final = -5

_QUIET_DBM: Final = -97.6
_QUIET_SPREAD_DB: Final = 0.7
# Heavy: a wireless LAN near by. Its bursts, and the gaps between them, last some ms.
_HEAVY_FLOOR_DBM: Final = -92.0
_HEAVY_FLOOR_SPREAD_DB: Final = 6.0
_HEAVY_BURST_DBM: Final = -66.0
_HEAVY_BURST_SPREAD_DB: Final = 12.0
_HEAVY_SHARE: Final = 0.12
_HEAVY_BURST_SAMPLES: Final = 1.5


def read_trace(path: str | Path) -> list[int]:
    """
    Read a trace: a number in dBm in each line; ``#`` comments and empty lines are ignored.

    :param path: a text file, or a gzipped one that ends with ``.gz``.
    :raises ValueError: for another line, with its number, or a trace that is too short.
    :raises OSError: when the file cannot be read.
    """
    data = Path(path).read_bytes()
    plain = gzip.decompress(data) if str(path).endswith('.gz') else data
    text = plain.decode('utf-8', 'replace')
    trace = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split('#')[0].split()
        if not words:
            continue
        try:
            value = round(float(words[-1]))
        except (OverflowError, ValueError):
            raise ValueError(
                f'{path}, line {number}: {line[:40]!r} is not a noise in dBm') from None
        if not -128 <= value <= 0:
            raise ValueError(f'{path}, line {number}: {value} dBm: must be -128 to 0')
        trace.append(value)
    if len(trace) <= _HISTORY:
        raise ValueError(f'{path}: {len(trace)} values, must be more than {_HISTORY}')
    return trace


def closest_pattern(trace: Sequence[int], random: Random,
                    length: int = SERIES_LENGTH) -> list[int]:
    """
    Generate a series from a trace by closest pattern matching (CPM), as TOSSIM does.

    Each value is drawn from those that followed the same pattern in the trace. A pattern is the
    last 20 values, each in steps of 5 dB. An unknown pattern is replaced by the most frequent one.

    :raises ValueError: for a trace that is too short.
    """
    if len(trace) <= _HISTORY:
        raise ValueError(f'{len(trace)} values, must be more than {_HISTORY}')
    bins = bytes(_bin(value) for value in trace)
    followers: dict[bytes, list[int]] = {}
    for end in range(_HISTORY, len(trace)):
        followers.setdefault(bins[end - _HISTORY:end], []).append(trace[end])
    frequent = max(followers, key=lambda pattern: len(followers[pattern]))
    pattern = bins[:_HISTORY]
    bin_of = {value: bytes([_bin(value)]) for value in set(trace)}
    draw = random.random
    series = []
    for _ in range(length):
        values = followers.get(pattern)
        if values is None:
            pattern = frequent
            values = followers[pattern]
        value = values[int(draw() * len(values))]
        series.append(value)
        pattern = pattern[1:] + bin_of[value]
    return series


def _bin(value: int) -> int:
    """Return the 5 dB bin of a value."""
    inside = value if _LOWEST_DBM <= value <= _HIGHEST_DBM else _LOWEST_DBM
    return (inside - _LOWEST_DBM) // _BIN_DB + 1


def quiet(random: Random, length: int = SERIES_LENGTH) -> list[int]:
    """Return the noise of a place without other radios: that of the chip, about -98 dBm."""
    gauss = random.gauss
    return [round(gauss(_QUIET_DBM, _QUIET_SPREAD_DB)) for _ in range(length)]


def heavy(random: Random, length: int = SERIES_LENGTH) -> list[int]:
    """Return the noise of a place with a busy wireless LAN: bursts of some ms up to -40 dBm."""
    gauss, draw = random.gauss, random.random
    end = 1 / _HEAVY_BURST_SAMPLES
    begin = end * _HEAVY_SHARE / (1 - _HEAVY_SHARE)
    in_burst = False
    series = []
    for _ in range(length):
        in_burst = draw() >= end if in_burst else draw() < begin
        mean, spread = ((_HEAVY_BURST_DBM, _HEAVY_BURST_SPREAD_DB) if in_burst
                        else (_HEAVY_FLOOR_DBM, _HEAVY_FLOOR_SPREAD_DB))
        series.append(min(max(round(gauss(mean, spread)), -99), -38))
    return series
