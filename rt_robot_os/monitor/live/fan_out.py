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
Sends one robot's signals to many clients: data that several of them watch is encoded once.

Watches with the same robot, rights, signals and rate are a group. A frame is everything that has
changed since a version of the robot; clients that are up to date share it, and a slow client gets
all missed changes in one frame, each signal once with its newest value.
"""

from __future__ import annotations

import asyncio
import time
from typing import Final

from rt_robot_os.monitor.live.patterns import matcher
from rt_robot_os.monitor.live.rights import Rights
from rt_robot_os.monitor.live.robot_state import encoded
from rt_robot_os.monitor.live.robot_state import RobotState
from rt_robot_os.monitor.live.robot_state import Signal
from rt_robot_os.monitor.live.send_queue import SendQueue

#: Most patterns that are requested from a robot; beyond that all signals are requested.
WANTED_MOST: Final = 256
#: Most cached frames of one version, for clients with different previous versions.
_FRAMES_MOST: Final = 16


class SignalWatch:
    """One client's watch of one robot."""

    def __init__(self, queue: SendQueue, group: WatchGroup) -> None:
        self._queue = queue
        self._group = group
        self._version = 0
        queue.offer(self.frame)
        group.watches[self] = None

    def is_due(self) -> None:
        """Offer changes, which are sent when the client is ready."""
        self._queue.offer(self.frame)

    def frame(self) -> str | None:
        """Return the changes since the last frame; None for none."""
        before, self._version = self._version, self._group.robot.version
        return self._group.frame(before)

    def end(self) -> None:
        """Stop sending."""
        self._queue.withdraw(self.frame)
        self._group.watches.pop(self, None)


class WatchGroup:
    """All watches of a robot with the same signals, rate and rights."""

    def __init__(self, robot: RobotState, rights: Rights, patterns: tuple[str, ...],
                 rate_hz: float) -> None:
        self.robot = robot
        self.watches: dict[SignalWatch, None] = {}
        self.rate_hz = rate_hz
        self.patterns = patterns
        self._rights = rights
        self._hidden: frozenset[str] = frozenset()
        self._wanted = matcher(patterns)
        self._names: list[str] = []
        self._names_at: object = None
        self._made: dict[int, str | None] = {}
        self._made_at = -1
        # A little faster than requested, so that one late frame does not delay all later ones.
        self._period_s = 0.8 / rate_hz
        self._due = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def changed(self) -> None:
        """Offer changes to all members, now or when their rate allows it."""
        loop = asyncio.get_running_loop()
        # A frame may be early: a robot that sends at exactly this rate is not delayed.
        begin = self._due - self._period_s
        if loop.time() >= begin:
            self._offer()
        elif self._timer is None:
            self._timer = loop.call_at(begin, self._offer)

    def end(self) -> None:
        """Stop offering."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _offer(self) -> None:
        self.end()
        self._due = max(self._due, asyncio.get_running_loop().time()) + self._period_s
        for each in self.watches:
            each.is_due()

    def frame(self, since: int) -> str | None:
        """Return the changes since a version of the robot; None for none."""
        if self._made_at != self.robot.version:
            self._made.clear()
            self._made_at = self.robot.version
        if since not in self._made:
            if len(self._made) >= _FRAMES_MOST:
                del self._made[next(iter(self._made))]
            self._made[since] = self._encode(since)
        return self._made[since]

    def _encode(self, since: int) -> str | None:
        robot = self.robot
        self._choose()
        found: list[Signal] = [each for name in self._names
                               if (each := robot.signals[name]).version > since]
        if not found:
            return None
        body = ','.join([each.text(self._hidden) for each in found])
        return (f'{{"kind":"signals","robot":{encoded(robot.id)},"n":{robot.live_n},'
                f'"utc_ns":{robot.live_utc_ns},"sent_ns":{time.time_ns()},"signals":{{{body}}}}}')

    def _choose(self) -> None:
        """Select the signals again when signals or residents have changed."""
        robot = self.robot
        state = (robot.names, robot.named, robot.people)
        if state == self._names_at:
            return
        self._names_at = state
        self._hidden = self._rights.hidden(robot.named)
        visible = self._rights.sees_robot(robot.people)
        self._names = [name for name in robot.signals if visible and self._wanted(name)
                       and robot.knows(name)
                       and self._rights.sees_signal(name, self._hidden)]


class FanOut:
    """All groups of all robots."""

    def __init__(self) -> None:
        self._groups: dict[str, dict[tuple[object, ...], WatchGroup]] = {}

    def watch(self, queue: SendQueue, robot: RobotState, rights: Rights,
              patterns: tuple[str, ...], rate_hz: float) -> SignalWatch:
        """Begin to send signals of a robot to a client, starting with the present values."""
        groups = self._groups.setdefault(robot.id, {})
        for key in [key for key, each in groups.items() if not each.watches]:
            groups.pop(key).end()
        group = groups.get((rights, patterns, rate_hz))
        if group is None:
            group = WatchGroup(robot, rights, patterns, rate_hz)
            groups[rights, patterns, rate_hz] = group
        return SignalWatch(queue, group)

    def changed(self, robot: RobotState) -> None:
        """Send changes of a robot to the clients that watch them."""
        for each in self._groups.get(robot.id, {}).values():
            if each.watches:
                each.changed()

    def wanted(self, robot: str) -> tuple[float, tuple[str, ...]]:
        """Return the highest rate at which a robot is watched, and all patterns."""
        groups = [each for each in self._groups.get(robot, {}).values() if each.watches]
        patterns = {name for each in groups for name in each.patterns}
        return (max((each.rate_hz for each in groups), default=0.0),
                tuple(sorted(patterns)) if len(patterns) <= WANTED_MOST else ('*',))
