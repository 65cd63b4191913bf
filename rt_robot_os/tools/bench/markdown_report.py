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

"""The report as Markdown, such as docs/benchmarks.md, with the pictures in files beside it."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence

from rt_robot_os.tools.bench.blocks import Block
from rt_robot_os.tools.bench.blocks import Bullets
from rt_robot_os.tools.bench.blocks import CodeBlock
from rt_robot_os.tools.bench.blocks import Heading
from rt_robot_os.tools.bench.blocks import Paragraph
from rt_robot_os.tools.bench.blocks import TableBlock

# How rows are marked, and in which columns.
_MARKS: Mapping[str, tuple[str, Sequence[int]]] = {
    'ours': ('**', (0,)), 'missed': ('**', (0, -1)), 'published': ('*', (0,))}


def markdown(blocks: Iterable[Block], images: str) -> str:
    """
    Write the report.

    :param images: the folder of the pictures as seen from the file, with a slash at its end.
    """
    return '\n'.join(line for block in blocks for line in _lines(block, images)).rstrip() + '\n'


def _lines(block: Block, images: str) -> Iterator[str]:
    if isinstance(block, Heading):
        yield '#' * block.level + ' ' + block.text
    elif isinstance(block, Paragraph):
        yield block.text
    elif isinstance(block, Bullets):
        yield from ('- ' + item for item in block.items)
    elif isinstance(block, CodeBlock):
        yield from (f'```{block.language}', block.text, '```')
    elif isinstance(block, TableBlock):
        yield from _table(block)
    else:
        yield f'![{block.plot.title}]({images}{block.unique}.svg)'
        if block.plot.caption:
            yield from ('', block.plot.caption)
    yield ''


def _table(grid: TableBlock) -> Iterator[str]:
    yield '| ' + ' | '.join(_text(text) for text in _headings(grid)) + ' |'
    yield '|' + '|'.join('---' if i < grid.words else '---:'
                         for i in range(len(grid.headings))) + '|'
    for row, kind in zip(grid.rows, grid.kinds):
        cells = [_text(text) for text in row] + [''] * (len(grid.headings) - len(row))
        marks, columns = _MARKS.get(kind, ('', ()))
        for column in columns:
            cells[column] = f'{marks}{cells[column]}{marks}'
        yield '| ' + ' | '.join(cells) + ' |'


def _headings(grid: TableBlock) -> Sequence[str]:
    if not grid.groups:
        return grid.headings
    return [f'{name} {heading}'.strip() + (f', {unit}' if unit else '')
            for heading, (name, unit) in zip(grid.headings, grid.groups)]


def _text(text: str) -> str:
    """Keep leading spaces, which say "of which", and bars out of the way."""
    indent = len(text) - len(text.lstrip())
    return '&nbsp;' * indent + text.strip().replace('|', r'\|')
