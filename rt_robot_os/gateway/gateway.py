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

"""The gateway of one robot: its parts, the link on one side and the server on the other."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
import time
from typing import Any
from typing import Final

from rt_robot_os.gateway.commands import CommandPart
from rt_robot_os.gateway.connection import ServerConnection
from rt_robot_os.gateway.connection import Talk
from rt_robot_os.gateway.drive import TeleopPart
from rt_robot_os.gateway.heartbeat import Heartbeat
from rt_robot_os.gateway.identity import Identity
from rt_robot_os.gateway.live import Live
from rt_robot_os.gateway.map_part import MapPart
from rt_robot_os.gateway.media import Media
from rt_robot_os.gateway.part import GatewayContext
from rt_robot_os.gateway.part import Part
from rt_robot_os.gateway.part import Record
from rt_robot_os.gateway.people import people_in
from rt_robot_os.gateway.record_queue import RecordQueue
from rt_robot_os.gateway.records import Records
from rt_robot_os.gateway.robot_link import RobotLink
from rt_robot_os.gateway.settings import GatewaySettings
from rt_robot_os.gateway.state_connection import StateConnection
from rt_robot_os.gateway.voice import Voice
from rt_robot_os.messages.uplink.greeting import DriveLimits
from rt_robot_os.messages.uplink.greeting import RobotHello
from rt_robot_os.messages.uplink.tasks import end

#: Each is made with :class:`~.part.GatewayContext`, and called in this order.
PARTS: Final[tuple[Callable[[GatewayContext], Part], ...]] = (
    CommandPart, MapPart, TeleopPart, Media, Voice)
_STOP_LOOK_S: Final = 0.1
#: The server is called without the robot after this time.
_ROBOT_S: Final = 1.0
_LOOK_S: Final = 0.01


class Gateway:
    """
    Carry between a core and a server.

    :param name: of the robot, as people call it.
    :param path: of the core's socket.
    :param folder: of its own files; made, for this user alone.
    :param tell: takes a line of text about what goes wrong.
    :raises StartError: the folder cannot be used.
    """

    def __init__(self, settings: GatewaySettings, name: str, path: Path, folder: Path,
                 tell: Callable[[str], None]) -> None:
        self._settings = settings
        self._tell = tell
        self._name = settings.name or name
        self.identity = Identity(folder)
        self.robot = RobotLink(path, tell)
        self.server = StateConnection(settings, self._hello, tell)
        self._extra: list[ServerConnection] = []
        context = GatewayContext(self.robot, self.server, settings, self._keep, self._connect,
                                 tell, folder)
        self.live = Live(context)
        self.keeper = RecordQueue(context, self.identity.boot)
        self.parts: tuple[Part, ...] = (
            *(make(context) for make in PARTS), self.keeper, Records(context, self.keeper),
            self.live, Heartbeat(context, self.statistics))

    def _keep(self, record: Record) -> None:
        """Store a record of a part."""
        self.keeper.keep(record)

    def _connect(self, path: str, talk: Talk) -> ServerConnection:
        """Add a connection of a part's own; before :meth:`run`."""
        made = ServerConnection(self._settings, path, talk, self._tell_more)
        self._extra.append(made)
        return made

    def _tell_more(self, text: str) -> None:
        """Tell of another connection what that for state has not told already."""
        if self.server.connected:
            self._tell(text)

    def _hello(self) -> RobotHello:
        """Say who this is, and what it can do."""
        greetings = [part.hello() for part in self.parts]
        limits = (each.limits for each in greetings)
        return RobotHello(
            self.identity.boot, self.identity.robot, self._name, time.time_ns(),
            tuple(self._settings.people or people_in(self.robot.topics)),
            tuple(name for each in greetings for name in each.cameras),
            tuple(dict.fromkeys(name for each in greetings for name in each.capabilities)),
            tuple(node for each in greetings for node in each.nodes),
            next((each.map for each in greetings if each.map), ''),
            next((each for each in limits if each.linear_m_s), DriveLimits()))

    async def _serve(self) -> None:
        """Talk with the server; it is greeted with what the robot has, if that runs."""
        deadline_s = time.monotonic() + _ROBOT_S
        while not self.robot.connected and time.monotonic() < deadline_s:
            await asyncio.sleep(_LOOK_S)
        await self.server.run(self.parts, (self.keeper, self.live))

    async def run(self, stopping: Callable[[], bool]) -> None:
        """
        Carry until stopped.

        :raises Exception: a part has ended, which none should.
        """
        self.keeper.start()
        self.robot.start(self.parts)
        tasks = [asyncio.ensure_future(each) for each in (
            self._serve(),
            *(part.run() for part in self.parts if type(part).run is not Part.run),
            *(each.run() for each in self._extra))]
        try:
            while not stopping():
                done, _ = await asyncio.wait(tasks, timeout=_STOP_LOOK_S,
                                             return_when=asyncio.FIRST_COMPLETED)
                for each in done:
                    each.result()
        finally:
            with suppress(asyncio.CancelledError):
                await end(tasks)
            self.robot.stop()
            self.keeper.stop()

    def statistics(self) -> dict[str, Any]:
        """Return the counters of all parts. Any thread."""
        found = {**self.robot.statistics(), **self.server.statistics()}
        for part in self.parts:
            found.update(part.statistics())
        return found
