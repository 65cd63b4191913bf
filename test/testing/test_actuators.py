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


"""The contract of actuators, held by wheels that do not stop by themselves."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from rt_robot_os.base.errors import TopicError
from rt_robot_os.devices import Input
from rt_robot_os.testing import ActuatorContract
from rt_robot_os.testing import settings_of
from wheels.driver import Wheels
from wheels.simulated import SimulatedWheels
from wheels.wire import order


class Contract(ActuatorContract):
    """Not collected: its name does not begin with Test."""

    actuator = Wheels
    simulated = SimulatedWheels
    speed = 0.5

    def fill(self, message: Any, speed: float) -> None:
        message.linear.x = speed

    def moves(self, simulated: Any) -> bool:
        return bool(simulated.speed_mm_s)


class TestWheels(Contract):
    """The wheels keep it."""


# --- the faults ---------------------------------------------------------------------------------

class NeverStops(Wheels):
    def safe_state(self) -> None:
        """Do nothing."""


class TakesNonsense(Wheels):
    def actuate(self, now_ns: int) -> None:
        speed = round(self.command.msg.linear.x * 1000.0)
        self.send(order(speed, speed))


class Repeats(Wheels):
    """Send the last speed with each poll, whether it is in force or not."""

    last = b''

    def actuate(self, now_ns: int) -> None:
        speed = round(min(self.command.msg.linear.x, 1.0) * 1000.0)
        self.last = order(speed, speed)

    def write(self, now_ns: int) -> None:
        if self.last:
            self.send(self.last)


class KnowsNoAge(Wheels):
    def receive(self, now_ns: int, polled: bool) -> int:
        if self.command.latest():
            self.actuate(now_ns)
        return 0


class KeepsWhatWaits(Wheels):
    def rest(self) -> None:
        self._deadline_ns = 0
        self.safe_state()


class Waits(Wheels):
    command = Input('cmd_vel', message='geometry_msgs/msg/Twist')


@pytest.mark.parametrize('fault, name, arguments', [
    (NeverStops, 'test_a_command_moves_it_until_it_is_too_old', ()),
    (NeverStops, 'test_closing_brings_it_to_rest', ()),
    (NeverStops, 'test_after_it_was_unplugged_it_waits_for_a_new_command', ()),
    (TakesNonsense, 'test_what_is_no_number_harms_nothing', (math.nan,)),
    (TakesNonsense, 'test_what_is_no_number_harms_nothing', (math.inf,)),
    (Repeats, 'test_a_command_moves_it_until_it_is_too_old', ()),
    (KnowsNoAge, 'test_a_command_moves_it_until_it_is_too_old', ()),
    (KnowsNoAge, 'test_a_stamp_of_the_future_keeps_nothing_moving', ()),
    (KeepsWhatWaits, 'test_after_it_was_unplugged_it_waits_for_a_new_command', ()),
    (Waits, 'test_its_command_has_a_type_and_releases_it', None),
], ids=lambda value: getattr(value, '__name__', ''))
def test_a_planted_fault_is_caught(tmp_path: Path, fault: type[Wheels], name: str,
                                   arguments: tuple[Any, ...] | None) -> None:
    contract = type('Changed', (Contract,), {'actuator': fault})()
    test = getattr(contract, name)
    with pytest.raises((AssertionError, ValueError)):
        if arguments is None:
            test()
        else:
            with contract.made(tmp_path) as rig:
                test(rig, *arguments)


def test_an_actuator_without_a_command_is_refused() -> None:
    class Deaf(Wheels):
        command = None  # type: ignore[assignment]

    with pytest.raises(TopicError, match='base: Deaf has no command: an actuator declares'):
        Deaf('base', settings_of(Wheels, port='x'))
