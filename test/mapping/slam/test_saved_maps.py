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

"""Saved maps: whole or not at all, told what is wrong with them, and those of others."""

from __future__ import annotations

import errno
import itertools
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.slam.archive import load
from rt_robot_os.features.mapping.slam.archive import save
from rt_robot_os.features.mapping.slam.archive import steps_of_saving
from rt_robot_os.features.mapping.slam.array_file import pack
from rt_robot_os.features.mapping.slam.array_file import unpack
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.graph_arrays import arrays_of
from rt_robot_os.features.mapping.slam.keyframes import Keyframe
from rt_robot_os.features.mapping.slam.pose_graph import AbsolutePose
from rt_robot_os.features.mapping.slam.pose_graph import PoseEdge
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.scan import surface_of
from rt_robot_os.features.mapping.slam.state_file import StateFile
from rt_robot_os.motion.grid_map import GridMap

ROOT = Path(__file__).resolve().parents[3]


def a_graph(seed: int = 1, keyframes: int = 3, beams: int = 60, reach_m: float = 8.0) -> MapGraph:
    rng = np.random.default_rng(seed)
    graph = MapGraph()
    for number in range(keyframes):
        ranges = rng.uniform(0.5, reach_m) + rng.normal(0, 0.01, beams)
        ranges[rng.integers(0, beams, 5)] = np.inf
        scan = Scan(10 ** 18 + number, rng.normal(size=3), ranges, -2.0, 4.0 / beams)
        graph.keyframes.append(Keyframe(scan.stamp_ns, rng.normal(size=3), scan.odometry,
                                        surface_of(scan, 100.0), 0.3 * number))
        if number:
            half = rng.normal(size=(3, 3))
            graph.edges.append(PoseEdge(number - 1, number, rng.normal(size=3),
                                        half @ half.T + np.eye(3), number % 2 == 0))
    graph.fixes.append(AbsolutePose(1, rng.normal(size=3), np.diag((4.0, 4.0, 100.0))))
    return graph


def a_grid(seed: int = 1, resolution_m: float = 0.05) -> GridMap:
    cells = np.random.default_rng(seed).choice(
        np.array((-1, 0, 100), np.int8), (12 + seed, 17), p=(0.2, 0.6, 0.2))
    return GridMap(cells, resolution_m, (-1.5, 0.1 * seed, 0.0))


def same(a: MapGraph | None, b: MapGraph | None) -> bool:
    if a is None or b is None:
        return a is b
    first, second = arrays_of(a), arrays_of(b)
    return all(np.array_equal(first[name], second[name]) for name in first)


def test_a_map_is_read_as_it_was_saved(tmp_path: Path) -> None:
    graph, grid = a_graph(), a_grid()
    assert save(tmp_path / 'new' / 'flat', graph, grid, {'keyframe_m': 0.3}).name == 'flat.yaml'
    assert sorted(os.listdir(tmp_path / 'new')) == ['flat.graph.npz', 'flat.pgm', 'flat.yaml']
    assert "image: 'flat.pgm'" in (tmp_path / 'new' / 'flat.yaml').read_text()
    for name in ('flat', 'flat.yaml', 'flat.graph.npz'):
        saved = load(tmp_path / 'new' / name)
        assert saved.graph is not None and saved.settings == {'keyframe_m': 0.3}
        assert not saved.notes and np.array_equal(saved.grid.cells, grid.cells)
        assert saved.grid.origin == grid.origin
        for was, now in zip(graph.keyframes, saved.graph.keyframes):
            assert now.stamp_ns == was.stamp_ns and np.array_equal(now.pose, was.pose)
            assert np.array_equal(now.odometry, was.odometry)
            assert now.travelled_m == was.travelled_m
            assert np.abs(now.surface.points - was.surface.points).max() <= 0.0005 + 1e-9
            assert np.abs(now.surface.normals - was.surface.normals).max() < 0.001
            assert np.array_equal(now.surface.lined, was.surface.lined)
        for edge, read in zip(graph.edges, saved.graph.edges):
            assert (edge.first, edge.second, edge.is_loop) == (
                read.first, read.second, read.is_loop)
            assert np.allclose(edge.relative, read.relative)
            assert np.allclose(edge.information, read.information)
        for fix, again in zip(graph.fixes, saved.graph.fixes):
            assert fix.keyframe == again.keyframe and np.array_equal(fix.pose, again.pose)
            assert np.array_equal(fix.information, again.information)
        assert len(saved.graph.fixes) == 1
    # Once more, and nothing changes.
    save(tmp_path / 'again', saved.graph, saved.grid)
    assert same(load(tmp_path / 'again').graph, saved.graph)


