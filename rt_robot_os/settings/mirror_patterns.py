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
Mirrors of many topics: ``topic: wsn/*`` matches topics of the core.

Each matching topic gets its own mirror when the settings are read; these share name and
parameters.
"""

from __future__ import annotations

from collections.abc import Collection
from collections.abc import Iterable
from collections.abc import Sequence
from dataclasses import replace
import itertools
import re
from typing import Final

from rt_robot_os.settings.names import topic_problem
from rt_robot_os.settings.problems import did_you_mean
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.sections import Section
from rt_robot_os.settings.wiring import TopicTable

STAR: Final = '*'

_EXAMPLE: Final = 'wsn/*'


def is_pattern(topic: object) -> bool:
    """Return whether a name is a pattern."""
    return isinstance(topic, str) and STAR in topic


def expanded(
    mirrors: Sequence[Section], table: TopicTable, problems: Problems,
) -> tuple[Section, ...]:
    """
    Replace each mirror with a pattern by mirrors of the matching topics.

    A ``*`` matches one or more characters, including ``/``. A topic belongs to the mirror that
    names it, otherwise to the first pattern of the list that matches it.
    """
    taken = {mirror.values.get('topic') for mirror in mirrors}
    found: list[Section] = []
    for mirror in mirrors:
        if not is_pattern(mirror.values.get('topic')):
            found.append(mirror)
            continue
        each = _matches(mirror, table, taken, problems)
        taken.update(one.values['topic'] for one in each)
        found += each
    return tuple(found)


def _matches(
    mirror: Section, table: TopicTable, taken: Collection[object], problems: Problems,
) -> list[Section]:
    pattern: str = mirror.values['topic']
    if (problem := _pattern_problem(mirror, pattern, problems)) is not None:
        mirror.reject('topic', problem, problems)
        return []
    ros_pattern: str | None = mirror.values.get('ros_topic')
    expression = re.compile('(.+)'.join(map(re.escape, pattern.split(STAR))))
    matches = [match for match in map(expression.fullmatch, table.declared) if match]
    free = [match for match in matches if match[0] not in taken]
    if not free and (matches or table.complete):
        mirror.reject('topic', 'each matching topic already has a mirror: delete this one'
                      if matches else _nothing(pattern, table), problems)
    return [replace(mirror, values={
        **mirror.values, 'topic': match[0],
        **({'ros_topic': _filled(ros_pattern, match.groups())} if ros_pattern else {}),
    }) for match in free]


def _pattern_problem(mirror: Section, pattern: str, problems: Problems) -> str | None:
    """Return the problem of a pattern, None for none; a problem of its ROS name is reported."""
    if mirror.values.get('direction') == 'in':
        return f'{STAR} is only for direction: out: name each topic that comes from ROS'
    ros_pattern = mirror.values.get('ros_topic')
    if ros_pattern and ros_pattern.count(STAR) != pattern.count(STAR):
        mirror.reject('ros_topic', f'must have as many {STAR} as topic, {pattern!r}: each is '
                      'replaced by the match of that in topic', problems)
    return topic_problem(pattern.replace(STAR, 'x'), _EXAMPLE)


def _nothing(pattern: str, table: TopicTable) -> str:
    return f'no topic matches, {did_you_mean(pattern, table.names)}'


def _filled(pattern: str, texts: Iterable[str]) -> str:
    """Replace the stars by strings."""
    return ''.join(itertools.chain.from_iterable(
        itertools.zip_longest(pattern.split(STAR), texts, fillvalue='')))
