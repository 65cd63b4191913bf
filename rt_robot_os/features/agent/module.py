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
The agent as a module: a coroutine that awaits alarms, commands and the next point of its grid.

What :mod:`rt_robot_os.features.agent` decides is carried out here. Decisions are stamped with the
event that led to them or with the point of the grid at which they were made, never with the time
at which the job came to run: that is another in a replay.
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

# Commands that stop what it does are never too old.
_STOPS: Final = ('abort', 'stay')
_TEXT: Final = 'std_msgs/msg/String'
_BOOL: Final = 'std_msgs/msg/Bool'
_FLOAT: Final = 'std_msgs/msg/Float64'
_ON_MAP: Final = {'header.frame_id': 'map'}
_SAY_BYTES: Final = 1000
# Enough for what is cut to 200 letters, and an alarm's name, however JSON writes them.
_TEXT_BYTES: Final = 4000
_COMMAND_BYTES: Final = 1000
# A grid that fell so far behind is begun anew: what was missed is over.
_MOST_BEHIND: Final = 20
# Of taking a map: that of 65,000 cells each.
_MAP_PIECES: Final = 20


class AgentModule(Module):
    """Go to whoever needs help: ask, look, tell, stay."""

    events = Input('alarms/events', message=_TEXT)
    command = Input('agent/command', message=_TEXT)
    answer = Input('agent/answer', message=_TEXT)
    observed = Input('agent/observed', message=_TEXT)
    # It looks at these when somebody needs it, and then at what is newest.
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
        """Leave alone what has no topic."""
        return bool(self.topic_of(attribute))

    def awaits(self) -> tuple[str, ...]:
        """Name what it goes on with, besides its own rounds."""
        return ('events', 'command') if self.connected('command') else ('events',)

    def own_rounds_hz(self) -> float:
        """Return the rate of its decisions."""
        return float(self.settings['decision_rate_hz'])

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the topics; it turns once a round at most, whatever wakes it."""
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
        """Begin without an emergency; after a failure with those of before."""
        tuning = made(AgentTuning, self.settings)
        self._restarted = self._agent is not None
        self._agent = agent = Agent(tuning, self._around, self._emit, self._period_ns)
        people = {name: self.listed[f'place {name}'] for name in self.settings['people']}
        topics = {name: getattr(self, name) for name in self.used(Input)}
        self._orders = OutputWriter({name: getattr(self, name) for name in self.used(Output)},
                              self.name, self.settings['name'], self.log, self._gave_goal)
        self._hearing = InputReader(agent.senses, topics, people, tuning.position_stddev_max_m)

    def changed(self, name: str) -> None:
        """Take over a setting."""
        if self._agent is not None:
            tuning = made(AgentTuning, self.settings)
            self._agent.retune(tuning)
            self._hearing.stddev_max_m = tuning.position_stddev_max_m

    def safe_state(self) -> None:
        """Publish a standstill."""
        self._orders.carry_out(Spin(0.0), 0)

    def statistics(self) -> Mapping[str, Any]:
        """Tell what it does, and what it could not use."""
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
            **self._orders.statistics(), **self._map.statistics()}

    # ---- work --------------------------------------------------------------------------------

    async def run(self) -> None:
        """Await what comes first: a point of the grid, an alarm, a command."""
        agent, period_ns = self._agent, self._period_ns
        if agent is None or self.kernel is None:
            return
        if self._restarted:
            self._remember(agent)
        # Whoever comes late hears it; of a moment that is the same in a replay.
        self._orders.tell(agent.text, self._stamp_ns or self.kernel.start_ns)
        tick_ns = 0
        while True:
            waits: list[Wait] = [self.events.next(), self.command.next()] if (
                self.connected('command')) else [self.events.next()]
            if agent.state is not AgentState.IDLE:
                # The point first: in a replay the job begins at the recorded time.
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
                self._orders.tell(agent.text, self._stamp_ns)
            else:
                self._begin_at(source.stamp_ns)
                self._take_command(agent, str(source.msg.data), source.stamp_ns)
                self._orders.tell(agent.text, self._stamp_ns)

    def _next_point(self, after_ns: int) -> int:
        return (after_ns // self._period_ns + 1) * self._period_ns

    def _begin_at(self, stamp_ns: int) -> None:
        """Take a moment as that of the decisions that follow; none lies before the last."""
        now_ns = self.events.topic.kernel.now_ns()
        self._stamp_ns = max(min(stamp_ns, now_ns), self._stamp_ns)
        self._hearing.listen()

    def _tick(self, agent: Agent, tick_ns: int) -> None:
        self._stamp_ns = max(tick_ns, self._stamp_ns)
        self._hearing.listen()
        self._take_map()
        self._take_words(agent)
        agent.tick(self._stamp_ns)
        self._orders.refresh(self._stamp_ns)
        self._orders.tell(agent.text, self._stamp_ns)

    def _take_command(self, agent: Agent, text: str, stamp_ns: int) -> None:
        """Do what an operator says; what sets the robot in motion must not be old."""
        why = ''
        if not text.startswith(_STOPS):
            why = stale_reason(stamp_ns, self.events.topic.kernel.now_ns(), self.settings)
        if why:
            agent.refused += 1
            self.log.warn('command %r refused: %s', text[:_TEXT_BYTES], why, throttle_s=1.0)
        else:
            agent.command(text, self._stamp_ns)

    def _take_map(self) -> None:
        """Take the newest map, if there is a new one: 2 ms for 1000 x 1000 cells, in pieces."""
        while self._map.is_behind:
            if self._map.advance(_MAP_PIECES):
                self._around.beside.clearing = clearing_of(self.settings, self._map.grid)

    def _take_words(self, agent: Agent) -> None:
        """Take what people and the observer say; answers count from when they were given."""
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
        """Return who wears the node of a button; empty when the survey does not say."""
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
        if found.kind == ObservationKind.SOUND.value and not text and math.isfinite(found.level_db):
            text = f'{found.level_db:.0f} dB'
        agent.observed(found.alarm, found.kind, text)

    def _gave_goal(self, pose: Pose) -> None:
        self._hearing.own_goal = pose

    def _remember(self, agent: Agent) -> None:
        """After a failure: take the events that are still kept, and go on with what is open."""
        self.events.rewind()
        texts = []
        while self.events.take():
            texts.append(str(self.events.msg.data))
            self._begin_at(self.events.stamp_ns)
        agent.remember(texts, self._stamp_ns)
        self._orders.tell(agent.text, self._stamp_ns)

    def _emit(self, order: AgentOrder | StateTransition) -> None:
        self._orders.carry_out(order, self._stamp_ns)
