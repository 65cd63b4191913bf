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

"""What mapping keeps on the disk, and what becomes of it when the disk does not want it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rt_robot_os.features.mapping.engine import Engine
from rt_robot_os.features.mapping.process.map_store import MapStore
from rt_robot_os.features.mapping.slam import state_file
from rt_robot_os.features.mapping.slam.graph import MapGraph


def extra(x: float = 0.0) -> dict[str, Any]:
    return {'base': [x, 0.0, 0.0], 'odometry': [x, 0.0, 0.0], 'mode': 'mapping', 'run_id': '1-2'}


def kept(folder: Path) -> tuple[MapGraph, dict[str, Any]]:
    found = MapStore(folder).read_state()
    assert found is not None
    return found


@pytest.fixture
def graph(mapped: Engine) -> MapGraph:
    assert mapped.graph is not None
    return mapped.graph


def test_a_robot_that_stands_spares_the_disk(graph: MapGraph, tmp_path: Path) -> None:
    keeper = MapStore(tmp_path)
    noise = np.random.default_rng(1).normal(0.0, 0.002, 8)
    for x in (0.0, *noise, 0.5, *(0.5 + noise)):
        keeper.save_state(graph, extra(float(x)))
        keeper.flush()
    assert keeper.counts['states_kept'] == 2
    keeper.save_state(graph, extra(0.5 + float(noise[-1])), is_last=True)
    keeper.close()
    assert keeper.counts['states_kept'] == 3
    assert kept(tmp_path)[1]['base'][0] == 0.5 + noise[-1]


def test_a_full_disk_keeps_the_state_of_before_and_its_room(
        graph: MapGraph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keeper = MapStore(tmp_path)
    keeper.save_state(graph, extra(1.0))
    keeper.flush()

    def torn(path: Path, data: bytes) -> None:
        path.write_bytes(data[:100])
        raise OSError(28, 'No space left on device', str(path))
    with monkeypatch.context() as full:
        full.setattr(state_file, 'write_whole', torn)
        keeper.save_state(graph, extra(2.0))
        keeper.flush()
    assert 'No space left' in keeper.problem and keeper.counts['states_unkept'] == 1
    assert kept(tmp_path)[1]['base'][0] == 1.0
    assert [each.name for each in (tmp_path / 'state').iterdir()] == ['state.1.npz']
    keeper.save_state(graph, extra(2.0))  # nothing has moved since, but it is not on the disk
    keeper.close()
    assert keeper.problem == '' and kept(tmp_path)[1]['base'][0] == 2.0


@pytest.mark.parametrize('harm', ['remove', 'truncate', 'flip', 'a file in its place'])
def test_what_somebody_does_to_the_files_while_it_runs_is_mended_with_the_next(
        graph: MapGraph, tmp_path: Path, harm: str) -> None:
    keeper = MapStore(tmp_path)
    for x in (1.0, 2.0):
        keeper.save_state(graph, extra(x))
        keeper.flush()
    folder = tmp_path / 'state'
    for path in folder.iterdir():
        data = bytearray(path.read_bytes())
        if harm in ('remove', 'a file in its place'):
            path.unlink()
        elif harm == 'truncate':
            path.write_bytes(data[:len(data) // 2])
        else:
            data[len(data) // 2] ^= 1
            path.write_bytes(data)
    if harm == 'a file in its place':
        folder.rmdir()
        folder.write_text('')
        keeper.save_state(graph, extra(2.5))
        keeper.flush()
        assert str(folder) in keeper.problem
        folder.unlink()
    keeper.save_state(graph, extra(3.0))
    keeper.close()
    found, told = kept(tmp_path)
    assert told['base'][0] == 3.0 and len(found.keyframes) == len(graph.keyframes)


def test_a_state_that_cannot_be_removed_is_told(graph: MapGraph, tmp_path: Path,
                                                monkeypatch: pytest.MonkeyPatch) -> None:
    keeper = MapStore(tmp_path)
    keeper.save_state(graph, extra())
    keeper.flush()

    def refused(self: Path, missing_ok: bool = False) -> None:
        raise PermissionError(1, 'Operation not permitted', str(self))
    with monkeypatch.context() as locked:
        locked.setattr(Path, 'unlink', refused)
        keeper.delete_state()
        keeper.flush()
    assert 'cannot be removed' in keeper.problem and 'delete it' in keeper.problem
    keeper.close()


def test_a_folder_that_cannot_be_looked_into_is_told_at_once(tmp_path: Path) -> None:
    (tmp_path / 'state').write_text('')  # so it is for root as well
    keeper = MapStore(tmp_path)
    assert keeper.read_state() is None and 'cannot be read: Not a directory' in keeper.problem
    keeper.close()
