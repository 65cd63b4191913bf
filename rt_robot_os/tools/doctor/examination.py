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

"""One examination: ask all checks, measure, write the report."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence
import os
import sys

from rt_robot_os.tools.doctor import wakeup
from rt_robot_os.tools.doctor.facts import asked_cpu
from rt_robot_os.tools.doctor.facts import key_values
from rt_robot_os.tools.doctor.facts import online_cpus
from rt_robot_os.tools.doctor.finding import Line
from rt_robot_os.tools.doctor.finding import unknown
from rt_robot_os.tools.doctor.json_report import as_json
from rt_robot_os.tools.doctor.options import Options
from rt_robot_os.tools.doctor.registry import examine
from rt_robot_os.tools.doctor.registry import GROUPS
from rt_robot_os.tools.doctor.report import Report
from rt_robot_os.tools.doctor.style import Progress
from rt_robot_os.tools.doctor.style import style_for
from rt_robot_os.tools.doctor.system import ProbeError
from rt_robot_os.tools.doctor.system import System
from rt_robot_os.tools.doctor.text_report import head_lines
from rt_robot_os.tools.doctor.text_report import histogram_lines
from rt_robot_os.tools.doctor.text_report import summary_lines
from rt_robot_os.tools.doctor.text_report import Writer

MEASURED = 'measured now'


def describe(system: System) -> dict[str, object]:
    """Return the facts for the head of the report."""
    facts = key_values(system.read('/proc/cpuinfo'))
    model = (system.read('/proc/device-tree/model') or facts.get('model name')
             or facts.get('Model') or system.machine)
    return {'host': system.read('/proc/sys/kernel/hostname') or 'this machine', 'cpu': model,
            'cpus': len(online_cpus(system)) or None, 'release': system.release,
            'architecture': system.machine, 'core_cpu': asked_cpu(system)}


class Doctor:
    """
    One examination.

    :param options: what to show, how long to measure.
    """

    def __init__(self, system: System, options: Options) -> None:
        self._system = system
        self._options = options
        self._style = style_for(sys.stdout, os.environ)
        self._writer = Writer(self._style, everything=options.everything, quiet=options.quiet)
        self._lines: list[Line] = []
        self._result: wakeup.Wakeup | None = None
        self._watch = wakeup.StepWatch()

    def report(self) -> Report:
        """Return what was found so far."""
        return Report(describe(self._system), self._system.wanted, self._lines, self._result)

    def run(self) -> Report:
        """Ask, measure, and write the report as it comes."""
        self._say(head_lines(self.report(), self._style))
        for group in GROUPS:
            self._add(group.title, examine(group, self._system))
        title, lines = self._measure() if self._options.seconds else (MEASURED, [])
        self._add(title, [*lines, Line('measured', self._watch.check, self._watch.finding())])
        if self._result and not self._options.quiet:
            self._say(histogram_lines(self._result, self._style))
        report = self.report()
        self._say(summary_lines(report, self._style))
        if self._options.json:
            print(as_json(report))
        return report

    def _say(self, lines: Iterable[str]) -> None:
        if not self._options.json:
            for line in lines:
                print(line)
            sys.stdout.flush()

    def _add(self, title: str, lines: Sequence[Line]) -> None:
        self._lines.extend(lines)
        self._say(self._writer.group(title, lines))

    def _measure(self) -> tuple[str, list[Line]]:
        """Measure wake-ups; what goes wrong is a line."""
        options, progress = self._options, None
        if sys.stdout.isatty() and not options.json:
            progress = Progress(sys.stdout, self._style, f'measuring {options.seconds:g} s')
        try:
            self._result = wakeup.measure(self._system, options.seconds,
                                          progress.show if progress else None)
        except (ProbeError, OSError) as error:
            return MEASURED, [Line('measured', wakeup.MACHINE, unknown(str(error)))]
        finally:
            if progress:
                progress.clear()
        result = self._result
        refused = f' (without {", ".join(result.refused)})' if result.refused else ''
        return (f'{MEASURED}: lateness of 1 kHz wake-ups, {result.seconds / 2:g} s each{refused}',
                [Line('measured', wakeup.MACHINE, wakeup.judge(result.machine, result.refused)),
                 Line('measured', wakeup.KERNEL, wakeup.judge(result.kernel, result.refused))])
