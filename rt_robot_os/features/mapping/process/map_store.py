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

"""The files of mapping: saved maps, and the state from which it resumes."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
import time
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.robot_pose import copy_of
from rt_robot_os.features.mapping.slam import archive
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.state_file import StateFile
from rt_robot_os.motion.grid_map import GridMap

_State = tuple[MapGraph | None, dict[str, Any]]
#: An unchanged state is written again after this time: its file may have been removed.
_REWRITE_S: Final = 300.0
#: Movement, in m and rad, below which a robot counts as standing.
_STANDSTILL: Final = 0.02


class MapStore:
    """
    Write files in a thread, so that no scan waits for the disk.

    :param folder: of the state.
    :ivar counts: ``states_kept``, ``states_unkept``, ``maps_saved``, ``state_bytes``.
    :ivar problem: why the state could not be saved last; empty when it was.
    """

    def __init__(self, folder: Path) -> None:
        self.counts = dict.fromkeys(('states_kept', 'states_unkept', 'maps_saved',
                                     'state_bytes'), 0)
        self.problem = ''
        self._file = StateFile(folder / 'state')
        self._thread = ThreadPoolExecutor(1, 'disk')
        self._saving: Future[None] | None = None
        self._saved: _State | None = None
        self._saved_s = 0.0

    def read_state(self) -> tuple[MapGraph, dict[str, Any]] | None:
        """Return the saved state; :attr:`problem` says why one of its files is not used."""
        found = self._file.read()
        self.problem = '; '.join(self._file.problems)
        return found

    @property
    def is_busy(self) -> bool:
        """Return whether the state is being written."""
        return self._saving is not None and not self._saving.done()

    def save_state(self, graph: MapGraph | None, extra: Mapping[str, Any], is_last: bool = False
                   ) -> None:
        """
        Write the state unless it is unchanged, to spare the disk; returns immediately.

        :param is_last: write it in any case, after the writes under way.
        """
        if self.is_busy and not is_last:
            return
        state, now_s = (copy_of(graph), dict(extra)), time.monotonic()
        if (is_last or self.problem or now_s - self._saved_s >= _REWRITE_S
                or not _same(self._saved, state)):
            self._saved, self._saved_s = state, now_s
            self._saving = self._thread.submit(self._write_state, *state)

    def _write_state(self, graph: MapGraph | None, extra: Mapping[str, Any]) -> None:
        try:
            self.counts['state_bytes'] = self._file.write(graph or MapGraph(), extra)
            self.counts['states_kept'] += 1
            self.problem = ''
        except Exception as error:  # any error of the disk: mapping continues
            self.counts['states_unkept'] += 1
            self.problem = error_text(error)

    def delete_state(self) -> None:
        """Delete the state, after the writes under way."""
        self._saved = None
        self._thread.submit(self._delete_state)

    def _delete_state(self) -> None:
        try:
            self._file.remove()
        except OSError as error:
            self.problem = (f'{error.filename}: the old state cannot be removed: '
                            f'{error.strerror}: delete it, or mapping continues with it after '
                            'a restart')

    def save_map(self, path: Path, graph: MapGraph | None, grid: GridMap,
                 settings: Mapping[str, Any]
                 ) -> Future[Path]:
        """
        Save a map.

        :return: the path that was written; its exception is ConfigError when it failed.
        """
        return self._thread.submit(self._write_map, path, copy_of(graph), grid, settings)

    def _write_map(self, path: Path, graph: MapGraph | None, grid: GridMap,
                   settings: Mapping[str, Any]
                   ) -> Path:
        written = archive.save(path, graph, grid, settings)
        self.counts['maps_saved'] += 1
        return written

    def flush(self) -> None:
        """Wait until all pending writes are done."""
        self._thread.submit(bool).result()

    def close(self) -> None:
        """Finish all writes and end the thread."""
        self._thread.shutdown(wait=True)


def _same(before: _State | None, now: _State) -> bool:
    """Return whether two states are equal up to the noise of a standing robot."""
    if before is None or not _same_graph(before[0], now[0]) or before[1].keys() != now[1].keys():
        return False
    return all(_same_value(value, now[1][key]) for key, value in before[1].items())


def _same_graph(before: MapGraph | None, now: MapGraph | None) -> bool:
    if before is None or now is None:
        return before is now
    return (len(before.keyframes) == len(now.keyframes) and len(before.edges) == len(now.edges)
            and len(before.fixes) == len(now.fixes)
            and all(old.surface is new.surface and np.abs(old.pose - new.pose).max() < _STANDSTILL
                    for old, new in zip(before.keyframes, now.keyframes)))


def _same_value(before: Any, now: Any) -> bool:
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        return all(map(_same_value, before, now))
    if isinstance(before, float) and isinstance(now, float):
        return abs(before - now) < _STANDSTILL
    return bool(before == now)


def error_text(error: Exception) -> str:
    """Return the text of an error for the operator."""
    if isinstance(error, ConfigError):
        return '; '.join(error.problems)
    if isinstance(error, OSError) and error.strerror:
        return f'{error.filename}: {error.strerror}' if error.filename else error.strerror
    return f'{type(error).__name__}: {error}'
