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


"""Reports are bounded, each reader gets each one once, whoever preempts whom."""

from __future__ import annotations

import sys

from at_line import AtLine
import pytest

from rt_robot_os.base.reports import LogEntry
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity


def report(number: int) -> LogEntry:
    return LogEntry(number, Severity.INFO, 'test', f'{number}')


def texts(reports: tuple[LogEntry, ...]) -> list[int]:
    return [int(r.text) for r in reports]


def test_readers_keep_their_own_place() -> None:
    reports = Reports()
    first = second = 0
    for number in range(5):
        reports.note(report(number))
        first, dropped, new = reports.since(first)
        assert (dropped, texts(new)) == (0, [number])
    second, dropped, new = reports.since(second)
    assert (dropped, texts(new)) == (0, [0, 1, 2, 3, 4])
    assert first == second == reports.total == 5
    assert reports.since(first) == (5, 0, ())


def test_the_oldest_give_way_and_are_counted() -> None:
    reports = Reports(capacity=3)
    assert reports.since(0) == (0, 0, ())
    for number in range(10):
        reports.note(report(number))
    place, dropped, new = reports.since(2)
    assert (place, dropped, texts(new)) == (10, 5, [7, 8, 9])


def test_a_report_says_how_bad_and_from_whom() -> None:
    assert str(LogEntry(1, Severity.WARN, 'imu', 'silent')) == '[WARN] imu: silent'


@pytest.mark.parametrize('capacity', [2, 100])
@pytest.mark.parametrize('nested', ['note', 'since'])
def test_none_is_lost_or_doubled_wherever_another_task_comes_in(
        untraced: None, capacity: int, nested: str) -> None:
    step, total = 1, 1
    while step <= total:
        reports = Reports(capacity)
        places = [0, 0]
        seen: list[list[int]] = [[], []]
        dropped = [0, 0]

        def read(which: int) -> None:
            places[which], lost, new = reports.since(places[which])
            dropped[which] += lost
            seen[which] += texts(new)

        codes = (Reports.note.__code__, Reports.since.__code__)
        tracer = AtLine(step, (lambda: reports.note(report(100))) if nested == 'note' else (
            lambda: read(1)), codes.__contains__)
        for number in range(2):
            reports.note(report(number))
        sys.settrace(tracer)
        try:
            reports.note(report(2))
            read(0)
            reports.note(report(3))
            read(0)
        finally:
            sys.settrace(None)
        for which in (0, 1):
            read(which)
            assert len(seen[which]) + dropped[which] == reports.total
            assert len(set(seen[which])) == len(seen[which])
            assert places[which] == reports.total
        total = tracer.seen
        step += 1
    assert total >= 10
