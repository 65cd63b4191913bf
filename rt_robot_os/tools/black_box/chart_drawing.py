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
Draw a chart as SVG or PNG with matplotlib, if it is installed.

It is an extra, not a dependency of the core; `show` and `export` work without it.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from rt_robot_os.base.errors import BlackBoxError
from rt_robot_os.tools.black_box.chart import Chart
from rt_robot_os.tools.black_box.chart import Row

FORMATS = ('.svg', '.png')
_WIDTH_INCHES, _ROW_INCHES, _FRAME_INCHES, _DPI = 16.0, 0.62, 1.5, 100
# The palette of Okabe and Ito, safe for colour blindness; hatching and height add redundancy.
_RUN, _LATE, _BLOCK, _HOLD = '#0072B2', '#D55E00', '#E69F00', '#009E73'
_WAIT, _PREEMPTED, _INK = '#A8A8A8', '#7FB8DA', '#222222'
_NOTE_WIDTH = 0.0062  # of a character of a note, relative to the width of the plot


def save(chart: Chart, path: Path) -> None:
    """
    Draw into a file; its suffix determines the format, one of :data:`FORMATS`.

    Requires matplotlib: see :func:`rt_robot_os.base.output_files.check_picture`.

    :raises BlackBoxError: the file cannot be written.
    """
    matplotlib = import_module('matplotlib')
    figure_class = import_module('matplotlib.figure').Figure
    settings = {'font.size': 10.0, 'font.family': 'sans-serif', 'svg.fonttype': 'none',
                'svg.hashsalt': 'black box', 'axes.unicode_minus': False,
                'hatch.linewidth': 0.6, 'path.simplify': False, 'text.parse_math': False}
    with matplotlib.rc_context(settings):
        height = _FRAME_INCHES + _ROW_INCHES * len(chart.rows)
        figure: Any = figure_class(figsize=(_WIDTH_INCHES, height), layout='constrained')
        _draw(figure.subplots(), chart)
        more = {'metadata': {'Date': None}} if path.suffix == '.svg' else {'dpi': _DPI}
        try:
            figure.savefig(path, **more)
        except OSError as error:
            raise BlackBoxError(f'{path} cannot be written: {error.strerror or error}') from error


def _draw(axes: Any, chart: Chart) -> None:
    axes.set_xlim(chart.from_ms, chart.to_ms)
    axes.set_ylim(len(chart.rows), 0)
    for number, row in enumerate(chart.rows):
        axes.axhline(number + 0.86, color='#E4E4E4', linewidth=0.8, zorder=0)
        _row(axes, row, number)
        _notes(axes, row, number + 0.12, chart)
    for at_ms, text in chart.marks:
        axes.axvline(at_ms, color=_INK, linewidth=0.8, linestyle=':')
        near_end = at_ms > chart.to_ms - 0.2 * (chart.to_ms - chart.from_ms)
        axes.text(at_ms, 0.02, f' {text} ', fontsize=8, va='top', clip_on=True,
                  ha='right' if near_end else 'left')
    if chart.from_ms <= 0.0 <= chart.to_ms:
        axes.axvline(0.0, color=_INK, linewidth=1.2)
    axes.set_yticks([number + 0.55 for number in range(len(chart.rows))],
                    [row.label for row in chart.rows])
    axes.tick_params(axis='y', length=0)
    axes.grid(True, axis='x', color='#EEEEEE', linewidth=0.8)
    axes.set_axisbelow(True)
    for side in ('top', 'right', 'left'):
        axes.spines[side].set_visible(False)
    quiet = f'   (nothing of {", ".join(chart.quiet)})' if chart.quiet else ''
    axes.set_xlabel(f'milliseconds before the dump{quiet}')
    axes.set_title(_shortened(chart.title, 150), loc='left', fontsize=12, pad=34)
    _legend(axes)


