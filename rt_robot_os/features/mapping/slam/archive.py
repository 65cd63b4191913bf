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
Maps as files: a grid as ROS' map_saver writes it, and the graph that it was drawn from.

``NAME.yaml`` and ``NAME.pgm`` are for all programs; mapping continues from ``NAME.graph.npz``. The
graph identifies its grid, so that files of different maps are never combined.

A map is written atomically, also over an existing one. The YAML file names its picture, so the
renaming of the YAML file is the one step that replaces the map: first it names a picture with a
temporary name, which gets its final name afterwards. Of two graphs, the one next to the map and
one that waits to be renamed, the one that belongs to the grid is used. So at any time all readers,
such as map_server, find the old map or the new one.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
import glob
import hashlib
import json
import os
from pathlib import Path
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.mapping.slam.array_file import Arrays
from rt_robot_os.features.mapping.slam.array_file import bytes_of
from rt_robot_os.features.mapping.slam.array_file import pack
from rt_robot_os.features.mapping.slam.array_file import sync_folder
from rt_robot_os.features.mapping.slam.array_file import unpack
from rt_robot_os.features.mapping.slam.array_file import write_whole
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.graph_arrays import arrays_of
from rt_robot_os.features.mapping.slam.graph_arrays import graph_of
from rt_robot_os.motion.grid_map import GridMap
from rt_robot_os.motion.map_picture import PICTURES

GRAPH_SUFFIX: Final = '.graph.npz'
#: Of the graph file. A release that reads version 2 also reads version 1.
VERSION: Final = 1
#: Share of cells that may be edited by hand; with more the graph no longer belongs to the grid.
_PAINTED_MOST: Final = 0.1
#: How the name of a map's YAML file ends.
YAML: Final = ('.yaml', '.yml')
_OTHERS: Final = {
    '.posegraph': 'a graph of slam_toolbox', '.data': 'a graph of slam_toolbox',
    '.pbstream': 'a state of Cartographer', '.png': 'a picture', '.pgm': 'a picture'}
_SETTINGS_MOST: Final = 1 << 20


@dataclass(frozen=True)
class Saved:
    """
    A map that was read.

    :ivar grid: for localisation.
    :ivar graph: for mapping; None for a map of another program.
    :ivar settings: with which it was made, as given to :func:`save`.
    :ivar notes: remarks for the operator, a line each.
    """

    grid: GridMap
    graph: MapGraph | None = None
    settings: Mapping[str, Any] | None = None
    notes: tuple[str, ...] = ()


# ---- writing ------------------------------------------------------------------------------------

def save(path: str | os.PathLike[str], graph: MapGraph | None, grid: GridMap,
         settings: Mapping[str, Any] | None = None) -> Path:
    """
    Write a map atomically; the old one stays until then.

    :param path: of the YAML file, with or without ``.yaml``; its folder is created. A path
        that ends with ``.png`` requests a PNG as the picture, which needs Pillow.
    :param graph: None: the grid alone.
    :param settings: plain values, stored with the map.
    :return: path of the YAML file.
    :raises ConfigError: it cannot be written; the old map is unchanged.
    """
    suffix = _picture_suffix(path)
    yaml = _yaml_of(Path(path).with_suffix('') if suffix else path)
    try:
        yaml.parent.mkdir(parents=True, exist_ok=True)
        for _ in steps_of_saving(yaml, graph, grid, settings, suffix or PICTURES[0]):
            pass
    except OSError as error:
        with suppress(OSError):
            _settle(yaml)
            _waiting(yaml).unlink(missing_ok=True)  # on a full disk it takes the last space
            _clear(yaml)
        raise ConfigError([f'{yaml}: the map cannot be written: {error.strerror}: give another '
                           'file or free space; the file is the old map, or this one']
                          ) from error
    return yaml


