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

"""Worked examples from books and papers, with the numbers that they give."""

from __future__ import annotations

from plan_tools import task
import pytest

from rt_robot_os.tools.plan.analysis import analyse
from rt_robot_os.tools.plan.result import Analysis
from rt_robot_os.tools.plan.result import Verdict
from rt_robot_os.tools.plan.task import PlannedTask


def responses(analysis: Analysis) -> dict[str, int | None]:
    return {result.task.name: result.response_ns for result in analysis.tasks}


def test_the_textbook_set_of_burns_and_wellings() -> None:
    """Give 3, 6, 20 (Real-Time Systems and Programming Languages, response time analysis)."""
    found = analyse([task('a', 3, 3, 7), task('b', 2, 3, 12), task('c', 1, 5, 20)])
    assert responses(found) == {'a': 3, 'b': 6, 'c': 20}
    assert found.utilisation == pytest.approx(3 / 7 + 3 / 12 + 5 / 20)
    assert not found.failed


def test_harmonic_periods_at_full_utilisation() -> None:
    """Accept utilisation 1 when it fits (Burns and Wellings, their set with T = 80, 40, 20)."""
    found = analyse([task('a', 1, 40, 80), task('b', 2, 10, 40), task('c', 3, 5, 20)])
    assert responses(found) == {'c': 5, 'b': 15, 'a': 80}
    assert found.utilisation == 1.0
    assert [result.verdict for result in found.tasks] == [Verdict.OK] * 3


def test_the_completion_time_of_lehoczky_sha_and_ding() -> None:
    """Finish the third task at 300, with three jobs of the first (RTSS 1989)."""
    tasks = [task('1', 3, 40, 100), task('2', 2, 40, 150), task('3', 1, 100, 350)]
    assert responses(analyse(tasks)) == {'1': 40, '2': 80, '3': 300}


def test_the_deadlines_beyond_periods_of_lehoczky() -> None:
    """Find 118, in the fifth job of the busy period, not in the first, 114 (RTSS 1990)."""
    tasks = [task('1', 2, 26, 70), task('2', 1, 62, 100, deadline_ns=120, backlog=1)]
    found = analyse(tasks)
    assert responses(found) == {'1': 26, '2': 118}
    assert not found.failed


def test_a_response_beyond_the_period_needs_a_policy_that_keeps_the_release() -> None:
    tasks = [task('1', 2, 26, 70), task('2', 1, 62, 100, deadline_ns=120)]
    assert [r.verdict for r in analyse(tasks).tasks] == [Verdict.OK, Verdict.SKIPPED]


def test_blocking_under_immediate_ceilings_as_burns_and_wellings_have_it() -> None:
    """
    Block by one section, once: d EEQVE, c EVVE, b EE, a EQQQQE on resources Q and V.

    By inheritance d would wait for both Q (4) and V (2); with ceilings it waits for 4, and b,
    which locks nothing, for 4 as well.
    """
    tasks = [
        task('a', 1, 6, 1000, sections={'Q': 4}), task('b', 2, 2, 1000),
        task('c', 3, 4, 1000, sections={'V': 2}),
        task('d', 4, 5, 1000, sections={'Q': 1, 'V': 1})]
    found = analyse(tasks)
    assert {r.task.name: (r.blocking.length_ns, r.blocking.by, r.blocking.what)
            for r in found.tasks} == {
        'd': (4, 'a', 'Q'), 'c': (4, 'a', 'Q'), 'b': (4, 'a', 'Q'), 'a': (0, '', '')}
    assert responses(found) == {'d': 9, 'c': 13, 'b': 15, 'a': 17}


def test_a_resource_of_lower_tasks_only_blocks_nobody_above_its_ceiling() -> None:
    tasks = [task('low', 1, 50, 1000, sections={'map': 20}),
             task('mid', 2, 50, 1000, sections={'map': 10}), task('high', 3, 50, 1000)]
    assert [r.blocking.length_ns for r in analyse(tasks).tasks] == [0, 20, 0]


def test_release_jitter_counts_once_for_the_task_and_in_what_it_adds_to_others() -> None:
    """Follow Audsley et al. 1993: w = C + sum ceil((w + J) / T) C, R = w + J."""
    tasks = [task('high', 2, 2, 10, jitter_ns=4), task('low', 1, 5, 50)]
    # low: 5 + 2 = 7; 7 + 4 jitter is more than a period: 5 + 2 * 2 = 9; 9 + 4 is not more than 2.
    assert responses(analyse(tasks)) == {'high': 6, 'low': 9}


def test_a_native_call_below_blocks_as_a_section_does_and_they_do_not_add() -> None:
    tasks = [task('a', 3, 1, 100, sections={'r': 1}), task('b', 2, 20, 100, sections={'r': 7}),
             task('c', 1, 30, 200, native_ns=9)]
    found = {r.task.name: r.blocking for r in analyse(tasks).tasks}
    assert (found['a'].length_ns, found['a'].by, found['a'].what) == (9, 'c', 'native call')
    assert (found['b'].length_ns, found['b'].by) == (9, 'c')


def test_a_section_of_unknown_length_is_as_long_as_the_job() -> None:
    low = PlannedTask('low', 1, period_ns=100, execution_ns=12, sections={'r': None})
    high = PlannedTask('high', 2, period_ns=100, execution_ns=1, sections={'r': None})
    assert analyse([low, high]).task('high').blocking.length_ns == 12
