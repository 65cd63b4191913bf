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
The agent as a module: a coroutine that awaits alarms, commands and points of its grid.

It publishes what :mod:`rt_robot_os.features.agent` decides. A decision has the stamp of the event
or of the grid point that led to it, never the time at which the job ran, which differs in a
replay.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
import math
from typing import Any
from typing import Final

from rt_robot_os.base.schema import made
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import period_from_rate
from rt_robot_os.features.agent.agent import Agent
from rt_robot_os.features.agent.dialogue import BUTTON
from rt_robot_os.features.agent.input_reader import InputReader
from rt_robot_os.features.agent.inputs import AgentOrder
from rt_robot_os.features.agent.inputs import Spin
from rt_robot_os.features.agent.machine import StateTransition
from rt_robot_os.features.agent.output_writer import OutputWriter
from rt_robot_os.features.agent.settings import clearing_of
from rt_robot_os.features.agent.settings import context_of
from rt_robot_os.features.agent.settings import home_of
from rt_robot_os.features.agent.settings import SETTINGS
from rt_robot_os.features.agent.tuning import AgentTuning
from rt_robot_os.features.mapping.live_map import LiveMap
from rt_robot_os.features.mapping.live_map import MAP_MESSAGE
from rt_robot_os.features.wsn.sensor_packets import survey_from
from rt_robot_os.kernel import any_of
from rt_robot_os.kernel import Until
from rt_robot_os.kernel import Wait
from rt_robot_os.messages.agent import AgentState
from rt_robot_os.messages.agent import Observation
from rt_robot_os.messages.agent import ObservationKind
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.cause_reports import CAUSES_OUTPUT
from rt_robot_os.modules.command_age import stale_reason
from rt_robot_os.motion.differential import Pose
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

# Commands that stop the robot are never too old.
_STOPS: Final = ('abort', 'stay')
_TEXT: Final = 'std_msgs/msg/String'
_BOOL: Final = 'std_msgs/msg/Bool'
_FLOAT: Final = 'std_msgs/msg/Float64'
_ON_MAP: Final = {'header.frame_id': 'map'}
_SAY_BYTES: Final = 1000
# Enough for 200 characters and the name of an alarm, however JSON escapes them.
_TEXT_BYTES: Final = 4000
_COMMAND_BYTES: Final = 1000
# A grid that fell behind by this restarts; missed points are dropped.
_MOST_BEHIND: Final = 20
# Pieces of reading a map: 65,000 cells each.
_MAP_PIECES: Final = 20