def steps_of_saving(yaml: Path, graph: MapGraph | None, grid: GridMap,
                    settings: Mapping[str, Any] | None = None, suffix: str = PICTURES[0]
                    ) -> Iterator[str]:
    """
    Write a map step by step; power may fail between any two steps.

    :param suffix: of the picture.
    :return: yields a description of each step.
    """
    grid = grid.trinary()
    waiting, picture = _waiting(yaml), yaml.with_suffix(suffix)
    # GridMap formats both files; only their bytes are used.
    described, pixels = grid.files(picture.name)
    _settle(yaml)
    # An empty graph marks that an existing graph belongs to another map.
    write_whole(waiting, _graph_file(graph or MapGraph(), grid, settings))
    yield 'the graph waits'
    other = yaml.with_name(f'.{yaml.stem}.{hashlib.sha256(pixels).hexdigest()[:8]}{suffix}')
    write_whole(other, pixels)
    yield 'the picture waits'
    aside = yaml.with_name(f'.{yaml.name}.new')
    write_whole(aside, grid.files(other.name)[0])
    sync_folder(yaml.parent)
    yield 'a YAML file waits that names that picture'
    aside.replace(yaml)
    sync_folder(yaml.parent)
    yield 'the new map is the map'
    if graph is not None:
        waiting.replace(_graph_path(yaml))
    else:
        _graph_path(yaml).unlink(missing_ok=True)
        yield 'the old graph is gone'
        waiting.unlink()
    yield 'the graph has its name'
    copy = yaml.with_name(f'.{picture.name}.new')
    write_whole(copy, pixels)
    copy.replace(picture)
    write_whole(aside, described)
    sync_folder(yaml.parent)
    yield 'the picture has its name'
    aside.replace(yaml)
    sync_folder(yaml.parent)
    yield 'the YAML file names it'
    _clear(yaml)


def _settle(yaml: Path) -> None:
    """Rename the graph that waits, if the present map needs it."""
    waiting = _waiting(yaml)
    if not waiting.exists():
        return
    with suppress(ConfigError):
        if not _changed(_arrays(waiting), _grid(yaml), waiting, yaml):
            waiting.replace(_graph_path(yaml))
            sync_folder(yaml.parent)


def _clear(yaml: Path) -> None:
    """Remove files that an interrupted save left, unless the map needs them."""
    needed = yaml.read_bytes() if yaml.exists() else b''
    kept = f'.{glob.escape(yaml.stem)}.' + '[0-9a-f]' * 8
    for path in (each for suffix in PICTURES for each in yaml.parent.glob(kept + suffix)):
        if path.name.encode() not in needed:
            path.unlink()
    for path in (yaml.with_name(f'.{yaml.name}.new'),
                 *(yaml.with_name(f'.{yaml.stem}{suffix}.new') for suffix in PICTURES)):
        path.unlink(missing_ok=True)


def _graph_file(graph: MapGraph, grid: GridMap, settings: Mapping[str, Any] | None) -> bytes:
    packed = json.dumps(settings or {}, sort_keys=True).encode()
    return pack({
        'version': np.array([VERSION]), 'settings': np.frombuffer(packed, np.uint8),
        'grid': _packed_cells(grid), 'grid_shape': np.array(grid.cells.shape),
        'grid_place': np.array((grid.resolution_m, *grid.origin)), **arrays_of(graph)})


def _packed_cells(grid: GridMap) -> Any:
    """Return two bits a cell: occupied, free."""
    return np.concatenate((np.packbits(grid.cells == 100), np.packbits(grid.cells == 0)))


# ---- reading ------------------------------------------------------------------------------------

def load(path: str | os.PathLike[str], with_graph: bool = True) -> Saved:
    """
    Read a map, made here or by another program.

    :param path: of the YAML file, with or without ``.yaml``, or of its picture.
    :param with_graph: False: the grid alone, even if there is a graph.
    :raises ConfigError: it cannot be read, is damaged, or its files are of several maps.
    """
    yaml = _yaml_of(path)
    if not yaml.exists() and _picture_suffix(path):
        of_picture = _yaml_of(Path(path).with_suffix(''))
        yaml = of_picture if of_picture.exists() else yaml
    grid = _grid(yaml)
    if not with_graph:
        return Saved(grid)
    problems: list[str] = []
    painted: Saved | None = None
    for file in (_graph_path(yaml), _waiting(yaml)):
        if not file.exists():
            continue
        try:
            arrays = _arrays(file)
            cells = _changed(arrays, grid, file, yaml)
        except ConfigError as error:
            problems.append(str(error))
            continue
        if not cells:
            return Saved(grid, *_contents(arrays, file))
        if painted is None:
            note = (f'{yaml}: {cells} cells differ from the saved ones: the picture was edited; '
                    'the grid is used as it is now, the graph as it was saved')
            painted = Saved(grid, *_contents(arrays, file), (note,))
    if painted is not None:
        return painted
    if problems and _graph_path(yaml).exists():
        raise ConfigError([problems[0]])
    return Saved(grid, notes=(
        f'{yaml}: has no {yaml.stem}{GRAPH_SUFFIX}: localization can use it, mapping cannot '
        'continue from it',))


