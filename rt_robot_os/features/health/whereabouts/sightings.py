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


"""Conversion of samples of nodes, of other people and of ROS to sightings of a person."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.whereabouts.place_estimate import PlaceEstimate
from rt_robot_os.features.health.whereabouts.place_estimate import SEEN
from rt_robot_os.features.health.whereabouts.place_estimate import Sighting
from rt_robot_os.messages.network_rows import rows_of
from rt_robot_os.messages.survey import SurveyedNode
from rt_robot_os.topics import Subscription

#: Least distance between two poses that counts as a movement.
STEP_M: Final = 0.5
_OTHERS_M: Final = 3.0
_OTHERS_NS: Final = 60 * NS_PER_S
_PARENT_M: Final = 6.0
_PRESENT: Final = 0.5
_NEW_NS: Final = NS_PER_S // 2


class SightingInputs:
    """
    Convert samples to sightings of one person; safe in the real-time loop.

    Each method takes a sample and returns whether the person was seen, and moved.

    :param survey: of the sensor network.
    :param worn: id of the node that the person wears; -1 without one.
    """

    def __init__(self, settings: Mapping[str, Any], place: PlaceEstimate,
                 survey: tuple[SurveyedNode, ...], worn: int) -> None:
        self._settings = settings
        self._place = place
        self._nodes = {node.id: node for node in survey if not node.person}
        self._worn = worn
        self._others: dict[str, Sighting] = {}
        self._nearest = ''
        #: The node of the last report of the worn one, without filtering.
        self.latest = ''
        self._network_ns = -_NEW_NS
        self._anchor = (math.nan, math.nan)

    def pose(self, values: tuple[float, ...], stamp_ns: int) -> tuple[bool, bool]:
        """Process a pose of ROS."""
        x, y, _ = values
        if not (math.isfinite(x) and math.isfinite(y)):
            return False, False
        self._place.put(Sighting(
            x, y, self._settings['pose_uncertainty_m'], 'ros', '', stamp_ns))
        x0, y0 = self._anchor
        if math.hypot(x - x0, y - y0) < STEP_M:
            return True, False
        known = math.isfinite(x0)
        self._anchor = x, y
        return True, known

    def seen(self, values: tuple[float, ...], stamp_ns: int) -> None:
        """Process a sighting by the robot; it does not count as a movement."""
        x, y, _ = values
        if math.isfinite(x) and math.isfinite(y):
            self._place.put(Sighting(
                x, y, self._settings['seen_uncertainty_m'], SEEN, '', stamp_ns))

    def nearest(self, values: tuple[float, ...], stamp_ns: int) -> tuple[bool, bool]:
        """Process the id of the node that the worn one receives best."""
        number, = values
        best = self._nodes.get(int(number)) if math.isfinite(number) else None
        if best is None:
            return False, False
        self.latest = best.token
        name, x, y = self._place.vote(best.token, best.x, best.y, stamp_ns)
        moved = bool(self._nearest) and name != self._nearest
        self._nearest = name
        self._place.put(Sighting(
            x, y, self._settings['node_uncertainty_m'], 'node', name, stamp_ns))
        return True, moved

    def presence(self, node: SurveyedNode, values: tuple[float, ...], stamp_ns: int
                 ) -> tuple[bool, bool]:
        """Process a sample of a presence sensor."""
        value, = values
        range_m = self._settings['presence_range_m']
        if not value > _PRESENT or not self._place.may_be_person(
                node.x, node.y, range_m, stamp_ns, self._others.values()):
            return False, False
        self._place.put(Sighting(node.x, node.y, range_m / 2, 'presence', node.token, stamp_ns))
        self.latest = ''
        # With another person there it is unknown which one moved.
        alone = not any(other.distance(node.x, node.y) <= range_m / 2
                        and stamp_ns - other.stamp_ns <= _OTHERS_NS
                        for other in self._others.values())
        return True, alone

    def other(self, name: str, values: tuple[float, ...], stamp_ns: int) -> None:
        """Process the position of another person."""
        x, y, _ = values
        if math.isfinite(x) and math.isfinite(y):
            self._others[name] = Sighting(x, y, _OTHERS_M, 'other', '', stamp_ns)

    def network(self, rows: Any, stamp_ns: int) -> bool:
        """
        Process the row of the worn node in the network model.

        :return: whether the person was seen.
        """
        for row in rows_of(rows):
            if row.id != self._worn or not row.age_s >= 0.0:
                continue
            received_ns = stamp_ns - round(row.age_s * NS_PER_S)
            if received_ns - self._network_ns < _NEW_NS:
                return False  # the same packet as before
            self._network_ns = received_ns
            parent = self._nodes.get(int(row.parent)) if math.isfinite(row.parent) else None
            if row.stddev_m > 0.0 and math.isfinite(row.x) and math.isfinite(row.y):
                self._place.put(Sighting(row.x, row.y, row.stddev_m, 'network', '', received_ns))
                return True
            if parent is not None:
                # The surveyed position of a worn node is meaningless; its parent is near.
                self._place.put(Sighting(parent.x, parent.y, _PARENT_M, 'network', parent.token,
                                         received_ns))
                return True
        return False


def field_values(read: Subscription, field: str) -> Callable[[], tuple[float, ...]]:
    """Return a function that reads the numbers of a field of the newest sample."""
    unpack = read.topic.layout.packer(field).unpack
    buffer = read.buffer
    return lambda: unpack(buffer)
