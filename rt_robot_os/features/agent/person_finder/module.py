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
Where the robot sees a person: objects in its scans that are not on the map.

It searches only while the agent serves that person, around the location from the nodes, and never
around its own result, which could not be corrected otherwise. It publishes the nearest point of
the body. A pose next to that point keeps its distance from the whole body; next to the middle of a
lying person it could be at their head.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.agent.person_finder.things import Things
from rt_robot_os.features.health.vital_signs.settings import checked_person
from rt_robot_os.features.health.whereabouts.module import BY_NODES_TOPIC
from rt_robot_os.features.health.whereabouts.module import PLACE_TOPIC
from rt_robot_os.features.mapping.live_map import check_map
from rt_robot_os.features.mapping.live_map import LiveMap
from rt_robot_os.features.mapping.live_map import MAP_MESSAGE
from rt_robot_os.features.navigation.collision_guard.sensors import Scanner
from rt_robot_os.features.navigation.collision_guard.sensors import sensor_mounting
from rt_robot_os.features.navigation.trajectory.pose_input import planar
from rt_robot_os.kernel import Task
from rt_robot_os.modules.base import Module
from rt_robot_os.motion.clearing import Clearing
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.unmapped_points import clusters
from rt_robot_os.motion.unmapped_points import unmapped_points
from rt_robot_os.motion.zones import Circle
from rt_robot_os.topics import Bus
from rt_robot_os.topics.ports import Input

SEEN_TOPIC: Final = 'health/{}/seen'
_POSE: Final = 'geometry_msgs/msg/PoseStamped'
_LOOKS: Final = ('confirm', 'approach', 'observe', 'report', 'stay')
# Pose and scan must be of about the same time, and the robot must not turn fast between them:
# else walls would appear twice.
_APART_NS: Final = NS_PER_S // 5
_TURN_RAD_S: Final = 0.6
# Older locations of other people are ignored.
_OTHERS_NS: Final = 60 * NS_PER_S
# Pieces of reading a map: 65,000 cells each.
_MAP_PIECES: Final = 20


