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

"""Map a log as fast as possible; write the result as text, JSON, a map and a figure."""

from __future__ import annotations

import argparse
from dataclasses import replace
import json
from pathlib import Path
import sys
import time
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.needs import require
from rt_robot_os.base.output_files import check_output
from rt_robot_os.base.output_files import check_picture
from rt_robot_os.base.requirements import EXTRAS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.cli.picture import draw
from rt_robot_os.features.mapping.cli.scan_source import opened
from rt_robot_os.features.mapping.cli.scan_source import ScanSource
from rt_robot_os.features.mapping.slam.archive import YAML
from rt_robot_os.features.mapping.slam.logs import rows
from rt_robot_os.features.mapping.slam.mapper import Mapper
from rt_robot_os.features.mapping.slam.max_range import echo_ranges
from rt_robot_os.features.mapping.slam.max_range import reported_max_range
from rt_robot_os.features.mapping.slam.occupancy import grid_of
from rt_robot_os.features.mapping.slam.relations import compare
from rt_robot_os.features.mapping.slam.relations import read_relations
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.tuning import MapperTuning

_PROGRESS_S: Final = 5.0
_PROBLEMS_MOST: Final = 20


def map_log(arguments: argparse.Namespace) -> None:
    """
    Map the log of a command line, and write the requested files.

    :raises ConfigError: a file cannot be read or written, or has nothing to map.
    :raises StartError: a library is missing.
    """
    require('mapping', *EXTRAS['slam'])
    if not 0.01 <= arguments.cell <= 1.0:
        raise ConfigError([f'--cell {arguments.cell:g}: 0.01 to 1 m'])
    if arguments.range_max is not None and not 0.5 <= arguments.range_max <= 200.0:
        raise ConfigError([f'--range-max {arguments.range_max:g}: 0.5 to 200 m'])
    _check_outputs(arguments)
    relations = None if arguments.relations is None else read_relations(arguments.relations)
    source = opened(arguments)
    begun_s = time.perf_counter()
    reach_m = (None if arguments.range_max is not None else
               reported_max_range(opened(arguments).scans()))
    mapper, stamps_ns = _mapped(source, arguments.range_max, reach_m)
    took_s = time.perf_counter() - begun_s
    poses = mapper.trajectory()
    report = _report(arguments.bag.name, source, mapper, stamps_ns, poses)
    report.update(seconds=round(took_s, 3), scans_per_s=round(len(poses) / took_s, 1),
                  reach_m=reach_m)
    if relations is not None:
        report['errors'] = compare(poses, relations)
        if source.bad:
            source.problems.append('relations refer to scans by number: after lines that '
                                   'were skipped they may refer to other scans')
    _print_report(report)
    if mapper.counts['empty'] == len(poses):
        raise ConfigError([f'{arguments.bag}: nothing to map: none of its {len(poses)} scans '
                           f'has a range between 0.05 and {mapper.tuning.range_max_m:g} m'])
    try:
        _write(arguments, mapper, poses, {**report, 'stamps_ns': stamps_ns,
                                          'poses': list(rows(poses))})
    except OSError as error:
        raise ConfigError([f'{error.filename or "a file"} cannot be written: '
                           f'{error.strerror or error}']) from error


def _check_outputs(arguments: argparse.Namespace) -> None:
    """
    Check the output files before the log is mapped, which may take hours.

    :raises ConfigError: a name that cannot be written.
    """
    check_output('--report', arguments.report)
    check_output('--map', arguments.map_file)
    check_picture('--picture', arguments.picture)
    if arguments.map_file is not None and arguments.map_file.suffix not in YAML:
        raise ConfigError([f'--map {arguments.map_file}: name the YAML file, such as '
                           f'{arguments.map_file.with_suffix(YAML[0])}; the picture of the map is '
                           'written next to it'])


def _report(name: str, source: ScanSource, mapper: Mapper, stamps_ns: list[int], poses: Floats
            ) -> dict[str, Any]:
    """Return the report that docs/mapping.md describes, without its long arrays."""
    mount = getattr(source, 'mount', None)
    steps = np.diff(poses[:, :2], axis=0)
    return {
        'log': name, **mapper.counts, 'near': _near_misses(mapper), 'bad_lines': source.bad,
        'problems': source.problems,
        'duration_s': round((max(stamps_ns) - min(stamps_ns)) / NS_PER_S, 3),
        'way_m': round(float(np.hypot(steps[:, 0], steps[:, 1]).sum()), 2),
        'laser': None if mount is None else next(rows(mount.pose.reshape(1, 3))),
        'upside_down': bool(mount is not None and mount.is_mirrored)}


