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

"""The figure of a map: walls, free space, the path of the robot, and a scale."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.motion.grid_map import GridMap

_WIDTH_IN: Final = 10.0
_HEIGHTS_IN: Final = (3.0, 16.0)
_MARGIN_M: Final = 1.0
_DOTS_PER_IN: Final = 120
_UNKNOWN_GREY: Final = 0.85
_WAY: Final = '#c0392b'
_LOOP: Final = '#2980b9'
#: Share of the width of the figure that the scale bar takes, about.
_BAR_SHARE: Final = 0.2


def draw(grid: GridMap, poses: Floats, loops: Floats, title: str, path: Path) -> None:
    """
    Draw a map and a path on it.

    :param poses: shape (n, 3): the path.
    :param loops: shape (k, 2, 2): both ends of each loop that was closed.
    :raises OSError: the picture cannot be written.
    :raises ValueError: matplotlib does not support the format of this name.
    """
    from matplotlib.figure import Figure  # the caller has checked that it is installed
    left, bottom, right, top = _bounds(grid, poses)
    height = min(_HEIGHTS_IN[1], max(_HEIGHTS_IN[0], _WIDTH_IN * (top - bottom) / (right - left)))
    figure = Figure(figsize=(_WIDTH_IN, height + 0.9), dpi=_DOTS_PER_IN, layout='constrained')
    axes = figure.subplots()
    width_m, height_m = grid.size_m
    shades = np.where(grid.cells < 0, _UNKNOWN_GREY, np.where(grid.cells > 50, 0.0, 1.0))
    axes.set_facecolor(str(_UNKNOWN_GREY))
    axes.imshow(shades, cmap='gray', vmin=0, vmax=1, origin='lower', interpolation='antialiased',
                extent=(grid.origin[0], grid.origin[0] + width_m, grid.origin[1],
                        grid.origin[1] + height_m))
    if len(loops):
        _draw_loops(axes, loops)
    axes.plot(poses[:, 0], poses[:, 1], color=_WAY, linewidth=0.8, label='path of the laser')
    for index, mark, name in ((0, 'o', 'start'), (-1, 's', 'end')):
        axes.plot(*poses[index, :2], marker=mark, markersize=7, linestyle='none', color=_WAY,
                  markeredgecolor='white', label=name)
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect='equal', xlabel='x in m',
             ylabel='y in m', title=title)
    _draw_bar(axes, left, bottom, right - left, top - bottom)
    figure.legend(loc='outside lower center', ncols=4, fontsize='small', frameon=False)
    figure.savefig(path)


def _bounds(grid: GridMap, poses: Floats) -> tuple[float, float, float, float]:
    """Return the bounds of the figure: all known cells, and the path."""
    rows, columns = np.nonzero(grid.cells >= 0)
    x, y, _ = grid.origin
    step = grid.resolution_m
    xs = [*poses[:, 0], *(x + step * np.array((columns.min(), columns.max() + 1))
                          if len(columns) else ())]
    ys = [*poses[:, 1], *(y + step * np.array((rows.min(), rows.max() + 1)) if len(rows) else ())]
    return (min(xs) - _MARGIN_M, min(ys) - _MARGIN_M, max(xs) + _MARGIN_M, max(ys) + _MARGIN_M)


def _draw_loops(axes: Any, loops: Floats) -> None:
    """Draw a segment for each loop, all as one line with gaps."""
    gaps = np.full((len(loops), 1, 2), np.nan)
    points = np.concatenate((loops, gaps), axis=1).reshape(-1, 2)
    axes.plot(points[:, 0], points[:, 1], color=_LOOP, linewidth=0.6, alpha=0.6,
              label=f'{len(loops)} loops closed')


def _draw_bar(axes: Any, left: float, bottom: float, width: float, height: float) -> None:
    """Draw a scale bar of a round length with its label."""
    wanted = width * _BAR_SHARE
    power = 10.0 ** math.floor(math.log10(wanted))
    length = max(each * power for each in (1.0, 2.0, 5.0) if each * power <= wanted)
    x, y = left + 0.03 * width, bottom + 0.04 * height
    axes.plot((x, x + length), (y, y), color='black', linewidth=3.0, solid_capstyle='butt')
    axes.text(x + length / 2, y + 0.012 * height, f'{length:g} m', ha='center', va='bottom')
