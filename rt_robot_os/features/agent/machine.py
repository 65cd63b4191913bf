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

"""The state machine that follows the table of edges."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.agent.edges import EDGES
from rt_robot_os.features.agent.edges import PAUSES
from rt_robot_os.features.agent.edges import StateEdge
from rt_robot_os.messages.agent import AgentState
from rt_robot_os.messages.agent import AgentTransition

_CAUSE_CHARACTERS: Final = 200

Guard = Callable[[], bool]


class StateTransition(NamedTuple):
    """
    A change of state that was made.

    :ivar edge: of the table.
    :ivar source: the state that it led from; in a pause that is not the one of the edge.
    :ivar target: the state that it led to.
    :ivar why: what happened, for people.
    :ivar alarm: the alarm that is served; empty without.
    :ivar t_ns: when, by the samples and deadlines that led to it.
    """

    edge: StateEdge
    source: AgentState
    target: AgentState
    why: str
    alarm: str
    t_ns: int

    def message(self) -> AgentTransition:
        """Return it as it is published."""
        cause = f'{self.edge.event}: {self.why}'[:_CAUSE_CHARACTERS] if self.why else (
            self.edge.event)
        return AgentTransition(self.source, self.target, cause, self.alarm, self.t_ns)


class StateMachine:
    """
    A state, and the edges from it; safe in the real-time loop.

    :param guards: functions, by the names that the table uses.
    :ivar state: now.
    :ivar before: the state that is resumed after ``held`` or ``operator``. Events meanwhile change
        it, as far as they need no robot.
    :ivar ignored: events that the state has no edge for.
    """

    def __init__(self, guards: Mapping[str, Guard]) -> None:
        self._guards = guards
        self.state = AgentState.IDLE
        self.before = AgentState.IDLE
        self.ignored = 0
        self._by_key: dict[tuple[AgentState, str], tuple[StateEdge, ...]] = {}
        for edge in EDGES:
            key = edge.source, edge.event
            self._by_key[key] = (*self._by_key.get(key, ()), edge)

    def find(self, event: str) -> tuple[StateEdge, AgentState] | None:
        """
        Return the edge of an event now, and the state at its end; None without one.

        In a pause it is an edge from the state that will be resumed, if the pause has none.
        """
        found = self._edge(self.state, event)
        if found is None and self.state in PAUSES and self.before not in PAUSES:
            found = self._edge(self.before, event)
        if found is None:
            self.ignored += 1
            return None
        return found, self.before if found.target is None else found.target

    def go(self, edge: StateEdge, target: AgentState) -> bool:
        """
        Follow an edge that was found.

        :return: whether the state has changed or restarts; in a pause only the resumed state
            changes.
        """
        if self.state in PAUSES and edge.source is not self.state:
            if target not in PAUSES:
                self.before = target
            return False
        if target in PAUSES and edge.source not in PAUSES:
            self.before = edge.source
        self.state = target
        return True

    def _edge(self, state: AgentState, event: str) -> StateEdge | None:
        for edge in self._by_key.get((state, event), ()):
            if not edge.guard or self._guards[edge.guard]():
                return edge
        return None