def _near_misses(mapper: Mapper) -> list[dict[str, Any]]:
    """Return the last near misses, as in docs/mapping.md."""
    return [{'keyframe': each.keyframe, 'nearest': each.nearest, 'share': round(each.share, 3),
             'of_visible': round(each.of_visible, 3), 'score': round(each.score, 3),
             'why': each.reason} for each in mapper.near_misses]


def _write(arguments: argparse.Namespace, mapper: Mapper, poses: Floats, report: dict[str, Any]
           ) -> None:
    if arguments.report is not None:
        arguments.report.write_text(json.dumps(report) + '\n')
    if arguments.map_file is None and arguments.picture is None:
        return
    grid = grid_of(mapper.keyframes, arguments.cell)
    if arguments.map_file is not None:
        grid.save(arguments.map_file)
    if arguments.picture is not None:
        ends = [(mapper.keyframes[each.first].pose[:2], mapper.keyframes[each.second].pose[:2])
                for each in mapper.edges if each.is_loop]
        title = f'{report["log"]}: {report["scans"]} scans, {report["way_m"]:.0f} m'
        try:
            draw(grid, poses, np.array(ends).reshape(-1, 2, 2), title, arguments.picture)
        except ValueError as error:
            raise ConfigError([f'--picture {arguments.picture}: {error}']) from error


def _mapped(source: ScanSource, range_max_m: float | None, reach_m: float | None
            ) -> tuple[Mapper, list[int]]:
    """
    Map all scans; return the mapper and the stamps of the scans.

    :param reach_m: ranges from here on are no echoes, see :func:`.reported_max_range`.
    """
    mapper = Mapper(None if range_max_m is None else MapperTuning(range_max_m=range_max_m))
    stamps_ns: list[int] = []
    begun_s = reported_s = time.monotonic()
    for scan in source.scans():
        mapper.add(scan if reach_m is None else replace(
            scan, ranges=echo_ranges(scan.ranges, 0.0, reach_m)))
        stamps_ns.append(scan.stamp_ns)
        now_s = time.monotonic()
        if now_s - reported_s > _PROGRESS_S:
            reported_s = now_s
            share = source.share_read
            left_s = (now_s - begun_s) * (1.0 - share) / max(share, 1e-3)
            print(f'mapping: {len(stamps_ns)} scans, {share:.0%} of the log, about {left_s:.0f} s '
                  'remain', file=sys.stderr, flush=True)
    mapper.optimise_all()
    if reach_m is not None:
        source.problems.append(
            'the laser reports its maximum range instead of no echo: '
            f'ranges from {reach_m:.2f} m on are treated as no echo; '
            f'--range-max {mapper.tuning.range_max_m:g} maps them as walls')
    return mapper, stamps_ns


def _print_report(report: dict[str, Any]) -> None:
    print(f'{report["scans"]} scans over {report["way_m"]:g} m, {report["keyframes"]} kept, '
          f'{report["loops"]} loops closed ({report["refused"]} refused, '
          f'{report["near_misses"]} near misses), {report["lost"]} lost; '
          f'{report["scans_per_s"]:g} scans a second')
    problems = report['problems']
    for each in problems[:_PROBLEMS_MOST]:
        print(f'note: {each}')
    if len(problems) > _PROBLEMS_MOST:
        print(f'note: and {len(problems) - _PROBLEMS_MOST} more, in the report')
    if 'errors' in report:
        _print_errors(report['errors'])


def _print_errors(errors: dict[str, Any]) -> None:
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
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise ConfigError([f'{report}: no report of mapping: {error}']) from error
    if poses.ndim != 2 or poses.shape[1] != 3 or not np.isfinite(poses).all():
        raise ConfigError([f'{report}: no report of mapping: poses must be rows of x, y, yaw'])
    _print_errors(compare(poses, read_relations(relations)))
