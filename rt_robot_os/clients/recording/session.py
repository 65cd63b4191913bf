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
A session: one core, from the connection of the recorder to its end; each has files of its own.

What a replay has to know of it stands at the beginning of each file: the checked settings as an
attachment, the rest as metadata ``rt_robot_os.session``.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from collections.abc import Set
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version
import json
import platform
from typing import Any
from typing import Final

from rt_robot_os.clients.recording.bag_info import TopicFacts
from rt_robot_os.clients.recording.definitions import type_hash
from rt_robot_os.errors import RecordingError
from rt_robot_os.link import TopicInfo
from rt_robot_os.settings.names import full_topic

FORMAT: Final = 2
# In the first, all topics stood under their names in the core, and nothing was kept apart.
FORMATS_READ: Final = (1, 2)
_DIGITS_MOST: Final = 24
_MOMENT_MOST_NS: Final = 1 << 62
SESSION: Final = 'rt_robot_os.session'
CLOCK: Final = 'rt_robot_os.clock'
SETTINGS: Final = 'settings.json'


def package_version() -> str:
    """Return the version of this package."""
    try:
        return version('rt_robot_os')
    except PackageNotFoundError:  # run from its sources
        return 'source'


@dataclass(frozen=True)
class Session:
    """
    What is recorded of one core.

    :ivar number: from 0, counted by the recorder.
    :ivar topics: names by channel, all that the core has.
    :ivar tasks: names by number.
    :ivar asked: the topics that are recorded.
    :ivar kept: the topics that are kept for a replay; those that were asked for up to
        ``begin_ns``.
    :ivar tapped: the taps were on from the start of the core.
    :ivar settings: as the node hands them to the core.
    :ivar robot: its name, see :func:`rt_robot_os.link.paths.robot_name`.
    :ivar begin_ns: samples before this moment, on CLOCK_MONOTONIC, were not asked for.
    :ivar end_ns: nor are those after it; 0 for no end.
    :ivar core_names: topics are called in the bag as in the core.
    """

    number: int
    pid: int
    start_ns: int
    tapped: bool
    tasks: tuple[str, ...]
    topics: tuple[str, ...]
    asked: tuple[TopicInfo, ...]
    kept: tuple[TopicInfo, ...]
    taps: tuple[str, ...]
    settings: str
    robot: str = 'robot'
    begin_ns: int = 0
    end_ns: int = 0
    core_names: bool = False

    def facts(self, offset_ns: int) -> dict[str, str]:
        """
        Return it as texts.

        :param offset_ns: from CLOCK_MONOTONIC to the time of day.
        """
        return {
            'format': str(FORMAT), 'rt_robot_os': package_version(),
            'python': platform.python_version(), 'machine': platform.machine(),
            'session': str(self.number), 'core_pid': str(self.pid),
            'core_start_ns': str(self.start_ns), 'offset_ns': str(offset_ns),
            'tapped_from_start': str(int(self.tapped)),
            'tasks': json.dumps(self.tasks), 'topics': json.dumps(self.topics),
            'taps': json.dumps(self.taps)}

    def topic_facts(self) -> dict[str, tuple[TopicFacts, ...]]:
        """
        Return how the topics that were asked for stand in the bag.

        :return: by topic of the core, with the names and the service quality of its mirrors.
        """
        names = ros_names(self.settings, self.robot)
        taken = {name for mirrored in names.values() for name, _ in mirrored}
        return {info.name: tuple(self._facts_of(info, names.get(info.name, ()), taken))
                for info in self.asked}

    def _facts_of(self, info: TopicInfo, mirrors: Sequence[tuple[str, Mapping[str, Any]]],
                  taken: Set[str]) -> Iterator[TopicFacts]:
        *namespace, node = self.robot.split('.')
        whole = full_topic(info.name, '/' + '/'.join(namespace), node)
        if not mirrors:
            mirrors = [(full_topic(f'~/{info.name}', '/' + '/'.join(namespace), node)
                        if whole in taken else whole, {})]
        if self.core_names:
            mirrors = [(f'/{info.name}', mirrors[0][1])]
        for number, (name, mirror) in enumerate(mirrors):
            yield TopicFacts(
                name, info.type_name, type_hash(info.type_name),
                str(mirror.get('reliability', 'reliable')),
                str(mirror.get('durability', 'volatile')), int(mirror.get('depth', 10)),
                '' if number else info.name)


def ros_names(settings: str, robot: str) -> dict[str, list[tuple[str, Mapping[str, Any]]]]:
    """
    Return the names that topics of a core have in ROS.

    :param settings: JSON, with the names of the mirrors as the node has resolved them.
    :return: by topic of the core, whole name and settings of each mirror; those to ROS come first.
    """
    *namespace, node = robot.split('.')
    found: dict[str, list[tuple[str, Mapping[str, Any]]]] = {}
    # A topic that ROS has in another type is recorded as the core has it, under its own name.
    mirrors = [each for each in json.loads(settings).get('mirrors', ()) if not each.get('as_')]
    for mirror in sorted(mirrors, key=lambda each: each['direction'] != 'out'):
        known = found.setdefault(mirror['topic'], [])
        if mirror['direction'] == 'out' or not known:
            known.append((
                full_topic(mirror['ros_topic'], '/' + '/'.join(namespace), node), mirror))
    return found


@dataclass(frozen=True)
class SessionFacts:
    """
    A session as it is read back.

    :ivar form: of the recording, see ``FORMATS_READ``.
    """

    form: int
    number: int
    start_ns: int
    offset_ns: int
    tapped: bool
    tasks: tuple[str, ...]
    topics: tuple[str, ...]
    taps: tuple[str, ...]
    versions: Mapping[str, str]

    @classmethod
    def read(cls, values: Mapping[str, str]) -> SessionFacts:
        """
        Read what :meth:`Session.facts` gave.

        :raises RecordingError: it is of another format, or damaged.
        """
        found = values.get('format', '')
        if found not in map(str, FORMATS_READ):
            raise RecordingError(f'the recording is of format {found[:20] or "?"}, this release '
                                 f'reads {" and ".join(map(str, FORMATS_READ))}: use the release '
                                 f'that wrote it ({values.get("rt_robot_os", "unknown")[:40]})')
        try:
            tasks, topics, taps = (_names(values[key]) for key in ('tasks', 'topics', 'taps'))
            return cls(
                int(found), int(values['session']), moment_ns(values['core_start_ns']),
                moment_ns(values['offset_ns']), values['tapped_from_start'] == '1', tasks, topics,
                taps,
                {key: values.get(key, '?')[:40] for key in ('rt_robot_os', 'python', 'machine')})
        except (KeyError, ValueError, TypeError, RecursionError) as error:
            raise RecordingError(f'what the recording says of its session is damaged: '
                                 f'{type(error).__name__} {error}') from error


def _names(text: str) -> tuple[str, ...]:
    found = json.loads(text)
    if not isinstance(found, list):
        raise ValueError(f'{text[:40]!r} is no list')
    return tuple(map(str, found))


def moment_ns(text: str) -> int:
    """
    Read a moment or an offset in nanoseconds.

    :raises ValueError: it is none that a clock could have.
    """
    value = int(text[:_DIGITS_MOST])
    if not -_MOMENT_MOST_NS < value < _MOMENT_MOST_NS:
        raise ValueError(f'{value} ns')
    return value
