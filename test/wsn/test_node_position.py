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

"""Where a node is that nobody surveyed."""

import math
import random

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rt_robot_os.features.wsn.sensor_network.node_position import distance_of_lqi
from rt_robot_os.features.wsn.sensor_network.node_position import estimate
from rt_robot_os.features.wsn.sensor_network.node_position import LinkLog
from rt_robot_os.features.wsn.sensor_network.node_position import lqi_of_link_cost
from rt_robot_os.features.wsn.sensor_network.node_position import MOST_LINKS
from rt_robot_os.features.wsn.sensor_network.node_position import PositionLink

ROOM = [(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0), (5.0, 4.0)]


@pytest.mark.parametrize('factor', [0.5, 1.0, 2.5])
def test_true_distances_give_the_place_whatever_their_scale(factor: float) -> None:
    found = estimate([PositionLink(x, y, factor * math.dist((x, y), (7.0, 2.5))) for x, y in ROOM])
    assert found is not None
    assert math.dist(found[:2], (7.0, 2.5)) < 0.7


def test_noisy_links_give_a_place_as_sure_as_it_says() -> None:
    chance, within, errors = random.Random(3), 0, []
    for _ in range(200):
        true = chance.uniform(0, 10), chance.uniform(0, 8)
        found = estimate([
            PositionLink(x, y, math.dist((x, y), true) * math.exp(chance.gauss(0, 0.5)))
            for x, y in [*ROOM, (3.0, 6.0), (8.0, 5.0)]])
        assert found is not None
        errors.append(math.dist(found[:2], true))
        within += errors[-1] < 2.5 * found.stddev_m
    assert within >= 180
    assert sorted(errors)[100] < 3.0


def test_one_link_says_about_where() -> None:
    found = estimate([PositionLink(3.0, 4.0, 6.0)])
    assert found == (3.0, 4.0, 6.0) and estimate([]) is None


def test_a_robot_that_drives_past_finds_a_node() -> None:
    log, chance = LinkLog(), random.Random(5)
    for step in range(20):
        x, y = 0.5 * step, 1.0 if step < 10 else 4.0
        distance = math.dist((x, y), (4.0, 3.0))
        # A room with furniture, and a weaker sender than the estimate thinks of.
        snr = 40.0 - 28.0 * math.log10(distance) + chance.gauss(0.0, 2.0)
        log.note(('sink', step), x, y, 0, float(np.interp(
            snr, (2, 5, 8, 12, 17, 30), (79, 89, 97, 104, 106.6, 107.3))))
    found = log.place(0)
    assert found is not None and math.dist(found[:2], (4.0, 3.0)) < 2.0


def test_a_straight_way_does_not_say_on_which_side() -> None:
    found = estimate([PositionLink(0.5 * step, 1.0, math.dist((0.5 * step, 1.0), (4.0, 3.0)))
                      for step in range(16)])
    assert found is not None
    assert found.y == pytest.approx(1.0, abs=0.01) and found.stddev_m > 1.5


def test_what_somebody_wears_is_where_it_was_heard_last() -> None:
    log = LinkLog()
    log.age_ns = 20
    log.note('hall', 0.0, 0.0, 10, 105.0)
    log.note('bed', 8.0, 3.0, 40, 105.0)
    found = log.place(45)
    assert found is not None and found[:2] == (8.0, 3.0)
    assert log.place(100) is None


def test_that_a_link_is_used_says_less_than_how_good_it_is() -> None:
    log = LinkLog()
    log.note('hall', 0.0, 0.0, 10, 80.0)
    far = log.place(10)
    for now_ns in range(20, 100):
        log.note('hall', 0.0, 0.0, now_ns)
    assert log.place(100) == pytest.approx(far)


def test_links_are_bounded() -> None:
    log = LinkLog()
    for each in range(100):
        log.note(each, float(each), 0.0, 0, 100.0)
    assert len(log) == MOST_LINKS


@pytest.mark.parametrize(('lqi', 'cost'), [(110, 125), (100, 420), (80, 1950), (50, 8000)])
def test_a_link_cost_is_an_lqi(lqi: int, cost: int) -> None:
    assert lqi_of_link_cost(cost) == pytest.approx(lqi, abs=0.1)


def test_a_better_link_is_nearer() -> None:
    found = [distance_of_lqi(lqi) for lqi in range(50, 111, 5)]
    assert found == sorted(found, reverse=True)


@settings(max_examples=50)
@given(st.lists(st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(0.1, 1e3)),
                min_size=1, max_size=32))
def test_any_links_give_a_finite_place(links: list[tuple[float, float, float]]) -> None:
    found = estimate([PositionLink(*each) for each in links])
    assert found is not None and all(map(math.isfinite, found)) and found.stddev_m > 0.0
