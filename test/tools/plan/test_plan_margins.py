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

"""What breaks first, what would help, and phases."""

from __future__ import annotations

from dataclasses import replace
import random

from plan_tools import random_set
from plan_tools import task
import pytest

from rt_robot_os.tools.plan.analysis import analyse
from rt_robot_os.tools.plan.phases import hyper_period_ns
from rt_robot_os.tools.plan.phases import lowest_peak
from rt_robot_os.tools.plan.phases import peak
from rt_robot_os.tools.plan.remedy import remedy
from rt_robot_os.tools.plan.sensitivity import load_margins
from rt_robot_os.tools.plan.sensitivity import scaled
from rt_robot_os.tools.plan.task import Overhead
from rt_robot_os.tools.plan.task import PlannedTask


@pytest.mark.parametrize('seed', range(15))
def test_a_set_fits_up_to_its_factor_and_breaks_beyond(seed: int) -> None:
    rng = random.Random(seed)
    tasks = [replace(t, backlog=0) for t in random_set(rng, 5, rng.uniform(0.2, 1.1), levels=9)]
    found = load_margins(tasks)
    assert not analyse([scaled(t, found.factor) for t in tasks]).failed
    beyond = analyse([scaled(t, found.factor * 1.003) for t in tasks]).failed
    assert beyond
    assert found.breaks in ('', *(result.task.name for result in beyond))


@pytest.mark.parametrize('seed', range(15))
def test_a_task_may_grow_as_far_as_told(seed: int) -> None:
    rng = random.Random(100 + seed)
    tasks = [replace(t, backlog=0) for t in random_set(rng, 4, 0.5, levels=9)]
    for growth in load_margins(tasks).growth:
        for factor, fits in ((1.0, True), (1.003, False)):
            changed = [replace(t, execution_ns=round((growth.execution_ns or 0) * factor))
                       if t.name == growth.task else t for t in tasks]
            assert (not analyse(changed).failed) is fits


def test_a_task_nobody_waits_for_may_grow_without_limit() -> None:
    growth = load_margins([task('a', 2, 1, 10), task('b', 1, 1, 100, judged=False)]).growth
    assert [(g.task, g.execution_ns is None) for g in growth] == [('a', False), ('b', True)]


def advice(tasks: list[PlannedTask]) -> str:
    return remedy(tasks, Overhead(), analyse(tasks))


def test_the_first_advice_is_the_cheapest_that_helps() -> None:
    ms = 10 ** 6
    wrong_order = [task('slow', 9, 40 * ms, 100 * ms), task('fast', 5, 2 * ms, 10 * ms)]
    assert advice(wrong_order) == (
        "give 'slow' a lower priority, since its deadline is longer than that of others below it: "
        'slow.priority: 4 (was 9)')
    lowest = [replace(wrong_order[0], priority=2), replace(wrong_order[1], priority=1)]
    assert advice(lowest) == ('give the shorter deadline the higher priority: '
                              'slow.priority: 1 (was 2), fast.priority: 2 (was 1)')
    blocked = [task('fast', 9, 2 * ms, 10 * ms), task('slow', 5, 40 * ms, 100 * ms,
                                                      native_ns=9 * ms)]
    assert advice(blocked) == ("shorten the longest native call of 'slow' from 9.000 ms to "
                               '7.998 ms')
    too_long = [task('fast', 9, 2 * ms, 10 * ms), task('slow', 5, 90 * ms, 100 * ms)]
    assert advice(too_long) == "make 'slow' compute at most 79.990 ms instead of 90.000 ms"
    late = [task('fast', 9, 2 * ms, 10 * ms, jitter_ns=9 * ms)]
    assert advice(late).startswith('timers of this machine were up to 9.000 ms late')
    cooperative = [task('fast', 9, 2 * ms, 10 * ms),
                   task('slow', 5, 40 * ms, 100 * ms, preemptible=False)]
    assert advice(cooperative) == 'set core.dispatcher to preemptive'
    assert advice([task('a', 1, 1, 10)]) == ''


# ---- phases ------------------------------------------------------------------------------------

def test_the_hyper_period_is_the_least_common_multiple_or_nothing() -> None:
    assert hyper_period_ns([task('a', 1, 1, 4), task('b', 1, 1, 6)]) == 12
    assert hyper_period_ns([PlannedTask('a', 1, execution_ns=1)]) == 0
    primes = [task(str(p), 1, 1, p) for p in (16_666_667, 33_333_331, 14_285_717, 9_999_991)]
    assert hyper_period_ns(primes) is None


def brute_force_peak(tasks: list[PlannedTask]) -> int:
    period, start = hyper_period_ns(tasks) or 0, max(t.phase_ns for t in tasks)
    return max(sum(t.execution_ns or 0 for t in tasks
                   if (at - t.phase_ns) % t.period_ns == 0) for at in range(start, start + period))


@pytest.mark.parametrize('seed', range(20))
def test_the_worst_instant_is_that_of_all_time(seed: int) -> None:
    rng = random.Random(seed)
    tasks = []
    for index in range(rng.randint(1, 6)):
        period = rng.choice([2, 3, 4, 6, 8, 12, 24])
        tasks.append(task(str(index), 1, rng.randint(1, 9), period,
                          phase_ns=rng.randrange(period)))
    assert peak(tasks).work_ns == brute_force_peak(tasks)


def test_phases_spread_what_can_be_spread() -> None:
    ms = 10 ** 6
    tasks = [task('a', 5, 2 * ms, 10 * ms), task('b', 4, 3 * ms, 20 * ms),
             task('c', 3, 1 * ms, 20 * ms), task('d', 2, 1 * ms, 10 * ms)]
    found = lowest_peak(tasks)
    assert (found.before.work_ns, len(found.before.tasks)) == (7 * ms, 4)
    assert (found.after.work_ns, found.after.tasks) == (3 * ms, ('b',))
    assert found.better
    assert found == lowest_peak(tasks)
    assert all(phase % 1000 == 0 for phase in found.phases_ns.values())


def test_phases_that_may_not_change_stay() -> None:
    ms = 10 ** 6
    tasks = [task('mine', 5, 2 * ms, 10 * ms), task('core', 1, ms, 10 * ms, phase_ns=5 * ms)]
    found = lowest_peak(tasks, fixed=['core'])
    assert list(found.phases_ns) == ['mine']
    assert found.after.work_ns == 2 * ms


def test_phases_of_periods_without_a_common_divisor_gain_nothing() -> None:
    found = lowest_peak([task('a', 2, 10, 9_999_991), task('b', 1, 10, 10_000_019)])
    assert not found.better
