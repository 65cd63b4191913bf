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
Convert a graph to arrays and back: small, and as exact as needed.

Points are integer millimetres (int16; of scans that reach beyond 32 m the unit is larger), as
differences from neighbour to neighbour, which pack well; normals are angles to 0.1 degrees. Both
are a tenth of a laser's noise, and every other number is unmodified.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.array_file import Arrays
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.keyframes import Keyframe
from rt_robot_os.features.mapping.slam.pose_graph import AbsolutePose
from rt_robot_os.features.mapping.slam.pose_graph import PoseEdge
from rt_robot_os.features.mapping.slam.scan import Surface
from rt_robot_os.features.mapping.slam.transforms import Floats

_UNIT_M: Final = 0.001
_HIGHEST: Final = 32767
#: Angles of normals and of beams: units of a turn.
_ANGLES: Final = 4096
_TURN: Final = 2.0 * np.pi / _ANGLES
_UPPER: Final = np.triu_indices(3)
#: Largest number of keyframes that is read.
_KEYFRAMES_MOST: Final = 1_000_000

Counts = npt.NDArray[np.int64]


def arrays_of(graph: MapGraph) -> Arrays:
    """Return a graph as arrays."""
    frames, edges = graph.keyframes, graph.edges
    surfaces = [each.surface for each in frames]
    points = _joined([each.points for each in surfaces], 2)
    unit = max(_UNIT_M, float(np.abs(points).max(initial=0.0)) / _HIGHEST)
    normals = _joined([each.normals for each in surfaces], 2)
    lined = np.concatenate([np.zeros(0, np.bool_), *(each.lined for each in surfaces)])
    silent = [_echoless(each) for each in surfaces]
    echoless = np.concatenate([np.zeros(0), *silent])
    information = np.array([each.information for each in edges], np.float64).reshape(-1, 3, 3)
    return {
        'stamps_ns': np.array([each.stamp_ns for each in frames], np.int64),
        'poses': np.array([each.pose for each in frames], np.float64).reshape(-1, 3),
        'odometry': np.array([each.odometry for each in frames], np.float64).reshape(-1, 3),
        'travelled_m': np.array([each.travelled_m for each in frames], np.float64),
        'point_counts': np.array([len(each.points) for each in surfaces], np.int32),
        'unit_m': np.array([unit]),
        'points': _differences(np.rint(points / unit).astype(np.int16)),
        'normals': _differences(_angles(np.arctan2(normals[:, 1], normals[:, 0]))[:, None]),
        'lined': np.packbits(lined),
        'echoless_counts': np.array([len(each) for each in silent], np.int32),
        'echoless': _differences(_angles(echoless)[:, None]),
        'edges': np.array([(each.first, each.second, each.is_loop) for each in edges],
                          np.int32).reshape(-1, 3),
        'edge_relative': np.array([each.relative for each in edges], np.float64).reshape(-1, 3),
        'edge_information': information[:, _UPPER[0], _UPPER[1]],
        'fix_at': np.array([each.keyframe for each in graph.fixes], np.int32),
        'fix_poses': np.array([each.pose for each in graph.fixes], np.float64).reshape(-1, 3),
        'fix_information': np.array([each.information for each in graph.fixes],
                                    np.float64).reshape(-1, 3, 3),
    }


def graph_of(arrays: Arrays) -> MapGraph:
    """
    Return the graph of arrays.

    :raises ValueError: they are malformed: one is missing, or has another shape or an invalid
        number.
    """
    stamps = _checked(arrays, 'stamps_ns', np.int64, (None,))
    count = len(stamps)
    if count > _KEYFRAMES_MOST:
        raise ValueError(f'{count} keyframes are more than {_KEYFRAMES_MOST}')
    poses = _checked(arrays, 'poses', np.float64, (count, 3))
    odometry = _checked(arrays, 'odometry', np.float64, (count, 3))
    travelled = _checked(arrays, 'travelled_m', np.float64, (count,))
    surfaces = _surfaces(arrays, count)
    frames = [Keyframe(int(stamps[at]), poses[at].copy(), odometry[at].copy(), surfaces[at],
                       float(travelled[at])) for at in range(count)]
    return MapGraph(frames, _edges(arrays, count), _fixes(arrays, count))


