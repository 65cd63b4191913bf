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
A session: one core, from the connection of the recorder to its end; each has its own files.

The facts for a replay are at the beginning of each file: the checked settings as an attachment,
the rest as metadata ``rt_robot_os.session``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version
import json
import platform
from typing import Final

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.link import TopicInfo
from rt_robot_os.recording.graph import ShownTopic
from rt_robot_os.settings.model import MountedFrame

FORMAT: Final = 2
# In format 1 all topics had their names in the core, and replay data was not separate.
FORMATS_READ: Final = (1, 2)
_DIGITS_MOST: Final = 24
_NAME_MOST: Final = 255
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
class RecordingSession:
    """
    The recording of one core.

    :ivar number: from 0, counted by the recorder.
    :ivar topics: names of all topics of the core, by channel.
    :ivar tasks: names by number.
    :ivar shown: the bag topics of each requested topic of the core.
    :ivar kept: the topics that are recorded unmodified for a replay: always if no topic of the bag
        has the same bytes, otherwise up to ``begin_ns``.
    :ivar tapped: the taps were on from the start of the core.
    :ivar settings: as the node sends them to the core.
    :ivar robot: its name, see :func:`rt_robot_os.linux.paths.robot_name`.
    :ivar begin_ns: samples before this time, on CLOCK_MONOTONIC, were not requested.
    :ivar end_ns: samples after this time were not requested; 0 for no end.
    :ivar frames: of devices, for ``/tf_static``; empty if it is not recorded.
    :ivar logs: the reports of the core are recorded.
    """

    number: int
    pid: int
    start_ns: int
    tapped: bool
    tasks: tuple[str, ...]
    topics: tuple[str, ...]
    shown: Mapping[TopicInfo, tuple[ShownTopic, ...]]
    kept: tuple[TopicInfo, ...]
    taps: tuple[str, ...]
    settings: str
    robot: str = 'robot'
    begin_ns: int = 0
    end_ns: int = 0
    frames: tuple[MountedFrame, ...] = ()
    logs: bool = False

    def facts(self, offset_ns: int) -> dict[str, str]:
        """
        Return the facts as strings.

        :param offset_ns: from CLOCK_MONOTONIC to the time of day.
        """
        return {
            'format': str(FORMAT), 'rt_robot_os': package_version(),
            'python': platform.python_version(), 'machine': platform.machine(),
            'robot': self.robot, 'session': str(self.number), 'core_pid': str(self.pid),
            'core_start_ns': str(self.start_ns), 'offset_ns': str(offset_ns),
            'tapped_from_start': str(int(self.tapped)),
            'tasks': json.dumps(self.tasks), 'topics': json.dumps(self.topics),
            'taps': json.dumps(self.taps)}


@dataclass(frozen=True)
class SessionFacts:
    """
    The facts of a session that was read.

    :ivar form: of the recording, see ``FORMATS_READ``.
    :ivar robot: its name; the default name in recordings without one.
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
    robot: str = 'robot'

    @classmethod
    def read(cls, values: Mapping[str, str]) -> SessionFacts:
        """
        Parse the result of :meth:`RecordingSession.facts`.

        :raises RecordingError: it has another format, or is damaged.
        """
        found = values.get('format', '')
        if found not in map(str, FORMATS_READ):
            raise RecordingError(f'the recording has format {found[:20] or "?"}, this release '
                                 f'reads {" and ".join(map(str, FORMATS_READ))}: use the release '
                                 f'that wrote it ({values.get("rt_robot_os", "unknown")[:40]})')
        try:
            tasks, topics, taps = (_names(values[key]) for key in ('tasks', 'topics', 'taps'))
            return cls(
                int(found), int(values['session']), moment_ns(values['core_start_ns']),
                moment_ns(values['offset_ns']), values['tapped_from_start'] == '1', tasks, topics,
                taps,
                {key: values.get(key, '?')[:40] for key in ('rt_robot_os', 'python', 'machine')},
                values.get('robot', 'robot')[:_NAME_MOST])
        except (KeyError, ValueError, TypeError, RecursionError) as error:
            raise RecordingError(f'the session facts of the recording are damaged: '
                                 f'{type(error).__name__} {error}') from error


def _names(text: str) -> tuple[str, ...]:
    found = json.loads(text)
    if not isinstance(found, list):
        raise ValueError(f'{text[:40]!r} is not a list')
    return tuple(map(str, found))


def moment_ns(text: str) -> int:
    """
    Parse a time or an offset in nanoseconds.

    :raises ValueError: it is not a possible time.
    """
    value = int(text[:_DIGITS_MOST])
    if not -_MOMENT_MOST_NS < value < _MOMENT_MOST_NS:
        raise ValueError(f'{value} ns')
    return value
