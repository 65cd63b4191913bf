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

"""Maps that are there, and places on them."""

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

# Gives where ``base_link`` was on the map at a scan; None: not known yet.
Hint = Callable[[PosedScan], Floats | None]


@dataclass(frozen=True)
class RobotPose:
    """
    Where a scan says that the robot is.

    :ivar pose: shape (3,): of ``base_link`` on the map.
    :ivar covariance: shape (3, 3).
    :ivar correction: how the map moved under the robot; None when it did not.
    :ivar is_sure: False when odometry alone says it.
    :ivar is_found: it did not know where it was before.
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
    A map that is there.

    :ivar graph: None of one that somebody else made: nothing can be added to it.
    """

    graph: MapGraph | None
    grid: GridMap | None = None


@dataclass
class LastScan:
    """Where the laser was at the last scan."""

    posed: PosedScan
    pose: Floats
    covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))


def robot_pose_of(posed: PosedScan, located: Located) -> RobotPose:
    """Return where ``base_link`` was, of where the laser was."""
    mount = posed.mount
    return RobotPose(posed.scan.stamp_ns, mount.base(located.pose),
                     mount.covariance_of_base(located.pose, located.covariance),
                     located.correction,
                     not located.is_lost)


def copy_of(graph: MapGraph | None) -> MapGraph | None:
    """Return the graph as it is now; surfaces never change, poses do. None when it is empty."""
    if graph is None or not graph.keyframes:
        return None
    return replace(graph, keyframes=[replace(each) for each in graph.keyframes],
                   edges=list(graph.edges), fixes=list(graph.fixes))


def keyframe_poses(graph: MapGraph | None, last_scan: LastScan | None) -> Floats:
    """Return where ``base_link`` was at the scans of a map, the laser being where it is now."""
    if graph is None or last_scan is None or not graph.keyframes:
        return np.zeros((0, 3))
    return last_scan.posed.mount.bases(np.array([each.pose for each in graph.keyframes]))
