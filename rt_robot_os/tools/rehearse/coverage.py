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

"""Coverage of the agent's state table: the edges taken, from its published transitions."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.features.agent.edges import BEFORE
from rt_robot_os.features.agent.edges import EDGES
from rt_robot_os.features.agent.edges import PAUSES
from rt_robot_os.features.agent.edges import StateEdge
from rt_robot_os.messages.agent import AgentState

_BY_ENDS: Final[Mapping[tuple[str, str, str], StateEdge]] = {
    (edge.source.value, edge.event, edge.target_name): edge for edge in EDGES}


def edges_taken(transitions: Iterable[Mapping[str, Any]]) -> Iterator[StateEdge]:
    """
    Yield the edge of each transition, in order.

    A transition that was delayed by a pause, and has no edge of its own, is skipped.

    :param transitions: as the agent published them.
    """
    before = AgentState.IDLE.value
    for each in transitions:
        source, target = str(each['from']), str(each['to'])
        event = str(each['cause']).partition(':')[0]
        key = source, event, target
        if event == 'released' and target == before:
            key = source, event, BEFORE
        if AgentState(source) not in PAUSES:
            before = source
        edge = _BY_ENDS.get(key) or _BY_ENDS.get((source, event, BEFORE))
        if edge is not None:
            yield edge


def name_of(edge: StateEdge) -> str:
    """Return an edge as in the diagram: ``confirm --> observe: help [there] / confirm``."""
    guard = f' [{edge.guard}]' if edge.guard else ''
    action = f' / {edge.action}' if edge.action else ''
    return f'{edge.source.value} --> {edge.target_name}: {edge.event}{guard}{action}'
