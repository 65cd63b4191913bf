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

"""Tells a story on the stage, through crashes of the core, and notes what became of it."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace
import json
from random import Random
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.alarm_state import CLOSED_STATES
from rt_robot_os.messages.alarm_state import LOUD_STATES
from rt_robot_os.settings import RobotSettings
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world.posture import Posture
from rt_robot_os.tools.rehearse.body import Body
from rt_robot_os.tools.rehearse.network import Network
from rt_robot_os.tools.rehearse.observers import Observers
from rt_robot_os.tools.rehearse.office import CARER
from rt_robot_os.tools.rehearse.office import Channels
from rt_robot_os.tools.rehearse.office import Disk
from rt_robot_os.tools.rehearse.office import Later
from rt_robot_os.tools.rehearse.office import Operator
from rt_robot_os.tools.rehearse.stage import Stage
from rt_robot_os.tools.rehearse.stage import STEP_NS
from rt_robot_os.tools.rehearse.story import Scene
from rt_robot_os.tools.rehearse.story import Story
from rt_robot_os.tools.rehearse.wearables import Wearables
from rt_robot_os.topics import Subscription

# A button is held down that long.
_PRESS_S: Final = 10.0
#: What is not over by then hangs.
LONGEST_S: Final = 1800.0
_LOOK_NS: Final = 10 * NS_PER_S
# An operator sends the robot so far beside its home: there the agent never goes.
_ASIDE_M: Final = 0.6


@dataclass
class Record:
    """
    What became of a story.

    :ivar events: of the alarms, in order.
    :ivar transitions: of the agent, in order.
    :ivar said: by the robot.
    :ivar shown: dedup key -> how often a person saw it.
    :ivar crashes: of the core.
    :ivar lasted_s: of virtual time.
    :ivar moved_m: the way of the robot.
    :ivar no_falls: scenes in which somebody was to fall who lay on the floor already.
    :ivar disobeyed: what the agent ordered while e-stop or operator had the robot.
    :ivar taken: e-stop or operator had the robot at the end.
    :ivar has_agent: the robot has one.
    """

    events: list[dict[str, Any]] = field(default_factory=list)
    transitions: list[dict[str, Any]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    shown: Mapping[str, int] = field(default_factory=dict)
    crashes: int = 0
    lasted_s: float = 0.0
    moved_m: float = 0.0
    no_falls: list[Scene] = field(default_factory=list)
    disobeyed: Sequence[str] = ()
    taken: bool = False
    has_agent: bool = False

    @property
    def agent_state(self) -> str:
        """Return the state of the agent at the end."""
        return str(self.transitions[-1]['to']) if self.transitions else 'idle'

    def forgotten(self) -> list[str]:
        """Return the alarms that wait for the agent: nobody has them, and it never had one."""
        if not self.has_agent:
            return []
        served = {each.get('alarm') for each in self.transitions}
        return [number for number, events in self.alarms().items()
                if number not in served and events[-1]['level'] in ('urgent', 'critical')
                and events[-1]['state'] in LOUD_STATES]

    def alarms(self) -> dict[str, list[dict[str, Any]]]:
        """Return the events of each alarm, by its number."""
        found: dict[str, list[dict[str, Any]]] = {}
        for each in self.events:
            found.setdefault(str(each['alarm']), []).append(each)
        return found


class Listener:
    """Writes down what alarms and agent say."""

    def __init__(self, record: Record) -> None:
        self._record = record

    def enter(self, stage: Stage) -> None:
        """Find the topics."""
        self._events = stage.reader('alarms/events')
        self._transitions = stage.reader('agent/transitions')
        self._record.has_agent = self._transitions is not None
        self._said = stage.reader('agent/say')

    def act(self, now_ns: int) -> None:
        """Take what was said."""
        for reader, into in ((self._events, self._record.events),
                             (self._transitions, self._record.transitions)):
            _take(reader, into)
        while self._said is not None and self._said.take():
            self._record.said.append(str(self._said.msg.data))


def _take(reader: Subscription | None, into: list[dict[str, Any]]) -> None:
    while reader is not None and reader.take():
        into.append(json.loads(str(reader.msg.data)))


class Director:
    """
    Tells one story.

    :param settings: of the robot; events of its own world are left out.
    :param story: what happens.
    :param longest_s: what is not over by then hangs.
    :ivar record: what became of it.
    """

    def __init__(self, settings: RobotSettings, story: Story, longest_s: float = LONGEST_S
                 ) -> None:
        self._settings = settings
        self._longest_s = longest_s
        self._story = story
        random = Random(story.number)
        self.world = World(replace(settings.world, events=(), seed=story.number))
        self.body = Body(self.world)
        self.network = Network(self.world, random)
        self.wearables = Wearables(settings, self.world)
        self.disk = Disk()
        self.channels = Channels(story.carer, random)
        self.observers = Observers(self.world)
        self.operator = Operator(self.body)
        self._switches: Mapping[str, tuple[object, str]] = {
            'path_blocked': (self.body, 'blocked'), 'lost_position': (self.body, 'lost'),
            'estop': (self.body, 'estop'), 'battery_low': (self.body, 'flat'),
            'no_free_place': (self.body, 'refuses'), 'planner_silent': (self.body, 'silent'),
            'robot_stuck': (self.body, 'stuck'), 'operator_drives': (self.body, 'driven'),
            'camera_fails': (self.observers, 'failing'), 'noise': (self.observers, 'noise'),
            'channel_fails': (self.channels, 'failing'), 'disk_full': (self.disk, 'full'),
            'sink_silent': (self.network, 'silent')}
        self.record = Record()
        self._later = Later()
        self._crash_at_s: list[tuple[float, float]] = []
        self._heard = 0
        for scene in story.scenes:
            self._plan(scene)

    # ---- the story ---------------------------------------------------------------------------

    def tell(self) -> Record:
        """
        Tell it to its end.

        :raises AssertionError: a job of the robot failed.
        """
        now_s = 0.0
        crashes = sorted(self._crash_at_s)
        for at_s, down_s in crashes:
            now_s = self._live(now_s, at_s) + down_s
            self.record.crashes += 1
            # Who begins anew does nothing yet.
            self.record.transitions.append({
                'from': self.record.agent_state, 'to': 'idle', 'cause': 'the core was killed',
                't_ns': round(now_s * NS_PER_S)})
        now_s = self._live(now_s, self._longest_s)
        self.record.shown = self.channels.shown
        self.record.lasted_s = now_s
        self.record.moved_m = self.body.moved_m
        self.record.disobeyed = self.body.disobeyed
        self.record.taken = self._is_taken()
        return self.record

    def _live(self, from_s: float, until_s: float) -> float:
        """Run one core until a time, or until all is over; return when that was."""
        begin_ns = round(from_s * NS_PER_S) // STEP_NS * STEP_NS
        stage = Stage(self._settings, (
            self, self.body, self.network, self.wearables, self.observers, self.disk,
            self.channels, self.operator, Listener(self.record)), begin_ns)
        try:
            stage.core.prepare_modules()
            stage.run(round(until_s * NS_PER_S))
            return stage.now_ns / NS_PER_S
        finally:
            stage.close()

    def _is_over(self, now_s: float) -> bool:
        """Return whether nothing is left to be waited for."""
        # All crashes come first: they are scenes as well.
        if now_s < self._story.settled_s or self.record.agent_state not in (
                'idle', 'stay', 'return', *(('held', 'operator') if self._is_taken() else ())):
            return False
        return all(is_settled(events) for events in self.record.alarms().values()) and (
            self._is_taken() or not self.record.forgotten())

    def _is_taken(self) -> bool:
        """Return whether e-stop or operator has the robot."""
        return self.body.estop or self.body.driven

    # ---- as an actor -------------------------------------------------------------------------

    def enter(self, stage: Stage) -> None:
        """Remember whom to stop."""
        self._stage = stage

    def act(self, now_ns: int) -> None:
        """Let happen what is due."""
        self._later.act(now_ns)
        self._help_up()
        if now_ns % _LOOK_NS == 0 and self._is_over(now_ns / NS_PER_S):
            self._stage.end()

    def _help_up(self) -> None:
        """Who was looked after lies on the floor no longer."""
        events = self.record.events
        for each in events[self._heard:]:
            person = self.world.people_model.find(each['subject'])
            if (each['event'], each['by']) == ('resolved', CARER) and person is not None and (
                    person.stance.posture is Posture.FALLEN):
                self.world.inject(['rise', person.name])
        self._heard = len(events)

    # ---- scenes ------------------------------------------------------------------------------

    def _plan(self, scene: Scene) -> None:
        if scene.what == 'core_killed':
            self._crash_at_s.append((scene.at_s, scene.for_s))
            return
        self._at(scene.at_s, lambda: self._begin(scene))
        if scene.for_s:
            self._at(scene.at_s + scene.for_s, lambda: self._end(scene))

    def _at(self, time_s: float, do: Any) -> None:
        self._later.at(round(time_s * NS_PER_S), lambda now_ns: do())

    def _begin(self, scene: Scene) -> None:
        order = self.world.inject
        match scene.what:
            case 'fall':
                person = self.world.people_model.find(scene.who)
                if person is not None and person.stance.posture is Posture.FALLEN:
                    self.record.no_falls.append(scene)
                order(['answer', scene.who, scene.answer])
                order(['fall', scene.who])
            case 'help':
                order(['press', scene.who, 'help', f'{_PRESS_S:g}'])
            case 'sick':
                lasts = f'{scene.for_s:.1f}'
                for sign, value in (('pulse_per_min', '141'), ('respiration_per_min', '27'),
                                    ('spo2_percent', '87')):
                    order(['vital', scene.who, sign, value, lasts])
            case 'smoke':
                order(['smoke', scene.who, f'{scene.for_s:.1f}'])
            case 'sit' | 'sleep' as what:
                order([what, scene.who])
            case 'node_dies':
                order(['node', scene.who, 'off', *([f'{scene.for_s:.1f}'] if scene.for_s else [])])
            case 'node_reboots':
                order(['node', scene.who, 'reboot'])
            case 'walks_off':
                order(['walk', scene.who])
            case 'presses_late':
                order(['press', scene.who, scene.answer, f'{_PRESS_S:g}'])
            case _:
                self._trouble(scene, True)

    def _end(self, scene: Scene) -> None:
        if scene.what in ('fall', 'sit', 'sleep'):
            self.world.inject(['rise', scene.who])
        else:
            self._trouble(scene, False)

    def _trouble(self, scene: Scene, begins: bool) -> None:
        what, who, now_ns = scene.what, scene.who, self._stage.now_ns
        if what in self._switches:
            setattr(*self._switches[what], begins)
        elif what == 'sensor_off':
            (self.wearables.off.add if begins else self.wearables.off.discard)(who)
        elif what == 'call' and not begins:
            self.operator.hang_up(who, now_ns)
        elif what == 'call':
            self.operator.call(who, round((scene.for_s or self._longest_s) * NS_PER_S), now_ns)
        elif what == 'operator_says':
            self.operator.order(who, now_ns)
        elif what == 'operator_sends' and begins:
            self.operator.send(self.body.home[0] + _ASIDE_M, self.body.home[1], now_ns)


def is_settled(events: list[dict[str, Any]]) -> bool:
    """Return whether an alarm is resolved, cancelled, or told to the last who can be told."""
    last = events[-1]
    return (last['state'] in CLOSED_STATES or last['level'] == 'technical'
            or any(each['event'] == 'top' for each in events))