def _grid(yaml: Path) -> GridMap:
    kind = _OTHERS.get(yaml.with_suffix('').suffix) if not yaml.exists() else None
    if kind is not None:
        raise ConfigError([f'{yaml.with_suffix("")}: is {kind}, no map: save it as NAME.yaml and '
                           'NAME.pgm ("ros2 run nav2_map_server map_saver_cli -f NAME"), and load '
                           'NAME.yaml'])
    if not yaml.exists():
        raise ConfigError([f'{yaml}: does not exist: give the YAML file of a map'])
    try:
        return GridMap.load(yaml)
    except ConfigError:
        # Another process that saves may have removed the picture that it named.
        return GridMap.load(yaml)


def _arrays(file: Path) -> Arrays:
    remedy = 'delete it to use the grid alone, or load an older copy'
    try:
        arrays = unpack(bytes_of(file))
        version = arrays.get('version')
        if version is None or version.shape != (1,) or version.dtype.kind != 'i':
            raise ValueError('has no version: it is not the graph of a map')
        if version[0] > VERSION:
            raise ConfigError([f'{file}: is of version {version[0]}, of a newer release: this one '
                               f'reads up to {VERSION}; update, or {remedy}'])
        return arrays
    except ValueError as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError([f'{file}: {error}; {remedy}']) from None


def _changed(arrays: Arrays, grid: GridMap, file: Path, yaml: Path) -> int:
    """
    Return how many cells of the grid differ from the saved ones.

    :raises ConfigError: the graph belongs to another map.
    """
    shape, place, cells = (arrays.get(each) for each in ('grid_shape', 'grid_place', 'grid'))
    if shape is None or place is None or cells is None:
        raise ConfigError([f'{file}: is not the graph of a map: delete it to use the grid alone'])
    ours = np.array((grid.resolution_m, *grid.origin))
    mine = _packed_cells(grid)
    if (tuple(shape.tolist()) != grid.cells.shape or place.shape != ours.shape
            or not (place == ours).all() or cells.shape != mine.shape):
        raise ConfigError([
            f'{file}: does not belong to the map {yaml}: it has {_described(shape, place)}, the '
            f'map {_described(np.array(grid.cells.shape), ours)}: one of them was replaced or '
            'damaged; delete the graph to use the grid alone'])
    off = cells ^ mine
    half = len(off) // 2
    changed = int(np.unpackbits(off[:half] | off[half:]).sum())
    known = int((grid.cells >= 0).sum())
    if changed > _PAINTED_MOST * known:
        raise ConfigError([f'{file}: does not belong to the map {yaml}: {changed} of {known} '
                           'cells differ; delete the graph to use the grid alone'])
    return changed


def _described(shape: Any, place: Any) -> str:
    rows, columns = [*shape.tolist(), 0, 0][:2]
    return f'{columns} x {rows} cells at [{", ".join(f"{each:g}" for each in place.tolist())}]'


def _contents(arrays: Arrays, file: Path) -> tuple[MapGraph | None, Mapping[str, Any]]:
    packed = arrays.get('settings')
    try:
        if packed is None or packed.dtype != np.uint8 or packed.size > _SETTINGS_MOST:
            raise ValueError('settings are missing')
        settings = json.loads(packed.tobytes())
        if not isinstance(settings, dict):
            raise ValueError('its settings are not a JSON object')
        graph = graph_of(arrays)
        return graph if graph.keyframes else None, settings
    except (ValueError, RecursionError) as error:
        raise ConfigError([f'{file}: is damaged: {error}; delete it to use the grid alone']
                          ) from None


def _picture_suffix(path: str | os.PathLike[str]) -> str:
    """Return the suffix of a path to the picture of a map; empty for a path to the map."""
    suffix = Path(path).suffix
    return suffix if suffix in PICTURES else ''


def _yaml_of(path: str | os.PathLike[str]) -> Path:
    file = Path(path).expanduser()
    if not file.name:
        raise ConfigError([f'{path}: is not the name of a map: give NAME or NAME.yaml'])
    if file.name.endswith(GRAPH_SUFFIX):
        file = file.with_name(file.name.removesuffix(GRAPH_SUFFIX))
    return file if file.suffix in YAML else file.with_name(f'{file.name}.yaml')


def _graph_path(yaml: Path) -> Path:
    return yaml.with_name(yaml.stem + GRAPH_SUFFIX)


def _waiting(yaml: Path) -> Path:
    return yaml.with_name(f'.{yaml.stem}{GRAPH_SUFFIX}.new')
