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


"""The result of `wsn compare` as text that fits a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
import shutil
import textwrap
from typing import Final
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rt_robot_os.features.wsn.cli.references import Skipped

# Longer values get lines of their own.
_SHORT: Final = 10
_NARROWEST, _WIDEST, _USUAL = 60, 120, 100
_FORM: Final = '  {:<7}  {:<17}  {:>10}  {:>10}  {}'
_INDENT: Final = 11


@dataclass(frozen=True)
class Difference:
    """
    One figure of one reference.

    :ivar ok: the difference is within the limit.
    """

    what: str
    ours: str
    theirs: str
    ok: bool
    allowed: str = ''


def width() -> int:
    """Return the width of the text: the terminal's, from 60 to 120 columns; 100 in pipes."""
    return min(max(shutil.get_terminal_size((_USUAL, 24)).columns, _NARROWEST), _WIDEST)


def lines(compared: Mapping[str, Sequence[Difference]], skipped: Sequence[Skipped], columns: int
          ) -> Iterator[str]:
    """
    Yield the lines: compared figures, skipped references, the total.

    :param compared: figures by the name of their reference.
    :param columns: largest length of a line.
    """
    yield _FORM.format('', 'figure', 'ours', 'theirs', 'limit')
    for name, found in compared.items():
        yield from _wrapped(name, columns, '')
        for each in found:
            yield from _figure(each, columns)
    yield ''
    for one in skipped:
        yield from _wrapped(f'skipped: {one.name}: {one.why}', columns, '  ')
    wrong = sum(not each.ok for found in compared.values() for each in found)
    count = sum(map(len, compared.values()))
    left = f'; {len(skipped)} skipped' if skipped else ''
    yield f'{count - wrong} of {count} figures agree, of {len(compared)} references{left}'


def _figure(one: Difference, columns: int) -> Iterator[str]:
    verdict = 'agrees' if one.ok else 'DIFFERS'
    is_long = max(len(one.ours), len(one.theirs)) > _SHORT
    line = f'  {verdict:<7}  {one.what:<17}  {one.allowed}' if is_long else _FORM.format(
        verdict, one.what, one.ours, one.theirs, one.allowed)
    yield from _wrapped(line.rstrip(), columns, ' ' * (_INDENT + 2))
    if is_long:
        for title, value in (('ours', one.ours), ('theirs', one.theirs)):
            yield from _wrapped(f'{"":{_INDENT}}{title:<8}{value}', columns, ' ' * (_INDENT + 8))


def _wrapped(line: str, columns: int, indent: str) -> Iterator[str]:
    if len(line) <= columns:
        yield line
        return
    yield from textwrap.wrap(line, columns, subsequent_indent=indent, break_on_hyphens=False,
                             drop_whitespace=True, replace_whitespace=False)
