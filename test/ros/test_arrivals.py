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

"""How old samples from ROS are: freezes, clocks that differ, clocks that are set."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from rt_robot_os.ros.arrivals import Arrivals
from rt_robot_os.ros.arrivals import OwnGaps

MS = 1_000_000
S = 1_000_000_000


class Node:
    """A node whose clocks a test moves, and a publisher on another machine."""

    def __init__(self, offset_ns: int = 0, latched: bool = False) -> None:
        self.boot_ns = 1000 * S
        self.set_ns = 1_700_000_000 * S
        self.offset_ns = offset_ns
        self.gaps = OwnGaps(lambda: self.boot_ns, lambda: self.boot_ns + self.set_ns)
        self.arrivals = Arrivals(self.gaps, latched)

    def run(self, seconds: float) -> None:
        """Let time pass while the node runs."""
        for _ in range(round(seconds * 10)):
            self.boot_ns += S // 10
            self.gaps.note()

    def freeze(self, seconds: float) -> None:
        self.boot_ns += round(seconds * S)

    def sample(self) -> dict[str, Any]:
        """Publish now; what is given back is taken later."""
        wall_ns = self.boot_ns + self.set_ns
        return {'source_timestamp': wall_ns + self.offset_ns, 'received_timestamp': wall_ns}

    def age_ms(self, info: Mapping[str, Any]) -> float:
        return self.arrivals.age_ns(info) / MS

    def take(self, seconds: float = 0.1) -> float:
        """Publish, and take it a millisecond later; then time passes."""
        info = self.sample()
        self.boot_ns += MS
        age_ms = self.age_ms(info)
        self.run(seconds)
        return age_ms

    def took_late(self, info: dict[str, Any]) -> float:
        """Take a sample that DDS, too, has received only now."""
        return self.age_ms({**info, 'received_timestamp': self.boot_ns + self.set_ns})


def test_a_sample_that_waited_for_a_frozen_node_is_old() -> None:
    for offset_s in (0, -3600, 3600):
        node = Node(offset_s * S)
        assert all(node.take() <= 2.0 for _ in range(20))
        waiting = node.sample()
        node.freeze(1.5)
        assert node.took_late(waiting) >= 1498, 'the clocks differ, and it is all the same'
        assert node.take() <= 2.0, 'one that was published afterwards'
        assert (node.gaps.gaps, node.gaps.longest_ns >= 1500 * MS) == (1, True)


def test_the_first_of_a_publisher_counts_from_when_the_node_ran_last() -> None:
    node = Node(7 * S)
    node.run(1.0)
    node.freeze(1.0)
    waiting = node.sample()  # in the middle of the freeze: nobody can know
    node.freeze(1.0)
    assert node.took_late(waiting) >= 2000
    node.boot_ns += 50 * MS
    assert node.took_late(node.sample()) >= 2000, 'nothing was learnt from the first'
    node.run(0.3)
    assert node.take() <= 2.0


def test_a_message_that_waited_behind_a_long_callback_is_as_old_as_that() -> None:
    node = Node(5 * S)
    waiting = node.sample()  # DDS has received it: another thread did
    node.boot_ns += 200 * MS
    assert node.age_ms(waiting) == 200


def test_a_delay_of_the_network_shows_once_the_publisher_is_known() -> None:
    node = Node(-100 * S)
    for _ in range(10):
        node.take()
    late = node.sample()
    node.run(0.8)
    assert 780 <= node.took_late(late) <= 820
    counters = node.arrivals.counters()
    assert counters['delayed'] == 1 and '1 samples were old' in counters['warning']
    assert counters['clock_offset_ms'] > 99_000
    assert 'warning' not in node.arrivals.counters(), 'told once'


def test_a_publishers_clock_set_back_holds_the_robot_for_a_while_and_then_is_known() -> None:
    node = Node()
    for _ in range(150):
        node.take()
    node.offset_ns = -3 * S
    ages = [node.take() for _ in range(250)]
    held = [age for age in ages if age > 2900]
    assert ages[0] > 2900 and 90 <= len(held) <= 205, '10 to 20 s'
    assert ages[-1] <= 2.0


def test_a_publishers_clock_set_forward_changes_nothing() -> None:
    node = Node()
    for _ in range(20):
        node.take()
    node.offset_ns = 3 * S
    assert all(node.take() <= 2.0 for _ in range(20))


def test_our_own_clock_set_back_during_a_freeze_makes_nothing_younger() -> None:
    node = Node()
    for _ in range(20):
        node.take()
    waiting = node.sample()
    node.freeze(1.5)
    node.set_ns -= 10 * S
    assert node.took_late(waiting) >= 1500
    assert node.gaps.clock_steps == 1


def test_a_suspended_machine_is_a_frozen_one() -> None:
    node = Node()
    for _ in range(20):
        node.take()
    waiting = node.sample()
    node.freeze(3600.0)  # CLOCK_BOOTTIME counts it
    assert node.took_late(waiting) >= 3_599_000


def test_what_is_latched_is_as_old_as_its_publisher_says() -> None:
    node = Node(latched=True)
    kept = node.sample()
    node.run(30.0)
    assert node.took_late(kept) >= 29_000


def test_without_a_source_time_only_our_own_gaps_are_known() -> None:
    node = Node()
    node.run(1.0)
    assert node.age_ms({}) == 0.0
    node.freeze(1.0)
    assert node.age_ms({}) >= 1000


@given(st.lists(st.tuples(
    st.integers(0, 3 * S), st.integers(-20 * S, 20 * S), st.integers(0, 5 * S)), max_size=40),
    st.integers(-10**6 * S, 10**6 * S), st.booleans())
def test_no_age_is_negative_whatever_the_clocks_do(
        moves: list[tuple[int, int, int]], offset_ns: int, latched: bool) -> None:
    node = Node(offset_ns, latched)
    for passed_ns, set_ns, waits_ns in moves:
        info = node.sample()
        node.boot_ns += passed_ns
        node.set_ns += set_ns
        info['source_timestamp'] -= waits_ns
        assert node.arrivals.age_ns(info) >= 0
