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

"""Runs a scenario with the fixture of a core, including crashes, and records its events."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace
from random import Random
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.settings import RobotSettings
from rt_robot_os.sim.scenarios.faults import FaultInjector
from rt_robot_os.sim.scenarios.timeline import VirtualTimeline
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world.posture import Posture
from rt_robot_os.tools.rehearse.fixture import CoreFixture
from rt_robot_os.tools.rehearse.fixture import STEP_NS
from rt_robot_os.tools.rehearse.journal_device import JournalDevice
from rt_robot_os.tools.rehearse.operators import CAREGIVER
from rt_robot_os.tools.rehearse.operators import NotifierAndCaregiver
from rt_robot_os.tools.rehearse.operators import SimulatedOperator
from rt_robot_os.tools.rehearse.scenario import CareScenario
from rt_robot_os.tools.rehearse.scenario import Occurrence
from rt_robot_os.tools.rehearse.simulated_network import SimulatedNetwork
from rt_robot_os.tools.rehearse.simulated_robot import SimulatedRobot
from rt_robot_os.tools.rehearse.simulated_sensors import CameraAndMicrophone
from rt_robot_os.tools.rehearse.simulated_wearables import SimulatedWearables
from rt_robot_os.tools.rehearse.topics import received
from rt_robot_os.tools.rehearse.topics import received_json

# Time for which a button is pressed.
_PRESS_S: Final = 10.0
#: Time-out of a scenario.
LONGEST_S: Final = 1800.0
_CHECK_NS: Final = 10 * NS_PER_S
# Offset from its home at which an operator sends the robot; the agent never goes there.
_ASIDE_M: Final = 0.6


@dataclass
class RunRecord:
    """
    The record of a run.

    :ivar events: of the alarms, in order.
    :ivar transitions: of the agent, in order.
    :ivar said: sentences of the robot's voice.
    :ivar shown: key of a notification -> how often a person was shown it.
    :ivar crashes: of the core.
    :ivar lasted_s: duration in virtual time.
    :ivar moved_m: distance that the robot drove.
    :ivar no_falls: falls of a person who was already lying on the floor.
    :ivar violations: orders of the agent during an e-stop or a control by an operator.
    :ivar overridden: at the end the e-stop was active, or an operator controlled the robot.
    :ivar has_agent: the robot has an agent.
    """

    events: list[dict[str, Any]] = field(default_factory=list)
    transitions: list[dict[str, Any]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    shown: Mapping[str, int] = field(default_factory=dict)
    crashes: int = 0
    lasted_s: float = 0.0
    moved_m: float = 0.0
    no_falls: list[Occurrence] = field(default_factory=list)
    violations: Sequence[str] = ()
    overridden: bool = False
    has_agent: bool = False

    @property
    def agent_state(self) -> str:
        """Return the state of the agent at the end."""
        return str(self.transitions[-1]['to']) if self.transitions else 'idle'

    def forgotten(self) -> list[str]:
        """Return the alarms that the agent never served and no person acknowledged."""
        if not self.has_agent:
            return []
        served = {each.get('alarm') for each in self.transitions}
        return [number for number, events in self.alarms().items()
                if number not in served and events[-1]['level'] in ('urgent', 'critical')
                and events[-1]['state'] in ('suspected', 'raised')]

    def alarms(self) -> dict[str, list[dict[str, Any]]]:
        """Return the events of each alarm, by its number."""
        found: dict[str, list[dict[str, Any]]] = {}
        for each in self.events:
            found.setdefault(str(each['alarm']), []).append(each)
        return found


class EventRecorder:
    """Records the messages of the alarms and of the agent."""

    def __init__(self, record: RunRecord) -> None:
        self._record = record

    def attach(self, fixture: CoreFixture) -> None:
        """Find the topics."""
        self._events = fixture.reader('alarms/events')
        self._transitions = fixture.reader('agent/transitions')
        self._record.has_agent = self._transitions is not None
        self._said = fixture.reader('agent/say')

    def step(self, now_ns: int) -> None:
        """Record new messages."""
        self._record.events += received_json(self._events)
        self._record.transitions += received_json(self._transitions)
        self._record.said += received(self._said)


class ScenarioRun:
    """
    Runs one scenario, including crashes of the core.

    :param settings: of the robot; the events of its world are not used.
    :param longest_s: time-out of the run.
    :ivar record: the record of the run.
    """

    def __init__(self, settings: RobotSettings, scenario: CareScenario,
                 longest_s: float = LONGEST_S) -> None:
        self._settings = settings
        self._longest_s = longest_s
        self._scenario = scenario
        random = Random(scenario.seed)
        self.world = World(replace(settings.world, events=(), seed=scenario.seed))
        self.robot = SimulatedRobot(self.world)
        self.network = SimulatedNetwork(self.world, random)
        self.wearables = SimulatedWearables(settings, self.world)
        self.journal = JournalDevice(random)
        self.notifier = NotifierAndCaregiver(scenario.caregiver, random)
        self.sensors = CameraAndMicrophone(self.world)
        self.operator = SimulatedOperator(self.robot)
        self._switches: Mapping[str, tuple[object, str]] = {
            'path_blocked': (self.robot, 'blocked'), 'lost_position': (self.robot, 'lost'),
            'estop': (self.robot, 'estop'), 'battery_low': (self.robot, 'battery_low'),
            'no_free_place': (self.robot, 'refuses'), 'planner_silent': (self.robot, 'silent'),
            'robot_stuck': (self.robot, 'stuck'), 'operator_drives': (self.robot, 'driven'),
            'camera_fails': (self.sensors, 'failing'), 'noise': (self.sensors, 'noise'),
            'channel_fails': (self.notifier, 'failing'), 'disk_full': (self.journal, 'full'),
            'sink_silent': (self.network, 'silent')}
        self.record = RunRecord()
        self._timeline = VirtualTimeline()
        self._injector = FaultInjector(self._timeline, random)
        self._crash_at_s: list[tuple[float, float]] = []
        self._seen_events = 0
        for each in scenario.occurrences:
            self._plan(each)

    def run(self) -> RunRecord:
        """
        Run the scenario to its end.

        :raises AssertionError: a job of the robot failed.
        """
        now_s = 0.0
        for at_s, down_s in sorted(self._crash_at_s):
            now_s = self._run_core(now_s, at_s) + down_s
            self.record.crashes += 1
            # A restarted agent is idle.
            self.record.transitions.append({
                'from': self.record.agent_state, 'to': 'idle', 'cause': 'the core was killed',
                't_ns': round(now_s * NS_PER_S)})
        now_s = self._run_core(now_s, self._longest_s)
        self.record.shown = self.notifier.shown
        self.record.lasted_s = now_s
        self.record.moved_m = self.robot.moved_m
        self.record.violations = self.robot.violations
        self.record.overridden = self._is_overridden()
        return self.record

    def _run_core(self, from_s: float, until_s: float) -> float:
        """Run one core until a time, or until all is settled; return its end time."""
        begin_ns = round(from_s * NS_PER_S) // STEP_NS * STEP_NS
        fixture = CoreFixture(self._settings, (
            self, self.robot, self.network, self.wearables, self.sensors, self.journal,
            self.notifier, self.operator, EventRecorder(self.record)), begin_ns)
        try:
            fixture.core.prepare_modules()
            fixture.run(round(until_s * NS_PER_S))
            return fixture.now_ns / NS_PER_S
        finally:
            fixture.close()

    def _is_settled(self, now_s: float) -> bool:
        """Return whether no more events are expected."""
        # All crashes must have happened: they are occurrences, too.
        if now_s < self._scenario.settled_s or self.record.agent_state not in (
                'idle', 'stay', 'return',
                *(('held', 'operator') if self._is_overridden() else ())):
            return False
        return all(is_settled(events) for events in self.record.alarms().values()) and (
            self._is_overridden() or not self.record.forgotten())

    def _is_overridden(self) -> bool:
        """Return whether the e-stop is active, or an operator controls the robot."""
        return self.robot.estop or self.robot.driven

    # ---- as a participant --------------------------------------------------------------------

    def attach(self, fixture: CoreFixture) -> None:
        """Store the fixture, to end it later."""
        self._fixture = fixture

    def step(self, now_ns: int) -> None:
        """Start the occurrences that are due."""
        self._timeline.run_until(now_ns)
        self._help_up()
        if now_ns % _CHECK_NS == 0 and self._is_settled(now_ns / NS_PER_S):
            self._fixture.end()

    def _help_up(self) -> None:
        """Make a person get up after the caregiver has helped."""
        events = self.record.events
        for each in events[self._seen_events:]:
            person = self.world.people_model.find(each['subject'])
            if (each['event'], each['by']) == ('resolved', CAREGIVER) and person is not None and (
                    person.stance.posture is Posture.FALLEN):
                self.world.inject(['rise', person.name])
        self._seen_events = len(events)

    # ---- occurrences -------------------------------------------------------------------------

    def _plan(self, each: Occurrence) -> None:
        if each.what == 'core_killed':
            self._crash_at_s.append((each.at_s, each.for_s))
        else:
            self._injector.once(each.at_s, each.for_s, lambda: self._begin(each),
                                lambda: self._end(each))

    def _begin(self, each: Occurrence) -> None:
        order = self.world.inject
        match each.what:
            case 'fall':
                person = self.world.people_model.find(each.who)
                if person is not None and person.stance.posture is Posture.FALLEN:
                    self.record.no_falls.append(each)
                order(['answer', each.who, each.answer])
                order(['fall', each.who])
            case 'help':
                order(['press', each.who, 'help', f'{_PRESS_S:g}'])
            case 'sick':
                lasts = f'{each.for_s:.1f}'
                for sign, value in (('pulse_per_min', '141'), ('respiration_per_min', '27'),
                                    ('spo2_percent', '87')):
                    order(['vital', each.who, sign, value, lasts])
            case 'smoke':
                order(['smoke', each.who, f'{each.for_s:.1f}'])
            case 'sit' | 'sleep' as what:
                order([what, each.who])
            case 'node_dies':
                order(['node', each.who, 'off', *([f'{each.for_s:.1f}'] if each.for_s else [])])
            case 'node_reboots':
                order(['node', each.who, 'reboot'])
            case 'walks_off':
                order(['walk', each.who])
            case 'presses_late':
                order(['press', each.who, each.answer, f'{_PRESS_S:g}'])
            case _:
                self._fault(each, True)

    def _end(self, each: Occurrence) -> None:
        if each.what in ('fall', 'sit', 'sleep'):
            self.world.inject(['rise', each.who])
        else:
            self._fault(each, False)

    def _fault(self, each: Occurrence, begins: bool) -> None:
        what, who, now_ns = each.what, each.who, self._fixture.now_ns
        if what in self._switches:
            setattr(*self._switches[what], begins)
        elif what == 'sensor_off':
            (self.wearables.off.add if begins else self.wearables.off.discard)(who)
        elif what == 'call' and not begins:
            self.operator.hang_up(who, now_ns)
        elif what == 'call':
            self.operator.call(who, round((each.for_s or self._longest_s) * NS_PER_S), now_ns)
        elif what == 'operator_says':
            self.operator.command(who, now_ns)
        elif what == 'operator_sends' and begins:
            self.operator.send(self.robot.home[0] + _ASIDE_M, self.robot.home[1], now_ns)


def is_settled(events: list[dict[str, Any]]) -> bool:
    """Return whether an alarm is resolved or cancelled, or its escalation is exhausted."""
    last = events[-1]
    return (last['state'] in ('resolved', 'cancelled') or last['level'] == 'technical'
            or any(each['event'] == 'top' for each in events))
