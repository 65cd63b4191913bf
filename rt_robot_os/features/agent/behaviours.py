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

"""The behaviour of each state: how it begins, what it does at each tick, when it ends."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.agent.dialogue import Dialogue
from rt_robot_os.features.agent.emergencies import Emergency
from rt_robot_os.features.agent.inputs import AddNote
from rt_robot_os.features.agent.inputs import AgentOrder
from rt_robot_os.features.agent.inputs import Location
from rt_robot_os.features.agent.inputs import Observe
from rt_robot_os.features.agent.inputs import ReportBlocked
from rt_robot_os.features.agent.robot_interface import RobotInterface
from rt_robot_os.features.agent.tuning import AgentTuning
from rt_robot_os.messages.agent import AgentState
from rt_robot_os.messages.agent import OBSERVATION_KINDS
from rt_robot_os.messages.fields import clean
from rt_robot_os.motion.differential import Pose

BehaviourEvent = tuple[str, str]

_NEVER: Final = -1


class Behaviours:
    """
    The behaviours of all states, for one emergency at a time; safe in the real-time loop.

    :param emit: receives each order.
    :param where: returns the location of an emergency; None when it is not known.
    :param orders: what is recorded: ``picture``, ``clip``, ``sound``.
    :param home: where it returns to; None: to where it came from.
    :ivar emergency: the one that is served; None without.
    :ivar others_wait: another emergency waits to be served.
    :ivar is_aborted: an operator has aborted it.
    :ivar stays_put: an operator has ordered it to stay where it is.
    :ivar origin: where the robot was when it set out.
    """

    def __init__(self, tuning: AgentTuning, robot: RobotInterface, dialogue: Dialogue,
                 emit: Callable[[AgentOrder], None], where: Callable[[Emergency], Location | None],
                 orders: Sequence[str], home: Pose | None) -> None:
        self.tuning = tuning
        self.robot = robot
        self.dialogue = dialogue
        self.emergency: Emergency | None = None
        self.others_wait = self.is_aborted = self.stays_put = False
        self.origin: Pose | None = None
        self.tries = 0
        self._emit = emit
        self._where = where
        self._orders = tuple(orders)
        self._home = home
        self._since_ns = self._deadline_ns = self._ordered_ns = self._speak_ns = _NEVER
        self._found: dict[str, str] = {}
        self._is_told = False
        self._begin: Mapping[AgentState, Callable[[int, str], None]] = {
            AgentState.IDLE: self._begin_idle, AgentState.CONFIRM: self._begin_confirm,
            AgentState.APPROACH: self._begin_approach, AgentState.OBSERVE: self._begin_observe,
            AgentState.REPORT: self._begin_report, AgentState.STAY: self._begin_stay,
            AgentState.RETURN: self._begin_return, AgentState.GIVE_UP: self._begin_give_up}
        self._tick: Mapping[AgentState, Callable[[int], BehaviourEvent | None]] = {
            AgentState.CONFIRM: self._tick_confirm, AgentState.APPROACH: self._tick_approach,
            AgentState.OBSERVE: self._tick_observe, AgentState.REPORT: self._tick_report,
            AgentState.STAY: self._tick_stay, AgentState.RETURN: self._tick_return,
            AgentState.GIVE_UP: self._tick_give_up}

    # ---- for the agent --------------------------------------------------------------------

    def place(self) -> Location | None:
        """Return where the emergency is."""
        return self._where(self.emergency) if self.emergency is not None else None

    def is_there(self) -> bool:
        """Return whether the robot is beside the place."""
        return self.robot.drive.arrived

    def observed(self, alarm: str, kind: str, text: str) -> None:
        """Store the result of an observation."""
        if self.emergency is not None and self.emergency.alarm == alarm and kind in self._orders:
            self._found[kind] = clean(text[:80])

    def begin(self, state: AgentState, t_ns: int, why: str) -> None:
        """Begin the behaviour of a state; a pause has none."""
        self._since_ns, self._deadline_ns = t_ns, _NEVER
        begin = self._begin.get(state)
        if begin is not None:
            begin(t_ns, why)

    def tick(self, state: AgentState, t_ns: int) -> BehaviourEvent | None:
        """Continue; return an event and its reason, if there is one."""
        tick = self._tick.get(state)
        found = tick(t_ns) if tick is not None else None
        if found is None and 0 <= self._deadline_ns <= t_ns:
            self._deadline_ns = _NEVER
            seconds = (t_ns - self._since_ns) / NS_PER_S
            event = 'silence' if state is AgentState.CONFIRM else 'timeout'
            return event, f'after {seconds:.0f} s'
        return found

    # ---- asking and driving -----------------------------------------------------------------

    def _begin_idle(self, t_ns: int, why: str) -> None:
        self.robot.forget()
        self.robot.limit(None)
        self._clear()
        self.origin = self.emergency = None

    def _begin_confirm(self, t_ns: int, why: str) -> None:
        self._set_out(t_ns)
        self._until(t_ns, self.tuning.confirm_s)
        self.dialogue.begin(self._person(), t_ns)

    def _tick_confirm(self, t_ns: int) -> BehaviourEvent | None:
        self.dialogue.tick(self.robot.inputs.voice, t_ns)
        place = self.place()
        if place is not None and not self.robot.is_battery_low():
            self.robot.go_beside(place, t_ns)
        return None

    def _begin_approach(self, t_ns: int, why: str) -> None:
        drive = self.robot.drive
        self.stays_put = False
        if not drive.is_under_way:
            self._set_out(t_ns)
            self.dialogue.speak(self.tuning.coming, t_ns, self._person())
        self._until(t_ns, self.tuning.approach_s)

    def _set_out(self, t_ns: int) -> None:
        """Start to move immediately; longer computations follow at the next tick."""
        place = self.place()
        if place is None:
            self.robot.halt()
        else:
            self.robot.forget()
        self.robot.face(place, t_ns)

    def _tick_approach(self, t_ns: int) -> BehaviourEvent | None:
        robot, place = self.robot, self.place()
        if robot.is_battery_low():
            return 'battery_low', f'{100 * robot.inputs.battery:.0f} %'
        if robot.is_lost(self._since_ns, t_ns):
            return 'lost_position', f'no good pose for {self.tuning.lost_s:g} s'
        if robot.drive.arrived:
            return 'arrived', ''
        if robot.drive.problem:
            return 'blocked', robot.drive.problem
        if place is not None:
            robot.go_beside(place, t_ns)
        elif t_ns - self._since_ns >= round(self.tuning.place_s * NS_PER_S):
            return 'no_place', 'nobody knows where it is'
        return None

    # ---- being there ------------------------------------------------------------------------

    def _begin_observe(self, t_ns: int, why: str) -> None:
        self.robot.face(self.place(), t_ns)
        self._clear()
        self._found.clear()
        self._ordered_ns = _NEVER

    def _tick_observe(self, t_ns: int) -> BehaviourEvent | None:
        place, t = self.place(), self.tuning
        if place is not None and self.robot.has_moved_away(place):
            return 'moved', f'to {place.x:.1f}, {place.y:.1f}'
        if self._ordered_ns < 0:
            if self.robot.is_aligned or t_ns - self._since_ns >= round(t.look_s * NS_PER_S):
                self._ordered_ns = t_ns
                self._until(t_ns, t.observe_s)
                self._order()
        elif len(self._found) == len(self._orders):
            return 'observed', ', '.join(self._found)
        return None

    def _order(self) -> None:
        emergency = self.emergency
        if emergency is not None:
            for order in self._orders:
                self._emit(Observe(OBSERVATION_KINDS[order], emergency.alarm, emergency.subject))

    def _begin_report(self, t_ns: int, why: str) -> None:
        self._until(t_ns, self.tuning.report_s)
        if self.emergency is not None:
            self._emit(AddNote(self.emergency.alarm, self._finding()))
        self.dialogue.speak(self.tuning.comfort, t_ns, self._person())

    def _tick_report(self, t_ns: int) -> BehaviourEvent | None:
        return None

    def _finding(self) -> str:
        """Return the findings in words."""
        pose, place = self.robot.inputs.pose, self.place()
        parts = ['robot is there']
        if pose is not None and place is not None:
            away_m = math.dist(pose[:2], place.point)
            parts = [f'robot is {away_m:.1f} m from {self._person() or "the place"}']
        for kind in self._orders:
            text = self._found.get(kind)
            parts.append(f'no {kind}' if text is None else f'{kind}: {text}' if text else kind)
        if self.dialogue.voices:
            parts.append(f'heard something {self.dialogue.voices} times')
        return ', '.join(parts)

    def _begin_stay(self, t_ns: int, why: str) -> None:
        self._until(t_ns, self.tuning.stay_s)
        self._speak_ns = t_ns + round(self.tuning.comfort_s * NS_PER_S)

    def _tick_stay(self, t_ns: int) -> BehaviourEvent | None:
        t, emergency, place = self.tuning, self.emergency, self.place()
        if self.robot.is_battery_low():
            return 'battery_low', f'{100 * self.robot.inputs.battery:.0f} %'
        if place is not None and self.stays_put:
            self.robot.look_at(place, t_ns)
        elif place is not None:
            self.robot.stay_beside(place, t_ns)
        if t_ns >= self._speak_ns and emergency is not None:
            self._speak_ns = t_ns + round(t.comfort_s * NS_PER_S)
            self.dialogue.speak(t.comfort, t_ns, self._person())
        if self.others_wait and t_ns - self._since_ns >= round(t.company_s * NS_PER_S):
            return 'timeout', 'another emergency waits'
        return None

    # ---- leaving ----------------------------------------------------------------------------

    def _begin_return(self, t_ns: int, why: str) -> None:
        self.robot.halt()
        self._clear()
        self._until(t_ns, self.tuning.return_s)
        target = self._home or self.origin
        if target is not None:
            self.robot.go_to(target, t_ns)

    def _tick_return(self, t_ns: int) -> BehaviourEvent | None:
        drive = self.robot.drive
        if drive.arrived:
            return 'arrived', ''
        if drive.problem:
            return 'blocked', drive.problem
        if (self._home or self.origin) is None:
            return 'no_place', 'it never knew where it was, and home is not set'
        if self.robot.is_lost(self._since_ns, t_ns):
            return 'lost_position', f'no good pose for {self.tuning.lost_s:g} s'
        return None

    def _begin_give_up(self, t_ns: int, why: str) -> None:
        t, emergency = self.tuning, self.emergency
        self.robot.halt()
        wait_s = t.retry_s if self.may_retry() else t.give_up_s
        self._until(t_ns, wait_s)
        if emergency is not None:
            whom = emergency.subject or 'the place'
            self._tell(f'robot could not reach {whom}: {why}')
            self._emit(AddNote(emergency.alarm, f'robot could not reach {whom}: {why}'))
            self.dialogue.speak(t.unreachable, t_ns, self._person())

    def _tick_give_up(self, t_ns: int) -> BehaviourEvent | None:
        if self.may_retry() and 0 <= self._deadline_ns <= t_ns and not self.robot.is_battery_low():
            self._deadline_ns = _NEVER
            return 'retry', f'{self.tries + 1} of {self.tuning.retries}'
        return None

    def may_retry(self) -> bool:
        """Return whether it has an emergency and tries left."""
        return (not self.is_aborted and self.emergency is not None
                and self.tries < self.tuning.retries)

    def _tell(self, text: str) -> None:
        self._is_told = True
        self._emit(ReportBlocked(True, text))

    def _clear(self) -> None:
        if self._is_told:
            self._is_told = False
            self._emit(ReportBlocked(False))

    # ---- helpers ----------------------------------------------------------------------------

    def _until(self, t_ns: int, seconds: float) -> None:
        self._deadline_ns = t_ns + round(seconds * NS_PER_S)

    def _person(self) -> str:
        return self.emergency.subject if self.emergency is not None else ''
