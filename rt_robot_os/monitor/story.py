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
The story of ``monitor --demo``: Anna falls, in real time.

The simulated world runs in the robot's own time, which a busy machine slows down. So the story
begins when the robot is ready and a page is open, announces the fall on the console and on the
page, and then orders it. If the fall is not detected, because samples came too late, she gets up
and falls once more.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
import os
import time
from typing import Any
from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.units import NS_PER_S

if TYPE_CHECKING:
    from rt_robot_os.monitor.live.hub import Hub
    from rt_robot_os.monitor.live.robot_state import RobotState

PERSON: Final = 'anna'
#: Time from a ready robot and an open page to the fall.
FALLS_AFTER_S: Final = 40.0
#: Without a page it begins this long after the robot is ready.
NO_PAGE_S: Final = 120.0
#: A fall that was not detected within this time is repeated.
NOTICED_S: Final = 45.0
FALLS_MOST: Final = 5
_LOOK_S: Final = 0.5
#: Signals that show that a robot is ready.
_READY: Final = ('pose', 'agent/state')


class DemoStory:
    """
    Orders and announces the events; for the event loop alone.

    :param robot: the name of the robot.
    :param order: triggers an event in the simulated world, such as ``fall anna``; it may block,
        and raises OSError when the world accepts none.
    :param say: prints a line on the console.
    :param clock_s: monotonic.
    :ivar falls: ordered falls.
    """

    def __init__(self, hub: Hub, robot: str, order: Callable[[str], None],
                 say: Callable[[str], None], clock_s: Callable[[], float] = time.monotonic
                 ) -> None:
        self.falls = 0
        self._hub = hub
        self._name = robot
        self._order = order
        self._say = say
        self._clock_s = clock_s
        self._ready_s = self._due_s = self._fell_s = 0.0
        self._fell_ns = 0
        self._about: dict[str, Any] | None = None
        self._is_over = False

    async def run(self) -> None:
        """Run the story until its end."""
        while not self._is_over:
            await self.look()
            await asyncio.sleep(_LOOK_S)

    async def look(self) -> None:
        """Do the next due step."""
        robot = next((each for each in self._hub.robots.values() if each.name == self._name
                      and each.connected), None)
        if robot is None or self._is_over:
            return
        now_s = self._clock_s()
        if not self._due_s:
            self._await_beginning(robot, now_s)
        elif self._fell_s:
            await self._await_notice(robot, now_s)
        elif now_s >= self._due_s:
            await self._fall()
        self._show(robot)

    def _await_beginning(self, robot: RobotState, now_s: float) -> None:
        if not all(each in robot.signals for each in _READY):
            return
        self._ready_s = self._ready_s or now_s
        if self._hub.clients or now_s >= self._ready_s + NO_PAGE_S:
            self._plan(now_s)

    def _plan(self, now_s: float) -> None:
        self._due_s, self._fell_s = now_s + FALLS_AFTER_S, 0.0
        at = time.strftime('%H:%M:%S', time.localtime(time.time() + FALLS_AFTER_S))
        self._say(f'demo: {PERSON} falls in {FALLS_AFTER_S:.0f} s, at {at}')
        self._about = {'what': 'fall', 'person': PERSON,
                       'at_ns': time.time_ns() + round(FALLS_AFTER_S * NS_PER_S)}

    async def _fall(self) -> None:
        self._fell_ns = time.time_ns()
        if not await self._ordered('fall'):
            return
        self.falls += 1
        self._fell_s = self._clock_s()
        self._say(f'demo: {PERSON} has fallen; the robot notices it within some seconds')

    async def _await_notice(self, robot: RobotState, now_s: float) -> None:
        # The clock of a robot may be slightly behind the server's.
        if any(each.get('subject') == PERSON and 'fall' in each.get('kinds', ())
               and each['opened_ns'] >= self._fell_ns - NS_PER_S
               for each in robot.alarms.values()):
            self._is_over = True
            self._about = None
        elif now_s >= self._fell_s + NOTICED_S:
            load = f'the load is {os.getloadavg()[0]:.0f} on {os.cpu_count()} CPUs'
            if self.falls >= FALLS_MOST:
                self._say(f'demo: the robot has noticed none of {self.falls} falls: this machine '
                          f'is too busy ({load}); end other programs and start the demo again')
                self._is_over = True
                self._about = None
                return
            self._say(f'demo: the robot has not noticed the fall ({load}); {PERSON} gets up, '
                      'and falls once more')
            if await self._ordered('rise'):
                self._plan(self._clock_s())

    async def _ordered(self, what: str) -> bool:
        """Return whether the order succeeded; otherwise the story ends."""
        try:
            await asyncio.to_thread(self._order, f'{what} {PERSON}')
        except OSError as error:
            self._say(f'demo: {PERSON} does not {what}: {error}')
            self._is_over, self._about = True, None
            return False
        return True

    def _show(self, robot: RobotState) -> None:
        """Announce the fall on the pages again, since a hello of the robot has cleared it."""
        if robot.about.get('story') != self._about:
            robot.about = {**robot.about, 'story': self._about}
            self._hub.tell_robot(robot)
