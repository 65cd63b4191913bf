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

"""Map a log as fast as it goes; what came of it as text, JSON, a map and a picture."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
import sys
import time
from typing import Any

import numpy as np

from rt_robot_os.errors import ConfigError
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.slam.libraries import check
from rt_robot_os.slam.logs import Log
from rt_robot_os.slam.logs import read_log
from rt_robot_os.slam.logs import rows
from rt_robot_os.slam.mapper import Mapper
from rt_robot_os.slam.occupancy import grid_of
from rt_robot_os.slam.relations import compare
from rt_robot_os.slam.relations import read_relations
from rt_robot_os.slam.transforms import Floats

#: Seconds between two lines that say how far it is.
_TELL_S = 5.0


def map_log(arguments: argparse.Namespace) -> None:
    """
    Map the log of a command line, and write what is asked for.

    :raises ConfigError: a file cannot be read or written.
    :raises StartError: a library is missing.
    """
    check()
    if not 0.01 <= arguments.cell <= 1.0:
        raise ConfigError([f'--cell {arguments.cell:g}: 0.01 to 1 m'])
    relations = None if arguments.relations is None else read_relations(arguments.relations)
    log = read_log(arguments.bag)
    begun_s = time.perf_counter()
    mapper = _mapped(log)
    took_s = time.perf_counter() - begun_s
    poses = mapper.trajectory()
    report: dict[str, Any] = {
        'log': arguments.bag.name, 'bad_lines': log.bad_lines, **mapper.counts,
        'seconds': round(took_s, 3), 'scans_per_s': round(len(poses) / took_s, 1)}
    if relations is not None:
        report['errors'] = compare(poses, relations)
    _say(report)
    try:
        if arguments.report is not None:
            whole = {**report, 'stamps_ns': [each.stamp_ns for each in log.scans],
                     'poses': list(rows(poses))}
            arguments.report.write_text(json.dumps(whole) + '\n')
        if arguments.map_file is not None or arguments.picture is not None:
            grid = grid_of(mapper.keyframes, arguments.cell)
            if arguments.map_file is not None:
                grid.save(arguments.map_file)
            if arguments.picture is not None:
                _draw(grid, poses, arguments.picture)
    except OSError as error:
        raise ConfigError([f'{error.filename or "a file"} cannot be written: '
                           f'{error.strerror or error}']) from error


def _mapped(log: Log) -> Mapper:
    mapper = Mapper()
    told_s = time.monotonic()
    for number, scan in enumerate(log.scans, 1):
        mapper.add(scan)
        if time.monotonic() - told_s > _TELL_S:
            told_s = time.monotonic()
            print(f'mapping: {number} of {len(log.scans)} scans', file=sys.stderr, flush=True)
    mapper.finish()
    return mapper


def _say(report: dict[str, Any]) -> None:
    print(f'{report["scans"]} scans, {report["keyframes"]} kept, {report["loops"]} loops closed '
          f'({report["refused"]} refused), {report["lost"]} lost; {report["scans_per_s"]:g} '
          'scans a second')
    if report['bad_lines']:
        print(f'{report["bad_lines"]} lines could not be read')
    if 'errors' in report:
        _say_errors(report['errors'])


def _say_errors(errors: dict[str, Any]) -> None:
    first, second = errors['largest']
    print(f'{errors["relations"]} relations: mean {errors["mean_m"]:.3f} m and '
          f'{errors["mean_rad"]:.4f} rad, largest {errors["largest_m"]:.3f} m '
          f'(scans {first} and {second}); {errors["loops"]} loops: mean '
          f'{errors["loops_mean_m"]:.3f} m')


def compared(report: Path, relations: Path) -> None:
    """
    Compare the poses of a report with relations.

    :raises ConfigError: one of the files is not what it should be.
    """
    try:
        poses: Floats = np.array(json.loads(report.read_text())['poses'], dtype=np.float64)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError([f'{report}: no report of mapping: {error}']) from error
    if poses.ndim != 2 or poses.shape[1] != 3 or not np.isfinite(poses).all():
        raise ConfigError([f'{report}: no report of mapping: poses must be rows of x, y, yaw'])
    _say_errors(compare(poses, read_relations(relations)))


def _draw(grid: GridMap, poses: Floats, path: Path) -> None:
    """
    Draw a map and the way through it.

    :raises ConfigError: matplotlib is missing.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ConfigError(['--picture needs matplotlib: pip install matplotlib']) from error
    width, height = grid.size_m
    figure = Figure(figsize=(10.0, max(3.0, min(20.0, 10.0 * height / width))), dpi=120)
    axes = figure.subplots()
    shades = np.where(grid.cells < 0, 0.82, np.where(grid.cells > 50, 0.0, 1.0))
    axes.imshow(shades, cmap='gray', vmin=0, vmax=1, origin='lower', interpolation='nearest',
                extent=(grid.origin[0], grid.origin[0] + width, grid.origin[1],
                        grid.origin[1] + height))
    axes.plot(poses[:, 0], poses[:, 1], color='#c0392b', linewidth=0.6)
    axes.set_xlabel('x in m')
    axes.set_ylabel('y in m')
    figure.tight_layout()
    figure.savefig(path)
