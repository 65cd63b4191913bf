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

"""Wheels that do not what they are told."""

from __future__ import annotations

from collections.abc import Callable
import math

import pytest
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.wheel_watch import WheelState
from rt_robot_os.motion.wheel_watch import WheelWatch

TICK_RAD = math.tau / 1440


def noticed(speed: Callable[[float], float], command: Callable[[float], float] = lambda s: 10.0,
            until_s: float = 3.0) -> tuple[WheelState, float]:
    """Return what a wheel is found to do, and when; its true speed and command over time."""
    watch = WheelWatch(patience_s=0.4, slowest_rad_s=1.0, noise_rad=2.5 * TICK_RAD)
    angle_rad = 0.0
    for n in range(round(until_s / 0.033)):
        time_s = n * 0.033
        angle_rad += speed(time_s) * 0.033
        shown_rad = math.floor(angle_rad / TICK_RAD) * TICK_RAD
        state = watch.update(command(time_s), shown_rad, round(n * 33 * NS_PER_MS))
        if state is not WheelState.RIGHT:
            return state, time_s
    return WheelState.RIGHT, until_s


def test_a_wheel_that_obeys_is_right() -> None:
    assert noticed(lambda s: 10.0)[0] is WheelState.RIGHT


@pytest.mark.parametrize('command', [10.0, -10.0, 1.2])
def test_an_encoder_that_stops_counting_is_noticed_within_half_a_second(command: float) -> None:
    state, at_s = noticed(lambda s: command if s < 1.0 else 0.0, lambda s: command)
    assert state is WheelState.STANDSTILL
    assert at_s < 1.5


def test_a_wheel_that_never_starts_is_noticed_within_half_a_second() -> None:
    assert noticed(lambda s: 0.0) == (WheelState.STANDSTILL, pytest.approx(0.43, abs=0.07))


def test_one_channel_alone_counts_to_and_fro() -> None:
    def shown(time_s: float) -> float:
        return TICK_RAD / 0.033 * (1 if round(time_s / 0.033) % 2 else -1)
    assert noticed(shown)[0] is WheelState.STANDSTILL


def test_a_slow_start_is_right() -> None:
    assert noticed(lambda s: 10.0 * (1 - math.exp(-s / 0.5)))[0] is WheelState.RIGHT


def test_a_command_that_friction_may_hold_is_not_watched() -> None:
    assert noticed(lambda s: 0.0, lambda s: 0.9)[0] is WheelState.RIGHT


def test_a_robot_that_is_not_commanded_may_stand() -> None:
    assert noticed(lambda s: 0.0, lambda s: 10.0 if s % 0.5 < 0.3 else 0.0)[0] is (
        WheelState.RIGHT)


@pytest.mark.parametrize('lag_s', [0.05, 0.2, 0.5])
def test_turning_round_takes_its_time(lag_s: float) -> None:
    state, _ = noticed(
        lambda s: 10.0 if s < 1.0 else -10.0 + 20.0 * math.exp(-(s - 1.0) / lag_s),
        lambda s: 10.0 if s < 1.0 else -10.0)
    assert state is WheelState.RIGHT


def test_a_wheel_that_runs_away_backwards_is_noticed() -> None:
    state, at_s = noticed(lambda s: -min(s * 60.0, 30.0))
    assert (state, at_s) == (WheelState.WRONG_WAY, pytest.approx(0.45, abs=0.1))


def test_it_is_noticed_again() -> None:
    watch = WheelWatch(patience_s=0.4, slowest_rad_s=1.0, noise_rad=2.5 * TICK_RAD)
    found = [n for n in range(100)
             if watch.update(10.0, 0.0, n * 33 * NS_PER_MS) is WheelState.STANDSTILL]
    assert len(found) == 7


def test_what_nobody_saw_is_held_against_nobody() -> None:
    watch = WheelWatch(patience_s=0.4, slowest_rad_s=1.0, noise_rad=2.5 * TICK_RAD)
    for n in range(10):
        watch.update(10.0, n * 0.33, n * 33 * NS_PER_MS)
    # Two seconds without a reading, as after a loose plug, and it stands where it was.
    found = [watch.update(10.0, 2.97, 2 * NS_PER_S + n * 33 * NS_PER_MS) for n in range(20)]
    assert found[:12] == [WheelState.RIGHT] * 12
    assert WheelState.STANDSTILL in found
