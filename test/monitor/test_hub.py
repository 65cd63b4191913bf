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


"""The hub of the monitor: whose answer is whose, and when a robot is silent."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Coroutine
from typing import Any

import pytest

from rt_robot_os.messages.uplink.commands import CommandAnswer
from rt_robot_os.messages.uplink.commands import RobotCommand
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.monitor.live.hub import Hub
from rt_robot_os.monitor.live.hub import RobotUnavailable
from rt_robot_os.monitor.live.robot_state import RobotState

HEARTBEAT_S = 2.0


class Link:
    """The connection of a robot; it keeps what it was told."""

    def __init__(self, room: bool = True) -> None:
        self.room = room
        self.commands: list[RobotCommand] = []
        self.closed: list[int] = []

    def send(self, message: UplinkMessage) -> bool:
        if isinstance(message, RobotCommand):
            self.commands.append(message)
        return self.room

    def send_urgent(self, message: UplinkMessage) -> None:
        raise AssertionError('nobody drives')

    def close(self, code: int, reason: str) -> None:
        self.closed.append(code)


class Scene:
    """A hub with two robots that are connected."""

    def __init__(self) -> None:
        self.hub = Hub(HEARTBEAT_S, 60.0)
        self.robots = {name: self.hub.get_or_create(name) for name in ('r1', 'r2')}
        self.links = {name: Link() for name in self.robots}
        for name, robot in self.robots.items():
            self.hub.connect(robot, self.links[name], 1)

    async def command(self, name: str, do: str = 'stop') -> tuple[asyncio.Task[Any], str]:
        """Have a robot do something; return what waits for the answer, and its number."""
        task = asyncio.create_task(self.hub.command(self.robots[name], do, {}, 'mary'))
        before = len(self.links[name].commands)
        while len(self.links[name].commands) == before:
            await asyncio.sleep(0)
        return task, self.links[name].commands[-1].id

    def answer(self, name: str, number: str, text: str = 'done') -> None:
        self.hub.answered(self.robots[name], CommandAnswer(number, True, text))

    def late(self, name: str) -> int:
        return self.robots[name].counts.get('answers_late', 0)


def play(scene: Callable[[Scene], Coroutine[Any, Any, None]]) -> None:
    async def run() -> None:
        await scene(Scene())

    asyncio.run(run())


# ---- answers ---------------------------------------------------------------------------------

def test_the_answer_of_another_robot_is_no_answer() -> None:
    async def scene(it: Scene) -> None:
        task, number = await it.command('r1')
        it.answer('r2', number, 'done by another')
        assert (it.late('r1'), it.late('r2')) == (0, 1)
        it.answer('r1', number)
        assert await task == CommandAnswer(number, True, 'done')
        assert (it.late('r1'), it.late('r2')) == (0, 1)

    play(scene)


def test_each_robot_answers_its_own_commands_in_any_order() -> None:
    async def scene(it: Scene) -> None:
        first, number = await it.command('r1')
        second, later = await it.command('r1')
        other, elsewhere = await it.command('r2')
        assert len({number, later, elsewhere}) == 3
        it.answer('r2', elsewhere, 'c')
        it.answer('r1', later, 'b')
        it.answer('r1', number, 'a')
        assert [(await each).text for each in (first, second, other)] == ['a', 'b', 'c']
        assert (it.late('r1'), it.late('r2')) == (0, 0)

    play(scene)


def test_an_answer_counts_once_and_one_to_no_command_is_counted() -> None:
    async def scene(it: Scene) -> None:
        task, number = await it.command('r1')
        it.answer('r1', number, 'first')
        it.answer('r1', number, 'second')
        assert (await task).text == 'first' and it.late('r1') == 1
        it.answer('r1', number)  # nobody waits for it any more
        it.answer('r1', 'made up')
        it.hub.answered(it.robots['r1'], CommandAnswer.from_json({}))
        assert it.late('r1') == 4

    play(scene)


@pytest.mark.parametrize('ok', [False, None, 1, 'true'])
def test_only_true_is_an_answer_that_it_was_done(ok: object) -> None:
    async def scene(it: Scene) -> None:
        task, number = await it.command('r1')
        it.hub.answered(it.robots['r1'], CommandAnswer.from_json(
            {'id': number, 'ok': ok, 'text': 'no way'}))
        assert await task == CommandAnswer(number, False, 'no way')

    play(scene)


def test_a_robot_that_goes_away_fails_its_own_commands_and_no_others() -> None:
    async def scene(it: Scene) -> None:
        gone, number = await it.command('r1')
        other, elsewhere = await it.command('r2')
        it.hub.disconnect(it.robots['r1'], it.links['r1'])
        with pytest.raises(RobotUnavailable):
            await gone
        it.answer('r1', number)
        assert it.late('r1') == 1
        it.answer('r2', elsewhere)
        assert (await other).ok

    play(scene)


def test_a_connection_that_was_replaced_takes_nothing_away_when_it_ends() -> None:
    async def scene(it: Scene) -> None:
        it.hub.connect(it.robots['r1'], newer := Link(), 2)
        assert it.links['r1'].closed == [4000]
        it.hub.disconnect(it.robots['r1'], it.links['r1'])
        assert it.hub.is_connected('r1') and it.robots['r1'].connected
        it.hub.disconnect(it.robots['r1'], newer)
        assert not it.hub.is_connected('r1') and not it.robots['r1'].connected

    play(scene)


def test_a_robot_that_does_not_read_or_is_away_cannot_be_asked() -> None:
    async def scene(it: Scene) -> None:
        it.links['r1'].room = False
        with pytest.raises(RobotUnavailable):
            await it.hub.command(it.robots['r1'], 'stop', {}, 'mary')
        it.hub.disconnect(it.robots['r2'], it.links['r2'])
        with pytest.raises(RobotUnavailable):
            await it.hub.command(it.robots['r2'], 'stop', {}, 'mary')

    play(scene)


# ---- silence ---------------------------------------------------------------------------------

def looked(it: Scene, at_s: float, robot: RobotState) -> bool:
    """Return whether a robot is silent at a time."""
    asyncio.get_running_loop().time = lambda: at_s  # type: ignore[method-assign]
    it.hub.check_timeouts()
    return robot.silent


def test_a_robot_is_silent_when_more_than_three_heart_beats_are_missing() -> None:
    async def scene(it: Scene) -> None:
        robot, began_s = it.robots['r1'], asyncio.get_running_loop().time()
        robot.heard = it.robots['r2'].heard = began_s
        assert not looked(it, began_s + 2.999 * HEARTBEAT_S, robot)
        assert not looked(it, began_s + 3 * HEARTBEAT_S - 1e-6, robot)
        assert looked(it, began_s + 3 * HEARTBEAT_S + 1e-3, robot)
        assert robot.counts['silences'] == 1
        assert looked(it, began_s + 100.0, robot) and robot.counts['silences'] == 1
        it.hub.touch(robot, 5)
        assert not robot.silent and robot.last_seen_ns == 5
        assert not looked(it, began_s + 100.0 + 2.9 * HEARTBEAT_S, robot)
        assert looked(it, began_s + 100.0 + 3.1 * HEARTBEAT_S, robot)
        assert robot.counts['silences'] == 2

    play(scene)


def test_a_robot_that_is_heard_keeps_no_other_one_from_being_silent() -> None:
    async def scene(it: Scene) -> None:
        began_s = asyncio.get_running_loop().time()
        it.robots['r1'].heard = began_s
        it.robots['r2'].heard = began_s + HEARTBEAT_S
        assert looked(it, began_s + 3.5 * HEARTBEAT_S, it.robots['r1'])
        assert not it.robots['r2'].silent

    play(scene)
