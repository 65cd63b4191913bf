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

"""Tele-operation at the robot's end: what is published when, and what a beat tells."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Coroutine
import itertools
from pathlib import Path
import struct
import time
from typing import Any

import pytest

from rt_robot_os.gateway.drive import Teleoperation
from rt_robot_os.gateway.drive_limits import TeleopLimits
from rt_robot_os.gateway.part import GatewayContext
from rt_robot_os.gateway.part import Greeting
from rt_robot_os.gateway.settings import GatewaySettings
from rt_robot_os.messages.uplink.driving import DriveBegin
from rt_robot_os.messages.uplink.driving import DriveCommand
from rt_robot_os.messages.uplink.greeting import DriveLimits
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.sim.world.drive_base import DriveBase
from rt_robot_os.sim.world.drive_base import STEP_S
import yaml

ROOT = Path(__file__).resolve().parents[2]


class Robot:
    """What a gateway's tele-operation publishes and sends."""

    def __init__(self) -> None:
        self.published: list[tuple[str, tuple[float, ...]]] = []
        self.stamps: list[int] = []
        self.sent: list[tuple[str, dict[str, Any]]] = []
        self.signals: dict[str, Any] = {}
        self.takes = True
        self.seq = itertools.count(1)
        # A machine that is busy with other tests may take a while for a command.
        self.drive = Teleoperation(TeleopLimits(ticket_s=60.0), self._publish, self._send,
                                   self.signals.get)

    def _publish(self, topic: str, cdr: bytes, stamp_ns: int) -> bool:
        body = cdr[4:]
        values = struct.unpack('<6d', body) if len(body) == 48 else tuple(body)
        self.published.append((topic, values))
        self.stamps.append(stamp_ns)
        return self.takes

    def _send(self, message: UplinkMessage) -> None:
        self.sent.append((message.KIND, message.content()))

    def begin(self, lease: str = 'a') -> None:
        self.drive.receive(DriveBegin(lease, 'carol'))

    def command(self, linear: float = 0.2, grip: bool = True, **more: Any) -> None:
        self.drive.receive(DriveCommand.from_json({
            'lease': 'a', 'seq': next(self.seq), 'grip': grip, 'beat': self.sent[-1][1]['n'],
            'linear_m_s': linear, 'angular_rad_s': 0.0, **more}))

    def speeds(self) -> list[float]:
        return [values[0] for topic, values in self.published if topic == 'cmd_vel_teleop']


def running(test: Callable[[Robot], Coroutine[Any, Any, None]]) -> Callable[[], None]:
    def run() -> None:
        asyncio.run(test(Robot()))
    return run


async def told(robot: Robot, count: int) -> None:
    """Wait until the robot was told so many speeds."""
    for _ in range(3000):
        if len(robot.speeds()) >= count:
            return
        await asyncio.sleep(0.01)
    pytest.fail(f'{count} commands did not come: {robot.published}')


def _moves_and_stands_by_itself() -> Any:
    async def test(robot: Robot) -> None:
        robot.begin()
        robot.command(0.0, grip=False)
        robot.command(0.2)
        assert robot.speeds() == [0.2]
        await told(robot, 2)
        assert robot.speeds() == [0.2, 0.0]
    return test


def _gives_up_the_goal() -> Any:
    async def test(robot: Robot) -> None:
        robot.begin()
        robot.command(0.0, grip=False)
        robot.command()
        robot.command()
        assert [topic for topic, _ in robot.published] == [
            'cmd_vel_teleop', 'trajectory_cancel', 'cmd_vel_teleop']
        assert robot.published[1][1] == (1,)
        assert robot.drive.driver == 'carol'
        robot.command(0.0, grip=False)
        assert robot.drive.driver == ''
        # Once more: somebody may have given one meanwhile.
        assert [topic for topic, _ in robot.published[3:]] == [
            'cmd_vel_teleop', 'trajectory_cancel']
    return test


