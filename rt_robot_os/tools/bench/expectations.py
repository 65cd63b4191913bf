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

"""What to expect on the machine that was measured: sentences made of the figures of one run."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
import textwrap
from typing import Any

from rt_robot_os.tools.bench import facts
from rt_robot_os.tools.bench.blocks import Block
from rt_robot_os.tools.bench.blocks import Bullets
from rt_robot_os.tools.bench.blocks import Heading
from rt_robot_os.tools.bench.blocks import Paragraph
from rt_robot_os.tools.bench.case import COMPILED
from rt_robot_os.tools.bench.case import PURE
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.text_report import number
from rt_robot_os.tools.bench.text_report import WIDTH

_TITLE = 'What to expect on your machine'
_INTRODUCTION = (
    'From the figures of this run, beside what the machine takes for the same without this '
    'package. Medians, but where it says otherwise.')
# Of one CPU, for the kernel alone: the other half is for what the tasks compute.
_SHARE = 0.5
_RATES_HZ = (1000, 200, 50)
_CROWD = 100
_US_PER_S = 1e6
Known = Mapping[str, float]


def known(results: Sequence[CaseResult]) -> Known:
    """Return the single figures that all cases together found, by their names."""
    return {name: metric.median for result in results for name, metric in result.facts.items()
            if metric is not None}


def sentences(found: Known, compiled: bool, build: str) -> Iterator[str]:
    """
    Say what the figures mean; what was not measured is left out.

    :param found: in microseconds, by the names of :mod:`rt_robot_os.tools.bench.facts`.
    :param compiled: the compiled build is the one that runs here.
    :param build: the same in words, with the reason.
    """
    which = COMPILED if compiled else PURE
    of = {name: value for name in facts.OF_BUILDS
          if (value := found.get(facts.of_build(name, which)))}
    yield from _build(found, compiled, build)
    for said in (_floors(found), _late(found), _preempting(found), _delay(of), _cpu(found, of),
                 _room(of), _thousand(of)):
        if said:
            yield said


def _build(found: Known, compiled: bool, build: str) -> Iterator[str]:
    ran, other = (COMPILED, PURE) if compiled else (PURE, COMPILED)
    compared = [f'{text} {number(found[two])} us instead of {number(found[one])}'
                for name, text in facts.COMPARED
                if (one := facts.of_build(name, ran)) in found
                and (two := facts.of_build(name, other)) in found]
    name = 'Pure Python' if compiled else 'The compiled build'
    if compared:
        yield f'What ran: {build}. {name} would take: {"; ".join(compared)}.'
    elif not compiled and any(facts.of_build(name, PURE) in found for name in facts.OF_BUILDS):
        yield (f'What ran: {build}. What the compiled build would give was not measured: '
               'elsewhere it takes about half the time for a message, and less CPU for a job.')


def _floors(found: Known) -> str:
    parts = [f'{text} {number(found[name])} us' for name, text in (
        (facts.CALL, 'the call of an empty Python function'),
        (facts.SYSTEM_CALL, 'a system call from Python'),
        (facts.WAKE_CPU, 'the CPU time of a wake-up from clock_nanosleep')) if name in found]
    return f'Without this package: {"; ".join(parts)}.' if parts else ''


def _late(found: Known) -> str:
    names = (facts.LATE, facts.LATE_P99, facts.WAKE_LATE, facts.WAKE_LATE_P99)
    if not set(names) <= set(found):
        return ''
    late, late_p99, bare, bare_p99 = (number(found[name]) for name in names)
    return (f'A task that wakes the idle CPU begins {late} us late, 99 of 100 times at most '
            f'{late_p99} us. A bare loop of clock_nanosleep: {bare} and {bare_p99} us; nothing in '
            'Python can be earlier.')


def _preempting(found: Known) -> str:
    if not {facts.PREEMPTING_P99, facts.LOADED_LATE_P99} <= set(found):
        return ''
    return (f'A 1 kHz task that interrupts another one, which computes 20 % of the time, begins '
            f'99 of 100 times at most {number(found[facts.PREEMPTING_P99])} us late. A bare loop '
            f'of clock_nanosleep beside such a load: {number(found[facts.LOADED_LATE_P99])} us.')


def _delay(of: Known) -> str:
    delay, bare = of.get(facts.DELAY), of.get(facts.BARE_DELAY)
    if delay is None or bare is None:
        return ''
    more = (f'the kernel adds {number(delay - bare)} us' if delay > bare
            else 'the kernel adds nothing that can be seen')
    warm = of.get(facts.TO_TASK)
    return (f'A message to a task that waits for it is there after {number(delay)} us, at 500 Hz. '
            f'To publish and take it without a kernel, after the same sleep, takes {number(bare)} '
            f'us: {more}.'
            + ('' if warm is None else f' One message after the other, each takes {number(warm)} '
               'us: the rest is caches that are cold.'))


def _cpu(found: Known, of: Known) -> str:
    together, spread, alone = (of.get(name) for name in (
        facts.TOGETHER, facts.SPREAD, facts.ALONE))
    if together is None or spread is None or alone is None:
        return ''
    wake = found.get(facts.WAKE_CPU)
    bare = '' if wake is None else f' (a bare wake-up takes {number(wake)} us then)'
    return (f'A job takes {number(together)} us of CPU where {_CROWD} tasks are released '
            f'together, {number(spread)} us where they are 50 us apart, and {number(alone)} us '
            f'where it is alone{bare}. Tasks of one rate are released together unless you give '
            'them phases.')


def capacity(of: Known, rate_hz: int) -> int:
    """
    Return how many tasks of a rate, released together, take half of a CPU.

    The first job of a period takes what one takes that is alone; the others share its wake-up.
    """
    alone_us, together_us = of[facts.ALONE], of[facts.TOGETHER]
    further_us = max(together_us / 2, (_CROWD * together_us - alone_us) / (_CROWD - 1))
    left_us = _SHARE * _US_PER_S / rate_hz - alone_us
    return 0 if left_us < 0 else 1 + int(left_us / further_us)


def _about(count: float) -> str:
    """Write a number of things with two digits."""
    return f'{float(f"{count:.2g}"):,.0f}'


def _room(of: Known) -> str:
    if not {facts.ALONE, facts.TOGETHER, facts.SPREAD} <= set(of):
        return ''
    counts = ', '.join(f'{_about(capacity(of, rate_hz))} tasks of {rate_hz} Hz'
                       for rate_hz in _RATES_HZ)
    apart = _SHARE * _US_PER_S / of[facts.SPREAD]
    return (f'Half of one CPU carries about this many tasks that are released together: {counts}. '
            f'Of tasks that are released one by one it carries {_about(apart)} jobs a second, '
            f'such as {_about(apart / 200)} tasks of 200 Hz. The other half is for what they '
            'compute; what a task computes itself is not in these figures.')


def _thousand(of: Known) -> str:
    together, spread = of.get(facts.REACHED), of.get(facts.REACHED_SPREAD)
    if together is None or spread is None:
        return ''
    return (f'1000 tasks of 200 Hz that do nothing reached {together:.1f} Hz, released together, '
            f'and {spread:.1f} Hz, released one by one.')


def _of(results: Sequence[CaseResult], machine: Mapping[str, Any]) -> list[str]:
    # What an earlier version has written does not say which build it was.
    return list(sentences(known(results), bool(machine.get('compiled')),
                          machine.get('build', 'pure Python')))


def blocks(results: Sequence[CaseResult], machine: Mapping[str, Any]) -> Iterator[Block]:
    """Make the part of the page."""
    said = _of(results, machine)
    if said:
        yield Heading(_TITLE, 2)
        yield Paragraph(_INTRODUCTION)
        yield Bullets(said)


def lines(results: Sequence[CaseResult], machine: Mapping[str, Any], width: int = WIDTH
          ) -> Iterator[str]:
    """Make the part for a terminal."""
    said = _of(results, machine)
    if said:
        yield ''
        yield f'== {_TITLE[0].lower()}{_TITLE[1:]}'
        for one in said:
            yield from textwrap.wrap(one, width, initial_indent='- ', subsequent_indent='  ')
