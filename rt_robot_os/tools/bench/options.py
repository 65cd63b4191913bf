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

"""The command line of `bench`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace
from difflib import get_close_matches
import json
import math
import os
from pathlib import Path
import sys
import textwrap
from typing import NoReturn

from rt_robot_os.settings.ros_args import split
from rt_robot_os.tools.bench.case import BenchOptions
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.output import DOCUMENT_FILE
from rt_robot_os.tools.bench.output import PAGE_FILE
from rt_robot_os.tools.bench.processes import alone
from rt_robot_os.tools.bench.processes import lock_path
from rt_robot_os.tools.bench.registry import SOURCE_ONLY

_DEFAULT = BenchOptions(2.0, 3)
_QUICK = BenchOptions(0.5, 1, quick=True)
_FULL = BenchOptions(3.2, 4, full=True)
# Repeats: at most; each case says how often.
_DOCS = BenchOptions(0.5, 5, quick=True, docs=True)
_SECONDS = (0.1, 86_400.0)
_HOURS = (0.001, 1000.0)
_REPEATS_MAXIMUM = 1000
_WIDTH = 99
_HOURS_CASE = 'stability'
# With --full and an hour or more it simulates an hour.
_HOUR_CASE = 'slam'

_EPILOG = """\
Everything is measured in one run, in turns, each system in a process of its own; tables show the
median of the repeats. What is not installed is a line in the table. The exit code is 0 also when
a target is missed: this is a measurement, not a test. 2: a bad argument; 1: a measurement failed;
130: Ctrl-C, which keeps and shows the cases that were complete, and the rows of stability.

Where `bench` stands here, type `ros2 run rt_robot_os bench`, or `./scripts/run bench`:

  bench --quick --out first           a first look, about six minutes; open first/index.html
  bench preemption --seconds 60       one case, longer
  bench memory --seconds 3600         watch the size of the core for an hour
  bench localization --data drive.csv --out drive    your own recording
  bench --full --out results          everything, 100 minutes
  bench --docs --out results          what docs/benchmarks.md is made of, 12 minutes
  bench stability --hours 24 --out s  the long test of the paper; to look at it meanwhile, in
  bench --page s                      another terminal: evaluates what is there so far;
                                      after Ctrl-C the same call goes on where it ended

With RT_ROBOT_OS_COMPILE=0 before it everything is measured in pure Python; micro, delay and
spacing measure the compiled build beside that in any case, where there is one.

"Paper 1" and "paper 2" are named on the page, and so is how each system is run.
"""


@dataclass(frozen=True)
class BenchRequest:
    """
    What the user wants.

    :ivar json: where to write the result, or None.
    :ivar out: the folder for the result and the raw samples, or None.
    :ivar page: the folder of an earlier call to evaluate again, or None.
    """

    cases: Sequence[Case]
    options: BenchOptions
    json: Path | None
    out: Path | None
    list_only: bool
    page: Path | None = None


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Print the error in one line; the usage would hide it."""
        print(f'{self.prog}: {message} (see {self.prog} --help)', file=sys.stderr)
        sys.exit(2)


