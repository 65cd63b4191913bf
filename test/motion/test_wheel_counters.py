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

"""Angles of wheels from counters that wrap, are reset and are misread."""

from __future__ import annotations

import math
import random

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.motion.wheel_counters import CounterReading
from rt_robot_os.motion.wheel_counters import WheelCounters

TICK_RAD = math.tau / 1440
FASTEST_RAD_S = 30.0
PERIOD_NS = 33 * NS_PER_MS
# What wheels can turn between two readings.
MOST = math.floor(FASTEST_RAD_S * 0.033 / TICK_RAD)


def made(bits: int = 32, left: float = TICK_RAD, right: float = TICK_RAD,
         most: float = 0.0) -> WheelCounters:
    return WheelCounters(left, right, bits=bits, fastest_rad_s=FASTEST_RAD_S, most=most)


def fed(counters: WheelCounters, *readings: tuple[float, float]) -> list[CounterReading]:
    """Feed readings a period apart."""
    at_ns = counters.stamp_ns or PERIOD_NS
    return [counters.update(left, right, at_ns + (n + 1) * PERIOD_NS)
            for n, (left, right) in enumerate(readings)]


def ticks(counters: WheelCounters) -> tuple[int, int]:
    left, right = counters.position_rad
    return round(left / TICK_RAD), round(right / TICK_RAD)


def test_the_angles_begin_where_the_robot_does() -> None:
    counters = made()
    fed(counters, (5000, -700), (5010, -720))
    assert ticks(counters) == (10, -20)
    assert counters.velocity_rad_s == pytest.approx(
        (10 * TICK_RAD / 0.033, -20 * TICK_RAD / 0.033))


def test_an_inverted_wheel_counts_backwards() -> None:
    counters = made(right=-TICK_RAD)
    fed(counters, (0, 0), (10, -10))
    assert ticks(counters) == (10, 10)


@pytest.mark.parametrize('bits', [16, 32])
def test_a_counter_that_wraps_goes_on(bits: int) -> None:
    counters = made(bits)
    top = 1 << bits
    fed(counters, (top - 10, 5), (10, top - 5), (20, top - 15))
    assert ticks(counters) == (30, -20)
    assert (counters.rejected, counters.resets) == (0, 0)


@given(st.lists(st.tuples(st.integers(-MOST, MOST), st.integers(-MOST, MOST)), max_size=60),
       st.sampled_from([16, 32]), st.integers(0, 2**32), st.booleans())
@settings(max_examples=60, deadline=None)
def test_any_movement_is_followed_exactly(steps: list[tuple[int, int]], bits: int, start: int,
                                          signed: bool) -> None:
    counters = made(bits)
    mask, sign = (1 << bits) - 1, 1 << (bits - 1) if signed else 0
    left = right = start
    total = [0, 0]
    at_ns = PERIOD_NS
    counters.update(((left + sign) & mask) - sign, ((right + sign) & mask) - sign, at_ns)
    for a, b in steps:
        # Any speed, held long enough to be believed.
        for _ in range(4):
            left, right = left + a, right + b
            shown = ((left + sign) & mask) - sign, ((right + sign) & mask) - sign
            if shown == (0, 0):
                left, right, shown = left + 1, right + 1, (1, 1)  # it might be a reset
            total = [left - start, right - start]
            at_ns += PERIOD_NS
            counters.update(*shown, at_ns)
        assert ticks(counters) == tuple(total)
    assert counters.resets == 0


def test_a_misread_count_moves_nothing_and_loses_nothing() -> None:
    counters = made()
    readings = fed(counters, (5000, 5000), (5010, 5010), (501, 5020), (5030, 5030))
    assert readings == [CounterReading.TAKEN, CounterReading.TAKEN, CounterReading.REJECTED,
                        CounterReading.TAKEN]
    assert ticks(counters) == (30, 30)
    assert (counters.rejected, counters.resets) == (1, 0)


def test_counters_that_start_anew_move_nothing() -> None:
    counters = made()
    readings = fed(counters, (50_000, 50_000), (50_010, 50_010), (120, 3), (130, 8), (140, 13),
                   (150, 18), (160, 23), (170, 28))
    assert readings[2:] == [CounterReading.REJECTED] * 4 + [CounterReading.REBASED,
                                                            CounterReading.TAKEN]
    assert ticks(counters) == (60, 35)
    assert counters.resets == 1
    assert counters.velocity_rad_s == pytest.approx(
        (10 * TICK_RAD / 0.033, 5 * TICK_RAD / 0.033))


def test_a_reset_shortly_after_the_start_is_noticed() -> None:
    counters = made()
    readings = fed(counters, (0, 0), (20, 20), (40, 40), (0, 0), (5, 5))
    assert readings[3:] == [CounterReading.REBASED, CounterReading.TAKEN]
    assert ticks(counters) == (45, 45)


def test_driving_back_to_the_start_is_no_reset() -> None:
    counters = made()
    readings = fed(counters, (60, 60), (40, 40), (20, 20), (0, 0), (-20, -20))
    assert readings == [CounterReading.TAKEN] * 5
    assert ticks(counters) == (-80, -80)