def test_a_scan_of_far_away_is_kept_to_some_millimetres(tmp_path: Path) -> None:
    graph = a_graph(reach_m=80.0, seed=5)
    save(tmp_path / 'hall', graph, a_grid())
    read = load(tmp_path / 'hall').graph
    assert read is not None
    for was, now in zip(graph.keyframes, read.keyframes):
        assert np.abs(now.surface.points - was.surface.points).max() < 0.003


@pytest.mark.parametrize('then', ['a graph', 'no graph'])
@pytest.mark.parametrize('before', ['nothing', 'a map', 'a grid', 'a map that waits'])
def test_power_may_fail_at_any_step_of_saving(tmp_path: Path, before: str, then: str) -> None:
    old, new = a_graph(1), a_graph(2) if then == 'a graph' else None
    count = len(list(steps_of_saving(tmp_path / 'count.yaml', new, a_grid(2))))
    assert count > 5
    for cut in range(count):
        yaml = tmp_path / f'{before}{cut}' / 'm.yaml'
        yaml.parent.mkdir()
        if before == 'a map that waits':
            save(yaml, a_graph(3), a_grid(3))
            interrupted(yaml, old, a_grid(1), 'the new map is the map')
        elif before != 'nothing':
            save(yaml, old if before == 'a map' else None, a_grid(1))
        steps = steps_of_saving(yaml, new, a_grid(2))
        said = [next(steps) for _ in range(cut + 1)]
        steps.close()
        if before == 'nothing' and 'the new map is the map' not in said:
            with pytest.raises(ConfigError, match='does not exist'):
                load(yaml)
            continue
        saved = load(yaml)
        is_new = 'the new map is the map' in said
        assert np.array_equal(saved.grid.cells, a_grid(2 if is_new else 1).cells)
        assert saved.grid.origin == a_grid(2 if is_new else 1).origin
        assert same(saved.graph, new if is_new else old if 'map' in before else None)
        # Other programs read the grid by itself.
        assert np.array_equal(GridMap.load(yaml).cells, saved.grid.cells)
        save(yaml, new, a_grid(2))
        assert same(load(yaml).graph, new)
        assert sorted(os.listdir(yaml.parent)) == [
            *(['m.graph.npz'] if new else []), 'm.pgm', 'm.yaml']


def interrupted(yaml: Path, graph: MapGraph, grid: GridMap, after: str) -> None:
    steps = steps_of_saving(yaml, graph, grid)
    while next(steps) != after:
        pass
    steps.close()


