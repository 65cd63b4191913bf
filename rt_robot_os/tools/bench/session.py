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

"""One call of the program `bench`: what is known so far, shown and written also after Ctrl-C."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from datetime import timezone
from pathlib import Path
import shlex
import statistics
import sys
import textwrap
from typing import Any

from rt_robot_os.tools.bench import machine
from rt_robot_os.tools.bench import plot_drawing
from rt_robot_os.tools.bench.case import Case
from rt_robot_os.tools.bench.case import Outcomes
from rt_robot_os.tools.bench.case import Run
from rt_robot_os.tools.bench.case import RunOutcome
from rt_robot_os.tools.bench.json_report import document
from rt_robot_os.tools.bench.json_report import write_json
from rt_robot_os.tools.bench.json_report import write_samples
from rt_robot_os.tools.bench.machine_state import LOOP
from rt_robot_os.tools.bench.options import BenchRequest
from rt_robot_os.tools.bench.output import DOCUMENT_FILE
from rt_robot_os.tools.bench.output import PAGE_FILE
from rt_robot_os.tools.bench.output import write_results
from rt_robot_os.tools.bench.processes import alone
from rt_robot_os.tools.bench.processes import lock_path
from rt_robot_os.tools.bench.progress import duration
from rt_robot_os.tools.bench.progress import ProgressLine
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import RunStatus
from rt_robot_os.tools.bench.runner import expected_seconds
from rt_robot_os.tools.bench.runner import Measure
from rt_robot_os.tools.bench.runner import run_case
from rt_robot_os.tools.bench.stamps import cost_ns
from rt_robot_os.tools.bench.text_report import case_lines
from rt_robot_os.tools.bench.text_report import terminal_width

_PATHS = ('--json', '--out', '--data', '--expected')
_PROBE = Run('probe', 'privileges', 'rt_robot_os.tools.bench.harness:prepare', {}, 1.0)


class BenchSession:
    """
    What is measured in one call.

    :ivar results: of the cases that are complete.
    :ivar failed: a run went wrong.
    """

    def __init__(self, request: BenchRequest, measured: Measure, argv: Sequence[str]) -> None:
        self._request = request
        self._measured = measured
        self._expected_s = sum(expected_seconds(case, request.options) for case in request.cases)
        self._progress = ProgressLine(sys.stderr, self._expected_s)
        self._realtime: dict[str, str] = {}
        self._paces: list[float] = []
        self.results: list[CaseResult] = []
        self.failed = False
        self.machine = machine.describe()
        self.conditions: dict[str, Any] = {
            'started': datetime.now(timezone.utc).isoformat(timespec='seconds'),
            'command': command(argv),
            'harness_ns_per_sample': cost_ns(), 'realtime': self._realtime}

    def introduce(self) -> None:
        """Say what is measured on, and how long it takes."""
        options = self._request.options
        for line in (*machine.summary(self.machine), *machine.warnings(self.machine)):
            _say(line)
        most = 'up to ' if options.docs else ''
        _say(f'{most}{options.repeats} x {options.seconds:g} s each, in turns; the median of the '
             f'repeats is shown. Taking a sample costs '
             f'{self.conditions["harness_ns_per_sample"] / 1000:.2f} us.')
        _say(f'This takes about {duration(self._expected_s)}.')
        with alone(lock_path(), wait=False) as others:
            if others:
                _say('Another bench measures on this machine as well: the two take turns.')
        self._note_realtime([self._measured(_PROBE)])
        if self._request.out is not None:
            # So that what is written until then can be looked at.
            write_json(self._request.out / DOCUMENT_FILE, self._content(True))

    def measure(self, case: Case) -> None:
        """Measure a case, show it, and keep its samples."""
        try:
            outcomes = run_case(case, self._request.options, self._progress, self._measured)
        except KeyboardInterrupt:
            self._progress.clear()
            partial = case.partial(self._request.options) if case.partial else None
            if partial is not None:
                self._evaluate(case, partial)
            raise
        finally:
            self._progress.clear()
        if self._request.out is not None:
            write_samples(self._request.out, case.name, outcomes)
        self._evaluate(case, outcomes)

    def _evaluate(self, case: Case, outcomes: Outcomes) -> None:
        known = [outcome for key in outcomes.runs for outcome in outcomes.all(key)]
        self._note_realtime(known)
        self._paces += [o.figures[LOOP] for o in known if LOOP in o.figures]
        self.failed = self.failed or any(o.status is RunStatus.FAILED for o in known)
        result = case.evaluate(self._request.options, outcomes)
        self.results.append(result)
        print('\n' + '\n'.join(case_lines(result, terminal_width())), flush=True)

    def _note_realtime(self, outcomes: Sequence[RunOutcome]) -> None:
        """Say once what Linux grants to the measured processes, and what it refuses."""
        granted = []
        for step, in_force, reason in (step for o in outcomes for step in o.realtime):
            if step not in self._realtime:
                self._realtime[step] = machine.IN_FORCE if in_force else reason
                if in_force:
                    granted.append(step)
                else:
                    _say(f'{step}: {reason}')
        if granted:
            _say(f'In force in the measured processes: {", ".join(granted)}.')

    def _content(self, interrupted: bool) -> dict[str, Any]:
        self.conditions['ended'] = datetime.now(timezone.utc).isoformat(timespec='seconds')
        if self._paces:
            self.conditions['loop_ns'] = {
                'median': statistics.median(self._paces), 'least': min(self._paces),
                'most': max(self._paces), 'processes': len(self._paces)}
        return document(self.machine, self.conditions, self._request.options, self.results,
                        interrupted)

    def write(self, interrupted: bool) -> None:
        """
        Write what was asked for.

        :raises OSError: it cannot be written.
        """
        content = self._content(interrupted)
        if self._request.json is not None:
            write_json(self._request.json, content)
        if self._request.out is None:
            if self.results:
                print('nothing was written: --out DIR keeps the raw samples and writes a page '
                      'with plots')
            return
        write_results(self._request.out, content, self.results)
        print(f'written: {self._request.out / PAGE_FILE}')
        if not plot_drawing.available():
            print(plot_drawing.remedy())


def command(argv: Sequence[str]) -> str:
    """Return the line that repeats a call; folders and files by their last name."""
    words, path_follows = [], False
    for word in argv:
        option, equals, value = word.partition('=')
        if path_follows:
            word = Path(word).name
        elif equals and option in _PATHS:
            word = f'{option}={Path(value).name}'
        words.append(word)
        path_follows = word in _PATHS
    return shlex.join(['ros2', 'run', 'rt_robot_os', 'bench', *words])


def _say(text: str) -> None:
    print(textwrap.fill(text, terminal_width(), subsequent_indent='  '), flush=True)
