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

"""A robot of one motor board, simulated on a real pty, on the virtual clock."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import select
from typing import Any

from rt_robot_os.devices.motor_board import MotorBoard
from rt_robot_os.sim.motor_board import SimulatedMotorBoard
from rt_robot_os.testing.actuator_rig import ActuatorRig

WHEELS = {'wheel_radius_m': 0.05, 'wheel_separation_m': 0.3, 'ticks_per_revolution': 1440.0}


def fill(message: Any, speed: float) -> None:
    """Fill in a command straight on."""
    message.linear.x = speed


class BoardRobot(ActuatorRig):
    """
    A robot whose topics can be read, and whose board is read on interrupt.

    :ivar disturb: called each millisecond, before what the board has sent is read.
    """

    def __init__(self, folder: Path, driver: type[MotorBoard[Any]],
                 simulated: type[SimulatedMotorBoard], sim: dict[str, Any],
                 fill: Callable[[Any, float], None] = fill, **settings: Any) -> None:
        super().__init__(folder, driver, simulated, fill, sim, **settings)
        self.readers = {topic: self.bus.subscribe(topic, 'test') for topic in (
            each.topic for each in self.device.publications())}
        self._sent = 0
        self.disturb: Callable[[], object] | None = None
        self.each = self._interrupt

    def _interrupt(self) -> None:
        if self.disturb is not None:
            self.disturb()
        sent, self._sent = self._sent, self.simulated.port.bytes_sent
        descriptor = self.device.fileno()
        if self._sent != sent and descriptor is not None and self.simulated.port.plugged:
            select.select([descriptor], [], [], 5.0)
            assert self.managed.arrival is not None
            self.kernel.release(self.managed.arrival)

    def take(self, topic: str, pick: Callable[[Any], Any] = lambda msg: msg.data) -> list[Any]:
        """Give the samples since the last time, each as ``pick`` looks at it."""
        reader, found = self.readers[topic], []
        while reader.take():
            found.append(pick(reader.msg))
        return found

    def faults(self) -> int:
        """Give all bits of motor_faults since the last time."""
        bits = 0
        for each in self.take('motor_faults'):
            bits |= int(each)
        return bits

    def odometry_error_rad(self) -> float:
        """Compare what the driver says that the wheels turned with what they did."""
        device, made = self.device, self.simulated
        assert isinstance(device, MotorBoard) and isinstance(made, SimulatedMotorBoard)
        return max(abs(told - true) for told, true in zip(
            device.counters.position_rad, made.base.wheel_angles))


@contextmanager
def board_robot(*arguments: Any, **settings: Any) -> Iterator[BoardRobot]:
    """Make a :class:`BoardRobot`, and close it."""
    made = BoardRobot(*arguments, **settings)
    try:
        yield made
    finally:
        made.close()
