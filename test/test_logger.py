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


"""What modules log is noted safely, formatted later, held back when asked, never lost unseen."""

from __future__ import annotations

from collections.abc import Callable
import sys
from typing import Any

from at_line import AtLine
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.base.logger import ARGUMENT_MAXIMUM
from rt_robot_os.base.logger import Logger
from rt_robot_os.base.reports import LogEntry
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock

S = 1_000_000_000


class Clock:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.ns = 0

    def __call__(self) -> int:
        return self.ns


def logger(reports: Reports, clock: Callable[[], int] | None = None, level: int = 10) -> Logger:
    log = Logger('arm', level)
    log.connect(reports, clock or Clock())
    return log


def texts(reports: Reports) -> list[str]:
    return [r.text for r in reports.since(0)[2]]


def test_lines_carry_severity_source_time_and_formatted_text() -> None:
    reports, clock = Reports(), Clock()
    log = logger(reports, clock)
    clock.ns = 5
    log.debug('plain 100 %')
    log.info('%.1f m at %d', 1.25, 3)
    log.warn('%s', 'w')
    log.error('e')
    log.fatal('f')
    assert reports.since(0)[2] == (
        LogEntry(5, Severity.DEBUG, 'arm', 'plain 100 %'),
        LogEntry(5, Severity.INFO, 'arm', '1.2 m at 3'),
        LogEntry(5, Severity.WARN, 'arm', 'w'), LogEntry(5, Severity.ERROR, 'arm', 'e'),
        LogEntry(5, Severity.FATAL, 'arm', 'f'))


def test_below_its_level_nothing_is_noted() -> None:
    reports = Reports()
    log = logger(reports, level=30)
    log.info('no')
    log.warn('yes')
    log.level = 20
    log.info('now')
    assert texts(reports) == ['yes', 'now']


class Rude:
    def __str__(self) -> str:
        raise RuntimeError('no')


def test_what_changes_later_is_logged_as_it_was() -> None:
    reports = Reports()
    log = logger(reports)
    values, array = [1, 2], np.array([1.0, 2.0])
    log.info('%s %s %.1f', values, array, np.float32(0.5))
    values.append(3)
    array[0] = 9.0
    log.info('%s', Rude())
    log.info('%s', 'x' * 10_000)
    log.info(values)  # type: ignore[arg-type]
    first, rude, long, alone = texts(reports)
    assert first == '[1, 2] [1. 2.] 0.5'
    assert 'RuntimeError' in rude and len(long) == ARGUMENT_MAXIMUM and alone == '[1, 2, 3]'


@given(st.text(max_size=30), st.lists(st.one_of(
    st.none(), st.integers(), st.floats(), st.text(max_size=5), st.binary(max_size=5),
    st.dictionaries(st.text(max_size=2), st.integers(), max_size=2)), max_size=4))
def test_no_text_and_no_argument_raises_anything(text: str, arguments: list[Any]) -> None:
    reports = Reports()
    logger(reports).info(text, *arguments, throttle_s=1.0)
    logger(reports).info('%d', *arguments)
    assert len(texts(reports)) == 2


def test_an_integer_that_has_no_text_stops_no_other_line() -> None:
    reports = Reports()
    log = logger(reports)
    log.info('%d', 10 ** 5000)
    log.info('next')
    first, second = texts(reports)
    assert 'do not fit' in first and second == 'next'


def test_a_flood_of_lines_drives_out_no_report_and_is_counted() -> None:
    reports = Reports(capacity=4, lines=8)
    log = logger(reports)
    reports.note(LogEntry(0, Severity.ERROR, 'core', 'important'))
    for number in range(100):
        log.info('%d', number)
    place, dropped, found = reports.since(0)
    assert (place, dropped) == (101, 92)
    assert [r.text for r in found] == ['important', *(str(n) for n in range(92, 100))]


def test_throttled_lines_are_summed_up_when_their_time_is_over() -> None:
    kernel = Kernel(VirtualClock())
    reports = Reports()
    log = logger(reports, kernel.now_ns)
    jobs = iter(range(25))
    kernel.add_task('arm', lambda: log.info('job %d', next(jobs), throttle_s=1.0), priority=50,
                    rate_hz=10.0, phase_ns=0)
    kernel.add_task('watch', lambda: log.sweep(kernel.now_ns()), priority=1, rate_hz=10.0)
    kernel.run(2 * S + S // 2 - 1)
    assert texts(reports) == [
        'job 0', '9 more in 1.0 s, the last: job 9', 'job 10',
        '9 more in 1.0 s, the last: job 19', 'job 20']


def test_a_line_that_stopped_is_summed_up_by_the_sweep() -> None:
    reports, clock = Reports(), Clock()
    log = logger(reports, clock)
    for _ in range(4):
        log.warn('50 % full', throttle_s=2.0)
    clock.ns = S
    log.sweep(clock.ns)
    assert texts(reports) == ['50 % full']
    clock.ns = 3 * S
    log.sweep(clock.ns)
    log.sweep(clock.ns)
    assert texts(reports) == ['50 % full', '3 more in 2.0 s, the last: 50 % full']


def test_each_place_in_the_code_is_held_back_by_itself() -> None:
    reports = Reports()
    log = logger(reports)
    for number in range(3):
        log.info(f'here {number}', throttle_s=1.0)
        log.info(f'there {number}', throttle_s=1.0)
        log.info(f'once {number}', once=True)
    assert texts(reports) == ['here 0', 'there 0', 'once 0']


def test_many_places_are_bounded() -> None:
    reports = Reports(lines=4096)
    log = logger(reports)
    for number in range(1000):  # a statement more is another place
        exec('x = 1;' * number + f'log.info("{number}", throttle_s=1.0)', {'log': log})
    assert len(texts(reports)) == 1000
    assert len(log._windows) <= 256


CODES = frozenset(f.__code__ for f in (
    Logger.info, Logger._log, Logger._note, Logger._passes, Logger._close, Logger.sweep,
    Reports.since))


def accounted(reports: list[LogEntry]) -> int:
    """Count the lines that were logged, told one by one or summed up."""
    return sum(int(r.text.split()[0]) if ' more in ' in r.text else 1 for r in reports)


@pytest.mark.parametrize('throttle_s', [0.0, 1.0])
@pytest.mark.parametrize('late_ns', [0, S])
def test_nothing_is_lost_or_torn_wherever_a_higher_task_logs_too(
        untraced: None, throttle_s: float, late_ns: int) -> None:
    step, total = 1, 1
    while step <= total:
        reports, clock = Reports(), Clock()
        log = logger(reports, clock)
        found: list[LogEntry] = []
        place = 0

        def say(number: int) -> None:
            log.info('job %d of %s', number, 'arm', throttle_s=throttle_s)

        def higher() -> None:
            clock.ns += late_ns
            for number in range(3):
                say(100 + number)

        tracer = AtLine(step, higher, CODES.__contains__)
        say(0)
        say(1)
        sys.settrace(tracer)
        try:
            say(2)
            clock.ns += S
            say(3)
            place, dropped, new = reports.since(place)
            found += new
            clock.ns += S
            log.sweep(clock.ns)
            say(4)
        finally:
            sys.settrace(None)
        clock.ns += 10 * S
        log.sweep(clock.ns)
        place, more, new = reports.since(place)
        found += new
        assert dropped == more == 0 and place == reports.total
        assert accounted(found) == 5 + 3, (step, found)
        assert all(' of arm' in r.text for r in found)
        total = tracer.seen
        step += 1
    assert total >= 20
