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

"""What a replay publishes, as a file; the same replay gives the same bytes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from rt_robot_os.clients.recording.bag_file import BagFile
from rt_robot_os.clients.recording.bag_info import TopicFacts
from rt_robot_os.clients.recording.compare import Produced
from rt_robot_os.clients.recording.compare import with_stamp
from rt_robot_os.clients.recording.definitions import type_hash
from rt_robot_os.clients.recording.reading import Recording
from rt_robot_os.clients.recording.replay import Replay


class ReplayOutput:
    """
    Write the publications of a replay.

    :raises RecordingError: the file is there, or cannot be made.
    """

    def __init__(self, path: Path, replay: Replay, recording: Recording) -> None:
        self._layouts = {topic.name: topic.layout for topic in replay.core.bus.topics}
        self._recording = recording
        self._offset_ns = recording.facts.offset_ns
        # Not this release, which would make the bytes of two releases differ.
        self._file = BagFile(path, 'rt_robot_os replay')
        self._channels: dict[str, int] = {}
        self._numbers: dict[str, int] = {}
        replay.on_produced = self._take

    def _take(self, one: Produced) -> None:
        layout = self._layouts[one.topic]
        channel = self._channels.get(one.topic)
        if channel is None:
            name = layout.type_name
            facts = self._recording.topics.get(one.topic, TopicFacts(f'/{one.topic}', name))
            channel = self._channels[one.topic] = self._file.channel(replace(
                facts, type_name=name, type_hash=type_hash(name), core_topic=one.topic))
        number = self._numbers.get(one.topic, -1) + 1 if one.number is None else one.number
        self._numbers[one.topic] = number
        wall_ns = one.stamp_ns + self._offset_ns
        self._file.add(channel, wall_ns, with_stamp(one.cdr, layout.stamp_offset, wall_ns),
                       number & 0xFFFFFFFF, wall_ns)

    def close(self) -> None:
        """Finish the file."""
        self._file.finish()
