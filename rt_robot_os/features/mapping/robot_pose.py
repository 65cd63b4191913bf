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

"""Poses of the robot on a map, and loaded maps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace

import numpy as np

from rt_robot_os.features.mapping.scan_intake import PosedScan
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.located import Located
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.motion.grid_map import GridMap

# Returns the pose of ``base_link`` on the map at a scan; None: not known yet.
Hint = Callable[[PosedScan], Floats | None]


@dataclass(frozen=True)
class RobotPose:
    """
    The pose of the robot at a scan.

    :ivar pose: shape (3,): of ``base_link`` on the map.
    :ivar covariance: shape (3, 3).
    :ivar correction: by how much the map moved under the robot; None when it did not.
    :ivar is_sure: False when it comes from odometry alone.
    :ivar is_found: the pose was unknown before.
    """

    stamp_ns: int
    pose: Floats
    covariance: Floats
    correction: Floats | None = None
    is_sure: bool = True
    is_found: bool = False


@dataclass(frozen=True)
class LoadedMap:
    """
    A loaded map.

    :ivar graph: None of a map of another program: it cannot be extended.
    """

    graph: MapGraph | None
    grid: GridMap | None = None


@dataclass
class LastScan:
    """The pose of the laser at the last scan."""

    posed: PosedScan
    pose: Floats
    covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))


def robot_pose_of(posed: PosedScan, located: Located) -> RobotPose:
    """Return the pose of ``base_link`` for that of the laser."""
    mount = posed.mount
    return RobotPose(posed.scan.stamp_ns, mount.base(located.pose),
                     mount.covariance_of_base(located.pose, located.covariance),
                     located.correction,
                     not located.is_lost)


def copy_of(graph: MapGraph | None) -> MapGraph | None:
    """Return a copy of the graph, which shares the immutable surfaces; None when it is empty."""
    if graph is None or not graph.keyframes:
        return None
    return replace(graph, keyframes=[replace(each) for each in graph.keyframes],
                   edges=list(graph.edges), fixes=list(graph.fixes))


def keyframe_poses(graph: MapGraph | None, last_scan: LastScan | None) -> Floats:
    """Return the poses of ``base_link`` at the keyframes, with the present mounting."""
    if graph is None or last_scan is None or not graph.keyframes:
        return np.zeros((0, 3))
    return last_scan.posed.mount.bases(np.array([each.pose for each in graph.keyframes]))
