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
Pictures as SVG and PNG, drawn by matplotlib where it is installed.

It is an extra and never a dependency: without it everything is measured and shown as tables.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
import io
from pathlib import Path
import re
from typing import Any

from rt_robot_os.bench.plot import Plot
from rt_robot_os.bench.plot import Series

REMEDY = 'no plots: matplotlib is not installed (remedy: pip install matplotlib)'
_SIZE_INCHES = (7.2, 3.6)
# Okabe and Ito: told apart by everybody, printed or not. Ours are blue, the floors grey.
_OURS = ('#0072B2', '#56B4E9', '#003f66')
_FLOORS = ('#000000', '#777777', '#bbbbbb')
_OTHERS = ('#D55E00', '#009E73', '#CC79A7', '#E69F00', '#8C564B', '#9467BD', '#BCBD22')
_MARKS = 'osD^vPX<>'


def available() -> bool:
    """Tell whether pictures can be drawn."""
    return find_spec('matplotlib') is not None


def svg(plot: Plot, unique: str) -> str:
    """
    Draw a picture that can stand inside a page.

    :param unique: no other picture of the page has it; identifiers inside begin with it.
    :return: the element, without the XML header.
    """
    with _figure(plot, {'svg.hashsalt': unique, 'svg.fonttype': 'none'}) as figure:
        stream = io.StringIO()
        figure.savefig(stream, format='svg', metadata={'Date': None})
    text = stream.getvalue()
    text = re.sub('<metadata>.*?</metadata>', '', text[text.index('<svg'):], flags=re.DOTALL)
    # Identifiers such as figure_1 occur in every picture.
    text = re.sub(r'\bid="([^"]+)"', rf'id="{unique}-\1"', text)
    text = re.sub(r'url\(#([^)]+)\)', rf'url(#{unique}-\1)', text)
    return re.sub(r'href="#([^"]+)"', rf'href="#{unique}-\1"', text)


def save(plot: Plot, path: Path) -> None:
    """
    Draw a picture into a file; its ending says the format.

    :raises OSError: it cannot be written.
    """
    with _figure(plot, {'svg.hashsalt': plot.name, 'svg.fonttype': 'none'}) as figure:
        more: dict[str, Any] = {'metadata': {'Date': None}} if path.suffix == '.svg' else {
            'dpi': 130}
        figure.savefig(path, **more)


@contextmanager
def _figure(plot: Plot, settings: dict[str, Any]) -> Iterator[Any]:
    """Make a figure without any window system."""
    with import_module('matplotlib').rc_context({
            'font.size': 9.0, 'font.family': 'sans-serif', 'axes.spines.top': False,
            'axes.spines.right': False, 'axes.unicode_minus': False, **settings}):
        figure: Any = import_module('matplotlib.figure').Figure(
            figsize=_SIZE_INCHES, layout='constrained')
        _draw(figure.subplots(), plot)
        yield figure


def _draw(axes: Any, plot: Plot) -> None:
    used = [0, 0, 0]
    for number, series in enumerate(plot.series):
        kind = 0 if series.label.startswith(('rt_robot_os', 'ours')) else (
            1 if series.label.startswith(('clock_nanosleep', 'cyclictest', 'memcpy')) else 2)
        colours = (_OURS, _FLOORS, _OTHERS)[kind]
        _curve(axes, series, colours[used[kind] % len(colours)], number)
        used[kind] += 1
    axes.set_title(plot.title, loc='left', fontsize=10)
    axes.set_xlabel(plot.x_label)
    axes.set_ylabel(plot.y_label)
    if plot.x_log:
        axes.set_xscale('log')
    if plot.y_log:
        axes.set_yscale('log')
    for axis, logarithmic in ((axes.xaxis, plot.x_log), (axes.yaxis, plot.y_log)):
        if logarithmic:
            low, high = axis.get_view_interval()
            axis.set_major_formatter(_plain_numbers('1'))
            axis.set_minor_formatter(_plain_numbers('25' if high < 60 * low else ''))
    axes.grid(True, which='major', color='#dddddd', linewidth=0.6)
    axes.set_axisbelow(True)
    if len(plot.series) > 1:
        axes.legend(loc='upper left', bbox_to_anchor=(1.01, 1.0), frameon=False, fontsize=8)


def _plain_numbers(digits: str) -> Any:
    """
    Write 0.001 and 100,000 as such, which people read faster than powers.

    :param digits: only numbers that begin with one of them.
    """
    def text(value: float, position: object) -> str:
        plain = f'{value:,.0f}' if value >= 1 else f'{value:g}'
        return plain if plain.lstrip('0.')[:1] in tuple(digits) else ''

    return import_module('matplotlib.ticker').FuncFormatter(text)


def _curve(axes: Any, series: Series, colour: str, number: int) -> None:
    common = {'label': series.label, 'color': colour}
    if series.style == 'steps':
        axes.step(series.x, series.y, where='post', linewidth=1.3, **common)
    elif series.style == 'filled':
        axes.fill_between(series.x, series.y, step='post', alpha=0.35, color=colour, linewidth=0)
        axes.step(series.x, series.y, where='post', linewidth=1.0, **common)
    elif series.style == 'marks':
        axes.plot(series.x, series.y, marker=_MARKS[number % len(_MARKS)], markersize=4,
                  linewidth=1.0, **common)
    else:
        axes.plot(series.x, series.y, linewidth=1.2, **common)
