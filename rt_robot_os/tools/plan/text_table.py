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

"""What reports for people are made of: numbers, tables, wrapped lines; 100 columns wide."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
import textwrap

WIDTH = 100


def ms(time_ns: int) -> str:
    """Write a time in milliseconds, with as many decimals as six digits allow."""
    value = time_ns / 1e6
    decimals = 3 if value < 100 else 2 if value < 1000 else 1 if value < 10_000 else 0
    return f'{value:.{decimals}f}'


def percent(part: float) -> str:
    """Write a part as a percentage without its sign."""
    value = part * 100
    return f'{value:.1f}' if abs(value) < 999.95 else f'{value:.0f}'


def _short(name: str, width: int) -> str:
    return name if len(name) <= width else f'{name[:max(0, width - 2)]}..'


def table(headings: Sequence[str], rows: Sequence[Sequence[str]], left: Sequence[int] = (0,)
          ) -> Iterator[str]:
    """
    Write a table; a heading may have a second line, its unit, after a line break.

    :param left: columns that are aligned to the left; the others to the right.
    """
    heads = [list(line) for line in zip(*(f'{h}\n'.split('\n')[:2] for h in headings))]
    heads = [line for line in heads if any(line)]
    columns = range(len(headings))
    widths = [max(len(row[i]) for row in [*heads, *rows]) for i in columns]
    over = sum(widths) + len(widths) - 1 - WIDTH
    if over > 0:
        widths[0] = max(1, widths[0] - over)
        rows = [(_short(row[0], widths[0]), *row[1:]) for row in rows]
    gap = ' ' * (2 if sum(widths) + 2 * (len(widths) - 1) <= WIDTH else 1)
    for row in [*heads, *rows]:
        yield gap.join(cell.ljust(width) if i in left else cell.rjust(width)
                       for i, cell, width in zip(columns, row, widths)).rstrip()


def wrapped(text: str) -> Iterator[str]:
    """Break a text into lines."""
    yield from textwrap.wrap(text, WIDTH, subsequent_indent='  ', break_long_words=False,
                             break_on_hyphens=False)
