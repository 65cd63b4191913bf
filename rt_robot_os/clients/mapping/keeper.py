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

"""What mapping keeps on the disk: maps that somebody saves, and the state that it goes on from."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from rt_robot_os.clients.mapping.places import copy_of
from rt_robot_os.errors import ConfigError
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.slam import archive
from rt_robot_os.slam.graph import Graph
from rt_robot_os.slam.state_file import StateFile


class Keeper:
    """
    Write in a thread, so that no scan waits for the disk.

    :param folder: of the state.
    :ivar counts: ``states_kept``, ``states_unkept``, ``maps_saved``, ``state_bytes``.
    :ivar problem: why the state could not be kept last; empty when it was.
    """

    def __init__(self, folder: Path) -> None:
        self.counts = dict.fromkeys(('states_kept', 'states_unkept', 'maps_saved',
                                     'state_bytes'), 0)
        self.problem = ''
        self._file = StateFile(folder / 'state')
        self._thread = ThreadPoolExecutor(1, 'disk')
        self._keeping: Future[None] | None = None

    def read(self) -> tuple[Graph, dict[str, Any]] | None:
        """Return the state of before; :attr:`problem` says why one of the files is not used."""
        found = self._file.read()
        self.problem = '; '.join(self._file.problems)
        return found

    @property
    def is_busy(self) -> bool:
        """Return whether the state is being written."""
        return self._keeping is not None and not self._keeping.done()

    def keep(self, graph: Graph | None, extra: Mapping[str, Any]) -> None:
        """Write the state; returns at once."""
        if not self.is_busy:
            self._keeping = self._thread.submit(self._keep, copy_of(graph), dict(extra))

    def _keep(self, graph: Graph | None, extra: Mapping[str, Any]) -> None:
        try:
            self.counts['state_bytes'] = self._file.write(graph or Graph(), extra)
            self.counts['states_kept'] += 1
            self.problem = ''
        except ConfigError as error:
            self.counts['states_unkept'] += 1
            self.problem = error.problems[0]

    def forget(self) -> None:
        """Remove the state, after what is being written."""
        self._thread.submit(self._file.remove)

    def save(self, path: Path, graph: Graph | None, grid: GridMap, settings: Mapping[str, Any]
             ) -> Future[Path]:
        """
        Save a map.

        :return: of the path that was written; its exception is ConfigError when none was.
        """
        return self._thread.submit(self._save, path, copy_of(graph), grid, settings)

    def _save(self, path: Path, graph: Graph | None, grid: GridMap, settings: Mapping[str, Any]
              ) -> Path:
        written = archive.save(path, graph, grid, settings)
        self.counts['maps_saved'] += 1
        return written

    def close(self) -> None:
        """Wait until everything is written."""
        self._thread.shutdown(wait=True)
