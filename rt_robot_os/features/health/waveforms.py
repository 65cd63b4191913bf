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
Reader of recorded waveforms of monitors: WFDB records of PhysioNet, of one segment.

A record is a header, the text file ``NAME.hea``, and a file of samples in the same folder. Format
16, the usual one, has 16-bit little-endian samples of the signals in turn; ``16+24`` skips 24
bytes first, which reads MATLAB files of version 4 (``NAME.mat``); ``212x4`` has four samples of
the signal in each frame, and ``16:3`` a signal with a skew of three frames. The header has a
checksum of each signal, so that a truncated or damaged file is detected.
"""

from __future__ import annotations

from pathlib import Path
import re
from typing import Final
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.health.wfdb_formats import FORMATS
from rt_robot_os.features.health.wfdb_formats import Integers

Floats = npt.NDArray[np.float64]

DEFAULT_RATE_HZ: Final = 250.0
DEFAULT_GAIN: Final = 200.0

_FORMAT: Final = re.compile(r'(\d+)(?:x(\d+))?(?::(\d+))?(?:\+(\d+))?').fullmatch
_GAIN: Final = re.compile(r'([-+.\deE]+)(?:\((-?\d+)\))?(?:/(\S+))?').fullmatch
_MOST_SIGNALS: Final = 64
# Largest number of samples in a frame; a header with more is damaged.
_MOST_IN_FRAME: Final = 10_000


class Signal(NamedTuple):
    """
    One signal of a record.

    :ivar name: in the header: ``II``, ``PLETH``.
    :ivar unit: of the samples.
    :ivar samples: shape (n,), in the unit; NaN where the monitor had none.
    """

    name: str
    unit: str
    samples: Floats


class Record(NamedTuple):
    """
    A record.

    :ivar name: of the record.
    :ivar rate_hz: sampling rate of all signals: the highest one; samples of slower signals are
        repeated.
    :ivar signals: in the order of the header.
    :ivar comments: the lines of the header that start with ``#``, without that.
    """

    name: str
    rate_hz: float
    signals: tuple[Signal, ...]
    comments: tuple[str, ...]

    def signal(self, *names: str) -> Signal | None:
        """Return the first signal with one of these names, in any case; else None."""
        wanted = [name.lower() for name in names]
        return next((each for each in self.signals if each.name.lower() in wanted), None)


class _Line(NamedTuple):
    """A line of the header, about one signal."""

    file: str
    form: str
    in_frame: int
    skew_frames: int
    offset: int
    gain: float
    baseline: int
    unit: str
    checksum: int | None
    name: str


def read_record(path: str | Path) -> Record:
    """
    Read a record.

    :param path: of its header; the suffix may be missing, or that of the samples.
    :raises ConfigError: it cannot be read, is damaged or has an unknown format.
    """
    header = Path(path).with_suffix('.hea')
    try:
        text = header.read_text(encoding='utf-8', errors='replace')
    except OSError as error:
        raise ConfigError([f'{header}: {error.strerror}: name the header of a WFDB record, '
                           'NAME.hea']) from error
    lines = [line.strip() for line in text.splitlines()]
    comments = tuple(line[1:].strip() for line in lines if line.startswith('#'))
    facts = [line for line in lines if line and not line.startswith('#')]
    try:
        name, rate_hz, count, length = _first(facts[0] if facts else '')
        signals = [_signal_line(line) for line in facts[1:1 + count]]
        if len(signals) != count:
            raise ValueError(f'it has {len(signals)} of {count} announced signals')
    except ValueError as error:
        raise ConfigError([f'{header}: {error}']) from None
    fastest = max(each.in_frame for each in signals)
    return Record(name, rate_hz * fastest, _samples(header, signals, length), comments)


def _first(line: str) -> tuple[str, float, int, int | None]:
    words = line.split()
    if len(words) < 2 or not words[1].isdigit():
        raise ValueError('its first line must be "name signals rate samples"')
    if '/' in words[0]:
        raise ValueError('records of several segments are not supported: name one of them')
    count = int(words[1])
    if not 0 < count <= _MOST_SIGNALS:
        raise ValueError(f'{count} signals: must be 1 to {_MOST_SIGNALS}')
    try:
        # After a slash or in brackets there may be a counter frequency.
        rate_hz = float(re.split('[/(]', words[2])[0]) if len(words) > 2 else DEFAULT_RATE_HZ
        length = int(words[3]) if len(words) > 3 else None
    except ValueError:
        raise ValueError(f'rate and samples {" ".join(words[2:4])[:40]!r} are not numbers'
                         ) from None
    if not 0.001 <= rate_hz <= 100_000.0:
        raise ValueError(f'rate {rate_hz:g} Hz: must be 0.001 to 100000 Hz')
    return words[0], rate_hz, count, length or None


def _signal_line(line: str) -> _Line:
    words = line.split(maxsplit=8)
    form = _FORMAT(words[1]) if len(words) > 1 else None
    if form is None:
        raise ValueError(f'{line[:60]!r} is not a signal line')
    in_frame = int(form[2] or 1) or 1  # 0 stands for 1 there
    if form[1] not in FORMATS:
        raise ValueError(f'{words[0]} has signal format {words[1][:20]}: only '
                         f'{", ".join(FORMATS)} are supported; convert it (xform of the WFDB '
                         'software)')
    if in_frame > _MOST_IN_FRAME:
        raise ValueError(f'{words[0]} has signal format {words[1][:20]}: {in_frame} samples in a '
                         f'frame, at most {_MOST_IN_FRAME}')
    gain, baseline, unit = DEFAULT_GAIN, None, 'mV'
    if len(words) > 2 and (told := _GAIN(words[2])):
        gain = float(told[1]) or DEFAULT_GAIN
        baseline = int(told[2]) if told[2] else None
        unit = told[3] or unit
    numbers = [int(word) for word in words[3:8] if re.fullmatch(r'-?\d+', word)]
    zero = numbers[1] if len(numbers) > 1 else 0
    return _Line(words[0], form[1], in_frame, int(form[3] or 0), int(form[4] or 0), gain,
                 zero if baseline is None else baseline, unit,
                 numbers[3] if len(numbers) > 3 else None, words[8] if len(words) > 8 else '')


def _samples(header: Path, signals: list[_Line], length: int | None) -> tuple[Signal, ...]:
    found = []
    for file in dict.fromkeys(each.file for each in signals):
        inside = [each for each in signals if each.file == file]
        place = header.parent / Path(file).name
        try:
            octets = np.fromfile(place, dtype=np.uint8, offset=inside[0].offset)
        except OSError as error:
            raise ConfigError([f'{place}: {error.strerror}: the samples of {header.name} must be '
                               'in the same folder']) from error
        if len({each.form for each in inside}) > 1:
            raise ConfigError([f'{header}: signals in {file} have several formats'])
        data = FORMATS[inside[0].form].decode(octets)
        width = sum(each.in_frame for each in inside)
        frames = data.size // width
        if length is not None and frames < length:
            raise ConfigError([f'{place} has {frames} samples of each signal and {header.name} '
                               f'announces {length}: it is truncated'])
        table = data[:(length or frames) * width].reshape(-1, width)
        begin = 0
        for each in inside:
            raw = table[:, begin:begin + each.in_frame]
            begin += each.in_frame
            found.append((each, _aligned(each, _checked(each, raw.ravel(), place), signals)))
    order = [each for each, _ in found]
    by_line = {id(each): samples for each, samples in found}
    return tuple(Signal(each.name, each.unit, by_line[id(each)])
                 for each in signals if each in order)


def _checked(line: _Line, raw: Integers, place: Path) -> Floats:
    total = int(raw.sum()) & 0xFFFF
    if line.checksum is not None and total != line.checksum & 0xFFFF:
        raise ConfigError([f'{place}: signal {line.name or "?"} has the checksum {total}, its '
                           f'header {line.checksum & 0xFFFF}: it is damaged'])
    samples: Floats = (raw.astype(np.float64) - line.baseline) / line.gain
    samples[raw == FORMATS[line.form].missing] = np.nan
    return samples


def _aligned(line: _Line, samples: Floats, signals: list[_Line]) -> Floats:
    """Remove the skew, and resample a signal to the highest rate of its record."""
    skew = min(line.skew_frames * line.in_frame, samples.size)
    if skew:
        samples = np.concatenate((samples[skew:], np.full(skew, np.nan)))
    fastest = max(each.in_frame for each in signals)
    if line.in_frame == fastest:
        return samples
    frames = samples.size // line.in_frame
    inside = np.arange(fastest) * line.in_frame // fastest
    return samples.reshape(frames, line.in_frame)[:, inside].ravel()
