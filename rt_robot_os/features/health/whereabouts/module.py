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
Where a person is, and whether they have not moved, stay or are away for too long.

What is known of places and movements is in :mod:`rt_robot_os.features.health.whereabouts.place_estimate` and
:mod:`rt_robot_os.features.health.whereabouts.activity`; here are topics, the order of samples, and words.
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
from rt_robot_os.features.health.rule.terms import refs_of
from rt_robot_os.features.health.rule.watched import bound_rules
from rt_robot_os.features.health.rule.watched import SETTLING_NS
from rt_robot_os.features.health.rule.watched import WatchedRules
from rt_robot_os.features.health.vital_signs.settings import checked_person
from rt_robot_os.features.health.whereabouts.activity import Activity
from rt_robot_os.features.health.whereabouts.activity import Finding
from rt_robot_os.features.health.whereabouts.activity import LEFT_HOME
from rt_robot_os.features.health.whereabouts.activity import NO_MOVEMENT
from rt_robot_os.features.health.whereabouts.activity import WANDERING
from rt_robot_os.features.health.whereabouts.place_estimate import PlaceEstimate
from rt_robot_os.features.health.whereabouts.place_estimate import Rooms
from rt_robot_os.features.health.whereabouts.place_estimate import Sighting
from rt_robot_os.features.health.whereabouts.senses import Senses
from rt_robot_os.features.health.whereabouts.senses import taking
from rt_robot_os.features.health.whereabouts.settings import check_names
from rt_robot_os.features.health.whereabouts.settings import limits_from
from rt_robot_os.features.health.whereabouts.settings import movement_from
from rt_robot_os.features.health.whereabouts.settings import rooms_from
from rt_robot_os.features.health.whereabouts.settings import SETTINGS
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
#: The same without what the robot saw; the robot looks for the person round this.
BY_NODES_TOPIC: Final = 'health/{}/place_by_nodes'
DETAILS_TOPIC: Final = 'health/{}/place_details'
_POSE: Final = 'geometry_msgs/msg/PoseStamped'
_DETAILS_BYTES: Final = 600
_TOLD_NS: Final = 5 * NS_PER_S
_OK, _STALE = 0, 3

Values = Callable[[], tuple[float, ...]]
Handler = Callable[[tuple[float, ...], int], list[Finding]]
_Event = tuple[int, int, Callable[[int], list[Finding]]]


