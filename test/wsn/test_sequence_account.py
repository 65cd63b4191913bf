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

"""What became of packets, by their numbers: against the truth of whoever sent them."""

from collections.abc import Iterator
from dataclasses import dataclass
import random

from hypothesis import assume
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.sensor_network.sequence_account import DUPLICATE
from rt_robot_os.features.wsn.sensor_network.sequence_account import LATE
from rt_robot_os.features.wsn.sensor_network.sequence_account import NEW
from rt_robot_os.features.wsn.sensor_network.sequence_account import SequenceAccount
from rt_robot_os.features.wsn.sensor_network.sequence_account import WINDOW

PERIOD_NS = NS_PER_S


@dataclass
class Arrival:
    """A packet at the sink: of which life of the node, its number unwrapped, when."""

    life: int
    number: int
    at_ns: int


@st.composite
def lives(draw: st.DrawFn) -> tuple[int, int, list[Arrival]]:
    """Make a node that reboots, on a network that loses, repeats, delays and reorders."""
    bits = draw(st.sampled_from((8, 16, 32)))
    chance = random.Random(draw(st.integers(0, 2 ** 32)))
    loss, again = draw(st.sampled_from((0.0, 0.1, 0.5))), draw(st.sampled_from((0.0, 0.3)))
    delay_ns = draw(st.sampled_from((0, NS_PER_S // 2, (3 if bits > 8 else 1) * NS_PER_S)))
    first = draw(st.sampled_from((0, 0, (1 << bits) - 20)))
    arrivals, at_ns = [], draw(st.integers(0, 3)) * NS_PER_S
    for life in range(draw(st.integers(1, 3))):
        count = draw(st.integers(12, 320))
        # Of 8 bits more can be told only by the clock, once the period is known well.
        outage_from = draw(st.integers(0, count))
        outage = range(outage_from, outage_from + draw(st.integers(
            0, 300 if outage_from > 50 or bits > 8 else 60)))
        start = first if life == 0 else 0
        for place in range(count):
            at_ns += PERIOD_NS
            is_lost = chance.random() < loss or place in outage
            if is_lost and 10 < place < count - 10:
                continue
            arrivals.append(Arrival(life, start + place, at_ns + chance.randrange(delay_ns + 1)))
            while chance.random() < again:
                arrivals.append(Arrival(life, start + place,
                                        arrivals[-1].at_ns + chance.randrange(2 * NS_PER_S)))
        at_ns += draw(st.integers(5, 40)) * NS_PER_S
    arrivals.sort(key=lambda each: each.at_ns)
    return bits, first, arrivals


def truth_of(arrivals: list[Arrival], first: int) -> tuple[int, int, int]:
    """Return what came, what came again, and what was lost."""
    came = {(each.life, each.number) for each in arrivals}
    lost = 0
    for life in {life for life, _ in came}:
        numbers = [number for each, number in came if each == life]
        lost += max(numbers) + 1 - (min(numbers) if life == 0 and first else 0) - len(numbers)
    return len(came), len(arrivals) - len(came), lost


def tellable(arrivals: list[Arrival], bits: int) -> Iterator[bool]:
    """
    Tell of each reboot whether the numbers can show it at once.

    They do not just go on, nor fill in what was missing shortly before.
    """
    highest: dict[int, Arrival] = {}
    came: set[tuple[int, int]] = set()
    for each in arrivals:
        for life in range(each.life if each.life not in highest else 0):
            last = highest[life]
            passed = (each.at_ns - last.at_ns) // PERIOD_NS
            yield 2 * passed + 20 < (each.number - last.number) % (1 << bits)
            yield (last.number - each.number) % (1 << bits) > 2 * WINDOW or all(
                (life, number) in came
                for number in range(max(0, last.number - 2 * WINDOW), last.number))
        came.add((each.life, each.number))
        if each.life not in highest or each.number > highest[each.life].number:
            highest[each.life] = each


@settings(max_examples=60, deadline=None)
@given(lives())
def test_what_was_lost_repeated_and_begun_again_is_the_truth(
        case: tuple[int, int, list[Arrival]]) -> None:
    bits, first, arrivals = case
    assume(all(tellable(arrivals, bits)))
    account = SequenceAccount(bits, 0)
    for each in arrivals:
        account.add(each.number % (1 << bits), hash((each.life, each.number)), each.at_ns)
    came, again, lost = truth_of(arrivals, first)
    assert (account.received, account.duplicates, account.lost) == (came, again, lost)
    assert account.reboots == len({each.life for each in arrivals}) - 1
    assert (account.jumps, account.strays, account.twins) == (0, 0, False)


def heard(account: SequenceAccount, numbers: list[int], from_s: float = 0.0, period_s: float = 1.0,
          node: str = '') -> list[int]:
    """Let packets come at a steady rate."""
    return [account.add(number, hash((node, number)), round((from_s + place * period_s) * 1e9))
            for place, number in enumerate(numbers, 1)]


def test_a_late_packet_is_no_loss_and_a_repeated_one_no_packet() -> None:
    account = SequenceAccount(16, 0)
    assert heard(account, [0, 1, 3, 2, 3, 5]) == [NEW, NEW, NEW, LATE, DUPLICATE, NEW]
    assert (account.received, account.lost, account.late, account.duplicates) == (5, 1, 1, 1)
    assert account.delivery == pytest.approx(5 / 6)


def test_what_was_sent_before_anybody_listened_is_not_lost() -> None:
    account = SequenceAccount(32, 0)
    heard(account, list(range(5000, 5020)))
    assert account.lost == 0


def test_what_was_sent_before_the_first_packet_came_is_lost() -> None:
    account = SequenceAccount(32, 0)
    heard(account, list(range(3, 20)), from_s=3.0)
    assert account.lost == 3


def test_another_rate_does_not_change_what_was_lost() -> None:
    account = SequenceAccount(32, 0)
    heard(account, list(range(3, 20)), from_s=3.0)
    heard(account, list(range(20, 60)), from_s=20.0, period_s=0.05)
    heard(account, list(range(60, 90)), from_s=22.0, period_s=30.0)
    assert account.lost == 3 and account.period_ns == pytest.approx(30e9, rel=0.3)


def test_two_nodes_with_one_number_are_found_and_both_counted() -> None:
    account = SequenceAccount(32, 0)
    for place in range(20):
        heard(account, [1000 + place], place, node='one')
        heard(account, [40 + 2 * place], place + 0.5, node='other')
    assert account.twins
    assert (account.received, account.reboots, account.strays) == (40, 0, 0)
    assert account.lost == 19


def test_two_nodes_that_began_together_are_found_as_well() -> None:
    account = SequenceAccount(16, 0)
    for place in range(20):
        heard(account, [place], place, node='one')
        heard(account, [place], place + 0.5, node='other')
    assert account.twins and account.received == 40 and account.lost == 0


def test_a_stray_number_changes_nothing() -> None:
    account = SequenceAccount(16, 0)
    heard(account, [*range(30), 20000, *range(30, 60), 5, *range(60, 80)])
    assert (account.lost, account.reboots, account.jumps) == (0, 0, 0)
    assert account.strays == 1 and account.highest == 79


def test_a_counter_that_jumps_is_no_loss() -> None:
    account = SequenceAccount(32, 0)
    heard(account, [*range(30), *range(100_000, 100_030)])
    assert (account.lost, account.reboots, account.jumps) == (0, 0, 1)


def test_an_outage_is_a_loss_however_long() -> None:
    account = SequenceAccount(8, 0)
    heard(account, list(range(100)))
    heard(account, [number % 256 for number in range(1100, 1150)], from_s=1100.0)
    assert (account.lost, account.reboots) == (1000, 0)


def test_a_node_that_begins_again_with_the_same_data_is_noticed() -> None:
    account = SequenceAccount(16, 0)
    heard(account, list(range(12)))
    heard(account, list(range(30)), from_s=15.0)
    assert (account.received, account.duplicates, account.lost) == (42, 0, 0)
    assert account.reboots == 1


@settings(max_examples=50, deadline=None)
@given(st.sampled_from((8, 16, 32)), st.lists(st.tuples(
    st.integers(0, 2 ** 32 - 1), st.integers(0, 3), st.integers(0, 10 ** 12))))
def test_any_numbers_at_any_time_are_counted(
        bits: int, packets: list[tuple[int, int, int]]) -> None:
    account = SequenceAccount(bits, 0)
    now_ns = 0
    for number, fingerprint, passed_ns in packets:
        now_ns += passed_ns
        account.add(number, fingerprint, now_ns)
    assert account.received + account.duplicates == len(packets)
    assert account.lost >= 0 and 0.0 <= account.delivery <= 1.0
