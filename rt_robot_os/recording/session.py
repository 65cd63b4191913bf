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

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version
import json
import platform
from typing import Any, Final

from rt_robot_os.errors import RecordingError
from rt_robot_os.link import TopicInfo
from rt_robot_os.recording.bag_info import TopicFacts
from rt_robot_os.recording.definitions import type_hash

FORMAT: Final = 1
SESSION: Final = 'rt_robot_os.session'
CLOCK: Final = 'rt_robot_os.clock'
SETTINGS: Final = 'settings.json'


def package_version() -> str:
    """Give the version of this package."""
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
    :ivar recorded: the topics that are recorded.
    :ivar tapped: the taps were on from the start of the core.
    :ivar settings: as the node hands them to the core.
    """

    number: int
    pid: int
    start_ns: int
    tapped: bool
    tasks: tuple[str, ...]
    topics: tuple[str, ...]
    recorded: tuple[TopicInfo, ...]
    taps: tuple[str, ...]
    settings: str

    def facts(self, offset_ns: int) -> dict[str, str]:
        """
        Give it as texts.

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

    def topic_facts(self, info: TopicInfo) -> TopicFacts:
        """Say how a topic stands in the bag: with the service quality of its mirror, if any."""
        mirrors: Sequence[Mapping[str, Any]] = json.loads(self.settings).get('mirrors', ())
        chosen = next((m for m in mirrors
                       if m.get('topic') == info.name and m.get('direction') == 'out'), {})
        return TopicFacts(f'/{info.name}', info.type_name, type_hash(info.type_name),
                          str(chosen.get('reliability', 'reliable')),
                          str(chosen.get('durability', 'volatile')))


@dataclass(frozen=True)
class SessionFacts:
    """A session as it is read back."""

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
        if found != str(FORMAT):
            raise RecordingError(f'the recording is of format {found or "?"}, this release reads '
                                 f'{FORMAT}: use the release that wrote it '
                                 f'({values.get("rt_robot_os", "unknown")})')
        try:
            tasks, topics, taps = (
                tuple(map(str, json.loads(values[key]))) for key in ('tasks', 'topics', 'taps'))
            return cls(
                int(values['session']), int(values['core_start_ns']), int(values['offset_ns']),
                values['tapped_from_start'] == '1', tasks, topics, taps,
                {key: values.get(key, '?') for key in ('rt_robot_os', 'python', 'machine')})
        except (KeyError, ValueError, TypeError) as error:
            raise RecordingError(f'what the recording says of its session is damaged: '
                                 f'{type(error).__name__} {error}') from error
