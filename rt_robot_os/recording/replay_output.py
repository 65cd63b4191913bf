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

"""Write the publications of a replay to a file; the same replay gives the same bytes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rt_robot_os.recording.bag_file import BagFile
from rt_robot_os.recording.bag_info import TopicFacts
from rt_robot_os.recording.compare import Produced
from rt_robot_os.recording.compare import with_stamp
from rt_robot_os.recording.definitions import is_known
from rt_robot_os.recording.definitions import type_hash
from rt_robot_os.recording.graph import read_graph
from rt_robot_os.recording.graph import ShownTopic
from rt_robot_os.recording.reading import Recording
from rt_robot_os.recording.replay import Replay
from rt_robot_os.recording.tracks import Outlet


class ReplayOutput:
    """
    Write the publications of a replay, with the topics of the recording.

    :raises RecordingError: the file exists, or cannot be created.
    """

    def __init__(self, path: Path, replay: Replay, recording: Recording) -> None:
        self._layouts = {topic.name: topic.layout for topic in replay.core.bus.topics}
        self._recording = recording
        self._offset_ns = recording.facts.offset_ns
        self._graph, _ = read_graph(recording.settings, recording.facts.robot)
        # Without the release, so that the bytes of two releases can be compared.
        self._file = BagFile(path, 'rt_robot_os replay')
        self._channels: dict[TopicFacts, int] = {}
        self._outlets: dict[str, Sequence[Outlet]] = {}
        self._numbers: dict[str, int] = {}
        replay.on_produced = self._write

    def _write(self, one: Produced) -> None:
        outlets = self._outlets.get(one.topic)
        if outlets is None:
            outlets = self._outlets[one.topic] = self._begin(one.topic)
        number = self._numbers.get(one.topic, -1) + 1 if one.number is None else one.number
        self._numbers[one.topic] = number
        wall_ns = one.stamp_ns + self._offset_ns
        cdr = with_stamp(one.cdr, self._layouts[one.topic].stamp_offset, wall_ns)
        for outlet in outlets:
            outlet.write(self._file, wall_ns, cdr, number & 0xFFFFFFFF, wall_ns)

    def _begin(self, topic: str) -> list[Outlet]:
        """Add the topics of the file for a topic of the core."""
        type_name = self._layouts[topic].type_name
        recorded = self._recording.topics.get(topic)
        shown = self._graph.shown(topic, type_name) if recorded is None else (ShownTopic(replace(
            recorded, type_name=type_name, type_hash=type_hash(type_name), core_topic=topic)),)
        outlets = [Outlet(each) for each in shown if is_known(each.facts.type_name)]
        for outlet in outlets:
            if outlet.facts not in self._channels:
                self._channels[outlet.facts] = self._file.channel(outlet.facts)
            outlet.channel = self._channels[outlet.facts]
        return outlets

    def close(self) -> None:
        """Finish the file."""
        self._file.finish()
