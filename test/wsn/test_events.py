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

"""Check the queue of events: order, cancelling, and what a failing event leaves."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.features.wsn.simulator.events import Event
from rt_robot_os.features.wsn.simulator.events import EventQueue

PLANS = st.lists(st.tuples(st.sampled_from(['at', 'cancel']), st.integers(0, 9),
                           st.integers(0, 20)), max_size=60)


@given(PLANS)
def test_events_run_in_order_of_time_then_of_planning(plans):
    queue = EventQueue()
    ran: list[tuple[int, int]] = []
    events = []
    for name in range(10):
        events.append(Event(lambda name=name: ran.append((queue.now_ns, name))))
    expected: dict[int, tuple[int, int]] = {}
    for step, (what, name, time_ns) in enumerate(plans):
        if what == 'at':
            queue.at(time_ns, events[name])
            expected[name] = (time_ns, step)
        else:
            queue.cancel(events[name])
            expected.pop(name, None)
    assert len(queue) == len(expected)
    queue.run_until(20)
    in_order = sorted(expected.items(), key=lambda each: each[1])
    assert ran == [(when, name) for name, (when, _) in in_order]
    assert queue.executed == len(ran) and len(queue) == 0


def test_events_beyond_the_time_wait():
    queue = EventQueue()
    ran = []
    queue.at(10, Event(lambda: ran.append(10)))
    queue.run_until(9)
    assert ran == [] and queue.now_ns == 9 and queue.next_ns() == 10
    queue.run_until(10)
    assert ran == [10] and queue.next_ns() is None


def test_an_event_in_the_past_is_an_error():
    queue = EventQueue()
    queue.run_until(100)
    with pytest.raises(ValueError, match='at 99 ns: it is 100 ns already'):
        queue.at(99, Event(lambda: None))


def test_an_exception_leaves_a_queue_that_runs_on():
    queue = EventQueue()
    ran = []
    queue.at(1, Event(lambda: 1 / 0))
    queue.at(2, Event(lambda: ran.append(2)))
    with pytest.raises(ZeroDivisionError):
        queue.run_until(5)
    queue.run_until(5)
    assert ran == [2] and queue.executed == 2


def test_an_event_that_is_put_off_for_ever_does_not_fill_the_queue():
    queue = EventQueue()
    event = Event(lambda: None)
    for time_ns in range(100_000):
        queue.at(1_000_000 + time_ns, event)
    assert len(queue) == 1
    assert len(queue._heap) < 2_100
