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
The agent: inputs become events, and the table of edges decides what follows.

It uses no kernel and no topics. The module updates
:class:`~rt_robot_os.features.agent.inputs.AgentInputs`, passes in events of alarms, answers and
commands, calls :meth:`Agent.tick` on a grid of times, and publishes the orders. All times are
handed in, so that the same input gives the same transitions at the same times.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.features.agent.behaviours import Behaviours
from rt_robot_os.features.agent.dialogue import answer_of
from rt_robot_os.features.agent.dialogue import Dialogue
from rt_robot_os.features.agent.edges import PAUSES
from rt_robot_os.features.agent.edges import SERVING
from rt_robot_os.features.agent.emergencies import Emergency
from rt_robot_os.features.agent.emergencies import EmergencyQueue
from rt_robot_os.features.agent.inputs import AgentInputs
from rt_robot_os.features.agent.inputs import AgentOrder
from rt_robot_os.features.agent.inputs import Location
from rt_robot_os.features.agent.inputs import SendAlarmCommand
from rt_robot_os.features.agent.machine import StateMachine
from rt_robot_os.features.agent.machine import StateTransition
from rt_robot_os.features.agent.operator import OperatorWatch
from rt_robot_os.features.agent.robot_interface import RobotInterface
from rt_robot_os.features.agent.standoff import StandoffPlanner
from rt_robot_os.features.agent.tuning import AgentTuning
from rt_robot_os.features.agent.tuning import GIVES_UP
from rt_robot_os.features.agent.tuning import LEAVES
from rt_robot_os.messages.agent import AgentState
from rt_robot_os.messages.alarm_state import AlarmState
from rt_robot_os.messages.cause import LEVELS
from rt_robot_os.motion.differential import Pose

_ORDERS: Final = ('abort', 'stay', 'return')


@dataclass(frozen=True)
class AgentContext:
    """
    What the agent knows from its settings.

    :ivar standoff: chooses the poses next to a person.
    :ivar nodes: locations of the sensor nodes, by name.
    :ivar wearers: the persons who wear nodes, by the name of the node.
    :ivar home: where the robot returns to; None: to where it came from.
    :ivar operators: sources of the multiplexer that are people.
    :ivar orders: what is recorded: ``picture``, ``clip``, ``sound``.
    :ivar ignored: kinds of causes that are not an emergency by themselves.
    :ivar name: of the robot, in its commands about alarms.
    """

    standoff: StandoffPlanner
    nodes: Mapping[str, Location]
    wearers: Mapping[str, str]
    home: Pose | None = None
    operators: tuple[str, ...] = ('teleop',)
    orders: tuple[str, ...] = ('picture', 'clip', 'sound')
    ignored: tuple[str, ...] = ('test',)
    name: str = 'robot'