def test_after_a_silence_counts_near_zero_are_those_of_a_reset() -> None:
    counters = made()
    fed(counters, (0, 0), (20, 20), (40, 44))
    counters.expect_reset()
    assert fed(counters, (3, 2), (4, 4)) == [CounterReading.REBASED, CounterReading.TAKEN]
    assert ticks(counters) == (41, 46)
    counters.expect_reset()
    assert fed(counters, (10, 10)) == [CounterReading.TAKEN]
    assert ticks(counters) == (47, 52)


def test_another_board_moves_nothing() -> None:
    counters = made()
    fed(counters, (100, 100), (110, 110))
    counters.restart()
    assert fed(counters, (120, 150), (130, 160)) == [CounterReading.TAKEN] * 2
    assert ticks(counters) == (20, 20)


def test_the_jump_may_be_set() -> None:
    counters = made(most=5)
    assert fed(counters, (1, 1), (6, 6), (12, 6)) == [
        CounterReading.TAKEN, CounterReading.TAKEN, CounterReading.REJECTED]


def test_what_surprises_is_added_when_it_is_sure() -> None:
    # Somebody turns the wheel, or many answers stayed away.
    counters = made()
    readings = fed(counters, (0, 0), (1, 1), (150, 1), (300, 1), (450, 1), (600, 1))
    assert readings[2:] == [CounterReading.REJECTED] * 2 + [CounterReading.TAKEN] * 2
    assert ticks(counters) == (600, 1)
    assert counters.resets == 0


def test_misread_counts_in_a_row_move_nothing() -> None:
    counters = made()
    fed(counters, (2337, 3311), (2342, 3316), (234, 3321), (2351, 332), (235, 332), (2362, 3338))
    assert ticks(counters) == (25, 27)
    assert (counters.rejected, counters.resets) == (3, 0)


def test_turns_that_are_no_numbers_are_held_back() -> None:
    counters = WheelCounters(math.tau, math.tau, bits=0, fastest_rad_s=FASTEST_RAD_S)
    readings = fed(counters, (0.5, 0.5), (math.nan, 0.5), (0.6, math.inf), (0.7, 0.3))
    assert readings == [CounterReading.TAKEN, CounterReading.REJECTED, CounterReading.REJECTED,
                        CounterReading.TAKEN]
    assert counters.position_rad == pytest.approx((0.2 * math.tau, -0.2 * math.tau))


def test_readings_that_come_together_are_no_speed() -> None:
    counters = made()
    fed(counters, (0, 0), (10, 10))
    before = counters.velocity_rad_s
    counters.update(11, 11, counters.stamp_ns + 1000)
    counters.update(12, 12, counters.stamp_ns)
    assert counters.velocity_rad_s == before
    fed(counters, (22, 22))
    assert counters.velocity_rad_s == pytest.approx(
        (12 * TICK_RAD / 0.033, 12 * TICK_RAD / 0.033), rel=1e-3)


@given(st.integers(0, 2**32), st.floats(0.0, 0.25), st.sampled_from([16, 32]))
@settings(max_examples=30, deadline=None)
def test_misread_counts_never_cost_anything(seed: int, share: float, bits: int) -> None:
    chance = random.Random(seed)
    counters = made(bits)
    at_ns, angle, speed, furthest = PERIOD_NS, 0.0, 0.0, 0.0
    counters.update(20_000, 20_000, at_ns)
    for n in range(150):
        at_ns += PERIOD_NS
        speed += chance.uniform(-40.0, 40.0) * 0.033
        speed = max(-20.0, min(speed, 20.0))
        angle += speed * 0.033
        true = round(angle / TICK_RAD) + 20_000
        wrong = n < 140 and chance.random() < share
        digits = str(true)
        cut = chance.randrange(len(digits))
        shown = int(digits[:cut] + digits[cut + 1:]) if wrong else true
        before = counters.position_rad[0]
        counters.update(shown, 20_000, at_ns)
        furthest = max(furthest, abs(counters.position_rad[0] - before))
    assert ticks(counters)[0] == true - 20_000
    assert counters.resets == 0
    assert furthest < FASTEST_RAD_S


def test_slow_readings_are_no_silence() -> None:
    counters = WheelCounters(TICK_RAD, TICK_RAD, bits=32, fastest_rad_s=FASTEST_RAD_S,
                             silence_s=1.5)
    for n, count in enumerate((0, 100, 200, 100, 30, -40)):
        counters.update(count, count, n * 500 * NS_PER_MS)
    assert ticks(counters) == (-40, -40)
    assert counters.resets == 0


def test_a_coarse_encoder_surprises_nobody() -> None:
    counters = WheelCounters(math.tau / 20, math.tau / 20, bits=32, fastest_rad_s=FASTEST_RAD_S)
    for n in range(400):
        count = math.floor(n * 0.13)
        assert counters.update(count, -count, (n + 1) * 10 * NS_PER_MS) is CounterReading.TAKEN
