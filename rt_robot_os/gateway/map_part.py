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

"""The map of the robot, from a file or growing, and the nodes of its network."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from collections.abc import Sequence
from pathlib import Path
import time
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.gateway.map_topic import MAP_MESSAGE
from rt_robot_os.gateway.map_topic import message_of
from rt_robot_os.gateway.part import GatewayContext
from rt_robot_os.gateway.part import Greeting
from rt_robot_os.gateway.part import Part
from rt_robot_os.gateway.reading import Reads
from rt_robot_os.gateway.reading import Sample
from rt_robot_os.linux.file_urls import read_text_file
from rt_robot_os.messages.survey import read_survey
from rt_robot_os.messages.uplink.greeting import NodePosition
from rt_robot_os.messages.uplink.greeting import ServerWelcome
from rt_robot_os.messages.uplink.maps import MapMessage
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.motion.grid_map import GridMap

TOPIC: Final = 'map'
#: Shortest time between two maps of a growing one.
MAP_S: Final = 5.0
_LOOK_S: Final = 0.1


class MapPart(Part):
    """
    Announce map and nodes in the greeting; send the map when the server does not have it.

    The map of the file is shown until the robot has one on its topic ``map``.

    :ivar maps_sent: maps sent to the server.
    :ivar maps_refused: messages of the topic that were not a valid map.
    """

    receives = (ServerWelcome,)

    def __init__(self, context: GatewayContext) -> None:
        super().__init__(context)
        self._map = self._read_map(context.settings.map)
        self._nodes = self._read_nodes(context.settings.nodes_file)
        self._wanted = False
        self._is_sent = True
        self._next_s = 0.0
        self._new: bytes | None = None
        self._told: set[str] = set()
        self.maps_sent = self.maps_refused = 0

    def _read_map(self, path: str) -> MapMessage | None:
        if not path:
            return None
        try:
            grid = GridMap.load(Path(path).expanduser())
            rows, columns = grid.cells.shape
            x, y, yaw = grid.origin
            return MapMessage.pack(columns, rows, grid.resolution_m, (x, y, yaw),
                                   grid.cells.tobytes())
        except (ConfigError, ValueError, OSError) as error:
            self.context.tell(f'map {path}: {error}; the page shows none')
            return None

    def _read_nodes(self, path: str) -> tuple[NodePosition, ...]:
        if not path:
            return ()
        try:
            file, text = read_text_file(path, 'nodes_file', 'a YAML file with nodes')
            return tuple(
                NodePosition(each.id, each.token, each.x, each.y, each.z, each.person)
                for each in read_survey(text, str(file)))
        except ConfigError as error:
            self.context.tell(f'nodes_file {path}: {error}; the page shows none where it hangs')
            return ()

    def hello(self) -> Greeting:
        """Announce the hash of the map and the positions of the nodes."""
        return Greeting(map=self._digest, nodes=self._nodes)

    @property
    def _digest(self) -> str:
        return '' if self._map is None else self._map.sha256

    def reads(self) -> Sequence[Reads]:
        """Read the growing map."""
        return [Reads(TOPIC, self._take, rate_hz=1.0 / MAP_S)]

    def _take(self, sample: Sample) -> None:
        if sample.type == MAP_MESSAGE:
            self._new = bytes(sample.cdr)

    async def run(self) -> None:
        """Send each changed map when it is due."""
        while True:
            await asyncio.sleep(_LOOK_S)
            new, self._new = self._new, None
            if new is not None and await self._become(new):
                self._is_sent = False
            if (not self._is_sent and self.context.server.connected
                    and time.monotonic() >= self._next_s):
                self._send()

    def _send(self) -> None:
        self._is_sent = True
        self._next_s = time.monotonic() + MAP_S
        if self._map is not None:
            self.maps_sent += 1
            self.context.server.send_newest(self._map)

    async def _become(self, cdr: bytes) -> bool:
        """Apply a map of the topic; return whether it has changed."""
        try:
            made = await asyncio.to_thread(message_of, cdr)
        except (ConfigError, ValueError) as error:
            self.maps_refused += 1
            if str(error) not in self._told and len(self._told) < 10:
                self._told.add(str(error))
                self.context.tell(f'topic {TOPIC}: {error}; the page shows the one before')
            return False
        is_new = made.sha256 != self._digest
        self._map = made
        return is_new

    def receive(self, message: UplinkMessage) -> None:
        """Store whether the server requests the map."""
        if isinstance(message, ServerWelcome):
            self._wanted = message.want_map and self._map is not None

    def met_server(self) -> None:
        """Send the map if it is requested."""
        if self._wanted:
            self._send()

    def statistics(self) -> Mapping[str, Any]:
        """Return its counters. Any thread."""
        return {'maps_sent': self.maps_sent, 'maps_refused': self.maps_refused}
