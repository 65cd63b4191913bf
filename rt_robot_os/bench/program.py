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

"""The program `bench`: measure the chosen cases, show tables, write files."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from datetime import datetime
from datetime import timezone
import signal
import sys
import textwrap
from types import FrameType
from typing import Any
from typing import TextIO

from rt_robot_os.bench import machine
from rt_robot_os.bench.case import Case
from rt_robot_os.bench.case import Outcome
from rt_robot_os.bench.case import Run
from rt_robot_os.bench.document import document
from rt_robot_os.bench.document import write_json
from rt_robot_os.bench.document import write_samples
from rt_robot_os.bench.options import DOCUMENT_FILE
from rt_robot_os.bench.options import parse
from rt_robot_os.bench.options import Request
from rt_robot_os.bench.processes import alone
from rt_robot_os.bench.processes import lock_path
from rt_robot_os.bench.processes import measure
from rt_robot_os.bench.registry import CASES
from rt_robot_os.bench.result import CaseResult
from rt_robot_os.bench.result import Status
from rt_robot_os.bench.runner import expected_seconds
from rt_robot_os.bench.runner import Measure
from rt_robot_os.bench.runner import run_case
from rt_robot_os.bench.stamps import cost_ns
from rt_robot_os.bench.text import case_lines
from rt_robot_os.bench.text import verdict_line
from rt_robot_os.bench.text import WIDTH

OK, FAILED, INTERRUPTED = 0, 1, 130
_PROBE = Run('probe', 'privileges', 'rt_robot_os.bench.workers.probe:prepare', {}, 1.0)


class _Progress:
    """One line that is written over in a terminal; nothing where there is none."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._shown = stream.isatty()

    def __call__(self, text: str) -> None:
        if self._shown:
            self._stream.write(f'\r\x1b[K{text[:99]}')
            self._stream.flush()

    def clear(self) -> None:
        """Remove the line."""
        self('')


class _Session:
    """What is known so far; what is there is shown and written also after Ctrl-C."""

    def __init__(self, request: Request, measured: Measure) -> None:
        self._request = request
        self._measured = measured
        self._progress = _Progress(sys.stderr)
        self._realtime: dict[str, str] = {}
        self.results: list[CaseResult] = []
        self.failed = False
        self.machine = machine.describe()
        self.conditions: dict[str, Any] = {
            'started': datetime.now(timezone.utc).isoformat(timespec='seconds'),
            'harness_ns_per_sample': cost_ns(), 'realtime': self._realtime}

    def introduce(self) -> None:
        """Say what is measured on, and how long it takes."""
        options = self._request.options
        for line in machine.summary(self.machine):
            _say(line)
        seconds = sum(expected_seconds(case, options) for case in self._request.cases)
        _say(f'{options.repeats} x {options.seconds:g} s each, in turns; the median of the '
             f'repeats is shown. Taking a sample costs '
             f'{self.conditions["harness_ns_per_sample"] / 1000:.2f} us.')
        _say(f'This takes about {_duration(seconds)}.')
        with alone(lock_path(), wait=False) as others:
            if others:
                _say('Another bench measures on this machine as well: the two take turns.')
        self._note_realtime([self._measured(_PROBE)])

    def measure(self, case: Case) -> None:
        """Measure a case, show it, and keep its samples."""
        try:
            outcomes = run_case(case, self._request.options, self._progress, self._measured)
        finally:
            self._progress.clear()
        known = [outcome for key in outcomes.runs for outcome in outcomes.all(key)]
        self._note_realtime(known)
        self.failed = self.failed or any(o.status is Status.FAILED for o in known)
        result = case.evaluate(self._request.options, outcomes)
        self.results.append(result)
        print('\n' + '\n'.join(case_lines(result)), flush=True)
        if self._request.out is not None:
            write_samples(self._request.out, case.name, outcomes)

    def _note_realtime(self, outcomes: Sequence[Outcome]) -> None:
        """Say once what Linux grants to the measured processes, and what it refuses."""
        granted = []
        for step, in_force, reason in (step for o in outcomes for step in o.realtime):
            if step not in self._realtime:
                self._realtime[step] = 'in force' if in_force else reason
                if in_force:
                    granted.append(step)
                else:
                    _say(f'{step}: {reason}')
        if granted:
            _say(f'In force in the measured processes: {", ".join(granted)}.')

    def write(self, interrupted: bool) -> None:
        """
        Write what was asked for.

        :raises OSError: it cannot be written.
        """
        self.conditions['ended'] = datetime.now(timezone.utc).isoformat(timespec='seconds')
        content = document(self.machine, self.conditions, self._request.options, self.results,
                           interrupted)
        if self._request.json is not None:
            write_json(self._request.json, content)
        if self._request.out is not None:
            write_json(self._request.out / DOCUMENT_FILE, content)
            print(f'written: {self._request.out}')


def _say(text: str) -> None:
    print(textwrap.fill(text, WIDTH, subsequent_indent='  '), flush=True)


def _duration(seconds: float) -> str:
    return f'{seconds:.0f} s' if seconds < 90 else f'{seconds / 60:.0f} min'


def _interrupt(signum: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def run(argv: Sequence[str], cases: Mapping[str, Case] = CASES, measured: Measure = measure
        ) -> int:
    """
    Measure what the arguments say.

    :param measured: runs one measurement; tests give their own.
    :return: the exit code.
    """
    request = parse(argv, cases)
    if request.list_only:
        for case in cases.values():
            print(f'{case.name:<12} {case.title}')
        return OK
    previous = signal.signal(signal.SIGTERM, _interrupt)
    try:
        return _run(request, measured)
    except OSError as error:
        print(f'bench: {error}', file=sys.stderr)
        return FAILED
    finally:
        signal.signal(signal.SIGTERM, previous)


def _run(request: Request, measured: Measure) -> int:
    session = _Session(request, measured)
    interrupted = False
    try:
        session.introduce()
        for case in request.cases:
            session.measure(case)
    except KeyboardInterrupt:
        interrupted = True
        print('bench: interrupted; cases that were not complete are left out', file=sys.stderr)
    if session.results:
        print(f'\n{verdict_line(session.results)}')
    session.write(interrupted)
    if interrupted:
        return INTERRUPTED
    return FAILED if session.failed else OK