def _shortened(text: str, length: int) -> str:
    line = ' '.join(text.split())
    return line if len(line) <= length else f'{line[:length - 3]}...'


def _row(axes: Any, row: Row, top: float) -> None:
    """Draw one task: a row has the height 1, boxes end at 0.86, and marks are above them."""
    base = top + 0.86
    axes.broken_barh(row.waiting, (base - 0.12, 0.12), facecolors=_WAIT, linewidth=0)
    axes.broken_barh(row.preempted, (base - 0.40, 0.40), facecolors='white', edgecolors=_PREEMPTED,
                     hatch='////', linewidth=0.5)
    # With an outline, a box of a few microseconds is visible.
    for boxes, colour in ((row.running, _RUN), (row.late, _LATE)):
        axes.broken_barh(boxes, (base - 0.40, 0.40), facecolors=colour, edgecolors=colour,
                         linewidth=0.8)
    axes.broken_barh(row.late, (base - 0.40, 0.40), facecolors='none', edgecolors=_INK,
                     hatch='xxx', linewidth=0)
    axes.broken_barh(row.held, (base - 0.30, 0.30), facecolors=_HOLD, edgecolors=_HOLD,
                     linewidth=0.8)
    axes.broken_barh(row.blocking, (base - 0.50, 0.10), facecolors=_BLOCK, edgecolors=_INK,
                     linewidth=0.6)
    for times, (marker, colour, size, height) in zip(
            (row.releases, row.publications, row.interrupts, row.overruns), _MARKS):
        axes.plot(times, [base - height] * len(times), linestyle='none', marker=marker,
                  color=colour, markersize=size, clip_on=True,
                  markeredgecolor='white' if marker == 'X' else colour, markeredgewidth=0.7)


# Marker, colour, size, height above the base line of the boxes.
_MARKS = (('^', _INK, 4.5, -0.06), ('|', '#56218A', 7.0, 0.50), ('v', '#CC79A7', 5.0, 0.48),
          ('X', _INK, 6.5, 0.20))


def _notes(axes: Any, row: Row, top: float, chart: Chart) -> None:
    """Write the notes of a row, faults first, as long as there is space."""
    width = chart.to_ms - chart.from_ms
    taken: list[tuple[float, float]] = []
    for at_ms, text in [*sorted(row.faults), *sorted(row.notes)]:
        length = len(text) * _NOTE_WIDTH * width
        rightmost = min([chart.to_ms, *(left for left, right in taken if right > at_ms)])
        for left in (at_ms, rightmost - 1.01 * length):
            if chart.from_ms <= left <= chart.to_ms - length and all(
                    left + length <= first or left >= last for first, last in taken):
                axes.text(left, top, text, fontsize=8, va='center', color=_INK, clip_on=True)
                taken.append((left, left + length))
                break


def _legend(axes: Any) -> None:
    patch = import_module('matplotlib.patches').Patch
    line = import_module('matplotlib.lines').Line2D
    boxes = [patch(facecolor=_RUN, label='runs'),
             patch(facecolor='white', edgecolor=_PREEMPTED, hatch='////', label='preempted'),
             patch(facecolor=_WAIT, label='waits for its start'),
             patch(facecolor=_LATE, edgecolor=_INK, hatch='xxx', label='late, failed or aborted'),
             patch(facecolor=_BLOCK, edgecolor=_INK, label='native call that blocks others'),
             patch(facecolor=_HOLD, label='holds a resource')]
    names = ('release', 'publication', 'interrupt', 'overrun')
    marks = [line([], [], linestyle='none', marker=marker, color=colour, label=name)
             for name, (marker, colour, _, _) in zip(names, _MARKS)]
    axes.legend(handles=[*boxes, *marks], loc='lower left', bbox_to_anchor=(0.0, 1.0),
                ncols=len(boxes) + len(marks), frameon=False, fontsize=9, handlelength=1.3,
                columnspacing=1.4, handletextpad=0.5, borderaxespad=0.3)
