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

"""A robot that looks for itself where places look alike turns, if it may."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from rt_robot_os.features.mapping.process.recovery_spin import RecoverySpin
from rt_robot_os.features.mapping.settings import MappingSettings

STEP_NS = 40_000_000


class Looking:
    """Who looks for the robot; and what goes to the wheels."""

    is_searching = is_ambiguous = True

    def __init__(self, **settings: Any) -> None:
        self.now_ns = 0
        self.rates: list[float] = []
        self.round = RecoverySpin(MappingSettings(**settings), self,  # type: ignore[arg-type]
                                  self.publish, lambda topic: topic == 'cmd_vel')

    def publish(self, topic: str, message: bytes) -> bool:
        assert topic == 'cmd_vel'
        numbers = struct.unpack('<6d', message[4:])
        assert not any(numbers[:5])
        self.rates.append(numbers[5])
        return True

    def steps(self, count: int, may_drive: bool = False) -> list[float]:
        self.rates.clear()
        for _ in range(count):
            self.now_ns += STEP_NS
            self.round.step(self.now_ns, may_drive)
        return self.rates


@pytest.mark.parametrize('allowed, told', [(True, False), (False, True)])
def test_it_turns_until_it_has_found_itself(allowed: bool, told: bool) -> None:
    looking = Looking(find_turns=allowed)
    assert looking.steps(10, told) == [0.4] * 10
    assert looking.round.state == 'turning to look round'
    looking.is_searching = looking.is_ambiguous = False
    assert looking.steps(10, told) == [0.0] and looking.round.state == ''


def test_nobody_turns_a_robot_that_must_not_move() -> None:
    assert Looking().steps(10) == []
    assert Looking(find_turns=True, find_topic='').steps(10) == []
    assert Looking(find_turns=True, find_topic='nobody/reads').steps(10) == []


def test_after_a_whole_turn_it_asks_to_be_driven() -> None:
    looking = Looking(find_turns=True, find_turn_rad_s=1.0)
    rates = looking.steps(300)
    assert 6.28 < sum(rates) * STEP_NS / 1e9 < 8.0 and rates[-1] == 0.0
    assert looking.round.state == 'looked round: drive it elsewhere'
    assert looking.steps(50) == []
    looking.is_searching = False
    looking.steps(1)
    looking.is_searching = True  # somewhere else
    assert looking.steps(5) == [1.0] * 5
