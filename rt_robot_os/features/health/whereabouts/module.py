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
Position of a person, and alarms when they do not move, stay or are away for too long.

The position is estimated in :mod:`.place_estimate`, and the durations are measured in
:mod:`.activity`; this module reads the topics in the order of their stamps and reports causes.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Mapping
import functools
import json
import math
from typing import Any
from typing import Final

from rt_robot_os.base.schema import TopicRead
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.rule.evaluation import RuleState
from rt_robot_os.features.health.rule.fields import checked
from rt_robot_os.features.health.rule.rule_set import bind_rules
from rt_robot_os.features.health.rule.rule_set import RuleSet
from rt_robot_os.features.health.rule.rule_set import SETTLING_NS
from rt_robot_os.features.health.rule.terms import refs_of
from rt_robot_os.features.health.vital_signs.settings import checked_person
from rt_robot_os.features.health.whereabouts.activity import Activity
from rt_robot_os.features.health.whereabouts.activity import ActivityChange
from rt_robot_os.features.health.whereabouts.activity import LEFT_HOME
from rt_robot_os.features.health.whereabouts.activity import NO_MOVEMENT
from rt_robot_os.features.health.whereabouts.activity import WANDERING
from rt_robot_os.features.health.whereabouts.place_estimate import PlaceEstimate
from rt_robot_os.features.health.whereabouts.place_estimate import Rooms
from rt_robot_os.features.health.whereabouts.place_estimate import Sighting
from rt_robot_os.features.health.whereabouts.settings import check_names
from rt_robot_os.features.health.whereabouts.settings import limits_from
from rt_robot_os.features.health.whereabouts.settings import movement_from
from rt_robot_os.features.health.whereabouts.settings import rooms_from
from rt_robot_os.features.health.whereabouts.settings import SETTINGS
from rt_robot_os.features.health.whereabouts.sightings import field_values
from rt_robot_os.features.health.whereabouts.sightings import SightingInputs
from rt_robot_os.features.wsn.sensor_packets import survey_from
from rt_robot_os.kernel import Task
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import LEVELS
from rt_robot_os.messages.quantities import FLOAT
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.cause_reports import CauseReports
from rt_robot_os.modules.cause_reports import CAUSES_OUTPUT
from rt_robot_os.modules.wake_up import WakeUp
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription
from rt_robot_os.topics.ports import Input

PLACE_TOPIC: Final = 'health/{}/place'
#: The same without the sightings of the robot, which searches the person around it.
BY_NODES_TOPIC: Final = 'health/{}/place_by_nodes'
DETAILS_TOPIC: Final = 'health/{}/place_details'
_POSE: Final = 'geometry_msgs/msg/PoseStamped'
_DETAILS_BYTES: Final = 600
_REPEAT_NS: Final = 5 * NS_PER_S
_OK, _STALE = 0, 3

Values = Callable[[], tuple[float, ...]]
Handler = Callable[[tuple[float, ...], int], list[ActivityChange]]
_Event = tuple[int, int, Callable[[int], list[ActivityChange]]]


