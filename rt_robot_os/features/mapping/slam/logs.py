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
Read logs of scans: CSV with reference poses, and CARMEN's, gzipped or not.

The CSV has a header line that begins with ``#`` and has the number of ranges, the angle of the
first beam and the angle between beams in degrees; then rows of time in s, x, y, yaw of
odometry, x, y, yaw of a reference, and the ranges in m.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
import gzip
import io
import math
from pathlib import Path
import re
from typing import Final
from typing import IO
import zlib

import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.slam.carmen import CarmenReader
from rt_robot_os.features.mapping.slam.carmen import judge
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.transforms import Floats

_HEAD: Final = re.compile(
    r'(\d+) ranges.*first beam at (-?[\d.]+) deg, step (-?[\d.]+) deg')
#: An example of the header of a CSV.
_EXAMPLE: Final = ('"# t, odometry x y yaw, reference x y yaw, then 180 ranges in m, first beam '
                   'at -90.0 deg, step 1.0000 deg"')
_POSES: Final = 7
_GZIP: Final = b'\x1f\x8b'
#: Longest line of a log.
_LINE_MOST: Final = 4 << 20


@dataclass(frozen=True)
class Log:
    """
    The scans of a log.

    :ivar reference: shape (scans, 3): reference poses; None without any.
    :ivar bad_lines: lines that could not be read, and were skipped.
    """

    scans: tuple[Scan, ...]
    reference: Floats | None
    bad_lines: int


class TextLog:
    """
    A log that is read line by line.

    :raises ConfigError: it cannot be read, or holds no scan; the message says which.
    :ivar bad: lines that could not be read.
    :ivar problems: a sentence for each problem, complete when all scans were read.
    :ivar share_read: from 0 to 1.
    """

    def __init__(self, path: Path) -> None:
        self.bad = 0
        self.problems: list[str] = []
        self.share_read = 0.0
        self._first_bad = ''
        self._path = path
        self._references: list[Floats] | None = []
        with self._lines([]) as lines:  # problems are reported when it is read
            first = next(lines, '')
            self._head = _HEAD.search(first) if first.startswith('#') else None
        with self._lines([]) as lines:
            self._judged = None if self._head else judge(lines)
        if self._head is None and self._judged is None:
            raise ConfigError([
                f'{path}:1: the first line of a CSV must say what its columns are, such as '
                f'{_EXAMPLE}' if first.startswith('#') or first.count(',') >= _POSES else
                f'{path}: no scan in it: neither rows of a CSV with ranges nor FLASER or '
                'ROBOTLASER1 lines of a CARMEN log'])
        if self._judged is not None and not self._judged.has_wheels:
            raise ConfigError([f'{path}: no odometry in it: its lines of odometry repeat the '
                               'corrected poses of the scans'])

    @property
    def reference(self) -> Floats | None:
        """Return the reference poses of the scans that were read; None without any."""
        return None if self._references is None else np.array(self._references).reshape(-1, 3)

    def scans(self) -> Iterator[Scan]:
        """
        Yield all scans.

        :raises ConfigError: there is none.
        """
        count = backwards = 0
        last_ns: int | None = None
        # A truncated log is read up to its end.
        with self._lines(self.problems) as lines:
            for scan in self._scans(lines):
                count += 1
                backwards += last_ns is not None and scan.stamp_ns < last_ns
                last_ns = scan.stamp_ns
                yield scan
        why = f'; the first is {self._first_bad}' if self._first_bad else ''
        if not count:
            raise ConfigError([f'{self._path}: no scan in it that could be read{why}',
                               *self.problems])
        if self.bad:
            self.problems.append(f'lines that could not be read, and were skipped: {self.bad}'
                                 f'{why}')
        if backwards:
            self.problems.append(f'{backwards} scans are stamped earlier than those before them: '
                                 'the order of the lines is used')

    def _scans(self, lines: Iterable[str]) -> Iterator[Scan]:
        if self._judged is None:
            yield from self._rows(lines)
            return
        reader = CarmenReader(self._judged)
        self._references = reader.references
        for scan in reader.scans(lines):
            self.bad = reader.bad_lines
            yield scan
        self.bad = reader.bad_lines
        if reader.others:
            self.problems.append(f'{reader.others} scans of a second kind of line were skipped: '
                                 f'{self._judged.kind} is read')

    def _rows(self, lines: Iterable[str]) -> Iterator[Scan]:
        assert self._head is not None and self._references is not None
        beams = int(self._head[1])
        start, step = math.radians(float(self._head[2])), math.radians(float(self._head[3]))
        for number, row in enumerate(lines):
            if not number or not row.strip():
                continue
            try:
                found = _numbers(row.split(','), beams)
            except ValueError as error:
                self.bad += 1
                self._first_bad = self._first_bad or f'line {number + 1}: {error}'
                continue
            self._references.append(found[4:_POSES])
            yield Scan(round(found[0] * NS_PER_S), found[1:4], found[_POSES:], start, step)

    @contextmanager
    def _lines(self, problems: list[str]) -> Iterator[Iterator[str]]:
        """
        Open the file, to be read as far as it is intact.

        :raises ConfigError: it cannot be opened.
        """
        try:
            raw = self._path.open('rb')
            packed = raw.read(2) == _GZIP
        except OSError as error:
            raise ConfigError([f'{self._path}: {error.strerror or error}']) from error
        with raw:
            raw.seek(0)
            size = max(1, self._path.stat().st_size)
            file: IO[bytes] = gzip.GzipFile(fileobj=raw) if packed else raw  # type: ignore
            with io.TextIOWrapper(file, errors='replace') as text:
                yield self._each(text, raw, size, problems)

    def _each(self, text: IO[str], raw: IO[bytes], size: int, problems: list[str]
              ) -> Iterator[str]:
        try:
            while line := text.readline(_LINE_MOST):
                self.share_read = min(1.0, raw.tell() / size)
                yield line
        except (OSError, EOFError, zlib.error) as error:
            problems.append(f'{self._path} is truncated or damaged: it was read up to that point '
                            f'({getattr(error, "strerror", None) or error})')


def read_log(path: Path) -> Log:
    """
    Read a whole log.

    :raises ConfigError: it cannot be read, or holds no scan; the message says which.
    """
    log = TextLog(path)
    scans = tuple(log.scans())
    return Log(scans, log.reference, log.bad)


def _numbers(words: list[str], beams: int) -> Floats:
    """
    Read a row.

    :raises ValueError: it is malformed; the message says why.
    """
    if len(words) != _POSES + beams:
        raise ValueError(f'{len(words)} values instead of {_POSES} and {beams} ranges as in the '
                         'header of the file')
    found = np.array([float(each) for each in words[:_POSES]]
                     + [float(each) if each.strip() else math.nan for each in words[_POSES:]])
    if not np.isfinite(found[:_POSES]).all():
        raise ValueError(f'time and poses must be finite: {", ".join(words[:_POSES])}')
    return found


def rows(poses: Floats) -> Iterator[list[float]]:
    """Write poses as lists of numbers, to a tenth of a millimetre."""
    for x, y, yaw in poses.tolist():
        yield [round(x, 4), round(y, 4), round(yaw, 5)]
