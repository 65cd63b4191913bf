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


"""Cyclic garbage is collected in gaps, and nowhere else."""

from __future__ import annotations

import gc

import pytest

from rt_robot_os.core.garbage import SlackCollector
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock

US, MS, S = 1_000, 1_000_000, 1_000_000_000


class Collected:
    """A robot whose collections take a chosen time."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, takes_ns: int) -> None:
        self.clock = VirtualClock()
        self.kernel = Kernel(self.clock)
        self.takes_ns = takes_ns
        self.stolen_ns = 0
        self.computed_ns = 0
        self.at: list[int] = []
        monkeypatch.setattr(gc, 'collect', self.collect)
        self.collector = SlackCollector(self.clock.now_ns, lambda: self.computed_ns)
        self.told: list[str] = []
        self.collector.on_overdue = self.told.append
        self.kernel.on_idle = self.collector.idle
        self.collector.prime()
        self.at.clear()

    def collect(self) -> None:
        self.at.append(self.clock.now_ns())
        self.clock._now_ns += self.takes_ns + self.stolen_ns  # a native call: nothing preempts it
        self.computed_ns += self.takes_ns


def test_beside_a_fast_task_it_runs_in_the_gaps_about_once_a_second(
        monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Collected(monkeypatch, 100 * US)
    task = robot.kernel.add_task('fast', lambda: robot.clock.spend(300 * US), priority=50,
                                 rate_hz=1000.0)
    robot.kernel.run(10 * S)
    assert len(robot.at) == robot.collector.collections == 9
    assert task.latency.maximum_ns == 0
    assert robot.told == []


def test_a_collection_that_takes_longer_than_expected_is_given_more_room(
        monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Collected(monkeypatch, 100 * US)
    robot.kernel.add_task('fast', lambda: None, priority=50, rate_hz=1000.0)
    robot.kernel.add_task('rare', lambda: None, priority=50, rate_hz=0.2)
    robot.kernel.run(3 * S)
    robot.takes_ns = 600 * US
    before = len(robot.at)
    robot.kernel.run(10 * S)
    # Once within a millisecond; then there is no gap of twice that, and of once after 10 s.
    assert len(robot.at) - before == 1


def test_when_no_gap_is_wide_enough_people_are_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Collected(monkeypatch, 900 * US)
    task = robot.kernel.add_task('fast', lambda: robot.clock.spend(300 * US), priority=50,
                                 rate_hz=1000.0)
    robot.kernel.run(70 * S)
    assert robot.at == []
    assert len(robot.told) == 1 and 'which takes 900 us' in robot.told[0]
    assert task.latency.maximum_ns == 0


def test_after_a_long_wait_it_takes_a_gap_without_a_margin(
        monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Collected(monkeypatch, 600 * US)
    robot.kernel.add_task('fast', lambda: robot.clock.spend(100 * US), priority=50,
                          rate_hz=1000.0)
    robot.kernel.run(15 * S)
    assert len(robot.at) == 1 and 11 * S <= robot.at[0] < 12 * S


def test_time_that_linux_took_during_a_collection_keeps_none_of_the_next_away(
        monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Collected(monkeypatch, 300 * US)
    robot.kernel.add_task('imu', lambda: robot.clock.spend(200 * US), priority=50, rate_hz=200.0)
    robot.stolen_ns = 700 * MS  # as when the process is stopped
    robot.collector.prime()
    robot.stolen_ns = 0
    robot.at.clear()
    robot.kernel.run(100 * S)
    assert len(robot.at) > 90
    assert robot.told == []


def test_a_collection_that_took_long_once_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Collected(monkeypatch, 300 * US)
    robot.kernel.add_task('imu', lambda: robot.clock.spend(200 * US), priority=50, rate_hz=200.0)
    robot.kernel.add_task('rare', lambda: None, priority=40, rate_hz=0.2)
    robot.kernel.run(5 * S)
    robot.takes_ns = 20 * MS  # cold caches, a busy machine
    robot.kernel.run(S + 500 * MS)
    robot.takes_ns = 300 * US
    robot.at.clear()
    robot.kernel.run(200 * S)
    assert len(robot.at) > 20
    assert robot.told == []
