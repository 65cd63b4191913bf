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

"""What is urgent goes first and whole; of what is live the newest; a stopped peer is alone."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from collections.abc import Callable
import json
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies
from rt_robot_os.monitor.live.fan_out import FanOut
from rt_robot_os.monitor.live.hub import Hub
from rt_robot_os.monitor.live.rights import Rights
from rt_robot_os.monitor.live.robot_state import RobotState
from rt_robot_os.monitor.live.send_queue import SendQueue
from rt_robot_os.monitor.live.send_queue import URGENT_MOST

ALL = Rights(None, True)


class Peer:
    """A WebSocket that takes a message whenever it is let."""

    def __init__(self) -> None:
        self.got: list[str] = []
        self.closed: tuple[int, str] | None = None
        self.reads = asyncio.Event()
        self.reads.set()

    async def send_text(self, text: str) -> None:
        await self.reads.wait()
        self.got.append(text)

    async def close(self, code: int, reason: str) -> None:
        self.closed = (code, reason)

    def kinds(self) -> list[str]:
        return [json.loads(each)['kind'] for each in self.got]


def run(what: Callable[[], Awaitable[None]]) -> None:
    """Run something on an event loop."""
    async def inner() -> None:
        await asyncio.wait_for(what(), 30)  # type: ignore[arg-type]
    asyncio.run(inner())


async def settle() -> None:
    """Let everything that can go on do so."""
    for _ in range(20):
        await asyncio.sleep(0)


def opened(peer: Peer) -> tuple[SendQueue, asyncio.Task[None]]:
    """Return the sending side to a peer, at work."""
    outlet = SendQueue(peer)  # type: ignore[arg-type]
    return outlet, asyncio.ensure_future(outlet.run())


class Client:
    """A client of the hub."""

    actor: Any = None

    def __init__(self, outlet: SendQueue, rights: Rights = ALL) -> None:
        self.rights = rights
        self._outlet = outlet

    def send(self, text: str) -> bool:
        return self._outlet.send(text)

    def close(self, code: int, reason: str) -> None:
        self._outlet.close(code, reason)

    def robot_came(self, robot: RobotState) -> None:
        pass


def test_alarms_overtake_signals_and_none_is_left_out() -> None:
    async def scene() -> None:
        peer = Peer()
        outlet, task = opened(peer)
        robot, fan_out = RobotState('robot', 'robot'), FanOut()
        fan_out.watch(outlet, robot, ALL, ('*',), 1000.0)
        await settle()
        peer.reads.clear()
        for n in range(1, 300):
            robot.take(n, n, {'speed': [n, n]})
            fan_out.changed(robot)
            outlet.send(f'{{"kind":"alarm","n":{n}}}')
            await settle()
        peer.reads.set()
        await settle()
        found = [json.loads(each) for each in peer.got]
        alarms = [each['n'] for each in found if each['kind'] == 'alarm']
        signals = [each for each in found if each['kind'] == 'signals']
        assert alarms == list(range(1, 300))
        # One that was under way, and then the newest alone, behind all that was urgent.
        assert len(signals) <= 2
        assert signals[-1]['signals'] == {'speed': [299, 299]}
        assert found[-1]['kind'] == 'signals'
        task.cancel()
    run(scene)


def test_who_stops_reading_changes_nothing_for_others_and_is_closed_when_alarms_pile_up() -> None:
    async def scene() -> None:
        hub = Hub(2.0, 1.0)
        robot = hub.get_or_create('robot')
        robot.lives_with([])
        stopped, quick = Peer(), Peer()
        outlets = [opened(each) for each in (stopped, quick)]
        for outlet, _ in outlets:
            hub.join(Client(outlet))
            hub.fan_out.watch(outlet, robot, ALL, ('*',), 1000.0)
        await settle()
        stopped.reads.clear()
        for n in range(1, URGENT_MOST + 50):
            robot.take(n, n, {'speed': [n, n]})
            hub.live(robot)
            hub.events(robot, [({'alarm': 'a', 'seq': n, 'state': 'raised'}, n)])
            await settle()
            assert json.loads(quick.got[-1])['utc_ns'] == n
        assert quick.kinds().count('alarm') == URGENT_MOST + 49
        assert len(hub.clients) == 1
        assert hub.counts['overrun'] == 1
        stopped.reads.set()
        await settle()
        assert stopped.closed is not None and stopped.closed[0] == 1013
        for _, task in outlets:
            task.cancel()
    run(scene)


def test_what_many_want_alike_is_encoded_once() -> None:
    async def scene() -> None:
        robot, fan_out = RobotState('robot', 'robot'), FanOut()
        robot.lives_with(['anna'])
        peers = [Peer() for _ in range(20)]
        outlets = [opened(each) for each in peers]
        for outlet, _ in outlets:
            fan_out.watch(outlet, robot, ALL, ('health/*',), 1000.0)
        robot.take(1, 1, {'health/anna/pulse': [1, 60], 'speed': [1, {}]})
        fan_out.changed(robot)
        await settle()
        assert {len(each.got) for each in peers} == {1}
        assert len({id(each.got[0]) for each in peers}) == 1
        for _, task in outlets:
            task.cancel()
    run(scene)


@settings(max_examples=60, deadline=None)
@given(steps=strategies.lists(strategies.tuples(
    strategies.dictionaries(strategies.sampled_from('abc'), strategies.integers(0, 9)),
    strategies.booleans()), max_size=20))
def test_a_peer_that_reads_now_and_then_ends_with_the_newest_of_each_signal(
        steps: list[tuple[dict[str, int], bool]]) -> None:
    async def scene() -> None:
        peer = Peer()
        outlet, task = opened(peer)
        robot, fan_out = RobotState('robot', 'robot'), FanOut()
        fan_out.watch(outlet, robot, ALL, ('*',), 1e6)
        newest: dict[str, int] = {}
        for n, (values, reads) in enumerate(steps, 1):
            newest |= values
            robot.take(n, n, {name: [n, value] for name, value in values.items()})
            fan_out.changed(robot)
            peer.reads.set() if reads else peer.reads.clear()
            await settle()
        peer.reads.set()
        await asyncio.sleep(0.001)
        await settle()
        seen: dict[str, int] = {}
        for each in peer.got:
            seen |= {name: value for name, (_, value) in json.loads(each)['signals'].items()}
        assert seen == newest
        task.cancel()
    run(scene)


def test_driving_goes_before_everything_and_only_the_newest() -> None:
    async def scene() -> None:
        peer = Peer()
        outlet, task = opened(peer)
        peer.reads.clear()
        for n in range(5):
            outlet.send(f'{{"kind":"want","n":{n}}}')
        await settle()
        for n in range(9):
            outlet.send_urgent('drive', f'{{"kind":"drive","n":{n}}}')
        outlet.send_urgent('drive_end', '{"kind":"drive_end"}')
        peer.reads.set()
        await settle()
        assert peer.kinds() == ['want', 'drive', 'drive_end', *['want'] * 4]
        assert json.loads(peer.got[1])['n'] == 8
        task.cancel()
    run(scene)