class AgentModule(Module):
    """Drive to a person in an emergency: ask, observe, report, stay."""

    events = Input('alarms/events', message=_TEXT)
    command = Input('agent/command', message=_TEXT)
    answer = Input('agent/answer', message=_TEXT)
    observed = Input('agent/observed', message=_TEXT)
    # Read during an emergency only, and then the newest.
    pose = Input('pose', message='geometry_msgs/msg/PoseWithCovarianceStamped', newest=True)
    planner_state = Input('planner/state', message=_TEXT, newest=True)
    steering = Input('steering', message=_TEXT, newest=True)
    estop = Input('estop', message=_BOOL, newest=True)
    battery = Input('battery', message='sensor_msgs/msg/BatteryState', newest=True)
    voice = Input('', message='std_msgs/msg/Float32', newest=True)
    map = Input('', message=MAP_MESSAGE, initial=True, newest=True)  # noqa: A003
    goals = Input('goal_pose', message='geometry_msgs/msg/PoseStamped', newest=True)
    turn = Output('cmd_vel_agent', 'geometry_msgs/msg/Twist')
    goal = Output('goal_pose', 'geometry_msgs/msg/PoseStamped', _ON_MAP, most_hz=1.0)
    cancel = Output('trajectory_cancel', _BOOL, most_hz=1.0)
    speed_limit = Output('speed_limit', _FLOAT, most_hz=1.0)
    say = Output('agent/say', _TEXT, tail=_SAY_BYTES, depth=16, most_hz=1.0)
    state = Output('agent/state', _TEXT, tail=_TEXT_BYTES, most_hz=2.0)
    transitions = Output('agent/transitions', _TEXT, tail=_TEXT_BYTES, depth=64, most_hz=2.0)
    order = Output('agent/observe', _TEXT, tail=_TEXT_BYTES, most_hz=1.0)
    alarm_command = Output('alarms/command', _TEXT, tail=_COMMAND_BYTES, most_hz=1.0)
    causes = CAUSES_OUTPUT

    SETTINGS = SETTINGS

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Read the survey.

        :raises ConfigError: it cannot be read, or a setting is wrong.
        """
        super().__init__(name, settings)
        home_of(name, settings)
        self._period_ns = period_from_rate(settings['decision_rate_hz'])
        self._survey = survey_from(name, settings)
        self._wearers = {f'/{node.token}/alarm': node.person for node in self._survey}
        self._agent: Agent | None = None
        self._restarted = False
        self._late = self._unreadable = 0
        self._stamp_ns = 0

    # ---- ports -------------------------------------------------------------------------------

    def connected(self, attribute: str) -> bool:
        """Return whether a port has a topic."""
        return bool(self.topic_of(attribute))

    def awaits(self) -> tuple[str, ...]:
        """Return the inputs that wake it, besides its own grid."""
        return ('events', 'command') if self.connected('command') else ('events',)

    def own_rounds_hz(self) -> float:
        """Return the rate of its decisions."""
        return float(self.settings['decision_rate_hz'])

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the topics; it publishes at most one turn per grid point."""
        turn = self.topic_of('turn')
        return tuple(replace(each, most_hz=self.own_rounds_hz()) if each.topic == turn else each
                     for each in super().publications())

    def listed_inputs(self) -> Mapping[str, Input]:
        """Return an input for the place of each person, and for each button."""
        place = 'geometry_msgs/msg/PoseStamped'
        return {
            **{f'place {name}': Input(f'health/{name}/place', message=place, initial=True,
                                      newest=True)
               for name in self.settings['people']},
            **{f'button {topic}': Input(topic, message=_FLOAT, newest=True)
               for topic in self.settings['answer_topics']}}

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """
        Read the map.

        :raises ConfigError: it cannot be read, or is in another frame.
        """
        self._map = LiveMap(self.settings['map'], self.map if self.connected('map') else None,
                            _ON_MAP['header.frame_id'], self.name, self.log)
        self._around = context_of(self.name, self.settings, self._survey, self._map.grid)
        self._buttons = {topic: self.listed[f'button {topic}']
                         for topic in self.settings['answer_topics']}

    def activate(self) -> None:
        """Start without an emergency; after a failure with those of before."""
        tuning = made(AgentTuning, self.settings)
        self._restarted = self._agent is not None
        self._agent = agent = Agent(tuning, self._around, self._emit, self._period_ns)
        people = {name: self.listed[f'place {name}'] for name in self.settings['people']}
        topics = {name: getattr(self, name) for name in self.used(Input)}
        self._outputs = OutputWriter(
            {name: getattr(self, name) for name in self.used(Output)}, self.name,
            self.settings['name'], self.log, self._gave_goal)
        self._input_reader = InputReader(agent.inputs, topics, people,
                                         tuning.position_stddev_max_m)

    def changed(self, name: str) -> None:
        """Apply a setting."""
        if self._agent is not None:
            tuning = made(AgentTuning, self.settings)
            self._agent.retune(tuning)
            self._input_reader.stddev_max_m = tuning.position_stddev_max_m

    def safe_state(self) -> None:
        """Publish a standstill."""
        self._outputs.publish(Spin(0.0), 0)

    def statistics(self) -> Mapping[str, Any]:
        """Return its state and its counters."""
        agent = self._agent
        if agent is None:
            return {}
        emergencies = agent.emergencies
        return {
            'warning': agent.text if agent.state is AgentState.GIVE_UP else self._map.warning(),
            'state': agent.text, 'emergencies': len(emergencies),
            'events_unreadable': emergencies.unreadable, 'events_lost': self.events.lost,
            'emergencies_dropped': emergencies.dropped, 'events_ignored': agent.ignored,
            'words_refused': agent.refused, 'observed_unreadable': self._unreadable,
            'ticks_late': self._late,
            **self._outputs.statistics(), **self._map.statistics()}

    # ---- work --------------------------------------------------------------------------------

    async def run(self) -> None:
        """Await the next input: a point of the grid, an alarm, a command."""
        agent, period_ns = self._agent, self._period_ns
        if agent is None or self.kernel is None:
            return
        if self._restarted:
            self._remember(agent)
        # For subscribers that come later; the stamp is the same in a replay.
        self._outputs.publish_state(agent.text, self._stamp_ns or self.kernel.start_ns)
        tick_ns = 0
        while True:
            waits: list[Wait] = [self.events.next(), self.command.next()] if (
                self.connected('command')) else [self.events.next()]
            if agent.state is not AgentState.IDLE:
                # The grid point first: in a replay the job begins at the recorded time.
                tick_ns = tick_ns or self._next_point(self._stamp_ns)
                waits.insert(0, Until(tick_ns))
            else:
                tick_ns = 0
            source = await any_of(*waits)
            if source is None:
                self._tick(agent, tick_ns)
                tick_ns += period_ns
                if self.kernel.now_ns() - tick_ns > _MOST_BEHIND * period_ns:
                    self._late += 1
                    tick_ns = self._next_point(self.kernel.now_ns())
            elif source is self.events:
                self._begin_at(source.stamp_ns)
                agent.alarm(str(source.msg.data), self._stamp_ns)
                self._outputs.publish_state(agent.text, self._stamp_ns)
            else:
                self._begin_at(source.stamp_ns)
                self._take_command(agent, str(source.msg.data), source.stamp_ns)
                self._outputs.publish_state(agent.text, self._stamp_ns)

    def _next_point(self, after_ns: int) -> int:
        return (after_ns // self._period_ns + 1) * self._period_ns

    def _begin_at(self, stamp_ns: int) -> None:
        """Set the time of the decisions that follow; it never goes back."""
        now_ns = self.events.topic.kernel.now_ns()
        self._stamp_ns = max(min(stamp_ns, now_ns), self._stamp_ns)
        self._input_reader.poll()

    def _tick(self, agent: Agent, tick_ns: int) -> None:
        self._stamp_ns = max(tick_ns, self._stamp_ns)
        self._input_reader.poll()
        self._take_map()
        self._take_words(agent)
        agent.tick(self._stamp_ns)
        self._outputs.refresh(self._stamp_ns)
        self._outputs.publish_state(agent.text, self._stamp_ns)

    def _take_command(self, agent: Agent, text: str, stamp_ns: int) -> None:
        """Handle a command of an operator; one that moves the robot must not be old."""
        why = ''
        if not text.startswith(_STOPS):
            why = stale_reason(stamp_ns, self.events.topic.kernel.now_ns(), self.settings)
        if why:
            agent.refused += 1
            self.log.warn('command %r refused: %s', text[:_TEXT_BYTES], why, throttle_s=1.0)
        else:
            agent.command(text, self._stamp_ns)

    def _take_map(self) -> None:
        """Read the newest map, if there is one: 2 ms for 1000 x 1000 cells, in pieces."""
        while self._map.is_behind:
            if self._map.advance(_MAP_PIECES):
                self._around.standoff.clearing = clearing_of(self.settings, self._map.grid)

    def _take_words(self, agent: Agent) -> None:
        """Handle answers and observations; an answer counts from its own time."""
        stamp_ns = self._stamp_ns
        if self.connected('answer'):
            while self.answer.unread and self.answer.take():
                agent.answer(str(self.answer.msg.data), self.answer.stamp_ns, stamp_ns)
        for topic, button in self._buttons.items():
            while button.unread and button.take():
                word = BUTTON.get(int(button.msg.data)) if abs(button.msg.data) < 1e6 else None
                if word is not None:
                    agent.answer(f'{self._wearer(topic)} {word}'.strip(), button.stamp_ns,
                                 stamp_ns)
        if self.connected('observed'):
            while self.observed.unread and self.observed.take():
                self._take_observed(agent, str(self.observed.msg.data))

    def _wearer(self, topic: str) -> str:
        """Return the person who wears the node of a button; empty when it is not known."""
        return next((person for end, person in self._wearers.items()
                     if f'/{topic}'.endswith(end)), '')

    def _take_observed(self, agent: Agent, text: str) -> None:
        try:
            found = Observation.from_json(text)
        except ValueError:
            self._unreadable += 1
            return
        if not found.alarm or not found.kind:
            self._unreadable += 1
            return
        text = found.problem
        is_sound = found.kind == ObservationKind.SOUND.value
        if is_sound and not text and math.isfinite(found.level_db):
            text = f'{found.level_db:.0f} dB'
        agent.observed(found.alarm, found.kind, text)

    def _gave_goal(self, pose: Pose) -> None:
        self._input_reader.own_goal = pose

    def _remember(self, agent: Agent) -> None:
        """After a failure: read the events that are still there, and continue."""
        self.events.rewind()
        texts = []
        while self.events.take():
            texts.append(str(self.events.msg.data))
            self._begin_at(self.events.stamp_ns)
        agent.remember(texts, self._stamp_ns)
        self._outputs.publish_state(agent.text, self._stamp_ns)

    def _emit(self, order: AgentOrder | StateTransition) -> None:
        self._outputs.publish(order, self._stamp_ns)
