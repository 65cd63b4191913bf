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
The table of edges between the states of the agent, which decides what it does.

The drawing in docs/active_agent.md shows the same edges; a test compares the two. Of several edges
from one state for one event the first one whose guard holds applies.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from typing import Final
from typing import NamedTuple

from rt_robot_os.messages.agent import AgentState

#: The name of the state before a pause, where the drawing has an edge back to it.
BEFORE: Final = 'before'
#: The emergency stop or an operator holds the robot; the behaviour waits.
PAUSES: Final = frozenset((AgentState.HELD, AgentState.OPERATOR))
#: An emergency is being served.
SERVING: Final = (AgentState.CONFIRM, AgentState.APPROACH, AgentState.OBSERVE,
                  AgentState.REPORT, AgentState.STAY, AgentState.GIVE_UP)
#: Something is being done.
BUSY: Final = (*SERVING, AgentState.RETURN)


class StateEdge(NamedTuple):
    """
    An edge from a state to another.

    :ivar source: where it begins.
    :ivar event: what happens; one of :data:`EVENTS`.
    :ivar guard: a condition; one of :data:`GUARDS`, empty for none.
    :ivar target: where it ends; None: the state before the pause.
    :ivar action: what is done in addition to the start of the state; empty for nothing.
    """

    source: AgentState
    event: str
    guard: str
    target: AgentState | None
    action: str = ''

    @property
    def target_name(self) -> str:
        """Return the target as the drawing names it."""
        return BEFORE if self.target is None else self.target.value


#: The events, and what they mean.
EVENTS: Final = {
    'suspected': 'a suspected emergency is the most important one that is not served',
    'raised': 'a raised emergency is the most important one that is not served',
    'confirmed': 'the emergency that is served was confirmed',
    'over': 'the emergency was resolved or cancelled',
    'acknowledged': 'a person has acknowledged the emergency',
    'fine': 'the person says that all is well',
    'help': 'the person wants help',
    'silence': 'there was no answer within confirm_s',
    'arrived': 'the robot has reached the person, or home',
    'blocked': 'there is no path, or none was found within the allowed tries',
    'battery_low': 'the battery is below battery_low',
    'lost_position': 'the position of the robot has been unknown for lost_s',
    'no_place': 'the location of the emergency is not known',
    'moved': 'the person has moved',
    'observed': 'all requested observations have arrived',
    'timeout': 'the time limit of the state has passed',
    'retry': 'another try is due',
    'abort': 'an operator has sent abort',
    'stay': 'an operator has sent stay',
    'return': 'an operator has sent return',
    'estop': 'the e-stop is set',
    'operator': 'an operator drives, or has given the robot another goal',
    'released': 'the e-stop is released, or the operator has stopped driving',
}

#: The guards, and what they mean.
GUARDS: Final = {
    'there': 'the robot has reached the person already',
    'leaves': 'when_acknowledged is return',
    'tries left': 'there are tries left (retries)',
    'aborted': 'an operator has sent abort',
    'driven': 'an operator drives',
    'gives up': 'after_operator is give_up',
}


def _from(sources: Iterable[AgentState], event: str, guard: str, target: AgentState,
          action: str = '') -> Iterator[StateEdge]:
    return (StateEdge(source, event, guard, target, action) for source in sources)


def _edges() -> Iterator[StateEdge]:
    state = AgentState
    # E-stop, operator and their commands first: they apply in each state.
    yield from _from((*BUSY, state.OPERATOR), 'estop', '', state.HELD, 'stop')
    yield from _from(BUSY, 'operator', '', state.OPERATOR, 'stop')
    yield from _from(BUSY, 'abort', '', state.GIVE_UP, 'abort')
    yield from _from(BUSY, 'stay', '', state.STAY, 'settle')
    yield from _from((state.IDLE, *BUSY), 'return', '', state.RETURN, 'leave')
    # Another emergency.
    yield from _from((state.IDLE, *BUSY), 'suspected', '', state.CONFIRM, 'take')
    yield from _from((state.IDLE, *BUSY), 'raised', '', state.APPROACH, 'take')
    # The emergency that is served.
    yield from _from(SERVING, 'over', '', state.RETURN, 'leave')
    yield from _from(SERVING, 'acknowledged', 'leaves', state.RETURN, 'leave')
    yield StateEdge(state.CONFIRM, 'fine', '', state.RETURN, 'cancel')
    for event in ('help', 'silence', 'confirmed'):
        action = '' if event == 'confirmed' else 'confirm'
        yield StateEdge(state.CONFIRM, event, 'there', state.OBSERVE, action)
        yield StateEdge(state.CONFIRM, event, '', state.APPROACH, action)
    yield StateEdge(state.APPROACH, 'arrived', '', state.OBSERVE)
    for event in ('blocked', 'battery_low', 'lost_position', 'no_place', 'timeout'):
        yield StateEdge(state.APPROACH, event, '', state.GIVE_UP)
    yield StateEdge(state.OBSERVE, 'moved', '', state.APPROACH)
    yield StateEdge(state.OBSERVE, 'observed', '', state.REPORT)
    yield StateEdge(state.OBSERVE, 'timeout', '', state.REPORT)
    yield StateEdge(state.REPORT, 'timeout', '', state.STAY)
    yield StateEdge(state.STAY, 'timeout', '', state.RETURN, 'leave')
    yield StateEdge(state.STAY, 'battery_low', '', state.RETURN, 'leave')
    yield StateEdge(state.GIVE_UP, 'retry', 'tries left', state.APPROACH, 'try')
    yield StateEdge(state.GIVE_UP, 'timeout', 'aborted', state.IDLE, 'leave')
    yield StateEdge(state.GIVE_UP, 'timeout', '', state.RETURN, 'leave')
    for event in ('arrived', 'blocked', 'lost_position', 'no_place', 'timeout'):
        yield StateEdge(state.RETURN, event, '', state.IDLE)
    # The e-stop or the operator releases the robot.
    yield StateEdge(state.HELD, 'released', 'driven', state.OPERATOR)
    yield StateEdge(state.HELD, 'released', '', None)
    yield StateEdge(state.OPERATOR, 'released', 'gives up', state.GIVE_UP, 'abort')
    yield StateEdge(state.OPERATOR, 'released', '', None)


#: The table, in the order in which edges are tried.
EDGES: Final = tuple(_edges())
