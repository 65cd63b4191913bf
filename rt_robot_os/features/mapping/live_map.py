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
The map that a module works with: of a file, of a topic, or of both.

A map on a topic grows while it is made. Each message is checked and copied in pieces. An invalid
one is rejected with a warning, and the last valid map stays in use. With a file as well, cells
that are unknown on the topic have the values of the file.
"""

from __future__ import annotations

from collections.abc import Generator
from collections.abc import Mapping
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.logger import Logger
from rt_robot_os.motion.base_map import BaseMap
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.map_message import grid_of
from rt_robot_os.topics.subscription import Subscription

MAP_MESSAGE = 'nav_msgs/msg/OccupancyGrid'


class LiveMap:
    """
    The newest valid map.

    :param path: of the YAML file of the base map; empty: none.
    :param source: of maps, the newest only; None: the map of the file alone is used.
    :param frame_id: of poses on the map.
    :param owner: name of the module, for errors.
    :raises ConfigError: the file cannot be read, or the frames differ.
    :ivar grid: None before the first.
    :ivar stamp_ns: of the last map of the topic; 0 before the first.
    :ivar seq: its number on the topic; -1 before the first.
    :ivar count: valid maps of the topic.
    :ivar refused: invalid ones.
    :ivar refusal: why the last one was rejected; empty when it was valid.
    """

    def __init__(self, path: str, source: Subscription | None, frame_id: str, owner: str,
                 log: Logger) -> None:
        if source is not None and source.msg.header.frame_id != frame_id:
            raise ConfigError([
                f'{owner}: {source.topic.name} is in the frame {source.msg.header.frame_id!r}, '
                f'but poses on it are in {frame_id!r}: declare both in the frame of the map'])
        self.grid = GridMap.load(path) if path else None
        self._base_map = BaseMap(self.grid) if self.grid is not None else None
        self.stamp_ns, self.seq = 0, -1
        self.count = self.refused = 0
        self.refusal = ''
        self._source = source
        self._log = log
        self._work: Generator[None, None, GridMap | None] | None = None

    @property
    def is_live(self) -> bool:
        """Return whether maps come on a topic."""
        return self._source is not None

    @property
    def published(self) -> int:
        """Return how many maps were published on the topic, read or not."""
        return self._source.topic.head if self._source is not None else 0

    def read_newest(self) -> Generator[None, None, GridMap | None]:
        """
        Read the newest map, if there is one; yields after each bounded piece of work.

        :return: the map; None when there is no new valid one.
        """
        source = self._source
        # A large sample is copied in pieces; samples that arrive meanwhile do not change the copy.
        if source is None or not source.latest():
            return None
        yield
        try:
            grid = yield from grid_of(source.msg)
            stamp_ns, seq = source.stamp_ns, source.seq
            if self._base_map is not None:
                grid = yield from self._base_map.filled(grid)
        except ConfigError as error:
            self.refused += 1
            self.refusal = '; '.join(error.problems)
            self._log.warn('a map on %s was rejected, the previous one stays in use: %s',
                           source.topic.name, self.refusal, throttle_s=10.0)
            return None
        self.grid, self.stamp_ns, self.seq, self.refusal = grid, stamp_ns, seq, ''
        self.count += 1
        return grid

    def advance(self, pieces: int) -> bool:
        """
        Do some pieces of reading the newest map; safe in the real-time loop.

        :return: whether :attr:`grid` was replaced.
        """
        if self._work is None:
            self._work = self.read_newest()
        try:
            for _ in range(pieces):
                next(self._work)
        except StopIteration as ended:
            self._work = None
            return ended.value is not None
        return False

    @property
    def is_reading(self) -> bool:
        """Return whether a map is being read."""
        return self._work is not None

    @property
    def is_behind(self) -> bool:
        """Return whether there is a map that was not read completely."""
        return self._work is not None or (self._source is not None and self._source.unread > 0)

    def warning(self) -> str:
        """Return the problem with the maps of the topic; empty without one."""
        if self.refusal:
            return f'the last map was rejected: {self.refusal}'
        return '' if self.grid is not None or self._source is None else (
            f'no map yet on {self._source.topic.name}')

    def statistics(self) -> Mapping[str, Any]:
        """Return the size of the map, and the counters."""
        grid = self.grid
        size = f'{grid.columns} x {grid.rows} of {grid.resolution_m:g} m' if grid else ''
        return {'map': size, 'maps': self.count, 'maps_refused': self.refused}


def check_map(path: str, is_live: bool, owner: str) -> None:
    """
    Check that a module has a source of maps.

    :raises ConfigError: it has none.
    """
    if not path and not is_live:
        raise ConfigError([f'{owner}: map and map_topic are both empty: there is no map; set '
                           'one of them'])
