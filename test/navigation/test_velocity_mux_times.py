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

"""The multiplexer of velocities at the very ends of its time-outs, holds and silences."""

from __future__ import annotations

import math

import pytest

from rt_robot_os.features.navigation.velocity_mux.sources import chosen
from rt_robot_os.features.navigation.velocity_mux.sources import GOOD
from rt_robot_os.features.navigation.velocity_mux.sources import holder
from rt_robot_os.features.navigation.velocity_mux.sources import LATE
from rt_robot_os.features.navigation.velocity_mux.sources import Lock
from rt_robot_os.features.navigation.velocity_mux.sources import lock_level
from rt_robot_os.features.navigation.velocity_mux.sources import REFUSED
from rt_robot_os.features.navigation.velocity_mux.sources import STANDSTILL
from rt_robot_os.features.navigation.velocity_mux.sources import Switch
from rt_robot_os.features.navigation.velocity_mux.sources import VelocitySource

AHEAD = 0.5, 0.0, 0.0
NOW_NS = 10_000


def source(priority: int = 20, *, stamp_ns: int = NOW_NS, now_ns: int = NOW_NS,
           hold_ns: int = 0, dead_man: bool = False) -> VelocitySource:
    """Return a source with a time-out of 100 ns that has given one command."""
    found = VelocitySource('ros', priority, 100, dead_man, hold_ns)
    found.receive(AHEAD, STANDSTILL, stamp_ns, now_ns, 10.0, 20.0)
    return found


@pytest.mark.parametrize(('age_ns', 'late'), [(0, 0), (99, 0), (100, 1), (101, 1)])
def test_a_command_that_comes_as_old_as_its_time_out_is_late_and_counted(
        age_ns: int, late: int) -> None:
    found = source(stamp_ns=NOW_NS - age_ns)
    assert (found.late, found.last) == (late, LATE if late else GOOD)
    assert found.is_new is not bool(late)
    assert found.is_fresh(NOW_NS) is not bool(late)


def test_a_late_command_takes_nothing_from_the_one_before() -> None:
    found = source()
    found.receive(STANDSTILL, STANDSTILL, NOW_NS - 40, NOW_NS + 60, 10.0, 20.0)
    assert found.late == 1 and found.linear == AHEAD
    assert found.is_fresh(NOW_NS + 99)


@pytest.mark.parametrize(('after_ns', 'steers'), [(99, True), (100, False), (101, False)])
def test_a_source_steers_until_its_last_command_is_as_old_as_its_time_out(
        after_ns: int, steers: bool) -> None:
    found = source()
    assert (chosen([found], [], True, NOW_NS + after_ns) is found) is steers


def test_a_command_of_the_future_is_one_of_now() -> None:
    found = source(stamp_ns=NOW_NS + 10 ** 9)
    assert found.stamp_ns == NOW_NS and not found.is_fresh(NOW_NS + 100)


@pytest.mark.parametrize(('after_ns', 'kept_off'), [(299, True), (300, False)])
def test_who_has_steered_holds_the_robot_up_to_the_very_end_of_the_hold(
        after_ns: int, kept_off: bool) -> None:
    higher, now_ns = source(100, hold_ns=300), NOW_NS + after_ns
    higher.hold()
    lower = source(stamp_ns=now_ns, now_ns=now_ns)
    assert (chosen([higher, lower], [], True, now_ns) is None) is kept_off
    assert (holder([higher, lower], now_ns) is higher) is kept_off


def test_a_hold_is_at_least_as_long_as_the_time_out() -> None:
    found = source(hold_ns=50)
    found.hold()
    assert found.held_until_ns == NOW_NS + 100


@pytest.mark.parametrize(('value', 'refused'), [
    (10.0, 0), (-10.0, 0), (10.000001, 1), (-10.000001, 1), (math.nan, 1), (math.inf, 1)])
def test_a_speed_at_the_limit_is_taken_and_one_beyond_it_is_a_standstill(
        value: float, refused: int) -> None:
    found = source()
    found.receive((0.0, value, 0.0), STANDSTILL, NOW_NS, NOW_NS, 10.0, 20.0)
    assert found.refused == refused
    assert (found.last == REFUSED) is bool(refused) is (found.linear == STANDSTILL)
    assert found.is_fresh(NOW_NS)  # a mistake stops the robot: it is nobody else's turn


@pytest.mark.parametrize(('after_ns', 'silent'), [(99, False), (100, True), (101, True)])
def test_a_switch_is_silent_when_it_was_last_heard_as_long_ago_as_its_time_out(
        after_ns: int, silent: bool) -> None:
    dead_man, pause = Switch(100), Lock('pause', 50, 100)
    dead_man.update(True, NOW_NS)
    pause.update(False, NOW_NS)
    now_ns = NOW_NS + after_ns
    assert dead_man.is_held(now_ns) is not silent
    assert pause.is_locked(now_ns) is silent
    assert lock_level([pause], now_ns) == (50 if silent else -1)
    assert dead_man.silent_at_ns() == NOW_NS + 100


def test_a_switch_that_was_heard_at_the_first_moment_of_the_clock_was_heard() -> None:
    dead_man = Switch(100)
    assert not dead_man.is_held(0) and dead_man.silent_at_ns() == math.inf
    dead_man.update(True, 0)
    assert dead_man.is_held(99) and not dead_man.is_held(100)
    assert dead_man.silent_at_ns() == 100


def test_a_lock_without_a_time_out_is_never_silent() -> None:
    pause = Lock('pause', 50, 0)
    assert not pause.is_locked(10 ** 18) and pause.silent_at_ns() == math.inf
    pause.update(True, 0)
    assert pause.is_locked(10 ** 18)


def test_a_lock_holds_off_the_priority_just_below_it_and_no_other() -> None:
    pause = Lock('pause', 50, 0)
    pause.update(True, NOW_NS)
    for priority, steers in ((49, False), (50, True), (51, True)):
        found = source(priority)
        assert (chosen([found], [pause], True, NOW_NS) is found) is steers


def test_of_equal_priorities_the_first_steers() -> None:
    first, second = source(), source()
    assert chosen([first, second], [], True, NOW_NS) is first
    assert chosen([second, first], [], True, NOW_NS) is second


def test_who_needs_the_dead_man_switch_leaves_the_robot_to_others_without_it() -> None:
    teleop, ros = source(100, dead_man=True), source()
    assert chosen([teleop, ros], [], True, NOW_NS) is teleop
    assert chosen([teleop, ros], [], False, NOW_NS) is ros
