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
Remove keyframes from a pose graph and keep it connected.

The information of the edges of a keyframe is preserved: the neighbour with the most certain edge
becomes its successor, and the others are connected to that one over both edges, with the sum of
their uncertainties. Several edges between the same two keyframes are merged. So the number of
edges never grows, and each keyframe stays connected to the first.
"""

from __future__ import annotations

import numpy as np

from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.pose_graph import AbsolutePose
from rt_robot_os.features.mapping.slam.pose_graph import PoseEdge
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import wrapped

_NOTHING = np.zeros(3)


def marginalise(graph: MapGraph, index: int) -> int:
    """
    Remove a keyframe from a graph; the indices of those after it decrease by one.

    :return: the index of its successor before the removal.
    :raises ValueError: it is the only one, or is not connected.
    """
    its = [each for each in graph.edges if index in (each.first, each.second)]
    if not its:
        raise ValueError(f'keyframe {index} is not connected to another one')
    ways = [each if each.first == index else reverse(each) for each in its]
    best = min(ways, key=_uncertainty)
    successor, from_heir = best.second, reverse(best)
    edges: dict[tuple[int, int], list[PoseEdge]] = {}
    for each in graph.edges:
        if index not in (each.first, each.second):
            edges.setdefault((each.first, each.second), []).append(each)
    for way in ways:
        if way is not best and way.second != successor:
            joined = chain(from_heir, way)
            forward, backward = (successor, way.second), (way.second, successor)
            known = edges.pop(forward, []) + [reverse(each) for each in edges.pop(backward, [])]
            edges[forward] = [_merged([joined, *known])]
    graph.edges[:] = [_renumbered(each, index) for parallel in edges.values()
                      for each in parallel]
    _pass_absolute_pose(graph, index, successor)
    del graph.keyframes[index]
    return successor


def _uncertainty(edge: PoseEdge) -> float:
    return float(np.trace(np.linalg.inv(edge.information))) + float(edge.is_loop)


def _renumbered(edge: PoseEdge, removed: int) -> PoseEdge:
    if edge.first < removed and edge.second < removed:
        return edge
    return PoseEdge(edge.first - (edge.first > removed), edge.second - (edge.second > removed),
                    edge.relative, edge.information, edge.is_loop)


def _pass_absolute_pose(graph: MapGraph, index: int, successor: int) -> None:
    """Transfer the absolute pose to the successor, unless that has one of its own."""
    has_own = any(each.keyframe == successor for each in graph.fixes)
    shift = between(graph.keyframes[index].pose, graph.keyframes[successor].pose)
    fixes = []
    for fix in graph.fixes:
        at, pose = fix.keyframe, fix.pose
        if at == index:
            if has_own:
                continue
            at, pose = successor, composed(pose, shift)
        fixes.append(AbsolutePose(at - (at > index), pose, fix.information))
    graph.fixes[:] = fixes


def reverse(edge: PoseEdge) -> PoseEdge:
    """Return an edge in the opposite direction."""
    x, y, yaw = edge.relative.tolist()
    cosine, sine = np.cos(yaw), np.sin(yaw)
    back = between(edge.relative, _NOTHING)
    jacobian = np.array(((-cosine, -sine, back[1]), (sine, -cosine, -back[0]), (0.0, 0.0, -1.0)))
    covariance = jacobian @ np.linalg.inv(edge.information) @ jacobian.T
    return PoseEdge(edge.second, edge.first, back, _inverse(covariance), edge.is_loop)


def chain(first: PoseEdge, second: PoseEdge) -> PoseEdge:
    """Return the composition of two edges."""
    cosine, sine = np.cos(first.relative[2]), np.sin(first.relative[2])
    x, y = second.relative[:2]
    of_first = np.array(((1.0, 0.0, -sine * x - cosine * y), (0.0, 1.0, cosine * x - sine * y),
                         (0.0, 0.0, 1.0)))
    of_second = np.array(((cosine, -sine, 0.0), (sine, cosine, 0.0), (0.0, 0.0, 1.0)))
    covariance = (of_first @ np.linalg.inv(first.information) @ of_first.T
                  + of_second @ np.linalg.inv(second.information) @ of_second.T)
    return PoseEdge(first.first, second.second, composed(first.relative, second.relative),
                    _inverse(covariance), first.is_loop or second.is_loop)


def _merged(edges: list[PoseEdge]) -> PoseEdge:
    """Return one edge for several between the same two; loops yield to certain edges."""
    sure = [each for each in edges if not each.is_loop]
    first, *more = sure or edges
    information, relative = first.information, first.relative
    for each in more:
        total = information + each.information
        off = each.relative - relative
        off[2] = wrapped(off[2])
        relative = relative + np.linalg.solve(total, each.information @ off)
        information = total
    return PoseEdge(first.first, first.second, _wrapped_pose(relative), information, first.is_loop)


def _wrapped_pose(pose: Floats) -> Floats:
    return np.array((pose[0], pose[1], wrapped(pose[2])))


def _inverse(covariance: Floats) -> Floats:
    inverse = np.linalg.inv(covariance)
    return np.asarray((inverse + inverse.T) / 2, dtype=np.float64)
