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


"""Which job had the CPU when: against a model that saw it nanosecond by nanosecond."""

from __future__ import annotations

from collections import Counter

from black_box_stories import stories
from black_box_stories import Story
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.tools.black_box import History
from rt_robot_os.tools.black_box import understand
from rt_robot_os.tools.black_box.slices import slices
from rt_robot_os.tools.black_box.slices import Span


def _all_slices(history: History) -> list[tuple[int, int, int]]:
    return sorted((start, end, job.task) for job in history.jobs for start, end in job.slices)


def _never_two_at_once(found: list[tuple[int, int, int]]) -> bool:
    return all(before[1] <= after[0] for before, after in zip(found, found[1:]))


@settings(max_examples=120, deadline=None)
@given(stories())
def test_every_nanosecond_goes_to_the_job_that_had_it(story: Story) -> None:
    history = understand(story.dump())
    found = _all_slices(history)
    assert _never_two_at_once(found)
    owner = [-1] * story.now_ns
    for start_ns, end_ns, task in found:
        owner[start_ns:end_ns] = [task] * (end_ns - start_ns)
    assert owner == story.owner


@settings(max_examples=80, deadline=None)
@given(stories())
def test_no_job_is_lost_and_each_has_its_execution_time(story: Story) -> None:
    history = understand(story.dump())
    assert Counter((j.task, j.start_ns, j.execution_ns) for j in history.jobs) == Counter(
        story.executed)


@settings(max_examples=80, deadline=None)
@given(stories(), st.data())
def test_when_old_records_are_gone_nothing_wrong_is_said(story: Story, data: st.DataObject
                                                         ) -> None:
    keep = data.draw(st.integers(0, len(story.records)))
    history = understand(story.dump(keep))
    found = _all_slices(history)
    assert _never_two_at_once(found)
    for start_ns, end_ns, task in found:
        assert start_ns >= history.from_ns
        assert set(story.owner[start_ns:end_ns]) == {task}


@settings(max_examples=80, deadline=None)
@given(stories(), st.data())
def test_who_ran_between_two_moments(story: Story, data: st.DataObject) -> None:
    from_ns = data.draw(st.integers(0, story.now_ns))
    to_ns = data.draw(st.integers(from_ns, story.now_ns))
    assert understand(story.dump()).who_ran(from_ns, to_ns) == story.used(from_ns, to_ns)


@settings(max_examples=80, deadline=None)
@given(st.lists(st.tuples(st.integers(-20, 20), st.integers(-5, 20)), max_size=12),
       st.none() | st.integers(-20, 20))
def test_slices_of_nonsense_do_not_overlap_either(pairs: list[tuple[int, int]],
                                                  from_ns: int | None) -> None:
    found, _ = slices([Span(start, start + length) for start, length in pairs], from_ns)
    assert _never_two_at_once(sorted((start, end, 0) for one in found for start, end in one))


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.integers(1, 99), st.integers(50, 900), st.integers(0, 400)),
                min_size=1, max_size=5))
def test_a_kernel_and_its_black_box_agree(plans: list[tuple[int, int, int]]) -> None:
    kernel = Kernel(VirtualClock())
    for number, (priority, period_us, spend_us) in enumerate(plans):
        kernel.add_task(f'task {number}', lambda us=spend_us: kernel.clock.spend(us * 1000),
                        priority=priority, rate_hz=1_000_000 / period_us)
    kernel.run(10_000_000)
    history = understand(kernel.black_box_dump('the end'))
    assert _never_two_at_once(_all_slices(history))
    for number, task in enumerate(kernel.tasks):
        jobs = [job for job in history.jobs if job.task == number]
        statistics = task.statistics()
        assert len(jobs) == statistics.runs
        assert sum(job.execution_ns for job in jobs) == statistics.execution_total_ns
        assert max((job.latency_ns for job in jobs), default=0) == statistics.latency.maximum_ns
        assert sum(job.late_ns > 0 for job in jobs) == statistics.deadline_missed
