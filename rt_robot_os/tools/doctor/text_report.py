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

"""The report for people: 100 columns, one line a finding, the remedy below it."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
import re
import textwrap

from rt_robot_os.kernel.histogram import bucket_limits
from rt_robot_os.tools.doctor.finding import Line
from rt_robot_os.tools.doctor.finding import Remedy
from rt_robot_os.tools.doctor.finding import State
from rt_robot_os.tools.doctor.lateness import Measured
from rt_robot_os.tools.doctor.report import Report
from rt_robot_os.tools.doctor.style import Style
from rt_robot_os.tools.doctor.wakeup import KERNEL
from rt_robot_os.tools.doctor.wakeup import MACHINE
from rt_robot_os.tools.doctor.wakeup import Wakeup

WIDTH = 100
_STATE_WIDTH = 9
_TITLE_WIDTH = 22
_INDENT = 2
_COLUMN = _INDENT + _STATE_WIDTH
_PROBLEMS = (State.WARN, State.BAD)
_BREAKS = re.compile(r' (\|\||&&|\|)(?= )')
_NAMED = 8


def shown(line: Line, *, everything: bool, quiet: bool) -> bool:
    """Return whether a line is for this reader."""
    if quiet:
        return line.finding.state in _PROBLEMS
    return everything or line.finding.state is not State.ABSENT


def head_lines(report: Report, style: Style) -> Iterator[str]:
    """Yield what was checked."""
    machine, wanted = report.machine, report.wanted
    number = machine['cpus']
    cpus = f'{number or "?"} CPU{"" if number == 1 else "s"}'
    yield style.heading(f'{machine["host"]}: {machine["cpu"]}, {cpus}, '
                        f'Linux {machine["release"]} {machine["architecture"]}')
    cpu = machine['core_cpu']
    asks = [f'SCHED_FIFO {wanted.priority}' if wanted.priority else 'no real-time priority',
            f'CPU {cpu}' if cpu is not None else 'no CPU of its own' if wanted.cpu == -2
            else 'the last CPU it may use',
            'locked memory' if wanted.lock_memory else 'no locked memory']
    yield f'The core asks for {", ".join(asks)} ({wanted.source}).'


class Writer:
    """
    Writes groups of findings one after the other.

    :param everything: also what does not apply, and why each line matters.
    :param quiet: only what is to be mended.
    """

    def __init__(self, style: Style, *, everything: bool = False, quiet: bool = False) -> None:
        self._style = style
        self._everything = everything
        self._quiet = quiet
        self._told: dict[Remedy, str] = {}

    def group(self, title: str, lines: Sequence[Line]) -> Iterator[str]:
        """Write the lines of a group; nothing when no line is for this reader."""
        chosen = [line for line in lines
                  if shown(line, everything=self._everything, quiet=self._quiet)]
        if chosen:
            yield ''
            yield self._style.heading(title)
        for line in chosen:
            yield from self._finding(line)

    def _finding(self, line: Line) -> Iterator[str]:
        finding = line.finding
        room = WIDTH - _COLUMN - _TITLE_WIDTH
        found = textwrap.wrap(printable(finding.found), room, break_on_hyphens=False) or ['']
        yield (' ' * _INDENT + self._style.state(finding.state, _STATE_WIDTH)
               + line.check.title.ljust(_TITLE_WIDTH) + found[0])
        for more in found[1:]:
            yield ' ' * (_COLUMN + _TITLE_WIDTH) + more
        visible = finding.state in _PROBLEMS or self._everything
        if visible:
            for text in textwrap.wrap(sentence(line.why), WIDTH - _COLUMN, break_on_hyphens=False):
                yield ' ' * _COLUMN + text
        if finding.remedy and (visible or finding.state is State.UNKNOWN):
            yield from self._remedy(finding.remedy, line.check.title)

    def _remedy(self, remedy: Remedy, title: str) -> Iterator[str]:
        """Write a remedy once; other lines that it mends as well refer to it."""
        first = self._told.setdefault(remedy, title)
        if first != title:
            yield from remedy_lines(Remedy((), f'as above, for {first}'), self._style)
        else:
            yield from remedy_lines(remedy, self._style)


def remedy_lines(remedy: Remedy, style: Style) -> Iterator[str]:
    """Write a remedy so that all of it can be pasted into a shell."""
    indent = ' ' * (_COLUMN + 2)
    notes = [f'# {text}' for text in textwrap.wrap(
        remedy.note, WIDTH - len(indent) - 2, break_on_hyphens=False, break_long_words=False)]
    after = remedy.note.startswith('then')
    for text in (*remedy.commands, *notes) if after else (*notes, *remedy.commands):
        for part in shell_lines(text, WIDTH - len(indent)):
            yield indent + style.command(printable(part))


def printable(text: str) -> str:
    """Take out what could steer a terminal: anybody may give a process or a file any name."""
    return ''.join(character if character.isprintable() else '?' for character in text)


def shell_lines(command: str, width: int) -> list[str]:
    """Break a command that is too long behind ``|`` or ``&&``, so that it stays one command."""
    if len(command) <= width or command.startswith('#'):
        return [command]
    blanks = ' ' * (len(command) - len(command.lstrip()))
    places = [match.end() for match in _BREAKS.finditer(command)
              if match.end() <= width and command[:match.start()].count("'") % 2 == 0
              and command[:match.start()].count('"') % 2 == 0]
    if not places:
        return [command]
    rest = f'{blanks}  {command[places[-1]:].lstrip()}'
    return [command[:places[-1]].rstrip(), *shell_lines(rest, width)]


def sentence(text: str) -> str:
    """Write a clause as a sentence; the names of programs stay as they are written."""
    first = text if text[:1] == '`' else text[:1].upper() + text[1:]
    return f'{first}.'


def summary_lines(report: Report, style: Style) -> Iterator[str]:
    """Write the verdict, and what to fix first."""
    state = {0: State.OK, 1: State.WARN, 2: State.BAD}[report.verdict.value]
    late = [line for line in report.to_mend if line.check in (MACHINE, KERNEL)]
    names = list(dict.fromkeys(line.check.title for line in report.to_mend if line not in late))
    if names:
        things = 'one thing' if len(names) == 1 else f'{len(names)} things'
        order = '' if len(names) == 1 else ', the most worthwhile first'
        more = f' and {len(names) - _NAMED} more' if len(names) > _NAMED else ''
        text = f'{things} to fix{order}: {", ".join(names[:_NAMED])}{more}'
    else:
        text = 'find out what else runs' if late else 'nothing to fix'
    if late:
        text = f'wake-ups are late; {text}'
    if report.wakeup is None:
        text += '; wake-ups were not measured'
    unknown = report.count(State.UNKNOWN)
    if unknown:
        text += f'; {unknown} could not be determined'
    first, *rest = textwrap.wrap(f'{report.verdict.text}: {text}', WIDTH, break_on_hyphens=False,
                                 subsequent_indent=' ' * _INDENT)
    verdict = report.verdict.text
    yield ''
    yield style.state(state, 0).replace(state.value, verdict) + first[len(verdict):]
    yield from rest


_BAR = 28
_LABEL = 16


def octaves(measured: Measured) -> dict[int, int]:
    """Add the buckets up by octave: octave n holds durations from 2^n ns up to twice that."""
    found: dict[int, int] = {}
    for index, count in measured.counts.items():
        octave = max(0, bucket_limits(index)[0].bit_length() - 1)
        found[octave] = found.get(octave, 0) + count
    return found


def _duration(octave: int) -> str:
    value = float(1 << octave)
    for unit in ('ns', 'us', 'ms'):
        if value < 999:
            return f'{value:.3g} {unit}'
        value /= 1000
    return f'{value:.3g} s'


def _cell(count: int, total: int, style: Style) -> str:
    if not count:
        return ' ' * (_BAR + 8)
    length = round(_BAR * count / total)
    bar = style.full * length if length else style.trace
    return f'{count:>7} {bar.ljust(_BAR)}'


def histogram_lines(wakeup: Wakeup, style: Style) -> Iterator[str]:
    """Write both histograms; a dot stands for less than half a character of a bar."""
    left, right = octaves(wakeup.machine), octaves(wakeup.kernel)
    if not left and not right:
        return
    totals = [max(1, sum(side.values())) for side in (left, right)]
    yield ''
    yield (f'  {"late by".ljust(_LABEL)} {"machine alone".ljust(_BAR + 8)}  with our kernel')
    for octave in range(min([*left, *right]), max([*left, *right]) + 1):
        label = f'{_duration(octave)} ..'.rjust(_LABEL - 2)
        row = (f'  {label}   {_cell(left.get(octave, 0), totals[0], style)}  '
               f'{_cell(right.get(octave, 0), totals[1], style)}')
        yield row.rstrip()