def _surfaces(arrays: Arrays, count: int) -> list[Surface]:
    ends = _ends(_checked(arrays, 'point_counts', np.int32, (count,)))
    total = int(ends[-1])
    unit = float(_checked(arrays, 'unit_m', np.float64, (1,))[0])
    points = _sums(_checked(arrays, 'points', np.int16, (total, 2))) * unit
    angles = _sums(_checked(arrays, 'normals', np.int16, (total, 1)))[:, 0] * _TURN
    packed = _checked(arrays, 'lined', np.uint8, ((total + 7) // 8,))
    lined = np.unpackbits(packed, count=total).astype(np.bool_)
    normals = np.stack((np.cos(angles), np.sin(angles)), -1) * lined[:, None]
    silent = _ends(_checked(arrays, 'echoless_counts', np.int32, (count,)))
    bearings = _sums(_checked(arrays, 'echoless', np.int16, (int(silent[-1]), 1)))[:, 0] * _TURN
    return [_surface(points[a:b], normals[a:b], lined[a:b], bearings[c:d])
            for a, b, c, d in zip(ends, ends[1:], silent, silent[1:])]


def _echoless(surface: Any) -> Floats:
    found: Floats = getattr(surface, 'echoless', np.zeros(0))
    return found


def _surface(*parts: Any) -> Surface:
    return Surface(*parts[:len(fields(Surface))])


def _edges(arrays: Arrays, count: int) -> list[PoseEdge]:
    ends = _checked(arrays, 'edges', np.int32, (None, 3))
    relative = _checked(arrays, 'edge_relative', np.float64, (len(ends), 3))
    upper = _checked(arrays, 'edge_information', np.float64, (len(ends), 6))
    if len(ends) and not (0 <= ends[:, :2].min() and ends[:, :2].max() < count):
        raise ValueError('an edge refers to a missing keyframe')
    information = np.zeros((len(ends), 3, 3))
    information[:, _UPPER[0], _UPPER[1]] = upper
    information[:, _UPPER[1], _UPPER[0]] = upper
    return [PoseEdge(first, second, relative[at].copy(), information[at].copy(), bool(is_loop))
            for at, (first, second, is_loop) in enumerate(ends.tolist())]


def _fixes(arrays: Arrays, count: int) -> list[AbsolutePose]:
    if 'fix_at' not in arrays:
        return []  # an older file
    at = _checked(arrays, 'fix_at', np.int32, (None,))
    poses = _checked(arrays, 'fix_poses', np.float64, (len(at), 3))
    information = _checked(arrays, 'fix_information', np.float64, (len(at), 3, 3))
    if len(at) and not 0 <= at.min() <= at.max() < count:
        raise ValueError('an absolute pose refers to a missing keyframe')
    return [AbsolutePose(int(each), pose.copy(), known.copy())
            for each, pose, known in zip(at, poses, information)]


def _checked(arrays: Arrays, name: str, kind: Any, shape: tuple[int | None, ...]
             ) -> npt.NDArray[Any]:
    found = arrays.get(name)
    if found is None:
        raise ValueError(f'{name} is missing')
    fits = len(found.shape) == len(shape) and all(
        wanted is None or wanted == there for wanted, there in zip(shape, found.shape))
    if found.dtype != kind or not fits:
        raise ValueError(f'{name} is {found.dtype} of shape {found.shape}: it must be '
                         f'{np.dtype(kind)} of shape {shape}')
    if found.dtype.kind == 'f' and not np.isfinite(found).all():
        raise ValueError(f'{name} has a number that is not finite')
    return found


def _ends(counts: Counts) -> Counts:
    if len(counts) and counts.min() < 0:
        raise ValueError('a scan has a negative number of points')
    return np.concatenate([np.zeros(1, np.int64), np.cumsum(counts, dtype=np.int64)])


def _joined(parts: Sequence[Floats], width: int) -> Floats:
    return np.concatenate([np.zeros((0, width)), *parts])


def _angles(angles: Floats) -> npt.NDArray[np.int16]:
    return (np.rint(angles / _TURN).astype(np.int64) % _ANGLES).astype(np.int16)


def _differences(values: npt.NDArray[np.int16]) -> npt.NDArray[np.int16]:
    """Return the difference of each row to the one before; overflows cancel in the sum."""
    found = values.copy()
    found[1:] -= values[:-1]
    return found


def _sums(differences: npt.NDArray[np.int16]) -> npt.NDArray[np.int16]:
    return np.cumsum(differences, 0, dtype=np.int16)
