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

"""The graph of a map: keyframes and the constraints between them."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field

from rt_robot_os.features.mapping.slam.keyframes import Keyframe
from rt_robot_os.features.mapping.slam.pose_graph import AbsolutePose
from rt_robot_os.features.mapping.slam.pose_graph import PoseEdge
from rt_robot_os.features.mapping.slam.pose_graph import PoseEdges


@dataclass
class MapGraph:
    """
    A map as a pose graph: the grid is drawn from it, and mapping continues from it.

    :ivar keyframes: in the order in which they were added.
    :ivar edges: between them, by their indices.
    :ivar fixes: absolute poses of some of them.
    """

    keyframes: list[Keyframe] = field(default_factory=list)
    edges: list[PoseEdge] = field(default_factory=list)
    fixes: list[AbsolutePose] = field(default_factory=list)
    _arrays: PoseEdges = field(default_factory=PoseEdges, init=False, repr=False, compare=False)

    def edge_arrays(self) -> PoseEdges:
        """Return the present edges as arrays, which are valid until the next call."""
        self._arrays.update(self.edges)
        return self._arrays