def _tells_what_the_driver_must_know() -> Any:
    async def test(robot: Robot) -> None:
        robot.drive.beat()
        assert robot.sent == []  # nobody may drive: no ticket
        robot.signals.update(stop_reason='scan: nothing is heard', speed={'linear_m_s': 0.1})
        robot.begin()
        kind, beat = robot.sent[-1]
        assert kind == 'beat' and beat['lease'] == 'a' and beat['armed'] is False
        assert beat['stop_reason'] == 'scan: nothing is heard' and beat['rtt_ms'] is None
        robot.command(0.0, grip=False)
        robot.drive.beat()
        assert robot.sent[-1][1]['armed'] is True and robot.sent[-1][1]['seq'] == 1
        assert robot.sent[-1][1]['rtt_ms'] >= 0.0
        assert robot.sent[-1][1]['n'] == beat['n'] + 1
    return test


def _counts_what_the_core_did_not_take() -> Any:
    async def test(robot: Robot) -> None:
        robot.takes = False
        robot.begin()
        robot.command(0.0, grip=False)
        robot.command()
        assert robot.drive.statistics()['unpublished'] == 1
    return test


def _ends_when_the_gateway_does() -> Any:
    async def test(robot: Robot) -> None:
        robot.begin()
        robot.command(0.0, grip=False)
        task = asyncio.ensure_future(robot.drive.run())
        await asyncio.sleep(0)
        robot.command()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        assert robot.speeds() == [0.2, 0.0]
        robot.command()
        assert robot.speeds() == [0.2, 0.0]
    return test


@pytest.mark.parametrize('test', [
    _moves_and_stands_by_itself(), _gives_up_the_goal(), _tells_what_the_driver_must_know(),
    _counts_what_the_core_did_not_take(), _ends_when_the_gateway_does()],
    ids=['stands by itself', 'goal given up', 'beats', 'core does not read', 'gateway ends'])
def test_driving(test: Any) -> None:
    running(test)()


def test_the_settings_of_the_gateway_are_its_limits() -> None:
    from rt_robot_os.gateway.drive import TeleopPart

    class Link:
        def has(self, topic: str) -> bool:
            return True

    class Server:
        def send_newest(self, message: UplinkMessage) -> None:
            pass

    settings = GatewaySettings(drive_linear_m_s=0.1, drive_angular_rad_s=0.3)
    part = TeleopPart(GatewayContext(
        Link(), Server(), settings, None, None, None, None))  # type: ignore
    assert part.hello() == Greeting(('drive',), limits=DriveLimits(0.1, 0.3))
    nobody = GatewayContext(
        Link(), Server(), GatewaySettings(drive_linear_m_s=0.0),  # type: ignore
        None, None, None, None)  # type: ignore
    assert TeleopPart(nobody).hello() == Greeting()


@pytest.mark.parametrize('name', ['service_robot', 'assisted_living'])
def test_the_shipped_robots_stand_soon_enough_after_the_last_command(name: str) -> None:
    """The gateway's hold ends first; after its death the multiplexer's time-out and the wheels."""
    robot = yaml.safe_load((ROOT / 'config' / f'{name}.yaml').read_text())['/**/robot']
    settings = robot['ros__parameters']
    timeout_s = settings['velocity_mux']['source_timeouts_s'][0]
    assert TeleopLimits().hold_s < timeout_s
    assert settings['base']['command_timeout_s'] > timeout_s
    base = DriveBase(wheel_radius_m=settings['base']['wheel_radius_m'],
                     wheel_separation_m=settings['base']['wheel_separation_m'])
    speed = TeleopLimits().linear_m_s / settings['base']['wheel_radius_m']
    base.set_wheel_speeds(speed, speed)
    for _ in range(1000):
        base.step()
    base.set_wheel_speeds(0.0, 0.0)
    brake_s = next(number * STEP_S for number in range(1, 1000)
                   if base.step() or base.velocity[0] < 0.01)
    assert timeout_s + brake_s < 0.35


def test_a_time_of_day_that_jumps_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    async def test() -> None:
        robot = Robot()
        robot.begin()
        robot.command(0.0, grip=False)
        for jump_ns in (3_600_000_000_000, -7_200_000_000_000, 10**18):
            now_ns = time.time_ns() + jump_ns
            monkeypatch.setattr(time, 'time_ns', lambda now_ns=now_ns: now_ns)
            robot.drive.beat()
            robot.command()
            assert robot.speeds()[-1] == 0.2
        assert robot.drive.controller.counters['stale'] == 0

    asyncio.run(test())
