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
# In the first, all topics stood under their names in the core, and nothing was kept apart.
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
    What is recorded of one core.

    :ivar number: from 0, counted by the recorder.
    :ivar topics: names by channel, all that the core has.
    :ivar tasks: names by number.
    :ivar shown: how the topics of the core that were asked for stand in the bag.
    :ivar kept: the topics that are kept for a replay as the core has them: always where no topic
        of the bag has the same bytes, and else up to ``begin_ns``.
    :ivar tapped: the taps were on from the start of the core.
    :ivar settings: as the node hands them to the core.
    :ivar robot: its name, see :func:`rt_robot_os.linux.paths.robot_name`.
    :ivar begin_ns: samples before this moment, on CLOCK_MONOTONIC, were not asked for.
    :ivar end_ns: nor are those after it; 0 for no end.
    :ivar frames: of devices, for ``/tf_static``; none when it is not recorded.
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
        Return it as texts.

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
    A session as it is read back.

    :ivar form: of the recording, see ``FORMATS_READ``.
    :ivar robot: its name; that of any robot in recordings that do not have it.
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
        Read what :meth:`RecordingSession.facts` gave.

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
                {key: values.get(key, '?')[:40] for key in ('rt_robot_os', 'python', 'machine')},
                values.get('robot', 'robot')[:_NAME_MOST])
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
