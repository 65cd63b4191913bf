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


"""When beacons go, and what a link is held to cost."""

from __future__ import annotations

from itertools import pairwise
from random import Random

from fake_node import FakeNode
from hypothesis import given
from hypothesis import strategies as st
from rt_robot_os.features.wsn.packets.ctp import Neighbour
from rt_robot_os.features.wsn.routing.link_estimator import LinkEstimator
from rt_robot_os.features.wsn.routing.link_estimator import TABLE_SIZE
from rt_robot_os.features.wsn.routing.link_estimator import UNKNOWN_ETX
from rt_robot_os.features.wsn.routing.protocol import BINARY_MS_NS
from rt_robot_os.features.wsn.routing.tinyos_random import TinyOsRandom
from rt_robot_os.features.wsn.routing.trickle import Trickle


class Beacons:
    """A trickle timer, and when it called."""

    def __init__(self, seed: int = 1, minimum_ms: int = 128, maximum_ms: int = 512_000) -> None:
        self.node = FakeNode(seed)
        self.at_ms: list[float] = []
        self.trickle = Trickle(self.node, self._call, minimum_ms, maximum_ms)
        self.trickle.reset()

    def _call(self) -> None:
        self.at_ms.append(self.node.time_ns / BINARY_MS_NS)

    def run(self, duration_ms: float) -> None:
        """Go on for so many 1/1024 s."""
        self.node.run_binary_ms(duration_ms)


@given(st.integers(0, 0xFFFE), st.integers(1, 10), st.integers(0, 12))
def test_a_beacon_goes_in_the_second_half_of_each_interval(seed: int, half: int,
                                                           doublings: int) -> None:
    minimum_ms = 2 * half
    maximum_ms = minimum_ms << doublings
    beacons = Beacons(seed, minimum_ms, maximum_ms)
    begin_ms, interval_ms = 0, minimum_ms
    for number in range(doublings + 3):
        beacons.run(begin_ms + interval_ms - beacons.node.time_ns / BINARY_MS_NS - 1e-3)
        assert len(beacons.at_ms) == number + 1
        assert begin_ms + interval_ms / 2 - 1e-3 <= beacons.at_ms[-1] < begin_ms + interval_ms
        begin_ms += interval_ms
        interval_ms = min(2 * interval_ms, maximum_ms)


def test_the_first_beacon_goes_when_the_random_numbers_of_tinyos_say() -> None:
    # 64 and the remainder by 64 of 16,807 times the address and 1.
    for address, at_ms in ((0, 103), (1, 78), (2, 117), (3, 92)):
        beacons = Beacons(address)
        beacons.run(128)
        assert [round(one) for one in beacons.at_ms] == [at_ms]


def test_a_quiet_node_sends_a_beacon_in_eight_minutes() -> None:
    beacons = Beacons()
    beacons.run(3_600_000)
    assert beacons.trickle.interval_ms == 512_000
    assert all([256_000 <= later - sooner <= 768_000
                for sooner, later in list(pairwise(beacons.at_ms))[-4:]])


@given(st.integers(1, 100_000))
def test_after_a_reset_the_next_beacon_goes_within_an_eighth_of_a_second(before_ms: int) -> None:
    beacons = Beacons()
    beacons.run(before_ms)
    count = len(beacons.at_ms)
    beacons.trickle.reset()
    beacons.run(128)
    assert len(beacons.at_ms) == count + 1
    assert beacons.trickle.interval_ms in (128, 256)


def test_a_stopped_trickle_is_silent_until_it_is_reset() -> None:
    beacons = Beacons()
    beacons.trickle.stop()
    beacons.run(10_000)
    assert beacons.at_ms == []
    beacons.trickle.reset()
    beacons.run(128)
    assert len(beacons.at_ms) == 1


def no() -> bool:
    """Be nobody better."""
    return False


class Links(LinkEstimator):
    """A table, and who lost the place in it."""

    __slots__ = ('gone',)

    def __init__(self, seed: int = 1) -> None:
        self.gone: list[int] = []
        super().__init__(TinyOsRandom(seed), self.gone.append)

    def hear(self, address: int, *sequences: int) -> None:
        """Take beacons with these numbers."""
        for sequence in sequences:
            self.receive_beacon(address, sequence & 0xFF, no)


def test_three_beacons_make_a_link_mature() -> None:
    links = Links()
    links.hear(7, 0, 1)
    assert links.etx(7) == UNKNOWN_ETX
    assert links.footer(7) == ()
    links.hear(7, 2)
    assert links.etx(7) == 10
    assert links.footer(7) == (Neighbour(7, 250),)


def test_lost_beacons_make_a_link_dearer() -> None:
    links = Links()
    # Two of three came in: 166 of 250, 2500 / 166 tenths.
    links.hear(7, 0, 2)
    assert links.footer(7) == (Neighbour(7, 166),)
    assert links.etx(7) == 15
    # All three of the next: (9 * 166 + 250) / 10 = 174, and ETX (9 * 15 + 14) / 10.
    links.hear(7, 3, 4, 5)
    assert links.footer(7) == (Neighbour(7, 174),)
    assert links.etx(7) == 14