def test_a_map_that_cannot_be_written_says_so_and_leaves_the_old_one(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    with pytest.raises(ConfigError, match='cannot be written: .*another file'):
        save(tmp_path / 'file' / 'm', a_graph(), a_grid())
    save(tmp_path / 'm', a_graph(1), a_grid(1))
    (tmp_path / '.m.yaml.new').mkdir()  # in its way
    with pytest.raises(ConfigError, match='cannot be written'):
        save(tmp_path / 'm', a_graph(2), a_grid(2))
    assert same(load(tmp_path / 'm').graph, a_graph(1))


@pytest.mark.parametrize('written', range(5))
def test_what_a_full_disk_did_not_take_leaves_its_room(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, written: int) -> None:
    save(tmp_path / 'm', a_graph(1), a_grid(1))
    fsync, calls = os.fsync, itertools.count()

    def full(handle: int) -> None:
        if next(calls) >= written:
            raise OSError(errno.ENOSPC, 'No space left on device')
        fsync(handle)

    monkeypatch.setattr(os, 'fsync', full)
    with pytest.raises(ConfigError, match='No space left'):
        save(tmp_path / 'm', a_graph(2), a_grid(2))
    monkeypatch.undo()
    assert '.m.graph.npz.new' not in os.listdir(tmp_path)
    kept = load(tmp_path / 'm')
    which = 1 if written < 4 else 2
    assert same(kept.graph, a_graph(which))
    assert np.array_equal(kept.grid.cells, a_grid(which).cells)


@pytest.mark.parametrize('name', ['m.graph.npz', 'm.yaml', 'm.pgm'])
def test_a_file_that_is_damaged_anywhere_is_never_a_wrong_map(tmp_path: Path, name: str) -> None:
    graph, grid = a_graph(), a_grid()
    save(tmp_path / 'm', graph, grid)
    file = tmp_path / name
    whole = file.read_bytes()
    rng = np.random.default_rng(3)
    ends = {0, 1, len(whole) - 1, *rng.integers(0, len(whole), 12).tolist()}
    cuts = [whole[:at] for at in ends]
    flips = []
    for at in {*range(0, min(60, len(whole))), *rng.integers(0, len(whole), 60).tolist()}:
        flips.append(whole[:at] + bytes([whole[at] ^ 1 << int(rng.integers(8))]) + whole[at + 1:])
    refused = 0
    for data in cuts + flips:
        file.write_bytes(data)
        try:
            saved = load(tmp_path / 'm')
        except ConfigError as error:
            refused += 1
            assert str(tmp_path) in str(error)
            continue
        assert same(saved.graph, graph)
        assert saved.grid.cells.shape == grid.cells.shape and saved.grid.origin == grid.origin
        changed = int((saved.grid.cells != grid.cells).sum())
        # A pixel is what anybody may paint on: it is told, not refused.
        assert changed <= 1 and bool(saved.notes) == bool(changed)
    assert refused >= (len(cuts) + len(flips)) * (0.6 if name == 'm.graph.npz' else 0.1)


def test_files_of_two_maps_are_not_taken_for_one(tmp_path: Path) -> None:
    save(tmp_path / 'a', a_graph(1), a_grid(1))
    save(tmp_path / 'b', a_graph(2), a_grid(2))
    (tmp_path / 'a.graph.npz').replace(tmp_path / 'b.graph.npz')
    with pytest.raises(ConfigError,
                       match=r'b\.graph\.npz: does not belong to the map .*delete the graph'):
        load(tmp_path / 'b')
    assert load(tmp_path / 'b', with_graph=False).graph is None
    assert load(tmp_path / 'a').graph is None


def test_a_picture_that_was_painted_on_is_told(tmp_path: Path) -> None:
    grid = a_grid()
    save(tmp_path / 'm', a_graph(), grid)
    cells = grid.cells.copy()
    cells[3, 4:7] = np.where(cells[3, 4:7] == 100, 0, 100)
    GridMap(cells, grid.resolution_m, grid.origin).save(tmp_path / 'm.yaml')
    saved = load(tmp_path / 'm')
    assert saved.graph is not None and np.array_equal(saved.grid.cells, cells)
    assert '3 cells differ from the saved ones' in saved.notes[0]


@pytest.mark.parametrize('name, value, says', [
    ('version', np.array([2]), 'newer release'),
    ('version', np.array(['1']), 'damaged: an array of'),
    ('points', np.zeros((1, 2), np.int16), 'points is int16 of shape'),
    ('point_counts', np.array([-1, 2, 3], np.int32), 'negative number of points'),
    ('point_counts', np.array([2 ** 31 - 1] * 3, np.int32), 'points is int16'),
    ('poses', np.full((3, 3), np.nan), 'not finite'),
    ('poses', None, 'poses is missing'),
    ('edges', np.array([[0, 9, 0], [0, 1, 0]], np.int32), 'refers to a missing keyframe'),
    ('fix_at', np.array([3], np.int32), 'absolute pose refers to a missing keyframe'),
    ('settings', np.frombuffer(b'[' * 9000, np.uint8), 'is damaged'),
])
def test_a_graph_that_was_made_up_is_refused(
        tmp_path: Path, name: str, value: Any, says: str) -> None:
    save(tmp_path / 'm', a_graph(), a_grid())
    file = tmp_path / 'm.graph.npz'
    arrays = unpack(file.read_bytes())
    if value is None:
        del arrays[name]
    else:
        arrays[name] = value
    file.write_bytes(pack(arrays))
    with pytest.raises(ConfigError, match=says) as found:
        load(tmp_path / 'm')
    assert 'delete it' in str(found.value) and 'm.graph.npz' in str(found.value)


def test_nothing_is_run_and_no_memory_is_asked_for(tmp_path: Path) -> None:
    save(tmp_path / 'm', a_graph(), a_grid())
    for array in (np.array([{'a': 1}], dtype=object),):
        np.savez(tmp_path / 'm.graph.npz', points=array, allow_pickle=True)
        with pytest.raises(ConfigError, match='damaged'):
            load(tmp_path / 'm')
    import zipfile
    with zipfile.ZipFile(tmp_path / 'm.graph.npz', 'w') as archive:
        archive.writestr('a.npy', b'\x93NUMPY\x01\x00v\x00' + (
            b"{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999,), }").ljust(118))
    with pytest.raises(ConfigError, match='damaged'):
        load(tmp_path / 'm')
    with zipfile.ZipFile(tmp_path / 'm.graph.npz', 'w', zipfile.ZIP_DEFLATED) as archive:
        for number in range(65):
            archive.writestr(f'{number}.npy', b'')
    with pytest.raises(ConfigError, match='65 arrays'):
        load(tmp_path / 'm')


@pytest.mark.parametrize('name, says', [
    ('none', 'does not exist'), ('m.posegraph', 'is a graph of slam_toolbox, no'),
    ('m.pbstream', 'Cartographer'), ('', 'is no name|does not exist'), ('m.png', 'is a picture')])
def test_what_is_no_map_is_told_with_what_would_be_one(
        tmp_path: Path, name: str, says: str) -> None:
    if name:
        (tmp_path / name).touch()
    with pytest.raises(ConfigError, match=says):
        load(tmp_path / name if name != 'none' else tmp_path / 'nothing')


# ---- the state of a run -------------------------------------------------------------------------

def test_a_state_is_read_again_and_a_torn_one_gives_the_one_before(tmp_path: Path) -> None:
    states = StateFile(tmp_path / 'run')
    assert states.read() is None and not states.problems
    for seed in (1, 2, 3):
        states.write(a_graph(seed), {'seed': seed})
    found = StateFile(tmp_path / 'run').read()
    assert found is not None and found[1] == {'seed': 3} and same(found[0], a_graph(3))
    newest = max((tmp_path / 'run').iterdir(), key=lambda each: unpack(
        each.read_bytes())['number'][0])
    whole = newest.read_bytes()
    for data in (b'', whole[:len(whole) // 2], whole[:300] + b'?' + whole[301:], b'PK'):
        newest.write_bytes(data)
        again = StateFile(tmp_path / 'run')
        found = again.read()
        assert found is not None and found[1] == {'seed': 2}
        assert newest.name in again.problems[0] and 'damaged' in again.problems[0]
    again.write(a_graph(4), {'seed': 4})  # over the damaged one
    assert StateFile(tmp_path / 'run').read()[1] == {'seed': 4}  # type: ignore[index]
    for file in (tmp_path / 'run').iterdir():
        file.write_bytes(b'?')
    again = StateFile(tmp_path / 'run')
    assert again.read() is None and len(again.problems) == 2
    again.remove()
    assert again.read() is None and not again.problems


_WRITER = """
import sys
sys.path.insert(0, {root!r})
from rt_robot_os.features.mapping.slam.array_file import unpack
from rt_robot_os.features.mapping.slam.graph_arrays import graph_of
from rt_robot_os.features.mapping.slam.state_file import StateFile
graph = graph_of(unpack(open({graph!r}, 'rb').read()))
states = StateFile({folder!r})
for number in range(1_000_000):
    states.write(graph, {{'number': number}})
    print(number, flush=True)
"""


def test_a_run_that_is_killed_while_it_writes_leaves_its_state(tmp_path: Path) -> None:
    (tmp_path / 'graph').write_bytes(pack(arrays_of(a_graph(keyframes=40))))
    code = _WRITER.format(root=str(ROOT), graph=str(tmp_path / 'graph'),
                          folder=str(tmp_path / 'run'))
    said = -1
    for lines in (1, 3, 4):
        with subprocess.Popen([sys.executable, '-c', code], stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            for _ in range(lines):
                said = int(process.stdout.readline())
            process.kill()
        found = StateFile(tmp_path / 'run').read()
        assert found is not None and found[1]['number'] >= said
        assert same(found[0], a_graph(keyframes=40))
