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
from collections.abc import Sequence
from contextlib import contextmanager
from html import escape
from importlib import import_module
import io
import math
from pathlib import Path
import re
from typing import Any

from rt_robot_os.base.needs import lacking
from rt_robot_os.tools.bench.plot import Plot
from rt_robot_os.tools.bench.plot import Series

_SIZE_INCHES = (7.2, 3.6)
# Of pictures of tails: which part is later, and the percentile that this is.
_TAIL_TICKS = ((1.0, 'all'), (0.5, '50 % (p50)'), (0.1, '10 % (p90)'), (0.01, '1 % (p99)'),
               (1e-3, '0.1 % (p99.9)'), (1e-4, '0.01 %'), (1e-5, '0.001 %'))
# One colour for each system in all pictures, distinguishable with any colour vision (mostly of
# Okabe and Ito, and of Tol): ours begins with blue, rclpy is warm, floors are black and grey. The
# first text that a label begins with decides.
_SYSTEMS = (
    ('rclpy Single', ('#D55E00',)), ('rclpy Multi', ('#E69F00',)), ('rclpy', ('#8B1A1A',)),
    ('HORUS', ('#009E73',)), ('Python threads', ('#CC79A7',)), ('plain thread', ('#CC79A7',)),
    ('threads', ('#CC79A7',)), ('loop', ('#777777',)),
    ('paper', ('#332288',)), ('Process', ('#777777',)),
    ('rt_robot_os', ('#0072B2', '#882255', '#56B4E9', '#999933', '#A0522D')),
    ('clock_nanosleep', ('#000000', '#777777', '#BBBBBB')), ('cyclictest', ('#AAAAAA',)),
    ('memcpy', ('#000000',)))
# Several variants of our own in one picture, none of which is another system.
_VARIANTS = ('#0072B2', '#882255', '#44AA99', '#56B4E9', '#999933', '#D55E00')
_DASHES = ('-', '--', '-.', ':')
_MARKS = 'osD^vPX<>'
# Number of marks on a curve of many points.
_MARKS_ON_CURVE = 8


def available() -> bool:
    """Return whether pictures can be drawn."""
    return not lacking('a plot', 'matplotlib')


def remedy() -> str:
    """Say that there are no pictures, and what to install."""
    return f'no plots: {lacking("a plot", "matplotlib")}'


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
    text = re.sub(r'href="#([^"]+)"', rf'href="#{unique}-\1"', text)
    return text.replace('<svg ', f'<svg role="img" aria-label="{escape(plot.title)}" ', 1)


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


def styles(labels: Sequence[str]) -> Sequence[tuple[str, str]]:
    """
    Choose (colour, dashes) of the curves of one picture by what their labels begin with.

    :return: no two are the same; a system has the same colour in every picture.
    """
    used: dict[str, int] = {}
    found = []
    for label in labels:
        name, colours = next((known for known in _SYSTEMS if label.startswith(known[0])),
                             ('', _VARIANTS))
        turn = used.get(name, 0)
        used[name] = turn + 1
        again = turn // len(colours) if len(colours) > 1 else turn
        found.append((colours[turn % len(colours)], _DASHES[again % len(_DASHES)]))
    return found


def _draw(axes: Any, plot: Plot) -> None:
    curves = [series for series in plot.series if len(series.x)]
    chosen = styles([series.label for series in curves])
    for number, (series, (colour, dashes)) in enumerate(zip(curves, chosen)):
        mark = _MARKS[number % len(_MARKS)] if len(curves) > 1 else ''
        _curve(axes, series, colour, dashes, mark)
    axes.set_title(plot.title, loc='left', fontsize=10)
    axes.set_xlabel(plot.x_label)
    axes.set_ylabel(plot.y_label)
    if plot.x_log:
        axes.set_xscale('log')
    if plot.y_log:
        axes.set_yscale('log')
    elif plot.y_from_zero:
        axes.set_ylim(0, axes.get_ylim()[1] * 1.1)
    if plot.x_range:
        axes.set_xlim(*plot.x_range)
    if plot.y_range:
        axes.set_ylim(*plot.y_range)
    for axis, logarithmic in ((axes.xaxis, plot.x_log), (axes.yaxis, plot.y_log)):
        if logarithmic:
            low, high = axis.get_view_interval()
            floor = plot.y_floor if axis is axes.yaxis else None
            axis.set_major_formatter(_plain_numbers('1', floor))
            axis.set_minor_formatter(_plain_numbers('25' if high < 700 * low else ''))
    if plot.equal:
        axes.set_aspect('equal', adjustable='datalim')
    axes.tick_params(which='minor', pad=5)  # in line with the longer major ones
    if plot.x_ticks:
        _ticks(axes.xaxis, plot.x_ticks)
    if curves and all(series.style == 'steps' for series in curves):
        _ticks(axes.yaxis, _TAIL_TICKS)
    axes.grid(True, which='major', color='#dddddd', linewidth=0.6)
    axes.set_axisbelow(True)
    if len(curves) > 1:
        axes.legend(loc='upper left', bbox_to_anchor=(1.01, 1.0), frameon=False, fontsize=8)


def _ticks(axis: Any, ticks: Sequence[tuple[float, str]]) -> None:
    """Put labels of their own at those places of an axis that it shows."""
    ticker = import_module('matplotlib.ticker')
    low, high = axis.get_view_interval()
    inside = [(place, text) for place, text in ticks if low <= place <= high]
    axis.set_major_locator(ticker.FixedLocator([place for place, _ in inside]))
    axis.set_major_formatter(ticker.FixedFormatter([text for _, text in inside]))
    axis.set_minor_locator(ticker.NullLocator())


def _plain_numbers(digits: str, floor: tuple[float, str] | None = None) -> Any:
    """
    Write 0.001 and 100,000 as such, which people read faster than powers.

    :param digits: only numbers that begin with one of them.
    :param floor: a value, and what is written there instead.
    """
    def text(value: float, position: object) -> str:
        if floor is not None and math.isclose(value, floor[0]):
            return floor[1]
        plain = f'{value:,.0f}' if value >= 1 else f'{value:g}'
        return plain if plain.lstrip('0.')[:1] in tuple(digits) else ''

    return import_module('matplotlib.ticker').FuncFormatter(text)


def _curve(axes: Any, series: Series, colour: str, dashes: str, mark: str) -> None:
    common = {'label': series.label, 'color': colour, 'linestyle': dashes, 'marker': mark,
              'markersize': 4, 'markevery': max(1, len(series.x) // _MARKS_ON_CURVE)}
    if series.style == 'steps':
        axes.step(series.x, series.y, where='post', linewidth=1.3, **common)
    elif series.style == 'filled':
        axes.fill_between(series.x, series.y, step='post', alpha=0.3, color=colour, linewidth=0)
        axes.step(series.x, series.y, where='post', linewidth=1.0, **common)
    elif series.style == 'points':
        axes.plot(series.x, series.y, linestyle='none', marker='.', markersize=3,
                  color='#999999', label=series.label)
    elif series.style == 'marks':
        axes.plot(series.x, series.y, linewidth=1.0, **{
            **common, 'marker': mark or _MARKS[0], 'markevery': 1})
    else:
        axes.plot(series.x, series.y, linewidth=1.2, **common)
