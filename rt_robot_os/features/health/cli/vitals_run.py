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

"""Playback of a recording to the modules of the robot, on the virtual clock."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import json
import re
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.assessment import Assessment
from rt_robot_os.features.health.cli.vitals_file import in_order
from rt_robot_os.features.health.cli.vitals_file import VitalsRecording
from rt_robot_os.features.health.vital_signs import VitalSigns
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.kernel.spec import RATE_MINIMUM_HZ
from rt_robot_os.messages.cause import Cause
from rt_robot_os.messages.cause import CAUSES_TOPIC
from rt_robot_os.messages.quantities import FLOAT
from rt_robot_os.modules import Module
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Subscription

_PERSON: Final = 'person'
#: Time before the first sample, so that the modules have started.
_LEAD_NS: Final = NS_PER_S
_RATE_HZ: Final = 1.0
_FEED, _SIGNS, _ASSESS, _RECORD = 60, 39, 30, 10


class PlaybackResult(NamedTuple):
    """
    Output of the modules; times in s from the start of the recording.

    :ivar causes: all reports of causes, with their times.
    :ivar signs: quality of each sign, at each change.
    :ivar news2: values of the score details, at each change.
    :ivar sensors: counters of the sensor of each column.
    """

    causes: Sequence[tuple[float, Cause]]
    signs: Mapping[str, Sequence[tuple[float, str]]]
    news2: Sequence[tuple[float, dict[str, str]]]
    sensors: Sequence[dict[str, int]]


class _TopicRecorder:
    """Records the messages of a topic."""

    def __init__(self, kernel: Kernel, bus: Bus, topic: str, into: list[tuple[float, str]]
                 ) -> None:
        self._read: Subscription = bus.subscribe(topic, 'health', task=kernel.add_task(
            f'record {topic}', self._receive, priority=_RECORD))
        self._into = into

    def _receive(self) -> None:
        while self._read.take():
            self._into.append(((self._read.stamp_ns - _LEAD_NS) / NS_PER_S, self._read.msg.data))


class _Player:
    """Publishes the samples of a recording, each at its time."""

    def __init__(self, kernel: Kernel, bus: Bus, recording: VitalsRecording, topics: Sequence[str]
                 ) -> None:
        self._kernel = kernel
        for topic in topics:
            bus.declare(topic, FLOAT, {}, depth=16)
        self._publishers = [bus.publisher(topic) for topic in topics]
        self._samples = in_order(recording)
        self._next = next(self._samples, None)
        # The rate releases only the first job, which starts the timer.
        self._timer = kernel.timer(kernel.add_task(
            'recording', self._play, priority=_FEED, rate_hz=RATE_MINIMUM_HZ))

    def _start(self) -> None:
        if self._next is not None:
            self._timer.start_at(_LEAD_NS + round(self._next[0] * NS_PER_S))

    def _play(self) -> None:
        now_ns = self._kernel.now_ns() - _LEAD_NS
        while self._next is not None and round(self._next[0] * NS_PER_S) <= now_ns:
            _, place, value = self._next
            self._publishers[place].msg.data = value
            self._publishers[place].publish()
            self._next = next(self._samples, None)
        self._start()


def play(recording: VitalsRecording, vital: Mapping[str, Any], assessment: Mapping[str, Any]
         ) -> PlaybackResult:
    """
    Run the modules on a recording as if it were live.

    :param vital: settings of ``vital_signs`` that are not defaults.
    :param assessment: settings of ``assessment`` that are not defaults.
    :raises ConfigError: a setting is invalid, or a module fails.
    """
    kernel = Kernel(VirtualClock())
    bus = Bus(kernel)
    names = _names(recording)
    topics = [f'recording/{name}' for name in names]
    vital_signs = VitalSigns('vital_signs', _settings(VitalSigns, {
        **vital, 'person': _PERSON, 'sources': [
            f'{column.sign} {topic} as {name}' for column, topic, name in zip(
                recording.columns, topics, names)]}))
    modules: list[Module] = [vital_signs, Assessment('assessment', _settings(
        Assessment, {**assessment, 'person': _PERSON}))]
    player = _Player(kernel, bus, recording, topics)
    recorded: dict[str, list[tuple[float, str]]] = {}
    for module, priority in zip(modules, (_SIGNS, _ASSESS)):
        module.declare(bus, _RATE_HZ)
        module.bind(bus, kernel.add_task(module.name, module.job, priority=priority,
                                         rate_hz=_RATE_HZ))
    for topic in (CAUSES_TOPIC, f'health/{_PERSON}/signs', f'health/{_PERSON}/news2_details'):
        _TopicRecorder(kernel, bus, topic, recorded.setdefault(topic.rpartition('/')[2], []))
    for module in modules:
        module.configure()
        module.activate()
    kernel.run(_LEAD_NS + round(recording.length_s * NS_PER_S) + 1)
    if kernel.failures:
        raise ConfigError([f'a module failed, which is a defect of it: {kernel.failures[-1]}'])
    del player
    return PlaybackResult(
        [(time_s, Cause.from_json(text)) for time_s, text in recorded['causes']],
        _qualities(recorded['signs']), _scores(recorded['news2_details']),
        vital_signs.counters())


def _names(recording: VitalsRecording) -> list[str]:
    """Return a name for each column that is valid in a topic's name."""
    found: list[str] = []
    for place, column in enumerate(recording.columns):
        name = re.sub(r'\W', '', column.name, flags=re.ASCII)[:24] or 'column'
        name = name if name[0].isalpha() else f'c{name}'
        found.append(name if name not in found else f'{name}_{place}')
    return found


def _settings(kind: type[Module], given: Mapping[str, Any]) -> dict[str, Any]:
    values = {each.name: each.default for each in kind.fields()}
    return {**values, **given}


def _qualities(recorded: Sequence[tuple[float, str]]) -> dict[str, list[tuple[float, str]]]:
    found: dict[str, list[tuple[float, str]]] = {}
    for time_s, text in recorded:
        for status in json.loads(text)['status']:
            course = found.setdefault(status['name'].rpartition('/')[2], [])
            quality = status['values']['quality']
            if not course or course[-1][1] != quality:
                course.append((max(time_s, 0.0), quality))
    return found


def _scores(recorded: Sequence[tuple[float, str]]) -> list[tuple[float, dict[str, str]]]:
    found: list[tuple[float, dict[str, str]]] = []
    for time_s, text in recorded:
        values = json.loads(text)['status'][0]['values']
        if not found or found[-1][1] != values:
            found.append((max(time_s, 0.0), values))
    return found