class Whereabouts(Module):
    """Publish the position of one person; report when they do not move or are away too long."""

    RATE_HZ = 1.0

    pose = Input('', message=_POSE, wake=True)
    seen = Input('', message=_POSE, wake=True, newest=True)
    network = Input('', message='std_msgs/msg/Float64MultiArray', newest=True)
    causes = CAUSES_OUTPUT

    SETTINGS = SETTINGS

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Parse the settings.

        :raises ConfigError: with every problem.
        """
        super().__init__(name, settings)
        self._person = checked_person(name, settings)
        self._survey = survey_from(name, settings)
        check_names(name, settings, self._survey)
        rooms = rooms_from(name, settings)
        self._rooms = Rooms(rooms)
        self._movement = movement_from(name, settings)
        self._exits = frozenset(settings['exits'])
        self._activity = Activity(limits_from(name, settings, rooms))
        self._place = PlaceEstimate(round(settings['timeout_s'] * NS_PER_S))
        worn = next((node for node in self._survey if node.person == self._person), None)
        self._nearest_topic = ''
        if worn is not None and 'nearest_node' in worn.quantities:
            self._nearest_topic = f'{settings["prefix"]}/{worn.token}/nearest_node'
        self._worn_sensor = bool(
            self._nearest_topic or self._movement or settings['pose_topic'])
        self._inputs = SightingInputs(settings, self._place, self._survey, worn.id if worn else -1)
        self._watched: RuleSet | None = None
        self._reports: CauseReports | None = None
        self._wake_up = WakeUp(None, None)
        self._published: Sighting | None = None
        self._published_by_nodes: Sighting | None = None
        self._published_ns = -_REPEAT_NS
        self._started = self._has_network = False

    # ---- ports -------------------------------------------------------------------------------

    def connected(self, attribute: str) -> bool:
        """Return whether a port has a topic."""
        return bool(self.topic_of(attribute))

    def listed_inputs(self) -> Mapping[str, Input]:
        """Return the inputs of nodes and of other people."""
        prefix = self.settings['prefix']
        found = {f'presence {node.token}': Input(
            f'{prefix}/{node.token}/presence', wake=True, message=FLOAT)
            for node in self._survey if 'presence' in node.quantities}
        if self._nearest_topic:
            found['nearest'] = Input(self._nearest_topic, wake=True, message=FLOAT)
        # Without wake: two such modules read each other.
        found |= {f'other {name}': Input(PLACE_TOPIC.format(name), message=_POSE)
                  for name in self.settings['others']}
        return found

    def reads(self) -> tuple[TopicRead, ...]:
        """Return the topics that are read, those of the movement rules included."""
        return (*super().reads(), *(
            TopicRead(ref.topic, wake=True, key='movement', check=checked(
                f'{self.name}.movement', text, rule, ref))
            for text, rule in self._movement.items() for ref in refs_of(rule)))

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the topics of the position, of its details, and of the causes."""
        on_map = {'header.frame_id': 'map'}
        by_nodes = (TopicSpec(BY_NODES_TOPIC.format(self._person), _POSE, on_map),)
        return (TopicSpec(PLACE_TOPIC.format(self._person), _POSE, on_map),
                *(by_nodes if self.connected('seen') else ()),
                TopicSpec(DETAILS_TOPIC.format(self._person), 'std_msgs/msg/String',
                          tail=_DETAILS_BYTES), *super().publications())

    def bind(self, bus: Bus, task: Task) -> None:
        """
        Connect the topics.

        :raises ConfigError: a topic or field of a movement rule does not exist.
        """
        super().bind(bus, task)
        layouts = {topic.name: topic.layout for topic in bus.topics}
        self._watched = RuleSet({
            f'{text} {star}': RuleState(rule) for text, written in self._movement.items()
            for star, rule in bind_rules(
                f'{self.name}.movement', text, written, layouts).items()},
            lambda topic: bus.subscribe(topic, self.name, task=task))
        self._out = bus.publisher(PLACE_TOPIC.format(self._person), task)
        self._out.msg.pose.orientation.w = 1.0
        self._nodes_out: Publisher | None = None
        if self.connected('seen'):
            self._nodes_out = bus.publisher(BY_NODES_TOPIC.format(self._person), task)
            self._nodes_out.msg.pose.orientation.w = 1.0
        self._details = bus.publisher(DETAILS_TOPIC.format(self._person), task)

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """Prepare."""
        self._reports = CauseReports(self.causes, self.name)
        self._wake_up = WakeUp(self.kernel, self.task)
        self._feeds = self._all_feeds()
        self._has_network = self.connected('network')

    def step(self) -> None:
        """Process new samples in the order of their stamps, and deadlines."""
        watched, reports = self._watched, self._reports
        if watched is None or reports is None:
            return
        now_ns = self.causes.topic.kernel.now_ns()
        if not self._started:
            self._started = True
            watched.start(self.job_ns)
        for stamp_ns, _, take in self._events(watched, now_ns):
            self._report(self._activity.advance(stamp_ns), reports)
            self._report(take(stamp_ns), reports)
        self._report(self._activity.advance(now_ns - SETTLING_NS), reports)
        self._publish(now_ns)
        reports.refresh(now_ns)
        self._wake_up.no_later_than(min(
            watched.due_ns(), self._activity.due_ns + SETTLING_NS, reports.due_ns))

    def statistics(self) -> Mapping[str, Any]:
        """Return the position, and the time without movement."""
        if self._reports is None:
            return {}
        now_ns = self.causes.topic.kernel.now_ns()
        best, moved_ns = self._place.best(now_ns), self._activity.moved_ns
        return {'place': 'not known' if best is None else
                f'{best.x:.2f} {best.y:.2f} by {best.how} {best.node}'.strip(),
                'room': self._activity.room, 'presence_of_others': self._place.refused,
                'still_s': round((now_ns - moved_ns) / NS_PER_S) if moved_ns >= 0 else '',
                **self._reports.statistics()}

    # ---- samples -----------------------------------------------------------------------------

    def _all_feeds(self) -> list[tuple[Subscription, Values, Handler]]:
        """Return each subscription, the reader of its samples, and their handler."""
        found: list[tuple[Subscription, Values, Handler]] = []
        inputs, nodes = self._inputs, {node.token: node for node in self._survey}
        for key, read in self.listed.items():
            what, _, name = key.partition(' ')
            if what == 'other':
                found.append((read, field_values(read, 'pose.position'),
                              functools.partial(self._other, name)))
                continue
            update = inputs.nearest if what == 'nearest' else functools.partial(
                inputs.presence, nodes[name])
            # With a worn sensor only that detects stillness; sensors of rooms do not.
            found.append((read, field_values(read, 'data'), functools.partial(
                self._handle, update, what == 'nearest' or not self._worn_sensor)))
        if self.connected('pose'):
            found.append((self.pose, field_values(self.pose, 'pose.position'),
                          functools.partial(self._handle, inputs.pose, True)))
        if self.connected('seen'):
            found.append(
                (self.seen, field_values(self.seen, 'pose.position'), self._seen_by_robot))
        return found

    def _events(self, watched: RuleSet, now_ns: int) -> list[_Event]:
        found: list[_Event] = []
        for read, values, handle in self._feeds:
            while read.take():
                found.append((min(read.stamp_ns, now_ns), len(found),
                              functools.partial(handle, values())))
        if self._has_network and self.network.take():
            rows = list(self.network.msg.data)
            found.append((min(self.network.stamp_ns, now_ns), len(found),
                          functools.partial(self._network, rows)))
        received_ns = watched.received_ns
        transitions = list(watched.step(now_ns))
        if watched.received_ns > received_ns:
            found.append((watched.received_ns, len(found), self._on_rule_sample))
        for name, transition in transitions:
            found.append((transition.time_ns, len(found), functools.partial(
                self._activity.on_lasting_movement, name, transition.active)))
        found.sort(key=lambda event: event[:2])
        return found

    def _handle(self, update: Callable[[tuple[float, ...], int], tuple[bool, bool]],
                personal: bool, values: tuple[float, ...], stamp_ns: int
                ) -> list[ActivityChange]:
        seen, moved = update(values, stamp_ns)
        if personal:
            self._activity.on_sensor_packet(stamp_ns)
        else:
            self._activity.on_home_packet(stamp_ns)
        found = self._seen(stamp_ns) if seen else []
        return found + self._activity.on_movement(stamp_ns) if moved else found

    def _on_rule_sample(self, stamp_ns: int) -> list[ActivityChange]:
        self._activity.on_sensor_packet(stamp_ns)
        return []

    def _network(self, rows: list[float], stamp_ns: int) -> list[ActivityChange]:
        return self._seen(stamp_ns) if self._inputs.network(rows, stamp_ns) else []

    def _other(self, name: str, values: tuple[float, ...], stamp_ns: int) -> list[ActivityChange]:
        self._inputs.other(name, values, stamp_ns)
        return []

    def _seen_by_robot(self, values: tuple[float, ...], stamp_ns: int) -> list[ActivityChange]:
        self._inputs.seen(values, stamp_ns)
        return []

    def _seen(self, stamp_ns: int) -> list[ActivityChange]:
        best = self._place.best(stamp_ns)
        if best is None:
            return []
        return self._activity.on_sighting(
            self._rooms.at(best.x, best.y), bool({best.node, self._inputs.latest} & self._exits),
            stamp_ns)

    # ---- words -------------------------------------------------------------------------------

    def _report(self, findings: Iterable[ActivityChange], reports: CauseReports) -> None:
        for finding in findings:
            s, best = self.settings, self._place.best(finding.stamp_ns)
            level = {NO_MOVEMENT: s['still_level'], WANDERING: s['stay_level'],
                     LEFT_HOME: s['away_level']}[finding.kind]
            x, y, node = (best.x, best.y, best.node) if best else (math.nan, math.nan, '')
            reports.report(Cause(
                finding.kind, self._person, LEVELS[level], finding.active,
                self._text(finding), node=node, x=x, y=y,
                value=(finding.stamp_ns - finding.since_ns) / NS_PER_S), finding.stamp_ns)

    def _text(self, finding: ActivityChange) -> str:
        who, room = self._person, self._activity.room
        length = _length((finding.stamp_ns - finding.since_ns) // NS_PER_S)
        if not finding.active:
            return {NO_MOVEMENT: f'{who} moves again', LEFT_HOME: f'{who} is back'}.get(
                finding.kind, f'{who} is elsewhere')
        if finding.kind == NO_MOVEMENT:
            return f'{who} has not moved for {length}{f", {room}" if room else ""}'
        if finding.kind == WANDERING:
            return f'{who} has been in {room} for {length}'
        return f'{who} has been away for {length}'

    def _publish(self, now_ns: int) -> None:
        best = self._place.best(now_ns)
        if best is not None and best != self._published:
            position = self._out.msg.pose.position
            position.x, position.y = best.x, best.y
            self._out.publish(best.stamp_ns)
        self._publish_by_nodes(now_ns)
        published = self._published
        changed = (best and best[:5]) != (published and published[:5])
        self._published = best
        if changed or now_ns - self._published_ns >= _REPEAT_NS:
            self._published_ns = now_ns
            self._details.msg.data = _details(
                self._person, best, self._rooms.at(best.x, best.y) if best else '',
                self._activity.moved_ns, now_ns)
            self._details.publish(now_ns)

    def _publish_by_nodes(self, now_ns: int) -> None:
        out = self._nodes_out
        if out is None:
            return
        by_nodes = self._place.by_nodes(now_ns)
        if by_nodes is not None and by_nodes != self._published_by_nodes:
            self._published_by_nodes = by_nodes
            out.msg.pose.position.x, out.msg.pose.position.y = by_nodes.x, by_nodes.y
            out.publish(by_nodes.stamp_ns)


def _details(person: str, best: Sighting | None, room: str, moved_ns: int, now_ns: int) -> str:
    """Return a position as a DiagnosticArray in JSON."""
    values = {'room': room}
    if moved_ns >= 0:
        values['still_s'] = f'{max(0, now_ns - moved_ns) / NS_PER_S:.0f}'
    if best is not None:
        values |= {'how': best.how, 'node': best.node, 'x': f'{best.x:.2f}', 'y': f'{best.y:.2f}',
                   'uncertainty_m': f'{best.now_m(now_ns):.1f}',
                   'age_s': f'{max(0, now_ns - best.stamp_ns) / NS_PER_S:.1f}'}
    near = f'near {best.node}' if best is not None and best.node else 'known'
    return json.dumps({'status': [{
        'level': _STALE if best is None else _OK, 'name': f'{person}/place',
        'message': 'not known' if best is None else room or near,
        'hardware_id': best.node if best else '', 'values': values}]}, separators=(',', ':'))


def _length(seconds: int) -> str:
    if seconds < 120:
        return f'{seconds} s'
    return f'{seconds // 60} min' if seconds < 7200 else f'{seconds / 3600:.3g} h'
