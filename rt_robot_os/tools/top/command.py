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

"""What the program `top` does with its command line."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import asdict
import json
import shutil
import sys
import time

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.errors import no_match
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.needs import lacking
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.link.robots import add_robot_option
from rt_robot_os.link.robots import others_than
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.tools.top.columns import check_sort
from rt_robot_os.tools.top.columns import TABLES
from rt_robot_os.tools.top.controls import Controls
from rt_robot_os.tools.top.controls import INTERVALS_S
from rt_robot_os.tools.top.core_source import Source
from rt_robot_os.tools.top.rows import Snapshot
from rt_robot_os.tools.top.screen_layout import body
from rt_robot_os.tools.top.screen_layout import Choices
from rt_robot_os.tools.top.screen_layout import head
from rt_robot_os.tools.top.screen_layout import PARTS
from rt_robot_os.tools.top.screen_layout import plain
from rt_robot_os.tools.top.screen_layout import rows_of
from rt_robot_os.tools.top.snapshot import compare
from rt_robot_os.tools.top.snapshot import Sample

NO_CORE = 1
_TRY_S = 0.2
_PIPE_COLUMNS = 160
_PIPE_LINES = 10_000

_EPILOG = """Rates, percentages and percentiles are those of the interval; counters and maxima
those since the start. Statistics cost the core about 100 us a task at the lowest priority, at 1 Hz
0.1 % of a CPU for ten tasks. Exit code: 0 fine, 1 no core answers, 2 bad use or no 'rich'."""


def _arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='top', description='Look at a running robot: tasks, topics, devices, clients.',
        epilog=_EPILOG)
    add_robot_option(parser)
    parser.add_argument('--interval', metavar='S', type=float, default=1.0,
                        help='seconds between two samples (default: %(default)g)')
    parser.add_argument('--once', action='store_true', help='two samples, one answer, and end')
    parser.add_argument('--json', action='store_true',
                        help='a line of JSON for each sample; with --once one document')
    parser.add_argument('--wait', metavar='S', type=float, default=0.0,
                        help='with --once: how long to wait for a core')
    parser.add_argument('--sort', metavar='COLUMN', default='',
                        help='such as cpu_percent or latency_max_us')
    parser.add_argument('--reverse', action='store_true', help='sort the other way round')
    parser.add_argument('--filter', metavar='TEXT', default='',
                        help='only names that contain it, or match it (link/*)')
    parser.add_argument('--part', choices=PARTS, default='all', help='what to show')
    return parser.parse_args(argv)


def run(argv: Sequence[str]) -> int:
    """
    Look once, write JSON, or run the live screen.

    :return: the exit code.
    """
    arguments = _arguments(argv)
    shortest_s, longest_s = INTERVALS_S[0], INTERVALS_S[-1]
    choices = Choices(arguments.part, arguments.sort, arguments.reverse, arguments.filter)
    try:
        if not shortest_s <= arguments.interval <= longest_s:
            raise ConfigError([f'--interval {arguments.interval:g}: must be from {shortest_s:g} '
                               f'to {longest_s:g} s'])
        check_sort(arguments.sort)
        robot = arguments.robot
        source = Source(socket_path(robot))
    except RtRobotError as error:
        warn('top', error)
        return BAD_USE
    try:
        if arguments.once:
            return _once(robot, source, choices, arguments)
        if arguments.json:
            return _stream(robot, source, choices, arguments.interval)
        return _live(robot, source, Controls(choices, arguments.interval))
    finally:
        source.close()


def document(snapshot: Snapshot, choices: Choices) -> dict[str, object]:
    """Return a snapshot as plain values, with the rows that were chosen, in their order."""
    values = asdict(snapshot)
    for part in TABLES:
        if choices.part in ('all', part):
            values[part] = [asdict(row) for row in rows_of(snapshot, part, choices)]
        else:
            del values[part]
    return values


def _first(source: Source, robot: str, wait_s: float) -> Sample | None:
    deadline_s = time.monotonic() + wait_s
    while True:
        try:
            return source.poll()
        except LinkError as error:
            if time.monotonic() >= deadline_s:
                warn('top', f'{error}{others_than(robot)}')
                return None
        time.sleep(_TRY_S)


def _once(robot: str, source: Source, choices: Choices, arguments: argparse.Namespace) -> int:
    before = _first(source, robot, arguments.wait)
    if before is None:
        return NO_CORE
    time.sleep(arguments.interval)
    now = _first(source, robot, 0.0)
    if now is None:
        return NO_CORE
    snapshot = compare(robot, now, before)
    if choices.pattern and not _matches(snapshot, choices):
        warn('top', no_match('--filter', choices.pattern, _names(snapshot, choices)))
        return BAD_USE
    if arguments.json:
        print(json.dumps(document(snapshot, choices), indent=1))
        return OK
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else _PIPE_COLUMNS
    lines = [*head(snapshot, choices, width),
             *body(snapshot, choices, width, _PIPE_LINES, source.lines)]
    print(plain(lines))
    return OK


def _parts(choices: Choices) -> tuple[str, ...]:
    return tuple(part for part in TABLES if choices.part in ('all', part))


def _matches(snapshot: Snapshot, choices: Choices) -> bool:
    """Return whether a filter leaves anything; the log has no names."""
    parts = _parts(choices)
    return not parts or any(rows_of(snapshot, part, choices) for part in parts)


def _names(snapshot: Snapshot, choices: Choices) -> Iterator[str]:
    for part in _parts(choices):
        yield from (row.name for row in getattr(snapshot, part))


def _stream(robot: str, source: Source, choices: Choices, interval_s: float) -> int:
    before: Sample | None = None
    reported = ''
    while True:
        try:
            now = source.poll()
            if before is not None:
                print(json.dumps(document(compare(robot, now, before), choices)), flush=True)
            before, reported = now, ''
        except LinkError as error:
            if str(error) != reported:
                reported = str(error)
                warn('top', f'{reported}; waiting')
        time.sleep(interval_s)


def _live(robot: str, source: Source, controls: Controls) -> int:
    if not sys.stdout.isatty():
        warn('top', 'the output is not a terminal: use --once or --json')
        return BAD_USE
    problem = lacking('the live screen', 'rich')
    if problem:
        warn('top', f'{problem}; --once and --json work without it')
        return BAD_USE
    from rt_robot_os.tools.top.live import Program
    Program(robot, source, controls).run()
    return OK
