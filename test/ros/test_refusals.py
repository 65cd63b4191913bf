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

"""What mirrors refuse is counted and told, and nobody floods the log with it."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from rt_robot_os.ros.conversions import Refusals  # noqa: E402, I100

S = 1_000_000_000


def test_a_reason_is_told_once_and_again_after_a_pause() -> None:
    told: list[str] = []
    refusals = Refusals('path -> way', told.append)
    for second in range(1, 60):
        refusals.add('wrong frame', second * S)
    refusals.add('wrong frame', 80 * S)
    assert told == ['path -> way: refused: wrong frame'] * 2
    assert refusals.counters()['refused'] == 60


def test_reasons_that_take_turns_are_a_line_a_second() -> None:
    told: list[str] = []
    refusals = Refusals('path -> way', told.append)
    for number in range(1000):  # ten seconds
        refusals.add(f'frame {number}', 100 * S + number * S // 100)
    assert len(told) == 10
    assert refusals.counters()['refused'] == 1000