def _parser(cases: Mapping[str, Case]) -> _Parser:
    parser = _Parser(
        prog='bench', formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Measure rt_robot_os on this machine, beside rclpy, HORUS and threads.',
        epilog='cases:\n' + ''.join(
            f'  {case.name:<12} {case.title}\n' for case in cases.values()) + _not_here(cases)
        + '\n' + _EPILOG)
    parser.add_argument('case', nargs='*', help='what to measure (default: all)')
    length = parser.add_mutually_exclusive_group()
    length.add_argument('--quick', action='store_true',
                        help=f'{_QUICK.seconds:g} s each, {_QUICK.repeats} repeat')
    length.add_argument('--full', action='store_true',
                        help=f'{_FULL.seconds:g} s each, {_FULL.repeats} repeats, more variants')
    length.add_argument('--docs', action='store_true',
                        help=f'the runs of --quick, repeated up to {_DOCS.repeats} times where '
                        'small figures are compared: what docs/benchmarks.md is made of')
    parser.add_argument('--seconds', metavar='S', type=_seconds,
                        help=f'length of each measurement (default {_DEFAULT.seconds:g})')
    parser.add_argument('--repeats', metavar='N', type=_repeats,
                        help=f'times that each is repeated (default {_DEFAULT.repeats})')
    parser.add_argument('--hours', metavar='H', type=_hours,
                        help='length of the case stability (default: a minute); with --full and '
                        '1 or more, slam simulates an hour')
    parser.add_argument('--data', metavar='FILE', type=Path,
                        help='a recording of yours, for the case that is named: '
                        f'{_readers(cases)}')
    parser.add_argument('--expected', metavar='FILE', type=Path,
                        help='what others make of it, as JSON (default: NAME.expected.json beside '
                        'it, if there is one)')
    parser.add_argument('--imu-mounting', metavar='ROLL,PITCH,YAW', type=_mounting,
                        help='how the inertial sensor of the recording is mounted on the robot, '
                        'in rad, as mounting_rad of a device (default: 0,0,0)')
    parser.add_argument('--json', metavar='FILE', type=Path, help='write the result as JSON')
    parser.add_argument('--out', metavar='DIR', type=Path,
                        help=f'write {PAGE_FILE} (tables and plots), {DOCUMENT_FILE}, '
                        'benchmarks.md and all raw samples (NumPy files) to a new folder')
    parser.add_argument('--page', metavar='DIR', type=Path,
                        help='measure nothing; evaluate what --out DIR wrote, also while it is '
                        'being written')
    parser.add_argument('--list', action='store_true', help='list the cases and end')
    return parser


def _seconds(text: str) -> float:
    return _number(text, 'seconds', _SECONDS)


def _hours(text: str) -> float:
    return _number(text, 'hours', _HOURS)


def _number(text: str, of: str, limits: tuple[float, float]) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    low, high = limits
    if not low <= value <= high:
        raise argparse.ArgumentTypeError(
            f'{text!r} is not a number of {of} from {low:g} to {high:g}')
    return value


def _mounting(text: str) -> tuple[float, float, float]:
    try:
        roll, pitch, yaw = (float(each) for each in text.split(','))
    except ValueError:
        roll = pitch = yaw = math.nan
    if not all(abs(each) <= math.tau for each in (roll, pitch, yaw)):
        raise argparse.ArgumentTypeError(
            f'{text!r} is not three angles in rad, such as 3.1416,0,0 for a sensor upside down')
    return roll, pitch, yaw


def _repeats(text: str) -> int:
    if not (text.isascii() and text.isdigit() and 1 <= int(text[:9]) <= _REPEATS_MAXIMUM):
        raise argparse.ArgumentTypeError(
            f'{text!r} is not an integer from 1 to {_REPEATS_MAXIMUM}')
    return int(text)


def parse(argv: Sequence[str], cases: Mapping[str, Case]) -> BenchRequest:
    """
    Read and check the arguments; ends the program with code 2 when they are wrong.

    What cannot be written is found out here, before anything is measured.
    """
    # `ros2 launch` appends them to every program.
    _, own = split(argv)
    parser = _parser(cases)
    given = parser.parse_args(own)
    chosen = [_case(parser, name, cases) for name in dict.fromkeys(given.case)]
    base = (_QUICK if given.quick else _FULL if given.full else _DOCS if given.docs
            else _DEFAULT)
    _check_together(parser, given)
    if given.docs and given.repeats is not None:
        parser.error(f'--repeats {given.repeats}: with --docs each case says how often')
    _check_data(parser, given, chosen)
    options = replace(
        base, out=_absolute(given.out), data=_absolute(given.data),
        expected=_absolute(given.expected),
        **{key: value for key in ('seconds', 'repeats', 'hours', 'imu_mounting')
           if (value := getattr(given, key)) is not None})
    if not given.list:
        if given.json is not None:
            _check_file(parser, given.json)
        if given.out is not None:
            _check_folder(parser, given.out, [case.name for case in chosen])
    return BenchRequest(chosen or list(cases.values()), options, given.json, given.out, given.list,
                        given.page)


def _absolute(path: Path | None) -> str:
    return '' if path is None else str(path.absolute())


