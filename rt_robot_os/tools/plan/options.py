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

"""The command line of `plan`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import math
from pathlib import Path

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.settings.command_line import parse_own
from rt_robot_os.tools.plan.chains import ChainRequest
from rt_robot_os.tools.plan.given import Given
from rt_robot_os.tools.plan.given import JOB_OVERHEAD_NS
from rt_robot_os.tools.plan.given import MARGIN
from rt_robot_os.tools.plan.given import TICK_OVERHEAD_NS
from rt_robot_os.tools.plan.typical import shipped

_EPILOG = """
Execution times come, for each task, from --execution, else from execution_us in its section, else
from a measurement. Without a measurement, what comes with rt_robot_os has typical times, of
another machine. Else budget_us with on_budget: abort counts, which is a true bound. Tasks without
any are listed as unknown.

  plan my_robot.yaml                                      with what the file declares
  plan my_robot.yaml --measure 10                         run its core for 10 s and use that
  plan --measure 60 --save-measured m.json                store what was measured ...
  plan --measured m.json --ros-args -p imu.rate_hz:=400.0 ... and try other settings with it

The exit code is 0 when all tasks with a deadline meet it; 1 when one may miss it, or there is more
work than time: the task and the margin are named; 3 when none is known to miss its deadline, but
some cannot be judged (unknown execution times or rates); 2 for a bad configuration, a bad
argument or a measurement that failed.
"""


def _number(least: float, what: str, most: float = 1e9, least_allowed: bool = True
            ) -> argparse._ActionType:
    def convert(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        low = value >= least if least_allowed else value > least
        if not (low and value <= most):
            above = f'from {least:g}' if least_allowed else f'above {least:g}'
            raise argparse.ArgumentTypeError(f'{text!r}: must be {what} {above} to {most:g}')
        return value
    return convert


def _named(what: str) -> argparse._ActionType:
    def convert(text: str) -> tuple[str, float]:
        name, separator, number = text.rpartition('=')
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not separator or not name or not 0 < value <= 1e9:
            raise argparse.ArgumentTypeError(
                f'{text!r}: must be NAME=NUMBER, {what} above 0, such as guard=150')
        return name, value
    return convert


def _chain(text: str) -> ChainRequest:
    names, separator, limit = text.partition('=')
    stages = tuple(name.strip() for name in names.split(','))
    try:
        limit_ms = float(limit) if separator else 0.0
    except ValueError:
        limit_ms = math.nan
    if len(stages) < 2 or not all(stages) or (separator and not 0 < limit_ms <= 1e6):
        raise argparse.ArgumentTypeError(
            f'{text!r}: must be two names or more with commas between, and =MILLISECONDS if there '
            'is a limit, such as sink,alarms,base=10')
    return ChainRequest(stages, round(limit_ms * NS_PER_MS))


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """Read the arguments outside of --ros-args; ends the program with code 2 for nonsense."""
    parser = argparse.ArgumentParser(
        prog='plan', description='Is this robot schedulable: utilisation, response times, what '
        'breaks first, phases.', epilog=_EPILOG,
        usage='plan [options] [FILE ...] [--ros-args -p NAME:=VALUE ...]',
        formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False)
    source = parser.add_mutually_exclusive_group()
    source.add_argument('--measure', metavar='S', type=_number(0.1, 'seconds', 86_400),
                        help='run the core of this configuration for S seconds and measure')
    source.add_argument('--measured', metavar='FILE', type=Path,
                        help='use what --save-measured stored')
    parser.add_argument('--save-measured', metavar='FILE', type=Path,
                        help='store what --measure found')
    parser.add_argument('--no-typical', action='store_true',
                        help='leave a task unknown rather than use the typical time of its kind')
    parser.add_argument('--margin', metavar='X', type=_number(1, 'a factor', 100), default=MARGIN,
                        help='multiply measured times by X (default %(default)g)')
    parser.add_argument('--execution', metavar='TASK=US', type=_named('microseconds'),
                        action='append', default=[],
                        help='longest computing time of a task, also of one of the core; may be '
                        'repeated')
    parser.add_argument('--native', metavar='TASK=US', type=_named('microseconds'),
                        action='append', default=[],
                        help='longest native call of a task, in which nothing preempts it')
    parser.add_argument('--held', metavar='RESOURCE=US', type=_named('microseconds'),
                        action='append', default=[],
                        help='longest time that a task holds a resource (default: as measured, '
                        'else as long as its job)')
    parser.add_argument('--rate', metavar='TASK=HZ', type=_named('a rate'), action='append',
                        default=[], help='how often something outside releases a task')
    us = _number(0, 'microseconds', 1e6)
    parser.add_argument('--job-us', metavar='US', type=us,
                        help="the kernel's own time for a job "
                        f'(default {JOB_OVERHEAD_NS / NS_PER_US:g})')
    parser.add_argument('--tick-us', metavar='US', type=us,
                        help="the kernel's own time for a release by a timer or an interrupt "
                        f'(default: as measured, else {TICK_OVERHEAD_NS / NS_PER_US:g})')
    parser.add_argument('--jitter-us', metavar='US', type=us,
                        help='how late timers are (default: as measured, else 0)')
    parser.add_argument('--chain', metavar='FROM,..,TO[=MS]', type=_chain, action='append',
                        default=[], help='bound the time from the release of a task or the bytes '
                        'of a device to the end of another, through those named in between; with '
                        '=MS it is a deadline; may be repeated')
    parser.add_argument('--json', action='store_true', help='write JSON instead of text')
    arguments = parse_own(parser, argv)
    if arguments.save_measured is not None and arguments.measure is None:
        parser.error('--save-measured stores what --measure finds: give --measure S as well')
    return arguments


def given(arguments: argparse.Namespace) -> Given:
    """Return what the arguments state of the tasks."""
    def ns(value_us: float | None) -> int | None:
        return None if value_us is None else round(value_us * NS_PER_US)

    def named(values: list[tuple[str, float]]) -> dict[str, int]:
        return {name: max(1, round(us * NS_PER_US)) for name, us in values}

    return Given(
        margin=arguments.margin, execution_ns=named(arguments.execution),
        native_ns=named(arguments.native), held_ns=named(arguments.held),
        rates_hz=dict(arguments.rate), job_ns=ns(arguments.job_us), tick_ns=ns(arguments.tick_us),
        jitter_ns=ns(arguments.jitter_us),
        typical=None if arguments.no_typical else shipped())
