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

"""The sentences at the end of a report: made of figures that are given, and of nothing else."""

from __future__ import annotations

import pytest

from rt_robot_os.tools.bench import facts
from rt_robot_os.tools.bench.blocks import Bullets
from rt_robot_os.tools.bench.blocks import Heading
from rt_robot_os.tools.bench.case import COMPILED
from rt_robot_os.tools.bench.case import PURE
from rt_robot_os.tools.bench.expectations import blocks
from rt_robot_os.tools.bench.expectations import capacity
from rt_robot_os.tools.bench.expectations import lines
from rt_robot_os.tools.bench.expectations import sentences
from rt_robot_os.tools.bench.facts import of_build
from rt_robot_os.tools.bench.result import CaseResult
from rt_robot_os.tools.bench.result import Metric

FLOORS = {facts.CALL: 0.02, facts.SYSTEM_CALL: 0.1, facts.WAKE_CPU: 20.0}
LATE = {facts.LATE: 50.0, facts.LATE_P99: 110.0, facts.WAKE_LATE: 45.0, facts.WAKE_LATE_P99: 90.0,
        facts.PREEMPTING_P99: 130.0, facts.LOADED_LATE_P99: 105.0}
COMPILED_BUILD = {
    facts.TAKE: 0.25, facts.TO_TASK: 1.25, facts.DELAY: 4.0, facts.BARE_DELAY: 3.5,
    facts.TOGETHER: 2.5, facts.SPREAD: 10.0, facts.ALONE: 30.0, facts.REACHED: 200.0,
    facts.REACHED_SPREAD: 199.9}
BUILD = 'compiled with GCC 9.9'
WITHOUT = 'pure Python: it was not compiled; `colcon build` does that'


def of(build: str, factor: float = 1.0) -> dict[str, float]:
    return {of_build(name, build): value * factor for name, value in COMPILED_BUILD.items()}


def said(found: dict[str, float], compiled: bool = True, build: str = BUILD) -> list[str]:
    return list(sentences(found, compiled, build))


def test_all_figures_become_one_sentence_or_two_each() -> None:
    assert said({**FLOORS, **LATE, **of(COMPILED), **of(PURE, 2.0)}) == [
        'What ran: compiled with GCC 9.9. Pure Python would take: a message to a '
        'task, one after the other, 2.50 us instead of 1.25; one at 500 Hz 8.00 us instead of '
        '4.00; a job of 100 tasks released together 5.00 us instead of 2.50; a job that is alone '
        '60.0 us instead of 30.0.',
        'Without this package: the call of an empty Python function 0.020 us; a system call from '
        'Python 0.100 us; the CPU time of a wake-up from clock_nanosleep 20.0 us.',
        'A task that wakes the idle CPU begins 50.0 us late, 99 of 100 times at most 110 us. A '
        'bare loop of clock_nanosleep: 45.0 and 90.0 us; nothing in Python can be earlier.',
        'A 1 kHz task that interrupts another one, which computes 20 % of the time, begins 99 of '
        '100 times at most 130 us late. A bare loop of clock_nanosleep beside such a load: 105 '
        'us.',
        'A message to a task that waits for it is there after 4.00 us, at 500 Hz. To publish and '
        'take it without a kernel, after the same sleep, takes 3.50 us: the kernel adds 0.500 us. '
        'One message after the other, each takes 1.25 us: the rest is caches that are cold.',
        'A job takes 2.50 us of CPU where 100 tasks are released together, 10.0 us where they are '
        '50 us apart, and 30.0 us where it is alone (a bare wake-up takes 20.0 us then). Tasks of '
        'one rate are released together unless you give them phases.',
        'Half of one CPU carries about this many tasks that are released together: 210 tasks of '
        '1000 Hz, 1,100 tasks of 200 Hz, 4,500 tasks of 50 Hz. Of tasks that are released one by '
        'one it carries 50,000 jobs a second, such as 250 tasks of 200 Hz. The other half is for '
        'what they compute; what a task computes itself is not in these figures.',
        '1000 tasks of 200 Hz that do nothing reached 200.0 Hz, released together, and 199.9 Hz, '
        'released one by one.']


def test_pure_python_says_why_and_what_the_compiled_build_would_give() -> None:
    both = said({**of(COMPILED), **of(PURE, 2.0)}, False, 'pure Python: RT_ROBOT_OS_COMPILE=0')
    assert both[0].startswith('What ran: pure Python: RT_ROBOT_OS_COMPILE=0. The compiled build '
                              'would take: a message to a task, one after the other, 1.25 us '
                              'instead of 2.50;')
    assert 'is there after 8.00 us' in both[1]
    only = said(of(PURE, 2.0), False, WITHOUT)
    assert only[0].startswith(f'What ran: {WITHOUT}. What the compiled build would give was not '
                              'measured')
    assert only[1:] == both[1:]


@pytest.mark.parametrize('found, count', [
    ({}, 0), (FLOORS, 1), ({facts.CALL: 0.02}, 1), (LATE, 2), (of(COMPILED), 4),
    ({of_build(facts.TAKE, PURE): 0.5}, 0)])
def test_what_was_not_measured_is_left_out(found: dict[str, float], count: int) -> None:
    assert len(said(found)) == count


def test_a_kernel_that_seems_quicker_than_a_bare_loop_adds_nothing_that_can_be_seen() -> None:
    found = {**of(COMPILED), of_build(facts.BARE_DELAY, COMPILED): 4.2}
    assert 'takes 4.20 us: the kernel adds nothing that can be seen' in said(found)[0]


def test_half_a_cpu_carries_what_its_time_allows() -> None:
    # A period of 5 ms has 2500 us: 30 for the first job, 250 for 100 of them.
    known = {facts.TOGETHER: 2.5, facts.ALONE: 30.0}
    count = capacity(known, 200)
    further_us = (250.0 - 30.0) / 99
    assert 30.0 + (count - 1) * further_us <= 2500.0 < 30.0 + count * further_us
    assert capacity(known, 10_000) == 1 + int(20.0 / further_us)
    assert capacity(known, 20_000) == 0  # not even one: it takes 30 of 25 us
    # A wake-up that costs more than all jobs together cannot make them free.
    assert capacity({facts.TOGETHER: 0.2, facts.ALONE: 30.0}, 1000) == 1 + int(470.0 / 0.1)


def test_it_ends_the_report_and_what_the_terminal_shows() -> None:
    result = CaseResult('x', 'x', (), (), facts={
        facts.CALL: Metric((0.3, 0.1, 0.2)), facts.SYSTEM_CALL: None})
    machine = {'build': BUILD, 'compiled': True}
    sentence = 'Without this package: the call of an empty Python function 0.200 us.'
    heading, _, bullets = blocks([result], machine)
    assert heading == Heading('What to expect on your machine', 2)
    assert bullets == Bullets([sentence])
    assert list(lines([result], machine, 60)) == [
        '', '== what to expect on your machine',
        '- Without this package: the call of an empty Python function', '  0.200 us.']
    # What was measured before builds were told apart, or measured none of this.
    assert list(blocks([CaseResult('x', 'x', (), ())], {})) == []
