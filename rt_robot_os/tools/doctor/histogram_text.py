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

"""Two histograms of lateness side by side, one row an octave."""

from __future__ import annotations

from collections.abc import Iterator

from rt_robot_os.kernel.histogram import bucket_limits
from rt_robot_os.tools.doctor.lateness import Measured
from rt_robot_os.tools.doctor.style import Style
from rt_robot_os.tools.doctor.wakeup import Wakeup

_BAR = 28
_LABEL = 16


def octaves(measured: Measured) -> dict[int, int]:
    """Add the buckets up by octave: octave n holds durations from 2^n ns up to twice that."""
    found: dict[int, int] = {}
    for index, count in measured.counts.items():
        octave = max(0, bucket_limits(index)[0].bit_length() - 1)
        found[octave] = found.get(octave, 0) + count
    return found


def _duration(octave: int) -> str:
    value = float(1 << octave)
    for unit in ('ns', 'us', 'ms'):
        if value < 999:
            return f'{value:.3g} {unit}'
        value /= 1000
    return f'{value:.3g} s'


def _cell(count: int, total: int, style: Style) -> str:
    if not count:
        return ' ' * (_BAR + 8)
    length = round(_BAR * count / total)
    bar = style.full * length if length else style.trace
    return f'{count:>7} {bar.ljust(_BAR)}'


def histogram_lines(wakeup: Wakeup, style: Style) -> Iterator[str]:
    """Write both histograms; a dot stands for less than half a character of a bar."""
    left, right = octaves(wakeup.machine), octaves(wakeup.kernel)
    if not left and not right:
        return
    totals = [max(1, sum(side.values())) for side in (left, right)]
    yield ''
    yield (f'  {"late by".ljust(_LABEL)} {"machine alone".ljust(_BAR + 8)}  with our kernel')
    for octave in range(min([*left, *right]), max([*left, *right]) + 1):
        label = f'{_duration(octave)} ..'.rjust(_LABEL - 2)
        row = (f'  {label}   {_cell(left.get(octave, 0), totals[0], style)}  '
               f'{_cell(right.get(octave, 0), totals[1], style)}')
        yield row.rstrip()