class Agent:
    """
    The agent; safe in the real-time loop.

    :param emit: receives each order and each transition, in order.
    :param period_ns: of the grid on which :meth:`tick` is called.
    :ivar inputs: what it knows of robot and people; the module updates it.
    :ivar emergencies: the open emergencies.
    :ivar refused: commands and answers that were not valid.
    """

    def __init__(self, tuning: AgentTuning, around: AgentContext,
                 emit: Callable[[AgentOrder | StateTransition], None], period_ns: int) -> None:
        self.tuning = tuning
        self.inputs = AgentInputs()
        self.emergencies = EmergencyQueue(LEVELS[tuning.least_level], around.ignored)
        self.refused = 0
        self._around = around
        self._emit = emit
        self._why = ''
        self._chosen: Emergency | None = None
        self._machine = StateMachine({
            'there': lambda: self._behaviours.is_there(),
            'leaves': lambda: self.tuning.when_acknowledged == LEAVES,
            'tries left': lambda: self._behaviours.may_retry(),
            'aborted': lambda: self._behaviours.is_aborted,
            'driven': lambda: self._is_driven,
            'gives up': lambda: self.tuning.after_operator == GIVES_UP})
        self._is_driven = False
        self._operator = OperatorWatch(around.operators, tuning)
        self._dialogue = Dialogue(tuning, emit)
        self._robot = RobotInterface(tuning, around.standoff, self.inputs, emit, period_ns)
        self._behaviours = Behaviours(tuning, self._robot, self._dialogue, emit, self._where,
                                      around.orders, around.home)
        self._actions: Mapping[str, Callable[[int], None]] = {
            'take': self._take, 'leave': self._leave, 'cancel': self._cancel,
            'confirm': self._confirm, 'abort': self._abort, 'stop': self._stop,
            'settle': self._settle, 'try': self._try}

    def retune(self, tuning: AgentTuning) -> None:
        """Apply settings while it runs."""
        self.tuning = self._dialogue.tuning = self._behaviours.tuning = tuning
        self._operator.tuning = tuning
        self._robot.configure(tuning)

    # ---- state ----------------------------------------------------------------------------

    @property
    def state(self) -> AgentState:
        """Return its state."""
        return self._machine.state

    @property
    def text(self) -> str:
        """Return its state for people; the first word is the state."""
        emergency, state = self._behaviours.emergency, self.state
        if emergency is None or state is AgentState.IDLE:
            return state.value
        why = f': {self._why}' if self._why and state in (AgentState.GIVE_UP, *PAUSES) else ''
        what = emergency.what(self._around.wearers)
        return f'{state.value} {emergency.subject or "?"}: {what}{why}'

    @property
    def ignored(self) -> int:
        """Return the number of events without an edge."""
        return self._machine.ignored

    # ---- inputs -----------------------------------------------------------------------------

    def alarm(self, text: str, t_ns: int) -> None:
        """Handle an event of an alarm, the JSON of ``alarms/events``."""
        found = self.emergencies.update(text, t_ns)
        if found is None:
            return
        alarm, meaning = found
        served = self._behaviours.emergency
        if served is not None and served.alarm == alarm and meaning in (
                'over', 'acknowledged', 'confirmed'):
            self._fire(meaning, f'alarm {alarm}', t_ns)
        self._update_holder(t_ns)
        self._choose(t_ns)
        self._check_holder(t_ns)

    def remember(self, texts: list[str], t_ns: int) -> None:
        """Handle the events of before a restart, then serve the most important emergency."""
        for text in texts:
            self.emergencies.update(text, t_ns)
        self._choose(t_ns)
        self._check_holder(t_ns)

    def answer(self, text: str, stamp_ns: int, t_ns: int) -> None:
        """Handle the answer of a person: ``anna fine``, ``anna help``."""
        found, served = answer_of(text), self._behaviours.emergency
        if found is None or served is None or self._working is not AgentState.CONFIRM or (
                found[0] not in ('', served.subject)) or not self._dialogue.counts(stamp_ns):
            self.refused += 1
            return
        self._fire(found[1], f'{served.subject or "somebody"} says so', t_ns)
        self._choose(t_ns)

    def command(self, text: str, t_ns: int) -> None:
        """Handle a command of an operator: ``abort``, ``stay``, ``return``, ``go ALARM``."""
        words = text.split()
        if words and words[0] in _ORDERS and len(words) == 1:
            self._fire(words[0], 'an operator says so', t_ns)
        elif len(words) == 2 and words[0] == 'go' and self.emergencies.prefer(words[1]):
            self._choose(t_ns)
        else:
            self.refused += 1

    def observed(self, alarm: str, kind: str, text: str) -> None:
        """Handle the result of an observation."""
        self._behaviours.observed(alarm, kind, text)

    def tick(self, t_ns: int) -> None:
        """Continue at a point of the grid."""
        if self.state is AgentState.IDLE:
            return
        self._check_holder(t_ns)
        if self.state not in PAUSES:
            self._robot.tick(t_ns)
            best = self.emergencies.best(self._behaviours.emergency)
            self._behaviours.others_wait = best is not None
            happened = self._behaviours.tick(self.state, t_ns)
            if happened is not None:
                self._fire(*happened, t_ns)
            self._choose(t_ns)
            if self.state in SERVING:
                self._robot.limit(self._behaviours.place())
        self.inputs.planner_new = self.inputs.other_goal = False

    # ---- events -----------------------------------------------------------------------------

    @property
    def _working(self) -> AgentState:
        """Return its state, or the one that the pause ends in."""
        return self._machine.before if self.state in PAUSES else self.state

    def _choose(self, t_ns: int) -> None:
        """Serve the most important emergency, if it is another one and may be served now."""
        served, working = self._behaviours.emergency, self._working
        best = self.emergencies.best(served)
        if best is None:
            return
        # An emergency is left for a worse one only, unless help has failed or has ended.
        is_serving = working in SERVING and working is not AgentState.GIVE_UP
        if served is not None and is_serving and not (
                best.first or best.level > served.level and not served.first
                or working is AgentState.STAY and served.state is AlarmState.ACKNOWLEDGED):
            return
        self._chosen = best
        name = best.subject or best.alarm
        self._fire('suspected' if best.state is AlarmState.SUSPECTED else 'raised',
                   f'{name}: {best.what(self._around.wearers)}', t_ns)

    def _update_holder(self, t_ns: int) -> bool:
        """Return whether the e-stop holds the robot; update whether an operator drives."""
        if self.state is AgentState.IDLE:
            self._operator.forget()
            self.inputs.other_goal = False  # an emergency comes first
        held = self._operator.is_held(self.inputs)
        if self.inputs.other_goal:
            self._robot.drive.stop()
            self._robot.drive.is_open = False  # cancelling now would cancel the other goal
        self._is_driven = self._operator.drives(self.inputs, t_ns)
        self._robot.is_free = not held and not self._is_driven
        return held

    def _check_holder(self, t_ns: int) -> None:
        """Fire an event when the e-stop or an operator has taken or released the robot."""
        if self.state is AgentState.IDLE:
            return
        held = self._update_holder(t_ns)
        if held and self.state is not AgentState.HELD:
            self._fire('estop', self._operator.why_held(self.inputs), t_ns)
        elif self._is_driven and self.state not in PAUSES:
            self._fire('operator', self._operator.why_driven(self.inputs), t_ns)
        elif self.state is AgentState.HELD and not held:
            self._fire('released', 'nobody holds the e-stop any more', t_ns)
        elif self.state is AgentState.OPERATOR and not self._is_driven:
            self._fire('released', 'the operator has let go', t_ns)

    def _fire(self, event: str, why: str, t_ns: int) -> None:
        """Apply an event."""
        found = self._machine.find(event)
        if found is None:
            return
        edge, target = found
        served = self._behaviours.emergency
        self._why = f'{event}: {why}' if why else event
        if edge.action:
            self._actions[edge.action](t_ns)
        source = self.state
        changes = self._machine.go(edge, target)
        served = self._behaviours.emergency or served
        alarm = served.alarm if served is not None else ''
        if changes:
            self._behaviours.begin(target, t_ns, self._why)
        else:
            why = f'{why}; {target.value} afterwards'
        self._emit(StateTransition(edge, source, self.state, why, alarm, t_ns))

    # ---- actions of edges -------------------------------------------------------------------

    def _take(self, t_ns: int) -> None:
        work = self._behaviours
        if self.state is AgentState.IDLE:
            work.origin = self.inputs.pose
        if self._working is AgentState.GIVE_UP and work.emergency is not None:
            work.emergency.is_done = True
        work.emergency, work.tries = self._chosen, 0
        work.is_aborted = work.stays_put = False
        self._robot.forget()

    def _leave(self, t_ns: int) -> None:
        if self._behaviours.emergency is not None:
            self._behaviours.emergency.is_done = True
        self._behaviours.emergency = None

    def _cancel(self, t_ns: int) -> None:
        served = self._behaviours.emergency
        if served is not None:
            by = served.subject or self._around.name
            self._emit(SendAlarmCommand(f'cancel {served.alarm} by {by}'))
            self._dialogue.speak(self.tuning.fine, t_ns)
        self._leave(t_ns)

    def _confirm(self, t_ns: int) -> None:
        served = self._behaviours.emergency
        if served is not None:
            self._emit(SendAlarmCommand(
                f'confirm {served.alarm} by {self._around.name} {self._why}'))

    def _abort(self, t_ns: int) -> None:
        self._behaviours.is_aborted = True

    def _stop(self, t_ns: int) -> None:
        self._robot.halt()

    def _settle(self, t_ns: int) -> None:
        self._robot.halt()
        self._behaviours.stays_put = True

    def _try(self, t_ns: int) -> None:
        self._behaviours.tries += 1

    # ---- places -----------------------------------------------------------------------------

    def _where(self, emergency: Emergency) -> Location | None:
        """Return where an emergency is: the person, the position of the cause, or the node."""
        around, people = self._around, self.inputs.people
        person = people.get(emergency.subject) or people.get(
            around.wearers.get(emergency.node, ''))
        if person is not None:
            return person
        if math.isfinite(emergency.x) and math.isfinite(emergency.y):
            return Location(emergency.x, emergency.y, 'cause')
        return around.nodes.get(emergency.node)
