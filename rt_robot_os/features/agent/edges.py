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
The states of the agent, and what leads from one to another: the table that it is driven by.

The drawing in docs/active_agent.md shows the same edges; a test compares the two. Of several edges
from one state for one event the first whose guard holds is taken.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from enum import Enum
from typing import Final
from typing import NamedTuple


class State(Enum):
    """What the agent does; the value is its name in messages."""

    #: Nobody needs it.
    IDLE = 'idle'
    #: It asks somebody whether they are all right, and drives there meanwhile.
    CONFIRM = 'confirm'
    #: It drives there.
    APPROACH = 'approach'
    #: It is there, looks and listens.
    OBSERVE = 'observe'
    #: It tells what it found.
    REPORT = 'report'
    #: It keeps somebody company until help is there.
    STAY = 'stay'
    #: It drives back.
    RETURN = 'return'
    #: It could not get there.
    GIVE_UP = 'give_up'
    #: The e-stop holds it.
    HELD = 'held'
    #: An operator drives.
    OPERATOR = 'operator'
    #: Not a state: what was done before ``held`` or ``operator``, begun anew.
    BEFORE = 'before'


#: A person or an operator has the robot; what the agent did waits.
PAUSES: Final = frozenset((State.HELD, State.OPERATOR))
#: An emergency is being served.
SERVING: Final = (State.CONFIRM, State.APPROACH, State.OBSERVE, State.REPORT, State.STAY,
                  State.GIVE_UP)
#: Something is being done.
BUSY: Final = (*SERVING, State.RETURN)


class Edge(NamedTuple):
    """
    One way from a state to another.

    :ivar source: where it begins.
    :ivar event: what happens; one of :data:`EVENTS`.
    :ivar guard: what must hold besides; one of :data:`GUARDS`, empty for nothing.
    :ivar target: where it ends.
    :ivar action: what is done on the way, besides what each state begins with; empty for nothing.
    """

    source: State
    event: str
    guard: str
    target: State
    action: str = ''


#: What happens, and what it means.
EVENTS: Final = {
    'suspected': 'an emergency that is not sure yet is the most important that is not served',
    'raised': 'an emergency that is sure is the most important that is not served',
    'confirmed': 'the emergency in question has become sure',
    'over': 'the emergency was resolved or cancelled',
    'acknowledged': 'somebody has taken the emergency over',
    'fine': 'the person says that all is well',
    'help': 'the person wants help',
    'silence': 'nobody answered within confirm_s',
    'arrived': 'the robot is beside the place, or at home',
    'blocked': 'there is no way, or none was found in the tries that it has',
    'battery_low': 'the battery is below battery_low',
    'lost_position': 'nobody knows for lost_s where the robot is',
    'no_place': 'nobody knows where the emergency is',
    'moved': 'the person is somewhere else now',
    'observed': 'all that was asked for has come',
    'timeout': 'the time of the state is over',
    'retry': 'it is time to try again',
    'abort': 'an operator says abort',
    'stay': 'an operator says stay',
    'return': 'an operator says return',
    'estop': 'the e-stop is set',
    'operator': 'an operator drives, or has given the robot another goal',
    'released': 'the e-stop is released; the operator has let go',
}

#: What must hold besides an event.
GUARDS: Final = {
    'there': 'the robot is beside the place already',
    'leaves': 'when_acknowledged is return',
    'tries left': 'it has not tried as often as tries says',
    'aborted': 'an operator said abort',
    'driven': 'an operator drives',
    'gives up': 'after_operator is give_up',
}


def _from(sources: Iterable[State], event: str, guard: str, target: State, action: str = ''
          ) -> Iterator[Edge]:
    return (Edge(source, event, guard, target, action) for source in sources)


def _edges() -> Iterator[Edge]:
    state = State
    # The worst first: whoever may stop it does so in each state.
    yield from _from((*BUSY, state.OPERATOR), 'estop', '', state.HELD, 'stop')
    yield from _from(BUSY, 'operator', '', state.OPERATOR, 'stop')
    yield from _from(BUSY, 'abort', '', state.GIVE_UP, 'abort')
    yield from _from(BUSY, 'stay', '', state.STAY, 'settle')
    yield from _from((state.IDLE, *BUSY), 'return', '', state.RETURN, 'leave')
    # Another emergency.
    yield from _from((state.IDLE, *BUSY), 'suspected', '', state.CONFIRM, 'take')
    yield from _from((state.IDLE, *BUSY), 'raised', '', state.APPROACH, 'take')
    # The one that is served.
    yield from _from(SERVING, 'over', '', state.RETURN, 'leave')
    yield from _from(SERVING, 'acknowledged', 'leaves', state.RETURN, 'leave')
    yield Edge(state.CONFIRM, 'fine', '', state.RETURN, 'cancel')
    for event in ('help', 'silence', 'confirmed'):
        action = '' if event == 'confirmed' else 'confirm'
        yield Edge(state.CONFIRM, event, 'there', state.OBSERVE, action)
        yield Edge(state.CONFIRM, event, '', state.APPROACH, action)
    yield Edge(state.APPROACH, 'arrived', '', state.OBSERVE)
    for event in ('blocked', 'battery_low', 'lost_position', 'no_place', 'timeout'):
        yield Edge(state.APPROACH, event, '', state.GIVE_UP)
    yield Edge(state.OBSERVE, 'moved', '', state.APPROACH)
    yield Edge(state.OBSERVE, 'observed', '', state.REPORT)
    yield Edge(state.OBSERVE, 'timeout', '', state.REPORT)
    yield Edge(state.REPORT, 'timeout', '', state.STAY)
    yield Edge(state.STAY, 'timeout', '', state.RETURN, 'leave')
    yield Edge(state.STAY, 'battery_low', '', state.RETURN, 'leave')
    yield Edge(state.GIVE_UP, 'retry', 'tries left', state.APPROACH, 'try')
    yield Edge(state.GIVE_UP, 'timeout', 'aborted', state.IDLE, 'leave')
    yield Edge(state.GIVE_UP, 'timeout', '', state.RETURN, 'leave')
    for event in ('arrived', 'blocked', 'lost_position', 'no_place', 'timeout'):
        yield Edge(state.RETURN, event, '', state.IDLE)
    # Whoever had the robot gives it back.
    yield Edge(state.HELD, 'released', 'driven', state.OPERATOR)
    yield Edge(state.HELD, 'released', '', state.BEFORE)
    yield Edge(state.OPERATOR, 'released', 'gives up', state.GIVE_UP, 'abort')
    yield Edge(state.OPERATOR, 'released', '', state.BEFORE)


#: The table, in the order in which edges are looked at.
EDGES: Final = tuple(_edges())