def _check_together(parser: _Parser, given: argparse.Namespace) -> None:
    """Refuse what would have no effect, rather than leave it out in silence."""
    if given.page is not None:
        useless = ['--' + name.replace('_', '-') for name in (
            'quick', 'full', 'docs', 'seconds', 'repeats', 'hours', 'json', 'out', 'data',
            'expected', 'imu_mounting') if getattr(given, name)]
        if useless or given.case:
            parser.error(f'--page {given.page}: measures nothing, and cannot go with '
                         f'{", ".join((*useless, *given.case))}')
    if given.hours is not None and given.case and not {_HOURS_CASE, _HOUR_CASE} & {*given.case}:
        parser.error(f'--hours {given.hours:g}: is the length of the case {_HOURS_CASE}; that of '
                     f'{", ".join(given.case)} is --seconds')


def _check_data(parser: _Parser, given: argparse.Namespace, chosen: Sequence[Case]) -> None:
    """Check that a recording can be read, and that a chosen case reads it."""
    if given.expected is not None and given.data is None:
        parser.error(f'--expected {given.expected}: of which recording? name it with --data FILE')
    if given.imu_mounting is not None and given.data is None:
        parser.error('--imu-mounting: of which recording? name it with --data FILE')
    if given.data is None:
        return
    if not any(case.takes_data for case in chosen):
        parser.error(f'--data {given.data}: name the case that reads it, such as bench '
                     f'localization --data {given.data}')
    for option in ('data', 'expected'):
        path = getattr(given, option)
        try:
            if path is not None:
                with open(path, 'rb'):
                    pass
        except OSError as error:
            parser.error(f'--{option} {path}: cannot be read: {error.strerror}')


def goes_on(request: BenchRequest) -> bool:
    """Return whether the same call, after Ctrl-C, goes on where it ended."""
    return request.out is not None and [case.name for case in request.cases] == [_HOURS_CASE]


def _readers(cases: Mapping[str, Case]) -> str:
    return (', '.join(case.name for case in cases.values() if case.takes_data)
            or 'none of the installed ones reads a recording')


def _not_here(cases: Mapping[str, Case]) -> str:
    """Return a line that names the cases of the source tree, where that is not here."""
    missing = ', '.join(name for name in SOURCE_ONLY if name not in cases)
    return textwrap.fill(f'Only in the source tree, by ./scripts/bench: {missing}.', _WIDTH,
                         initial_indent='  ', subsequent_indent='  ') + '\n' if missing else ''


def _case(parser: _Parser, name: str, cases: Mapping[str, Case]) -> Case:
    if name in cases:
        return cases[name]
    if name in SOURCE_ONLY:
        parser.error(f'case {name!r} is not installed; it is in benchmarks/ of the source tree: '
                     f'run ./scripts/bench {name} there')
    close = get_close_matches(name, cases, 1)
    hint = f'did you mean {close[0]}?' if close else f'there are {", ".join(cases)}'
    parser.error(f'no case {name!r}; {hint}')


def _interrupted(path: Path) -> bool:
    """Return whether a call ended early that measured nothing but what can go on."""
    try:
        content = json.loads(path.read_text())
        others = {case['name'] for case in content['cases']} - {_HOURS_CASE}
        return bool(content['interrupted']) and not others
    except (OSError, ValueError, KeyError, TypeError):
        return False


def _check_file(parser: _Parser, path: Path) -> None:
    new = not path.exists()
    try:
        with open(path, 'ab'):
            pass
        if new:
            path.unlink()
    except OSError as error:
        parser.error(f'--json {path}: cannot be written: {error.strerror}')


def _check_folder(parser: _Parser, path: Path, cases: Sequence[str]) -> None:
    if (path / DOCUMENT_FILE).exists():
        if cases != [_HOURS_CASE] or not _interrupted(path / DOCUMENT_FILE):
            parser.error(f'--out {path}: holds results of an earlier run; name another folder')
        with alone(lock_path(), wait=False) as others:
            if others:
                parser.error(f'--out {path}: another bench is measuring, perhaps into this folder'
                             f'; to see what is there so far: --page {path}')
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe = path / f'.probe{os.getpid()}'
        probe.touch()
        probe.unlink()
    except OSError as error:
        parser.error(f'--out {path}: cannot be written: {error.strerror}')
