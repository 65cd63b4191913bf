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

"""What mapping publishes: the pose, the map, its graph, and its status."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import json
from typing import Any
from typing import Final
from typing import Protocol

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.graph_markers import EdgeKind
from rt_robot_os.features.mapping.graph_markers import graph_numbers
from rt_robot_os.features.mapping.messages import grid_message
from rt_robot_os.features.mapping.messages import numbers_message
from rt_robot_os.features.mapping.messages import pose_message
from rt_robot_os.features.mapping.robot_pose import RobotPose
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.messages.cdr import string_message
from rt_robot_os.motion.grid_map import GridMap

POSE: Final = 'slam/pose'
CORRECTION: Final = 'slam/correction'
MAP: Final = 'map'
PATH: Final = 'slam/path'
GRAPH: Final = 'slam/graph'
STATE: Final = 'mapping/state'
STATUS: Final = 'mapping/status'
ANSWER: Final = 'mapping/answer'
TOPICS: Final = (POSE, CORRECTION, MAP, PATH, GRAPH, STATE, STATUS, ANSWER)

_STATE_BYTES: Final = 199
_ANSWER_CHARACTERS: Final = 1500
_STATUS_NS: Final = NS_PER_S
_PATH_POSES: Final = 1000
#: Minimum time between two graphs.
_GRAPH_NS: Final = 2 * NS_PER_S


class CorePublisher(Protocol):
    """The connection to the core, for samples."""

    def publish(self, topic: str, cdr: bytes, stamp_ns: int = 0) -> bool:
        """Publish a sample; return False when the core did not accept it."""

    def has(self, topic: str) -> bool:
        """Return whether the core accepts samples of a topic."""


class Outputs:
    """
    Publish what has changed, at limited rates.

    :param map_period_ns: minimum time between two maps.
    """

    def __init__(self, port: CorePublisher, map_period_ns: int) -> None:
        self._publisher = port
        self._map_period_ns = map_period_ns
        self.reset()

    def reset(self) -> None:
        """Publish everything again, to another core."""
        self._state = ''
        self._status_ns = self._map_ns = self._graph_ns = -(1 << 62)
        self._map_version = self._graph_version = -1

    def publish_pose(self, place: RobotPose) -> None:
        """Publish the pose, and before it the movement of the map if there was one."""
        if place.correction is not None:
            self._publisher.publish(CORRECTION, pose_message(place.correction, place.covariance),
                                    place.stamp_ns)
        if place.is_sure:
            self._publisher.publish(POSE, pose_message(place.pose, place.covariance),
                                    place.stamp_ns)

    def publish_relocation(self, topic: str, place: RobotPose) -> Floats | None:
        """
        Publish a new pose to localization, which applies it immediately.

        :return: the pose that was published; None when the core did not accept it.
        """
        is_taken = self._publisher.publish(topic, pose_message(place.pose, place.covariance),
                                           place.stamp_ns)
        return place.pose if is_taken else None

    def publish_grid(self, now_ns: int, version: int, grid: GridMap, drawn_ns: int) -> None:
        """
        Publish the map when it has changed and the period has passed.

        :param drawn_ns: stamp of the newest scan on it; 0 without a scan.
        """
        if (version == self._map_version or not version
                or now_ns - self._map_ns < self._map_period_ns):
            return
        self._map_ns = now_ns
        if self._publisher.publish(MAP, grid_message(grid), drawn_ns):
            self._map_version = version

    def publish_graph(self, now_ns: int, version: int, poses: Floats, graph: MapGraph | None
                      ) -> None:
        """
        Publish the poses of the keyframes, and the edges between them.

        :param poses: shape (n, 3): of ``base_link``.
        """
        if (version == self._graph_version or graph is None or not len(poses)
                or now_ns - self._graph_ns < _GRAPH_NS):
            return
        self._graph_ns = now_ns
        step = -(-len(poses) // _PATH_POSES) or 1
        shown = poses[::-1][::step][::-1]  # includes the newest
        if self._publisher.publish(PATH, numbers_message(np.ravel(shown))):
            self._graph_version = version
        edges = [(each.first, each.second, EdgeKind.LOOP if each.is_loop else EdgeKind.NEIGHBOUR)
                 for each in graph.edges]
        edges += [(each.keyframe, each.keyframe, EdgeKind.FIX) for each in graph.fixes]
        self._publisher.publish(GRAPH,
                                numbers_message(graph_numbers(poses[:, :2].tolist(), edges)))

    def publish_state(self, text: str) -> None:
        """Publish the state when it has changed."""
        text = text.encode()[:_STATE_BYTES].decode(errors='ignore')
        if text != self._state and self._publisher.publish(STATE, string_message(text)):
            self._state = text

    def is_status_due(self, now_ns: int) -> bool:
        """Return whether the next status is due."""
        return now_ns - self._status_ns >= _STATUS_NS

    def publish_status(self, now_ns: int, level: int, message: str, values: Mapping[str, Any]
                       ) -> None:
        """Publish the status."""
        self._status_ns = now_ns
        self._publisher.publish(STATUS, string_message(json.dumps({'status': [{
            'level': level, 'name': 'robot: mapping', 'message': message,
            'values': {key: _plain(value) for key, value in values.items()}}]})))

    def publish_answer(self, command: str, is_ok: bool, text: str) -> None:
        """Publish the answer to a command."""
        self._publisher.publish(ANSWER, string_message(json.dumps({
            'command': command[:_ANSWER_CHARACTERS // 2], 'ok': is_ok,
            'text': text[:_ANSWER_CHARACTERS // 2]})))


def _plain(value: Any) -> Any:
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    if isinstance(value, int | str):
        return value
    if isinstance(value, float):
        return round(value, 4)
    return ', '.join(map(str, value)) if isinstance(value, Sequence) else str(value)