class Whereabouts(Module):
    """Tell where one person is; report when they have not moved, or are away, for too long."""

    RATE_HZ = 1.0

    pose = Input('', message=_POSE, wake=True)
    seen = Input('', message=_POSE, wake=True, newest=True)
    network = Input('', message='std_msgs/msg/Float64MultiArray', newest=True)
    causes = CAUSES_OUTPUT

    SETTINGS = SETTINGS

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Read the settings.

        :raises ConfigError: with what cannot be used.
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
        self._senses = Senses(settings, self._place, self._survey, worn.id if worn else -1)
        self._watched: WatchedRules | None = None
        self._reports: CauseReports | None = None
        self._wake_up = WakeUp(None, None)
        self._told: Sighting | None = None
        self._told_by_nodes: Sighting | None = None
        self._told_ns = -_TOLD_NS
        self._begun = self._has_network = False

    # ---- ports -------------------------------------------------------------------------------

    def connected(self, attribute: str) -> bool:
        """Leave alone what has no topic."""
        return bool(self.topic_of(attribute))

    def listed_inputs(self) -> Mapping[str, Input]:
        """Return the inputs of nodes and of other people."""
        prefix = self.settings['prefix']
        found = {f'presence {node.token}': Input(
            f'{prefix}/{node.token}/presence', wake=True, message=FLOAT)
            for node in self._survey if 'presence' in node.quantities}
        if self._nearest_topic:
            found['nearest'] = Input(self._nearest_topic, wake=True, message=FLOAT)
        # Without wake: two people look at each other.
        found |= {f'other {name}': Input(PLACE_TOPIC.format(name), message=_POSE)
                  for name in self.settings['others']}
        return found

    def reads(self) -> tuple[TopicRead, ...]:
        """Return what is read, with what the rules of movement read."""
        return (*super().reads(), *(
            TopicRead(ref.topic, wake=True, key='movement', check=checked(
                f'{self.name}.movement', text, rule, ref))
            for text, rule in self._movement.items() for ref in refs_of(rule)))

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the place, its details, where nodes say it is, and the causes."""
        on_map = {'header.frame_id': 'map'}
        by_nodes = (TopicSpec(BY_NODES_TOPIC.format(self._person), _POSE, on_map),)
        return (TopicSpec(PLACE_TOPIC.format(self._person), _POSE, on_map),
                *(by_nodes if self.connected('seen') else ()),
                TopicSpec(DETAILS_TOPIC.format(self._person), 'std_msgs/msg/String',
                          tail=_DETAILS_BYTES), *super().publications())

    def bind(self, bus: Bus, task: Task) -> None:
        """
        Connect the topics.

        :raises ConfigError: a rule of movement is about what is not there.
        """
        super().bind(bus, task)
        layouts = {topic.name: topic.layout for topic in bus.topics}
        self._watched = WatchedRules({
            f'{text} {star}': RuleState(rule) for text, written in self._movement.items()
            for star, rule in bound_rules(
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
        """Take what came in the order of its stamps, and let time pass between."""
        watched, reports = self._watched, self._reports
        if watched is None or reports is None:
            return
        now_ns = self.causes.topic.kernel.now_ns()
        if not self._begun:
            self._begun = True
            watched.begin(self.job_ns)
        for stamp_ns, _, take in self._events(watched, now_ns):
            self._report(self._activity.pass_time(stamp_ns), reports)
            self._report(take(stamp_ns), reports)
        self._report(self._activity.pass_time(now_ns - SETTLING_NS), reports)
        self._publish(now_ns)
        reports.refresh(now_ns)
        self._wake_up.no_later_than(min(
            watched.due_ns(), self._activity.due_ns + SETTLING_NS, reports.due_ns))

    def statistics(self) -> Mapping[str, Any]:
        """Tell where the person is, and since when they have not moved."""
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
        """Return each subscription, what its samples hold, and what is done with that."""
        found: list[tuple[Subscription, Values, Handler]] = []
        senses, nodes = self._senses, {node.token: node for node in self._survey}
        for key, read in self.listed.items():
            what, _, name = key.partition(' ')
            if what == 'other':
                found.append((read, taking(read, 'pose.position'),
                              functools.partial(self._other, name)))
                continue
            sense = senses.nearest if what == 'nearest' else functools.partial(
                senses.presence, nodes[name])
            # Who wears something is watched by that: the rooms say nothing of who is still.
            found.append((read, taking(read, 'data'), functools.partial(
                self._sense, sense, what == 'nearest' or not self._worn_sensor)))
        if self.connected('pose'):
            found.append((self.pose, taking(self.pose, 'pose.position'),
                          functools.partial(self._sense, senses.pose, True)))
        if self.connected('seen'):
            found.append((self.seen, taking(self.seen, 'pose.position'), self._seen_by_robot))
        return found

    def _events(self, watched: WatchedRules, now_ns: int) -> list[_Event]:
        found: list[_Event] = []
        for read, values, handle in self._feeds:
            while read.take():
                found.append((min(read.stamp_ns, now_ns), len(found),
                              functools.partial(handle, values())))
        if self._has_network and self.network.take():
            rows = list(self.network.msg.data)
            found.append((min(self.network.stamp_ns, now_ns), len(found),
                          functools.partial(self._network, rows)))
        heard_ns = watched.heard_ns
        transitions = list(watched.step(now_ns))
        if watched.heard_ns > heard_ns:
            found.append((watched.heard_ns, len(found), self._heard))
        for name, transition in transitions:
            found.append((transition.time_ns, len(found), functools.partial(
                self._activity.moving, name, transition.active)))
        found.sort(key=lambda event: event[:2])
        return found

    def _sense(self, sense: Callable[[tuple[float, ...], int], tuple[bool, bool]],
               personal: bool, values: tuple[float, ...], stamp_ns: int) -> list[Finding]:
        seen, moved = sense(values, stamp_ns)
        if personal:
            self._activity.heard(stamp_ns)
        else:
            self._activity.home_heard(stamp_ns)
        found = self._seen(stamp_ns) if seen else []
        return found + self._activity.moved(stamp_ns) if moved else found

    def _heard(self, stamp_ns: int) -> list[Finding]:
        self._activity.heard(stamp_ns)
        return []

    def _network(self, rows: list[float], stamp_ns: int) -> list[Finding]:
        return self._seen(stamp_ns) if self._senses.network(rows, stamp_ns) else []

    def _other(self, name: str, values: tuple[float, ...], stamp_ns: int) -> list[Finding]:
        self._senses.other(name, values, stamp_ns)
        return []

    def _seen_by_robot(self, values: tuple[float, ...], stamp_ns: int) -> list[Finding]:
        self._senses.seen(values, stamp_ns)
        return []

    def _seen(self, stamp_ns: int) -> list[Finding]:
        best = self._place.best(stamp_ns)
        if best is None:
            return []
        return self._activity.seen(self._rooms.at(best.x, best.y),
                                   bool({best.node, self._senses.latest} & self._exits), stamp_ns)

    # ---- words -------------------------------------------------------------------------------

    def _report(self, findings: Iterable[Finding], reports: CauseReports) -> None:
        for finding in findings:
            s, best = self.settings, self._place.best(finding.stamp_ns)
            level = {NO_MOVEMENT: s['still_level'], WANDERING: s['stay_level'],
                     LEFT_HOME: s['away_level']}[finding.kind]
            x, y, node = (best.x, best.y, best.node) if best else (math.nan, math.nan, '')
            reports.report(Cause(
                finding.kind, self._person, LEVELS[level], finding.active,
                self._words(finding), node=node, x=x, y=y,
                value=(finding.stamp_ns - finding.since_ns) / NS_PER_S), finding.stamp_ns)

    def _words(self, finding: Finding) -> str:
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
        if best is not None and best != self._told:
            position = self._out.msg.pose.position
            position.x, position.y = best.x, best.y
            self._out.publish(best.stamp_ns)
        self._publish_by_nodes(now_ns)
        told = self._told
        changed = (best and best[:5]) != (told and told[:5])
        self._told = best
        if changed or now_ns - self._told_ns >= _TOLD_NS:
            self._told_ns = now_ns
            self._details.msg.data = _details(
                self._person, best, self._rooms.at(best.x, best.y) if best else '',
                self._activity.moved_ns, now_ns)
            self._details.publish(now_ns)

    def _publish_by_nodes(self, now_ns: int) -> None:
        out = self._nodes_out
        if out is None:
            return
        by_nodes = self._place.by_nodes(now_ns)
        if by_nodes is not None and by_nodes != self._told_by_nodes:
            self._told_by_nodes = by_nodes
            out.msg.pose.position.x, out.msg.pose.position.y = by_nodes.x, by_nodes.y
            out.publish(by_nodes.stamp_ns)


def _details(person: str, best: Sighting | None, room: str, moved_ns: int, now_ns: int) -> str:
    """Write where somebody is as a DiagnosticArray in JSON."""
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
