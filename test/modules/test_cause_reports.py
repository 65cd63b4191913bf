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

"""The causes of alarms that a module reports, as a reader of the topic finds them."""

from __future__ import annotations

from collections.abc import Callable

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import CAUSES_TOPIC
from rt_robot_os.messages.cause import Level
from rt_robot_os.modules import Module
from rt_robot_os.modules.cause_reports import CauseReports
from rt_robot_os.modules.cause_reports import CAUSES_OUTPUT
from rt_robot_os.testing.module_bench import ModuleBench
from rt_robot_os.topics import Subscription

FALL = Cause('fall', 'anna', Level.CRITICAL, text='anna fell')
LOW = Cause('pulse_per_min_low', 'anna', Level.WARNING, text='pulse 48', value=48.0)


class Reporter(Module):
    """Reports what the test says, every second."""

    causes = CAUSES_OUTPUT
    most = 64

    def configure(self) -> None:
        """Begin without causes."""
        self.reports = CauseReports(self.causes, self.name, self.most)
        self.todo: list[Callable[[int], object]] = []

    def step(self) -> None:
        """Report what there is to report."""
        assert self.kernel is not None
        while self.todo:
            self.todo.pop(0)(self.kernel.now_ns())
        self.reports.refresh(self.kernel.now_ns())


class SmallReporter(Reporter):
    """Has room for two."""

    most = 2


def said(read: Subscription) -> list[tuple[float, Cause]]:
    """Return what was published, with the time in s."""
    found = []
    while read.take():
        found.append((read.stamp_ns / NS_PER_S, Cause.from_json(read.msg.data)))
    assert not read.lost
    return found


def report(module: Reporter, cause: Cause) -> Callable[[], None]:
    return lambda: module.todo.append(lambda now_ns: module.reports.report(cause, now_ns))


def test_a_cause_is_told_when_it_begins_every_ten_seconds_and_when_it_is_over() -> None:
    with ModuleBench() as bench:
        module = bench.add(Reporter, 'watch', rate_hz=1.0)
        read = bench.watch(CAUSES_TOPIC)
        bench.at(2.0, report(module, FALL))
        bench.at(30.0, report(module, replace(FALL, active=False, text='anna got up')))
        bench.run(60.0)
        found = said(read)
        assert [(time_s, cause.active) for time_s, cause in found] == [
            (2.0, True), (12.0, True), (22.0, True), (30.0, False)]
        assert {cause.source for _, cause in found} == {'watch'}
        assert found[-1][1].text == 'anna got up'
        assert module.statistics() == {}
        assert module.reports.statistics() == {
            'causes': 0, 'cause_reports': 4, 'causes_refused': 0}


def test_a_change_of_level_is_told_at_once_and_a_new_value_with_the_next_report() -> None:
    with ModuleBench() as bench:
        module = bench.add(Reporter, rate_hz=1.0)
        read = bench.watch(CAUSES_TOPIC)
        bench.at(1.0, report(module, LOW))
        bench.at(3.0, report(module, replace(LOW, value=47.0)))
        bench.at(15.0, report(module, replace(LOW, value=38.0, level=Level.URGENT)))
        bench.run(26.0)
        assert [(time_s, cause.level, cause.value) for time_s, cause in said(read)] == [
            (1.0, Level.WARNING, 48.0), (11.0, Level.WARNING, 47.0), (15.0, Level.URGENT, 38.0),
            (25.0, Level.URGENT, 38.0)]


def test_what_is_over_twice_or_never_began_is_not_told() -> None:
    with ModuleBench() as bench:
        module = bench.add(Reporter, rate_hz=1.0)
        read = bench.watch(CAUSES_TOPIC)
        bench.at(1.0, report(module, replace(FALL, active=False)))
        bench.at(2.0, lambda: module.todo.append(
            lambda now_ns: module.reports.end('fall', 'anna', now_ns)))
        bench.run(4.0)
        assert not said(read)


def test_when_there_is_no_room_the_mildest_gives_way_and_says_so() -> None:
    with ModuleBench() as bench:
        module = bench.add(SmallReporter, rate_hz=1.0)
        read = bench.watch(CAUSES_TOPIC)
        for kind in ('battery', 'silent'):
            bench.at(1.0, report(module, Cause(kind, 'bed', Level.TECHNICAL)))
        bench.at(2.0, report(module, LOW))
        bench.at(3.0, report(module, Cause('off', 'bed', Level.TECHNICAL)))
        bench.run(5.0)
        assert [(cause.kind, cause.active) for _, cause in said(read)] == [
            ('battery', True), ('silent', True), ('battery', False), ('pulse_per_min_low', True)]
        assert module.reports.refused == 2


def test_two_modules_share_the_topic() -> None:
    with ModuleBench() as bench:
        first = bench.add(Reporter, 'falls', rate_hz=1.0)
        second = bench.add(Reporter, 'rules', rate_hz=1.0)
        read = bench.watch(CAUSES_TOPIC)
        bench.at(1.0, report(first, FALL))
        bench.at(1.0, report(second, LOW))
        bench.run(2.0)
        assert {(cause.source, cause.kind) for _, cause in said(read)} == {
            ('falls', 'fall'), ('rules', 'pulse_per_min_low')}


class FakePublisher:
    """Remembers causes."""

    def __init__(self) -> None:
        self.msg = self
        self.data = ''
        self.sent: list[Cause] = []

    def publish(self, stamp_ns: int) -> None:
        """Remember."""
        self.sent.append(Cause.from_json(self.data))


CAUSES = st.builds(
    Cause, st.sampled_from(['a', 'b', 'c']), st.sampled_from(['anna', 'otto']),
    st.sampled_from(list(Level)), st.booleans(), st.text(max_size=300))


@given(st.lists(st.tuples(CAUSES, st.integers(0, 20))), st.integers(1, 6))
def test_a_reader_that_keeps_what_it_hears_knows_what_is_active(
        reports: list[tuple[Cause, int]], most: int) -> None:
    publisher = FakePublisher()
    kept = CauseReports(publisher, 'dut', most)  # type: ignore[arg-type]
    now_ns = 0
    for cause, passed_s in reports:
        now_ns += passed_s * NS_PER_S
        kept.report(cause, now_ns)
        kept.refresh(now_ns)
        assert kept.due_ns > now_ns
    heard: dict[tuple[str, str], Level] = {}
    for cause in publisher.sent:
        if cause.active:
            heard[cause.kind, cause.subject] = cause.level
        else:
            del heard[cause.kind, cause.subject]
    active = {(kind, subject): found.level for kind in 'abc' for subject in ('anna', 'otto')
              if (found := kept.active(kind, subject))}
    assert heard == active
    assert len(heard) <= most


def test_what_is_told_again_has_the_stamp_at_which_it_was_due_however_late_the_task_is() -> None:
    with ModuleBench() as bench:
        module = bench.add(Reporter, rate_hz=1.0)
        read = bench.watch(CAUSES_TOPIC)
        bench.run(0.5)
        module.reports.report(FALL, 3 * NS_PER_S)
        module.reports.refresh(13 * NS_PER_S + 123_456)
        module.reports.refresh(23 * NS_PER_S - 1)
        module.reports.refresh(44 * NS_PER_S)
        assert [stamp_s for stamp_s, _ in said(read)] == [3.0, 13.0, 43.0]
        assert module.reports.due_ns == 53 * NS_PER_S
