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

"""Check that the services of the node fit the topics of the core, and each other."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from rt_robot_os.link.conversions import TEXT
from rt_robot_os.settings.names import full_topic
from rt_robot_os.settings.names import ros_topic_problem
from rt_robot_os.settings.names import topic_problem
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.sections import Section
from rt_robot_os.settings.service_model import GET_MAP
from rt_robot_os.settings.service_model import LOAD_MAP
from rt_robot_os.settings.service_model import MAP_URL
from rt_robot_os.settings.service_model import SET_BOOL
from rt_robot_os.settings.wiring import TopicTable

_MAP: Final = 'nav_msgs/msg/OccupancyGrid'

# Of this node, of every lifecycle node and of every node.
_TAKEN: Final = frozenset({
    'rearm', 'save_parameters', 'change_state', 'get_state', 'get_available_states',
    'get_available_transitions', 'get_transition_graph', 'describe_parameters',
    'get_parameter_types', 'get_parameters', 'list_parameters', 'set_parameters',
    'set_parameters_atomically', 'get_type_description'})


def check_services(
    services: Iterable[Section], table: TopicTable, namespace: str, node: str,
    problems: Problems,
) -> None:
    """Find services with the same name, unsuitable topics, and missing or unsuitable texts."""
    own = {full_topic(f'~/{name}', namespace, node): 'the node itself' for name in _TAKEN}
    for each in services:
        _check_name(each, own, (namespace, node), problems)
        for key in ('topic', 'answer_topic'):
            _check_topic(each, key, table, problems)
        for key in ('text', 'text_false'):
            _check_text(each, key, table, problems)
        values = each.values
        if values.get('topic') and values.get('topic') == values.get('answer_topic'):
            each.reject('answer_topic', 'is the topic of the command: name the topic of the '
                        'answers', problems)


def _check_name(
    section: Section, taken: dict[str, str], node: tuple[str, str], problems: Problems,
) -> None:
    name = section.values.get('service')
    if name is None:
        return
    wrong = ros_topic_problem(name) if name else None
    if wrong is None:
        full = full_topic(name or f'~/{section.name}', *node)
        by = taken.setdefault(full, f'{section.name} ({section.origin})')
        if by != f'{section.name} ({section.origin})':
            wrong = f'{full} is already a service of {by}: give each its own name'
    if wrong is not None:
        section.reject('service', wrong, problems)


def _check_topic(section: Section, key: str, table: TopicTable, problems: Problems) -> None:
    topic = section.values.get(key)
    if not topic:
        return
    wrong = topic_problem(topic) or table.missing(topic)
    gives_map = section.values.get('type') == GET_MAP
    wanted = _MAP if gives_map and key == 'topic' else TEXT
    if key == 'answer_topic' and gives_map:
        wrong = f'is not used with type: {GET_MAP}, which returns the last sample of topic'
    elif wrong is None and topic in table.declared and table.message(topic) != wanted:
        wrong = f'is a {table.message(topic)}: it must be a {wanted}'
    elif (wrong is None and wanted == TEXT and topic in table.declared
            and table.declared[topic].spec.fixed):
        wrong = 'is declared with a fixed string: delete fixed'
    if wrong is not None:
        section.reject(key, wrong, problems)


def _check_text(section: Section, key: str, table: TopicTable, problems: Problems) -> None:
    text = section.values.get(key)
    if text is None:
        return
    kind = section.values.get('type')
    check = _text_false_problem if key == 'text_false' else _text_problem
    problem = check(text, kind) if kind is not None else None
    if problem is None and key == 'text' and kind != GET_MAP and not text.strip():
        problem = 'must not be empty'
    if problem is None and '\0' in text:
        problem = 'must not contain a NUL'
    problem = problem or _length_problem(text, section.values.get('topic', ''), table)
    if problem is not None:
        section.reject(key, problem, problems)


def _text_false_problem(text: str, kind: str) -> str | None:
    if kind == SET_BOOL and not text:
        return 'must be given: a SetBool needs a text for false'
    if kind != SET_BOOL and text:
        return f'is used with type: {SET_BOOL} only'
    return None


def _text_problem(text: str, kind: str) -> str | None:
    if kind == GET_MAP:
        return f'is not used with type: {GET_MAP}: delete it' if text else None
    if kind == LOAD_MAP and text.strip() and MAP_URL not in text:
        return f"must contain {MAP_URL} for the map_url of the request, such as 'load {MAP_URL}'"
    if kind != LOAD_MAP and MAP_URL in text:
        return f'contains {MAP_URL}: only requests of type: {LOAD_MAP} have one'
    return None


def _length_problem(text: str, topic: str, table: TopicTable) -> str | None:
    declared = table.declared.get(topic)
    tail = declared.spec.tail if declared is not None else None
    if isinstance(tail, int) and len(text.encode()) > tail:
        return f'has {len(text.encode())} bytes: the topic {topic!r} can hold {tail}'
    return None
