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

"""The drawing of the agent's states in the docs and the table that drives the code are one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re

from rt_robot_os.features.agent.edges import BEFORE
from rt_robot_os.features.agent.edges import EDGES
from rt_robot_os.features.agent.edges import EVENTS
from rt_robot_os.features.agent.edges import GUARDS
from rt_robot_os.features.agent.edges import StateEdge
from rt_robot_os.messages.agent import AgentState

PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'active_agent.md'
LINE = re.compile(r'(\w+) --> (\w+): ([\w, ]+?)(?: \[([\w ]+)\])?(?: / (\w+))?')


def drawing() -> list[str]:
    block = re.search(r'```mermaid\nstateDiagram-v2\n(.*?)```', PAGE.read_text(), re.S)
    assert block is not None
    return [line.strip() for line in block.group(1).splitlines() if line.strip()]


def boxes(lines: list[str]) -> dict[str, list[str]]:
    """Return which states stand in each box, those in boxes within it included."""
    inside: dict[str, list[str]] = {}
    open_boxes: list[str] = []
    for line in lines:
        begin = re.fullmatch(r'state (\w+) \{', line)
        if begin:
            open_boxes.append(begin.group(1))
            inside[begin.group(1)] = []
        elif line == '}':
            open_boxes.pop()
        elif re.fullmatch(r'\w+', line):
            for box in open_boxes:
                inside[box].append(line)
    assert not open_boxes
    return inside


def drawn(lines: list[str]) -> Iterator[StateEdge]:
    inside = boxes(lines)
    for line in lines:
        if line.startswith(('[*]', 'state ', '}')) or re.fullmatch(r'\w+', line):
            continue
        match = LINE.fullmatch(line)
        assert match, f'the drawing has {line!r}: write "from --> to: event [guard] / action"'
        begin, end, events, guard, action = match.groups()
        for source in inside.get(begin, [begin]):
            for event in events.split(', '):
                target = None if end == BEFORE else AgentState(end)
                yield StateEdge(AgentState(source), event, guard or '', target, action or '')


def test_the_drawing_has_every_edge_of_the_table_and_no_other() -> None:
    found = list(drawn(drawing()))
    assert sorted(map(str, found)) == sorted(map(str, EDGES))
    assert len(set(found)) == len(found)


def test_the_drawing_has_a_guarded_edge_before_that_for_the_rest() -> None:
    # The order is that of the table, which is what decides.
    for edges in (EDGES, tuple(drawn(drawing()))):
        for place, edge in enumerate(edges):
            later = [other for other in edges[place + 1:]
                     if (other.source, other.event) == (edge.source, edge.event)]
            assert edge.guard or not later, f'{edge} hides {later}'


def test_every_event_and_guard_of_the_table_is_explained() -> None:
    page = PAGE.read_text()
    assert {edge.event for edge in EDGES} == set(EVENTS)
    assert {edge.guard for edge in EDGES if edge.guard} == set(GUARDS)
    for name, meaning in {**EVENTS, **GUARDS}.items():
        assert f'| `{name}` | {meaning} |' in page, name


def test_every_state_is_reached_and_left() -> None:
    for state in AgentState:
        assert any(edge.source is state for edge in EDGES), state
        assert any(edge.target is state for edge in EDGES), state
