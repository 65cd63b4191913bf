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

"""What stays where it is: the map, and the nodes of the sensor network, as the server asks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rt_robot_os.clients.gateway.part import Part
from rt_robot_os.clients.gateway.part import Ways
from rt_robot_os.errors import ConfigError
from rt_robot_os.linux.survey_files import load_survey
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.uplink.maps import map_message


class Surroundings(Part):
    """Name map and nodes in the greeting; send the map when the server has not got it."""

    kinds = frozenset({'welcome'})

    def __init__(self, ways: Ways) -> None:
        super().__init__(ways)
        self._map = self._read_map(ways.settings.map)
        self._nodes = self._read_nodes(ways.settings.nodes_file)
        self._wanted = False

    def _read_map(self, path: str) -> dict[str, Any]:
        if not path:
            return {}
        try:
            grid = GridMap.load(Path(path).expanduser())
            rows, columns = grid.cells.shape
            x, y, yaw = grid.origin
            return map_message(columns, rows, grid.resolution_m, (x, y, yaw), grid.cells.tobytes())
        except (ConfigError, ValueError, OSError) as error:
            self.ways.tell(f'map {path}: {error}; the page shows none')
            return {}

    def _read_nodes(self, path: str) -> list[dict[str, Any]]:
        if not path:
            return []
        try:
            return [{'id': each.id, 'name': each.token, 'x': each.x, 'y': each.y, 'z': each.z,
                     'person': each.person} for each in load_survey(path, 'nodes_file')]
        except ConfigError as error:
            self.ways.tell(f'nodes_file {path}: {error}; the page shows none where it hangs')
            return []

    def hello(self) -> Mapping[str, Any]:
        """Say which map it is, and where the nodes are."""
        return {'map': self._map.get('sha256', ''), 'nodes': self._nodes}

    def hear(self, message: Mapping[str, Any]) -> None:
        """Note whether the server wants the map."""
        self._wanted = message.get('want_map') is True and bool(self._map)

    def met_server(self) -> None:
        """Send the map to who wants it."""
        if self._wanted:
            self.ways.server.send('map', self._map)
