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

"""The connection of a robot, ``/robot/state``: its records are stored, shown and acknowledged."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from collections.abc import Sequence
import logging
import math
import time
from typing import Any
from typing import Final
from typing import NamedTuple

from fastapi import WebSocket
from rt_robot_os.base.errors import StoreError
from rt_robot_os.base.safe_text import safe_text
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.uplink.commands import CommandAnswer
from rt_robot_os.messages.uplink.driving import DriveBeat
from rt_robot_os.messages.uplink.greeting import RobotHello
from rt_robot_os.messages.uplink.greeting import ServerWelcome
from rt_robot_os.messages.uplink.kinds import read
from rt_robot_os.messages.uplink.kinds import STATE_UP
from rt_robot_os.messages.uplink.live import LiveReceived
from rt_robot_os.messages.uplink.live import LiveSignals
from rt_robot_os.messages.uplink.maps import MapMessage
from rt_robot_os.messages.uplink.messages import decode
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.messages.uplink.messages import VERSION
from rt_robot_os.messages.uplink.records import BatchRefused
from rt_robot_os.messages.uplink.records import BatchStored
from rt_robot_os.messages.uplink.records import RecordBatch
from rt_robot_os.messages.uplink.voice import VoiceMessage
from rt_robot_os.monitor.live.residents import admitted
from rt_robot_os.monitor.live.residents import greet
from rt_robot_os.monitor.live.robot_state import is_time
from rt_robot_os.monitor.live.robot_state import RobotState
from rt_robot_os.monitor.live.send_queue import SendQueue
from rt_robot_os.monitor.services import Services
from rt_robot_os.monitor.store.robot_clock import RobotClock
from rt_robot_os.monitor.store.store import Hello
from rt_robot_os.monitor.store.writer import TIMEOUT_S
from starlette.websockets import WebSocketDisconnect

_LOG: Final = logging.getLogger('monitor')
HELLO_S: Final = 10.0
#: Most batches that wait for the disk; more are refused, and the robot sends them again.
BATCHES_MOST: Final = 8
RETRY_S: Final = 2.0
#: Shortest time between two maps of a robot.
MAP_S: Final = 1.0
MESSAGES_A_SECOND: Final = 500
BURST_S: Final = 1.0
#: A larger difference between the clocks is logged.
CLOCK_S: Final = 5.0


class _Received(NamedTuple):
    """A batch of records that waits for the disk."""

    batch: int | str
    boot: str
    records: list[Any]
    clock: RobotClock


class RobotConnection:
    """One connection of one robot."""

    def __init__(self, services: Services, websocket: WebSocket, robot: RobotState) -> None:
        self._services = services
        self._websocket = websocket
        self._robot = robot
        self._queue = SendQueue(websocket)
        self._batches: asyncio.Queue[_Received] = asyncio.Queue(BATCHES_MOST)
        self._boot = ''
        self._map_s = -math.inf
        self._map_kept = asyncio.Lock()
        self._next_s = 0.0
        self._tasks: set[asyncio.Task[None]] = set()

    def send(self, message: UplinkMessage) -> bool:
        """Send a message; False when the robot does not read."""
        return self._queue.send(message.to_json())

    def send_urgent(self, message: UplinkMessage) -> None:
        """Send a message before all others; only the newest of a kind is sent."""
        self._queue.send_urgent(message.KIND, message.to_json())

    def close(self, code: int, reason: str) -> None:
        """Close it."""
        self._queue.close(code, reason)

    async def run(self) -> None:
        """Serve the connection until it ends."""
        tasks = [asyncio.create_task(self._queue.run()), asyncio.create_task(self._keep())]
        try:
            if await self._hello():
                while True:
                    self._take(await self._receive())
        except (WebSocketDisconnect, RuntimeError, KeyError):
            pass
        finally:
            self._services.hub.disconnect(self._robot, self)
            for each in tasks:
                each.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _receive(self) -> dict[str, Any]:
        while True:
            await self._not_too_fast()
            text = await self._websocket.receive_text()
            try:
                found = decode(text)
                # A well-behaved robot writes neither escapes nor unprintable characters.
                return clean(found) if '\\u' in text or not text.isprintable() else found
            except (ValueError, RecursionError):
                self._robot.count('messages_wrong')

    async def _not_too_fast(self) -> None:
        """Limit the rate of messages; further ones wait on the robot."""
        now = asyncio.get_running_loop().time()
        self._next_s = max(self._next_s, now - BURST_S) + 1 / MESSAGES_A_SECOND
        if self._next_s > now:
            await asyncio.sleep(self._next_s - now)

    async def _hello(self) -> bool:
        hello = await self._await_hello()
        if hello is None:
            await self._websocket.close(1008, 'the first message must be a hello with a boot')
            return False
        if hello.version != VERSION:
            await self._websocket.close(4426, f'this server speaks version {VERSION}')
            return False
        self._boot = hello.boot
        now_ns = time.time_ns()
        self._take_about(hello, now_ns)
        await greet(self._services, self._robot, hello.people)
        wants_map = await self._wants_map(hello.map or '')
        if wants_map:  # a page requests a map when it is announced
            self._robot.about['map'] = self._services.maps.digest(self._robot.id)
        self.send(ServerWelcome(now_ns, wants_map))
        self._services.hub.connect(self._robot, self, now_ns)
        self._services.writer.hello(Hello(
            self._robot.id, hello.boot, self._robot.name,
            {'people': sorted(self._robot.suggested), **self._robot.about}))
        return True

    async def _await_hello(self) -> RobotHello | None:
        try:
            message = await asyncio.wait_for(self._receive(), HELLO_S)
            if message['kind'] == RobotHello.KIND:
                return RobotHello.from_json(message)
        except (asyncio.TimeoutError, ValueError):
            pass
        return None

    def _take_about(self, hello: RobotHello, now_ns: int) -> None:
        robot = self._robot
        robot.boot = self._boot
        robot.about = hello.about()
        for name, count in (('hello_too_long', hello.too_long), ('hello_wrong', hello.malformed)):
            if count:
                robot.count(name, count)
        if hello.utc_ns is not None:
            robot.offset_s = (hello.utc_ns - now_ns) / 1e9
            if abs(robot.offset_s) > CLOCK_S:
                _LOG.warning('%s: its clock is off by %+.1f s', robot.name, robot.offset_s)

    async def _wants_map(self, sha256: str) -> bool:
        maps = self._services.maps
        return bool(sha256) and maps is not None and not await asyncio.to_thread(
            maps.has, self._robot.id, sha256)

    def _take(self, content: dict[str, Any]) -> None:
        hub, robot = self._services.hub, self._robot
        hub.touch(robot, time.time_ns())
        if content['kind'] == MapMessage.KIND:  # not decompressed here, since that is slow
            self._take_map(content)
            return
        try:
            message = read(STATE_UP, content)
        except ValueError:
            robot.count('messages_wrong')
            return
        if isinstance(message, LiveSignals):
            self._take_live(message)
        elif isinstance(message, RecordBatch):
            self._take_records(message)
        elif isinstance(message, CommandAnswer):
            hub.answered(robot, message)
        elif isinstance(message, DriveBeat):
            hub.beat(robot, message)
        elif isinstance(message, VoiceMessage):
            hub.voice(robot, message)
        else:
            robot.count('messages_unknown')

    def _take_live(self, message: LiveSignals) -> None:
        self._robot.take(message.utc_ns, message.n, message.signals)
        self._services.hub.live(self._robot)
        self.send(LiveReceived(message.n))

    def _take_map(self, content: dict[str, Any]) -> None:
        now = asyncio.get_running_loop().time()
        if self._services.maps is None or now < self._map_s + MAP_S:
            self._robot.count('messages_unknown' if self._services.maps is None
                              else 'maps_too_fast')
            return
        self._map_s = now  # one map is requested; others come as it grows
        self._start(self._keep_map(content))

    async def _keep_map(self, content: dict[str, Any]) -> None:
        try:
            async with self._map_kept:
                await asyncio.to_thread(self._store_map, content)
        except (ValueError, OSError) as error:
            self._robot.count('maps_wrong')
            _LOG.warning('%s: its map cannot be stored: %s', self._robot.name, error)
            return
        self._robot.about['map'] = self._services.maps.digest(self._robot.id)
        self._services.hub.tell_robot(self._robot)

    def _store_map(self, content: dict[str, Any]) -> None:
        self._services.maps.put(self._robot.id, MapMessage.from_json(content))

    def _start(self, what: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(what)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _take_records(self, message: RecordBatch) -> None:
        records = [admitted(self._services.hub, self._robot, each) for each in message.records]
        boot = message.boot or self._boot  # an earlier start of the server may have left some
        if message.lost is not None:
            self._robot.lost = dict(message.lost)
        wrong = sum(not is_record(each) for each in records)
        if wrong:
            self._robot.count('records_wrong', wrong)
            _LOG.warning('%s: %d records without a number are set aside', self._robot.name, wrong)
        clock = RobotClock(round(self._robot.offset_s * NS_PER_S), boot == self._boot)
        self._show_alarms(records, boot, clock)
        try:
            self._batches.put_nowait(_Received(message.batch, boot, records, clock))
        except asyncio.QueueFull:
            self._refuse(message.batch, 'too many batches wait for the disk')

    def _show_alarms(self, records: Sequence[Any], boot: str, clock: RobotClock) -> None:
        """Show alarms before they are stored: a full disk does not delay an alarm."""
        now_ns = time.time_ns()
        self._services.hub.events(self._robot, [
            (each['content'], clock.corrected(each['utc_ns'], now_ns)) for each in records
            if is_record(each) and each.get('type') == 'alarm_event'
            and is_time(each.get('utc_ns')) and isinstance(each.get('content'), dict)], boot)

    async def _keep(self) -> None:
        while True:
            each = await self._batches.get()
            try:
                added = await self._services.writer.put(self._robot.id, each.boot, each.records,
                                                        TIMEOUT_S, each.clock)
            except StoreError as error:
                self._robot.count('batches_refused')
                _LOG.warning('%s: records cannot be stored: %s', self._robot.name, error)
                self._refuse(each.batch, 'the server cannot store records now')
                continue
            self._robot.count('records', len(each.records) - added.refused)
            if added.refused:
                self._robot.count('records_refused', added.refused)
                self._refuse(each.batch, f'{added.refused} records make no sense to this server, '
                             'and it has no room to set more aside: update it')
            else:
                self.send(BatchStored(each.batch))

    def _refuse(self, batch: int | str, text: str) -> None:
        self.send(BatchRefused(batch, text, RETRY_S))


def clean(value: Any) -> Any:
    """Return a JSON value whose strings every database can store and every screen can show."""
    if isinstance(value, str):
        return safe_text(value)
    if isinstance(value, dict):
        return {safe_text(key): clean(each) for key, each in value.items()}
    return [clean(each) for each in value] if isinstance(value, list) else value


def is_record(value: object) -> bool:
    """Return whether a value has a number, which identifies it when it is sent again."""
    return isinstance(value, dict) and is_time(value.get('seq'))
