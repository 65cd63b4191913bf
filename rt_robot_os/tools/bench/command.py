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

"""What the program `bench` does: measure the chosen cases, show tables, write files."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import signal
from types import FrameType
from typing import Any

from rt_robot_os.base.programs import FAILED
from rt_robot_os.base.programs import INTERRUPTED
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.tools.bench import expectations
from rt_robot_os.tools.bench import plot_drawing
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.options import BenchRequest
from rt_robot_os.tools.bench.options import goes_on
from rt_robot_os.tools.bench.options import parse
from rt_robot_os.tools.bench.output import EarlierRun
from rt_robot_os.tools.bench.output import PAGE_FILE
from rt_robot_os.tools.bench.processes import measure
from rt_robot_os.tools.bench.registry import CASES
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.runner import Measure
from rt_robot_os.tools.bench.session import BenchSession
from rt_robot_os.tools.bench.text_report import case_lines
from rt_robot_os.tools.bench.text_report import closing_lines
from rt_robot_os.tools.bench.text_report import terminal_width


def _interrupt(signum: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def run(argv: Sequence[str], cases: Mapping[str, Case] = CASES, measured: Measure = measure
        ) -> int:
    """
    Measure what the arguments say.

    :param measured: runs one measurement; tests give their own.
    :return: the exit code.
    :raises OSError, RtRobotError: something cannot be measured, read or written.
    """
    request = parse(argv, cases)
    if request.list_only:
        for case in cases.values():
            print(f'{case.name:<12} {case.title}')
        return OK
    previous = signal.signal(signal.SIGTERM, _interrupt)
    try:
        return _again(request, cases) if request.page else _run(request, measured, argv)
    finally:
        signal.signal(signal.SIGTERM, previous)


def _run(request: BenchRequest, measured: Measure, argv: Sequence[str]) -> int:
    session = BenchSession(request, measured, argv)
    interrupted = False
    if request.out is not None and not plot_drawing.available():
        warn('bench', plot_drawing.remedy())  # before hours are spent, not only afterwards
    try:
        session.introduce()
        for case in request.cases:
            session.measure(case)
    except KeyboardInterrupt:
        interrupted = True
        further = ('the same call goes on where this ended' if goes_on(request)
                   else 'cases that were not complete are left out')
        warn('bench', f'interrupted; {further}')
    if session.results:
        _close(session.results, session.machine)
    session.write(interrupted)
    if interrupted:
        return INTERRUPTED
    return FAILED if session.failed else OK


def _close(results: Sequence[CaseResult], machine: Mapping[str, Any]) -> None:
    width = terminal_width()
    print('\n' + '\n'.join((*closing_lines(results, width),
                            *expectations.lines(results, machine, width))))


def _again(request: BenchRequest, cases: Mapping[str, Case]) -> int:
    """Evaluate the raw samples of an earlier call again, show and write that."""
    if request.page is None:
        return OK
    earlier = EarlierRun(request.page, cases)
    for result in earlier.results:
        print('\n' + '\n'.join(case_lines(result, terminal_width())))
    if earlier.results:
        _close(earlier.results, earlier.content['machine'])
    earlier.write()
    print(f'written: {request.page / PAGE_FILE}')
    if not earlier.results:
        warn('bench', f'--page {request.page}: no raw samples yet: nothing was evaluated')
        return FAILED
    if not plot_drawing.available():
        print(plot_drawing.remedy())
    return OK