def test_five_transmissions_count_as_one_estimate() -> None:
    links = Links()
    links.hear(7, 0, 1, 2)
    assert [links.sent(7, True) for _ in range(4)] == [False] * 4
    assert links.sent(7, False)
    assert links.etx(7) == (9 * 10 + 50 // 4) // 10
    # Of the next five none gets through: 5 transmissions for none count as 50 tenths.
    for _ in range(5):
        links.sent(7, False)
    assert links.etx(7) == (9 * 10 + 50) // 10


def test_without_any_success_each_failure_counts() -> None:
    links = Links()
    links.hear(7, 0, 1, 2)
    seen = []
    for _ in range(8):
        links.sent(7, False)
        seen.append(links.etx(7))
    # 50, 60, 70, 80 tenths go into the average one after the other.
    assert seen == [10, 10, 10, 10, 14, 18, 23, 28]
    links.sent(7, True)
    assert links.etx(7) == (9 * 28 + 90) // 10
    links.sent(7, False)
    assert links.etx(7) == (9 * 28 + 90) // 10


def test_more_than_ten_lost_beacons_make_a_link_unknown_again() -> None:
    links = Links()
    links.hear(7, 0, 1, 2)
    links.hear(7, 12)
    assert links.etx(7) != UNKNOWN_ETX
    links.hear(7, 23)
    assert links.etx(7) == UNKNOWN_ETX
    links.hear(7, 24, 25)
    assert links.etx(7) == 10


def test_a_full_table_takes_no_stranger() -> None:
    links = Links()
    for address in range(TABLE_SIZE):
        links.hear(address, 0, 1, 2)
    links.hear(99, 0, 1, 2)
    assert links.etx(99) == UNKNOWN_ETX
    assert links.gone == []


def test_the_worst_link_makes_room_and_a_pinned_one_does_not() -> None:
    links = Links()
    for address in range(TABLE_SIZE):
        links.hear(address, 0, 1, 2)
    for address in 3, 4:
        for _ in range(20 + address):
            links.sent(address, False)
    links.pin(4)
    links.hear(99, 0)
    assert links.gone == [3]
    # The beacon that opened the place does not count, and the next one counts as the first.
    links.hear(99, 20, 21)
    assert links.etx(99) == UNKNOWN_ETX
    links.hear(99, 22)
    assert links.etx(99) == 10


def test_a_better_neighbour_takes_the_place_of_one_that_is_not_known_yet() -> None:
    links = Links()
    for address in range(TABLE_SIZE):
        links.hear(address, *((0, 1, 2) if address != 5 else (0,)))
    links.receive_beacon(99, 0, lambda: True)
    assert links.gone == [5]


def test_a_root_gets_room_at_the_cost_of_the_worst() -> None:
    links = Links()
    for address in range(TABLE_SIZE):
        links.hear(address, 0, 1, 2)
    for _ in range(5):
        links.sent(6, False)
    assert links.insert(99)
    assert links.gone == [6]
    for address in range(TABLE_SIZE):
        links.pin(address)
    links.pin(99)
    assert not links.insert(98)


def test_the_footer_tells_of_all_neighbours_in_turn() -> None:
    links = Links()
    for address in range(TABLE_SIZE):
        links.hear(address, 0, 1, 2)
    told = [[one.address for one in links.footer(7)] for _ in range(3)]
    assert told == [[1, 2, 3, 4, 5, 6, 7], [8, 9, 0, 1, 2, 3, 4], [5, 6, 7, 8, 9, 0, 1]]


@given(st.data())
def test_whatever_comes_the_table_keeps_its_bounds(data: st.DataObject) -> None:
    links = Links()
    address = st.integers(0, 15)
    for _ in range(data.draw(st.integers(0, 120))):
        kind = data.draw(st.integers(0, 5))
        who = data.draw(address)
        if kind <= 2:
            links.receive_beacon(who, data.draw(st.integers(0, 255)), lambda: bool(who & 1))
        elif kind == 3:
            links.sent(who, data.draw(st.booleans()))
        elif kind == 4:
            links.insert(who)
        else:
            links.pin(who)
        known = [one for one in range(16) if links.etx(one) != UNKNOWN_ETX]
        assert len(known) <= TABLE_SIZE
        assert all([0 <= links.etx(one) <= 0xFFFF for one in known])
        assert {one.address for one in links.footer(TABLE_SIZE)} == set(known)


@given(st.integers(0, 2**32), st.floats(0.3, 1.0))
def test_the_estimate_comes_near_to_the_true_number_of_transmissions(seed: int,
                                                                     share: float) -> None:
    links = Links()
    links.hear(7, 0, 1, 2)
    chance = Random(seed)
    seen = []
    for number in range(1500):
        links.sent(7, chance.random() < share)
        if number > 300:
            seen.append(links.etx(7))
    # The mean of quotients over windows of five is above the quotient of the means, and what is
    # cut off in each step of the average below it.
    assert 0.55 * 10 / share <= sum(seen) / len(seen) <= 2.2 * 10 / share
