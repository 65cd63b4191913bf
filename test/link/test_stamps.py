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

"""Stamps follow the time of day and never run backwards."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from rt_robot_os.link.stamp_mapper import StampMapper

S = 1_000_000_000


class Clocks:
    """A CLOCK_MONOTONIC and a system clock that somebody sets."""

    def __init__(self) -> None:
        self.monotonic = 5 * S
        self.offset = 1_700_000_000 * S

    def mapper(self) -> StampMapper:
        return StampMapper(lambda: self.monotonic, lambda: self.monotonic + self.offset)


def test_stamps_are_the_time_of_day() -> None:
    clocks = Clocks()
    line = clocks.mapper().line()
    clocks.monotonic += S
    assert line.wall_ns(clocks.monotonic) == clocks.monotonic + clocks.offset


def test_a_step_forward_is_followed_at_once() -> None:
    clocks = Clocks()
    mapper = clocks.mapper()
    clocks.offset += 3600 * S
    mapper.compare()
    assert mapper.line().wall_ns(clocks.monotonic) == clocks.monotonic + clocks.offset
    assert mapper.forward_steps == 1


def test_after_a_step_back_intervals_keep_within_five_percent_until_it_caught_up() -> None:
    clocks = Clocks()
    mapper = clocks.mapper()
    line = mapper.line()
    clocks.offset -= S
    before = line.wall_ns(clocks.monotonic)
    for _ in range(250):
        clocks.monotonic += S // 10
        mapper.compare()
        now = line.wall_ns(clocks.monotonic)
        assert 0.949 * S / 10 <= now - before <= S / 10
        before = now
    assert before == clocks.monotonic + clocks.offset
    assert mapper.forward_steps == 0


@given(st.lists(st.tuples(
    st.integers(0, 10 * S), st.integers(-10**4 * S, 10**4 * S), st.integers(0, S)),
    min_size=1, max_size=60))
def test_no_step_of_the_clock_makes_a_topic_run_backwards(
        moves: list[tuple[int, int, int]]) -> None:
    clocks = Clocks()
    mapper = clocks.mapper()
    line = mapper.line()
    last_stamp = clocks.monotonic
    last_wall = 0
    for elapsed, step, age in moves:
        clocks.monotonic += elapsed
        clocks.offset = max(0, clocks.offset + step)
        mapper.compare()
        last_stamp = max(last_stamp, clocks.monotonic - age)
        wall = line.wall_ns(last_stamp)
        assert wall > last_wall
        last_wall = wall


def test_a_clock_that_runs_as_it_likes_is_followed_as_it_is() -> None:
    clocks = Clocks()
    mapper = clocks.mapper()
    line = mapper.line()
    real = line.wall_ns(clocks.monotonic)
    mapper.follows = True
    clocks.offset = -clocks.monotonic + 1000 * S  # simulated time, at 1000 s
    mapper.compare()
    assert line.wall_ns(clocks.monotonic) == 1000 * S < real
    for _ in range(20):  # it stands still
        clocks.monotonic += S // 20
        clocks.offset -= S // 20
        mapper.compare()
        stamp = line.wall_ns(clocks.monotonic)
    assert 1000 * S < stamp < 1000 * S + 100
    assert mapper.resets == 1
    clocks.offset -= 500 * S  # begun anew
    mapper.compare()
    assert line.wall_ns(clocks.monotonic) == 500 * S
    assert mapper.resets == 2
