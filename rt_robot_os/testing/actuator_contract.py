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


"""
The contract of every actuator on a serial port; its test inherits it.

    class TestMyWheels(ActuatorContract):
        actuator = MyWheels
        simulated = SimulatedWheels
        speed = 0.5

        def fill(self, message, speed):
            message.linear.x = speed

        def moves(self, simulated):
            return simulated.speed_mm_s != 0

Nothing may move without a current command. The bytes go over a real pty; time is controlled by the
test.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from collections.abc import Mapping
from contextlib import contextmanager
import math
from pathlib import Path
import threading
from typing import Any
from typing import ClassVar

import pytest
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.actuator import Actuator
from rt_robot_os.devices.actuator import TIMEOUT
from rt_robot_os.devices.state import DeviceState
from rt_robot_os.kernel import FailurePolicy
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.pty_port import PtyPort
from rt_robot_os.testing.actuator_rig import ActuatorRig
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.topics import Layout

# A poll, and a round of the recovery task.
_LATE_MS = 120


class ActuatorContract:
    """
    The contract.

    :cvar actuator: the driver.
    :cvar simulated: its simulated device. It should have no watchdog of its own, or one longer
        than ``command_timeout_s``, because the driver must stop it.
    :cvar speed: a command that moves it, for :meth:`fill`.
    :cvar changes: settings of the driver other than the defaults.
    :cvar sim: settings of the simulated device other than the defaults.
    """

    actuator: ClassVar[type[Actuator]]
    simulated: ClassVar[type[SimulatedDevice]]
    speed: ClassVar[float]
    changes: ClassVar[Mapping[str, Any]] = {}
    sim: ClassVar[Mapping[str, Any]] = {}

    @abstractmethod
    def fill(self, message: Any, speed: float) -> None:
        """Fill in a command."""

    @abstractmethod
    def moves(self, simulated: Any) -> bool:
        """Return whether the simulated device moves, or was last commanded to."""

    @pytest.fixture
    def rig(self, tmp_path: Path) -> Iterator[ActuatorRig]:
        """Return a robot of one actuator."""
        with self.made(tmp_path) as made:
            yield made

    @contextmanager
    def made(self, folder: Path, **settings: Any) -> Iterator[ActuatorRig]:
        """Make a robot of one actuator, with other settings."""
        made = ActuatorRig(folder, self.actuator, self.simulated, self.fill, self.sim,
                           **{**self.changes, **settings})
        try:
            yield made
        finally:
            made.close()

    def _driving(self, rig: ActuatorRig) -> None:
        rig.steer(self.speed)
        rig.run(300)
        assert rig.managed.state in (DeviceState.ACTIVE, DeviceState.OPENING), rig.managed.reason
        assert self.moves(rig.simulated)

    # --- commands --------------------------------------------------------------------------------

    def test_nothing_moves_before_the_first_command(self, rig: ActuatorRig) -> None:
        for _ in range(20):
            rig.run(20)
            assert not self.moves(rig.simulated)
        counters = rig.counters()
        assert (counters['command'], counters['commands']) == ('none', 0)

    def test_what_moved_before_it_was_opened_is_brought_to_rest(self, rig: ActuatorRig) -> None:
        self._driving(rig)
        rig.steer(None)
        rig.managed.restart()
        rig.run(_LATE_MS)
        assert not self.moves(rig.simulated)

    def test_a_command_moves_it_until_it_is_too_old(self, rig: ActuatorRig) -> None:
        self._driving(rig)
        rig.steer(None)
        timeout_ms = round(rig.device.settings[TIMEOUT] * 1000)
        rig.run(timeout_ms - 30)
        assert self.moves(rig.simulated)
        rig.run(35)
        assert not self.moves(rig.simulated)
        rests = rig.counters()['rests']
        rig.run(3 * timeout_ms)
        assert not self.moves(rig.simulated)
        counters = rig.counters()
        assert (counters['command_timeouts'], counters['command']) == (1, 'none')
        assert counters['rests'] == rests, 'it is brought to rest once'

    def test_the_next_command_moves_it_again(self, rig: ActuatorRig) -> None:
        self._driving(rig)
        rig.steer(None)
        rig.run(1000)
        assert not self.moves(rig.simulated)
        self._driving(rig)
        assert rig.counters()['command_timeouts'] == 1

    def test_a_stamp_of_the_future_keeps_nothing_moving(self, rig: ActuatorRig) -> None:
        rig.run(_LATE_MS)
        rig.steer(self.speed, offset_ns=3600 * NS_PER_S, only=1)
        rig.run(100)
        assert self.moves(rig.simulated)
        rig.run(round(rig.device.settings[TIMEOUT] * 1000))
        assert not self.moves(rig.simulated)

    def test_a_command_that_is_old_when_it_comes_moves_nothing(self, rig: ActuatorRig) -> None:
        late_ns = round(1.5 * rig.device.settings[TIMEOUT] * NS_PER_S)
        rig.steer(self.speed, offset_ns=-late_ns)
        rig.run(500)
        assert not self.moves(rig.simulated)
        assert rig.counters()['late_commands'] >= 10

    @pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
    def test_what_is_no_number_harms_nothing(self, rig: ActuatorRig, value: float) -> None:
        rig.run(_LATE_MS)
        rig.steer(value)
        rig.run(200)
        if math.isnan(value):
            assert not self.moves(rig.simulated)
        assert rig.managed.faults == 0, rig.managed.reason

    def test_the_age_limit_can_be_set(self, tmp_path: Path) -> None:
        with self.made(tmp_path, **{TIMEOUT: 0.1}) as rig:
            self._driving(rig)
            rig.steer(None)
            rig.run(105)
            assert not self.moves(rig.simulated)

    # --- life ------------------------------------------------------------------------------------

    def test_closing_brings_it_to_rest(self, rig: ActuatorRig) -> None:
        self._driving(rig)
        rig.manager.close()
        rig.pump()
        assert not self.moves(rig.simulated)

    def test_the_end_of_the_robot_brings_it_to_rest_before_it_is_closed(
            self, rig: ActuatorRig) -> None:
        self._driving(rig)
        rig.manager.rest(lambda name, function: function())
        rig.pump()
        assert not self.moves(rig.simulated)
        assert rig.device.fileno() is not None

    def test_after_it_was_unplugged_it_waits_for_a_new_command(self, rig: ActuatorRig) -> None:
        self._driving(rig)
        rig.unplug()
        rig.steer(self.speed, only=2)  # before it is opened again
        rig.run(250)
        assert rig.managed.faults >= 1
        assert not self.moves(rig.simulated), 'it moved by itself, or by an old command'
        self._driving(rig)

    @pytest.mark.parametrize('policy', [
        FailurePolicy.SAFE_STATE, FailurePolicy.STOP, FailurePolicy.RESTART])
    def test_while_its_task_is_held_no_command_moves_it(
            self, rig: ActuatorRig, policy: FailurePolicy) -> None:
        self._driving(rig)
        moves: list[bool] = []
        rig.each = lambda: moves.append(self.moves(rig.simulated))
        rig.hold(policy)
        rig.kernel.run(500 * NS_PER_MS)
        assert not any(moves[40:100])
        # A restart has ended by then; with other policies the task is held until it is re-armed.
        assert any(moves[100:]) == (policy is FailurePolicy.RESTART)

    def test_the_safe_state_does_not_block(self, tmp_path: Path) -> None:
        # Nothing reads the other end, so it becomes full.
        port = PtyPort(tmp_path / 'full')
        port.plug()
        device = self.actuator('dut', settings_of(self.actuator, **{
            **self.changes, 'port': str(port.link), 'baud': 0}))
        device.open()
        worker = threading.Thread(
            target=lambda: [device.safe_state() for _ in range(30_000)], daemon=True)
        worker.start()
        worker.join(20.0)
        assert not worker.is_alive(), 'safe_state() blocks on the device'
        device.close()
        port.unplug()

    # --- declarations ----------------------------------------------------------------------------

    def test_its_command_has_a_type_and_releases_it(self) -> None:
        command = self.actuator.command
        assert Layout.compile(command.message)
        assert command.wake is True, 'a command must be executed when it arrives'
        assert self.actuator.has_safe_state()