class PersonFinder(Module):
    """Publish where the robot sees one person, while the agent serves them."""

    RATE_HZ = 5.0

    pose = Input('pose', message='geometry_msgs/msg/PoseWithCovarianceStamped', newest=True)
    map = Input('', message=MAP_MESSAGE, initial=True, newest=True)  # noqa: A003
    state = Input('agent/state', message='std_msgs/msg/String', initial=True, newest=True)

    SETTINGS = (
        Field('person', str, REQUIRED, 'Name of the person; part of the names of topics'),
        Field('others', list, [], 'Other people with a module whereabouts: an object nearer to '
              'one of their locations is not this person'),
        Field('map', str, '', 'The map: a YAML file as map_saver writes it; objects on it are '
              'not a person', is_file=True),
        Field('map_topic', str, '', 'Topic of a growing map, nav_msgs/msg/OccupancyGrid: the '
              'newest at the start of a search is used until its end, because a lying person is '
              'soon on the map; map is used for areas that it does not cover yet'),
        Field('scan_topics', list, ['scan'], 'Laser scanners, each a sensor_msgs/msg/LaserScan; '
              'one that is 0.25 m above the floor detects a lying person'),
        Field('scan_minimum_m', float, 0.0, 'Nearer points of a scan are the robot itself; 0: the '
              'range_min of the scanner', 'm', 0.0, 5.0),
        Field('range_m', float, 5.0, 'Farther points of a scan are ignored', 'm', 0.1, 30.0),
        Field('map_tolerance_m', float, 0.2, 'Points this near to an object of the map belong to '
              'it', 'm', 0.0, 2.0),
        Field('search_m', float, 3.0, 'Radius of the search around the location from the nodes',
              'm', 0.1, 30.0, live=True),
        Field('gap_m', float, 0.3, 'Points that are farther apart belong to different objects',
              'm', 0.01, 2.0, live=True),
        Field('size_min_m', float, 0.1, 'Smaller objects are not a person', 'm', 0.0, 2.0),
        Field('size_max_m', float, 2.2, 'Larger objects are not a person', 'm', 0.1, 10.0),
        Field('points', int, 5, 'The fewest points of a person in a scan', '', 1, 1000),
        Field('steady_s', float, 1.0, 'How long an object has to stay in place; a person who '
              'walks by is another one', 's', 0.0, 60.0),
        Field('steady_m', float, 0.3, 'Movement that still counts as staying in place', 'm', 0.01,
              2.0),
        Field('lost_s', float, 2.0, 'An object that was not seen for this time is gone', 's', 0.1,
              60.0),
    )

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Check the settings; the map is read later.

        :raises ConfigError: there is no map, or no such person, or they are among the others.
        """
        super().__init__(name, settings)
        check_map(settings['map'], bool(settings['map_topic']), name)
        self._person = checked_person(name, settings)
        if self._person in settings['others']:
            raise ConfigError([f'{name}.others has {self._person}, who is the person: take it '
                               'out'])
        s = settings
        self._things = Things(
            (s['size_min_m'], s['size_max_m']), s['points'], s['steady_m'],
            round(s['steady_s'] * NS_PER_S), round(s['lost_s'] * NS_PER_S))
        self._looks = self._takes_map = False
        self._scanners: list[Scanner] = []
        self._robot: Pose | None = None
        self._robot_ns = 0
        self._is_turning = False
        self._place: tuple[float, float] | None = None
        self._others: dict[str, tuple[int, float, float]] = {}
        self._seen: tuple[float, float] | None = None
        self._scans = self._turning = self._found = 0

    # ---- ports -------------------------------------------------------------------------------

    def connected(self, attribute: str) -> bool:
        """Return whether a port has a topic."""
        return bool(self.topic_of(attribute))

    def listed_inputs(self) -> Mapping[str, Input]:
        """Return an input for the location from the nodes, and for each scanner."""
        return {
            'by nodes': Input(BY_NODES_TOPIC.format(self._person), message=_POSE, initial=True,
                              newest=True),
            **{f'other {name}': Input(PLACE_TOPIC.format(name), message=_POSE, newest=True)
               for name in self.settings['others']},
            **{topic: Input(topic, message='sensor_msgs/msg/LaserScan', newest=True)
               for topic in self.settings['scan_topics']}}

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return where the person is seen."""
        return (TopicSpec(SEEN_TOPIC.format(self._person), _POSE, {'header.frame_id': 'map'}),)

    def bind(self, bus: Bus, task: Task) -> None:
        """Connect the topics."""
        super().bind(bus, task)
        self._out = bus.publisher(SEEN_TOPIC.format(self._person), task)
        self._out.msg.pose.orientation.w = 1.0

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """
        Read the map.

        :raises ConfigError: it cannot be read, or there is no transform of a scanner.
        """
        s = self.settings
        self._map = LiveMap(s['map'], self.map if self.connected('map') else None,
                            str(self.pose.msg.header.frame_id), self.name, self.log)
        self._clearing = Clearing(self._map.grid) if self._map.grid is not None else None
        outline = Circle(0.1)
        self._scanners = [
            Scanner(self.listed[topic],
                    sensor_mounting(self.listed[topic], self.mountings, self.name),
                    outline, s['scan_minimum_m']) for topic in s['scan_topics']]

    def activate(self) -> None:
        """Start without a detection, also after a failure."""
        self._things.forget()
        self._looks = False
        self._robot = self._place = self._seen = None
        self.state.rewind()
        for key in ('by nodes', *(f'other {name}' for name in self.settings['others'])):
            self.listed[key].rewind()

    def step(self) -> None:
        """Search, if the agent serves the person."""
        if self.state.latest():
            self._take_state(str(self.state.msg.data))
        if not self._looks:
            return
        self._take_places()
        if self.pose.latest():
            self._take_pose()
        if self._takes_map:
            self._take_map()
        now_ns = self._out.topic.kernel.now_ns()
        for scanner in self._scanners:
            if scanner.update(now_ns, self.settings['range_m'], 0.0, 0.0):
                self._look(scanner, min(self.listed[scanner.topic].stamp_ns, now_ns))

    def statistics(self) -> Mapping[str, Any]:
        """Return whether it searches, and what it found."""
        seen = self._seen
        return {'warning': self._map.warning(), **self._map.statistics(), 'looks': self._looks,
                'scans': self._scans, 'scans_while_turning': self._turning,
                'things': len(self._things), 'sightings': self._found,
                'seen': f'{seen[0]:.2f} {seen[1]:.2f}' if seen else ''}

    # ---- work --------------------------------------------------------------------------------

    def _take_state(self, text: str) -> None:
        """Handle the state of the agent: ``approach anna: fall``."""
        state, _, rest = text.partition(' ')
        looks = state in _LOOKS and rest.partition(':')[0] == self._person
        if looks and not self._looks:
            self._things.forget()
            self._robot = self._seen = None
            self._takes_map = self._map.is_live
        self._looks = looks

    def _take_map(self) -> None:
        """Read the newest map, in pieces; later ones contain a lying person."""
        if self._map.advance(_MAP_PIECES) and self._map.grid is not None:
            self._clearing = Clearing(self._map.grid)
        self._takes_map = self._map.is_reading or self._clearing is None

    def _take_places(self) -> None:
        nodes = self.listed['by nodes']
        if nodes.latest():
            position = nodes.msg.pose.position
            x, y = float(position.x), float(position.y)
            self._place = (x, y) if math.isfinite(x) and math.isfinite(y) else None
        for name in self.settings['others']:
            read = self.listed[f'other {name}']
            if read.latest():
                position = read.msg.pose.position
                self._others[name] = read.stamp_ns, float(position.x), float(position.y)

    def _take_pose(self) -> None:
        pose, stamp_ns = planar(self.pose.msg.pose.pose), self.pose.stamp_ns
        before, since_ns = self._robot, stamp_ns - self._robot_ns
        self._robot, self._robot_ns = pose, stamp_ns
        if pose is not None and before is not None and since_ns > 0:
            turned = abs(math.remainder(pose[2] - before[2], math.tau))
            self._is_turning = turned * NS_PER_S > _TURN_RAD_S * since_ns

    def _look(self, scanner: Scanner, stamp_ns: int) -> None:
        robot, place, chart, s = self._robot, self._place, self._clearing, self.settings
        if robot is None or place is None or chart is None or (
                abs(stamp_ns - self._robot_ns) > _APART_NS):
            return
        if self._is_turning:
            self._turning += 1
            return
        self._scans += 1
        x, y = unmapped_points(chart, robot, scanner.x, scanner.y, s['map_tolerance_m'])
        self._things.look(clusters(x, y, s['gap_m']), stamp_ns)
        others = [each[1:] for each in self._others.values()
                  if stamp_ns - each[0] <= _OTHERS_NS and math.isfinite(each[1] + each[2])]
        best = self._things.best(place, s['search_m'], stamp_ns, others)
        if best is not None:
            self._found += 1
            self._seen = position = best.nearest(robot[:2])
            self._out.msg.pose.position.x, self._out.msg.pose.position.y = position
            self._out.publish(stamp_ns)
