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

"""The connection of a browser, ``/live``: first the state, then changes, as subscribed."""

from __future__ import annotations

import asyncio
import json
import math
import time
from typing import Any
from typing import Final

from fastapi import WebSocket
from rt_robot_os.monitor.live import turns
from rt_robot_os.monitor.live.fan_out import SignalWatch
from rt_robot_os.monitor.live.robot_state import encoded
from rt_robot_os.monitor.live.robot_state import RobotState
from rt_robot_os.monitor.live.send_queue import SendQueue
from rt_robot_os.monitor.security.guard import Actor
from rt_robot_os.monitor.services import Services
from starlette.websockets import WebSocketDisconnect

MESSAGE_CHARACTERS: Final = 64 << 10
MESSAGES_A_SECOND: Final = 50
WATCHES_MOST: Final = 16
PATTERNS_MOST: Final = 200
PATTERN_CHARACTERS: Final = 200
STARS_MOST: Final = 3
#: Most names with a star in one watch: each is compared with all names.
STARRED_MOST: Final = 32
RATE_HZ: Final = 5.0
RATE_MOST_HZ: Final = 30.0
RATE_LEAST_HZ: Final = 0.1


class ClientConnection:
    """One connection of one browser."""

    def __init__(self, services: Services, websocket: WebSocket, actor: Actor) -> None:
        self._hub = services.hub
        self._websocket = websocket
        self._queue = SendQueue(websocket)
        self.actor = actor
        self.rights = services.hub.rights_of(actor)
        self._wanted: dict[str, tuple[str | None, tuple[str, ...], float]] = {}
        self._watches: dict[str, list[tuple[RobotState, SignalWatch]]] = {}
        self._tokens = float(MESSAGES_A_SECOND)
        self._filled = 0.0

    def send(self, text: str) -> bool:
        """Send an urgent message."""
        return self._queue.send(text)

    def close(self, code: int, reason: str) -> None:
        """Close it."""
        self._queue.close(code, reason)

    async def run(self) -> None:
        """Serve the connection until it ends."""
        writing = asyncio.create_task(self._queue.run())
        self._hub.join(self)
        try:
            while True:
                text = await self._websocket.receive_text()
                if len(text) > MESSAGE_CHARACTERS or not self._may_say():
                    self.close(1008, 'too much')
                    await writing
                    break
                await self._take(text)
        except (WebSocketDisconnect, RuntimeError, KeyError):
            pass
        finally:
            self._hub.leave(self)
            for key in list(self._watches):
                self._end(key)
            writing.cancel()
            await asyncio.gather(writing, return_exceptions=True)

    def _may_say(self) -> bool:
        now = asyncio.get_running_loop().time()
        self._tokens = min(2.0 * MESSAGES_A_SECOND,
                           self._tokens + (now - self._filled) * MESSAGES_A_SECOND)
        self._filled = now
        self._tokens -= 1
        return self._tokens >= 0

    async def _take(self, text: str) -> None:
        try:
            message = json.loads(text)
        except (ValueError, RecursionError):
            message = None
        kind = message.get('kind') if isinstance(message, dict) else None
        if kind == 'ping':
            self.send(encoded({'kind': 'pong', 't': _plain(message.get('t')),
                              'utc_ns': time.time_ns()}))
        elif kind == 'watch':
            problem = await self._watch(message)
            if problem:
                self.send(encoded({'kind': 'error', 'text': problem}))

    async def _watch(self, message: dict[str, Any]) -> str:
        key, robot = message.get('id', ''), message.get('robot')
        patterns, rate = message.get('signals', []), message.get('rate_hz', RATE_HZ)
        if not isinstance(key, str) or len(key) > 64 or not isinstance(robot, str | None):
            return 'watch: id and robot are strings'
        if (not isinstance(patterns, list) or len(patterns) > PATTERNS_MOST
                or not all(isinstance(each, str) and len(each) <= PATTERN_CHARACTERS
                           and each.count('*') <= STARS_MOST for each in patterns)):
            return (f'watch: signals is a list of at most {PATTERNS_MOST} names of '
                    f'{PATTERN_CHARACTERS} characters with {STARS_MOST} stars each')
        if not isinstance(rate, int | float) or isinstance(rate, bool) or not 0 < rate < 1e9:
            return 'watch: rate_hz is a number above 0'
        starred = sum('*' in each for each in patterns)
        if starred > STARRED_MOST:
            return f'watch: {starred} names with a star; at most {STARRED_MOST} in one watch'
        rate = min(max(float(rate), RATE_LEAST_HZ), RATE_MOST_HZ)
        wanted = (robot, tuple(sorted(set(patterns))), rate)
        if self._wanted.get(key) == wanted:
            return ''  # the same watch again
        if patterns:
            await self._turn(robot, starred)
        self._end(key)
        return self._start(key, wanted) if patterns else ''

    async def _turn(self, robot: str | None, starred: int) -> None:
        """Wait until the user's quota allows this work; other connections are served meanwhile."""
        names = sum(len(each.signals) for each in self._hub.robots.values()
                    if robot in (None, each.id))
        wait_s = self._hub.turns.wait_s(self.actor.id, names * starred,
                                        asyncio.get_running_loop().time())
        if wait_s:
            self._hub.counts['watches_delayed'] += 1
            await asyncio.sleep(wait_s)

    def _start(self, key: str, wanted: tuple[str | None, tuple[str, ...], float]) -> str:
        if len(self._wanted) >= WATCHES_MOST or not self._hub.turns.begin(self.actor.id):
            return (f'watch: at most {WATCHES_MOST} on a connection and {turns.WATCHES_MOST} of a '
                    'user; end one by an empty list of signals')
        self._wanted[key] = wanted
        self._watches[key] = []
        for each in list(self._hub.robots.values()):
            self._begin(key, each)
        return ''

    def robot_came(self, robot: RobotState) -> None:
        """Watch a robot that is new to the hub."""
        for key in self._wanted:
            self._begin(key, robot)

    def _begin(self, key: str, robot: RobotState) -> None:
        wanted, patterns, rate_hz = self._wanted[key]
        if wanted is None or wanted == robot.id:
            watch = self._hub.fan_out.watch(self._queue, robot, self.rights, patterns, rate_hz)
            self._watches[key].append((robot, watch))
            self._hub.want(robot)

    def _end(self, key: str) -> None:
        if self._wanted.pop(key, None) is not None:
            self._hub.turns.end(self.actor.id)
        for robot, watch in self._watches.pop(key, ()):
            watch.end()
            self._hub.want(robot)


def _plain(value: object) -> object:
    """Return a number or a short string unmodified; None for anything else."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, int | float) or (
        isinstance(value, str) and len(value) <= 64) else None
