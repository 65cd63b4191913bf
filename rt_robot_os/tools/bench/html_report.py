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

"""The report as one HTML file that needs nothing else: no network, no script."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from itertools import groupby
import re

from rt_robot_os.tools.bench import plot_drawing
from rt_robot_os.tools.bench.blocks import Block
from rt_robot_os.tools.bench.blocks import Bullets
from rt_robot_os.tools.bench.blocks import CodeBlock
from rt_robot_os.tools.bench.blocks import Heading
from rt_robot_os.tools.bench.blocks import Paragraph
from rt_robot_os.tools.bench.blocks import TableBlock

_STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, sans-serif; color: #1b1b1b; background: #fff;
  max-width: 66rem; margin: 2rem auto; padding: 0 1rem; }
h2 { margin-top: 2.5rem; border-bottom: 1px solid #ccc; }
h3 { margin-top: 2.2rem; } h4 { margin: 1.2rem 0 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: .8rem 0; font-size: 13px; }
th, td { padding: .15rem .7rem; text-align: right; border-bottom: 1px solid #e4e4e4;
  font-variant-numeric: tabular-nums; vertical-align: top; }
th { font-weight: 600; vertical-align: bottom; }
tr.groups th { text-align: center; border-bottom: 0; padding: 0 .35rem; }
tr.groups span { display: block; border-bottom: 1px solid #bbb; padding: 0 .35rem; }
.w { text-align: left; }
td { white-space: nowrap; } td.w { white-space: normal; }
td.w:first-child { white-space: pre-wrap; min-width: 14rem; }
tr.ours { font-weight: 600; background: #eef6ee; }
tr.published { font-style: italic; background: #f5f2e8; }
tr.absent { color: #777; }
tr.missed td:last-child { color: #b00020; font-weight: 700; }
tr.reached td:last-child { color: #1b6e1b; font-weight: 700; }
figure { margin: 1rem 0; } figcaption { font-size: 13px; color: #444; }
svg { max-width: 100%; height: auto; }
code, pre { font: 13px/1.4 ui-monospace, monospace; background: #f4f4f4; }
code { padding: 0 .2em; } pre { padding: .6rem; overflow-x: auto; }
nav { font-size: 14px; line-height: 1.8; }
"""


def page(blocks: Iterable[Block]) -> str:
    """Write the page."""
    blocks = list(blocks)
    title = next((b.text for b in blocks if isinstance(b, Heading)), 'bench')
    body = []
    for block in blocks:
        body.append(_html(block))
        if isinstance(block, Heading) and block.level == 1:
            body.append(_contents(blocks))
    return ('<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n'
            + '\n'.join(body) + '\n</body>\n</html>\n')


def _anchor(text: str) -> str:
    return re.sub(r'[^a-z0-9]+', '-', text.lower()).strip('-')


def _contents(blocks: Iterable[Block]) -> str:
    links = []
    for block in blocks:
        if isinstance(block, Heading) and block.level in (2, 3):
            # Of a case the name is enough.
            text = block.text.partition(':')[0]
            links.append(f'<a href="#{_anchor(block.text)}">{escape(text)}</a>')
    return f'<nav>{" · ".join(links)}</nav>'


def _inline(text: str) -> str:
    """Escape, and set what stands between backquotes as code."""
    return re.sub(r'`([^`]+)`', r'<code>\1</code>', escape(text))


def _html(block: Block) -> str:
    if isinstance(block, Heading):
        return (f'<h{block.level} id="{_anchor(block.text)}">{escape(block.text)}'
                f'</h{block.level}>')
    if isinstance(block, Paragraph):
        return f'<p>{_inline(block.text)}</p>'
    if isinstance(block, Bullets):
        return '<ul>' + ''.join(f'<li>{_inline(item)}</li>' for item in block.items) + '</ul>'
    if isinstance(block, CodeBlock):
        return f'<pre>{escape(block.text)}</pre>'
    if isinstance(block, TableBlock):
        return _table(block)
    return (f'<figure>{plot_drawing.svg(block.plot, block.unique)}'
            f'<figcaption>{_inline(block.plot.caption)}</figcaption></figure>')


def _table(grid: TableBlock) -> str:
    count = len(grid.headings)
    lines = ['<div class="wide"><table>']
    if grid.groups:
        lines.append('<tr class="groups">' + ''.join(
            _group(', '.join(filter(None, group)), len(list(same)))
            for group, same in groupby(grid.groups)) + '</tr>')
    if any(grid.headings):
        lines.append('<tr>' + ''.join(
            f'<th{_class(i < grid.words)}>{escape(text)}</th>'
            for i, text in enumerate(grid.headings)) + '</tr>')
    for row, kind in zip(grid.rows, grid.kinds):
        cells = []
        for i, text in enumerate(row):
            wide = f' colspan="{count - i}"' if i == len(row) - 1 < count - 1 else ''
            cells.append(f'<td{_class(i < grid.words or bool(wide))}{wide}>{escape(text)}</td>')
        lines.append(f'<tr class="{kind}">{"".join(cells)}</tr>')
    return '\n'.join((*lines, '</table></div>'))


def _group(text: str, columns: int) -> str:
    line = f'<span>{escape(text)}</span>' if text else ''
    return f'<th colspan="{columns}">{line}</th>'


def _class(words: bool) -> str:
    return ' class="w"' if words else ''
