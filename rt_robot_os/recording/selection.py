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

"""Select the topics to record: those of the bag, and those that only a replay needs."""

from __future__ import annotations

from collections.abc import Collection
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from rt_robot_os.core.tap_format import is_tap
from rt_robot_os.link import TopicInfo
from rt_robot_os.recording.definitions import is_known
from rt_robot_os.recording.graph import LOG
from rt_robot_os.recording.graph import ShownTopic
from rt_robot_os.recording.graph import STATIC
from rt_robot_os.recording.graph import TopicGraph
from rt_robot_os.settings.static_frames import published_frames

_INPUT_BYTES_MOST: Final = 1 << 16


@dataclass(frozen=True)
class Wanted:
    """
    The requested recording.

    :ivar topics: names, in the core or in ROS; empty for all mirrored topics.
    :ivar replay: also record the data for a replay.
    :ivar duration_ns: since the first connection; 0 until stopped.
    :ivar core_names: topics have the names and types of the core; all of them if none is named.
    :ivar unmirrored: if none is named, also record topics that are not mirrored.
    """

    topics: tuple[str, ...] = ()
    replay: bool = True
    duration_ns: int = 0
    core_names: bool = False
    unmirrored: bool = False


class Selection:
    """
    The selected topics of a core.

    :param known: the topics of the core, by name.
    :param taps: topics that only a replay needs; empty without replay.
    :ivar shown: the bag topics of each topic of the core.
    :ivar kept: topics that are recorded for a replay.
    :ivar frames: for ``/tf_static``; empty if it is not recorded.
    :ivar logs: the reports of the core are recorded.
    :ivar names: the topics of the bag.
    :ivar missing: a sentence about named topics that do not exist; '' if all exist.
    :ivar unknown_types: sentences about topics whose types are not installed.
    """

    def __init__(self, known: Mapping[str, TopicInfo], taps: Collection[str], wanted: Wanted,
                 graph: TopicGraph) -> None:
        self.missing = ''
        self.unknown_types: list[str] = []
        self._known = known
        own = [facts.name for facts in graph.own]
        asked = self._named(wanted, graph, own) if wanted.topics else [
            *(name for name in known if not is_tap(name) and (
                wanted.unmirrored or graph.has(name))), *own]
        self.shown = self._shown([known[name] for name in asked if name in known], graph)
        self.frames = published_frames(graph.settings) if STATIC.name in asked else ()
        self.logs = LOG.name in asked
        self.names = {each.facts.name for topics in self.shown.values() for each in topics} | {
            name for name in asked if name in own}
        self.kept = tuple(self._kept(taps, wanted, graph)) if wanted.replay else ()

    def _named(self, wanted: Wanted, graph: TopicGraph, own: list[str]) -> list[str]:
        known = self._known
        found = {text: graph.find(text, known) for text in wanted.topics}
        missing = [text for text, names in found.items() if not names]
        if missing:
            there = {*graph.in_ros, *own} | {
                f'/{name}' for name in known if not is_tap(name) and not graph.is_mirrored(name)}
            self.missing = (f'no topic {", ".join(missing)} in the core; known are '
                            f'{", ".join(sorted(there))}')
        return list(dict.fromkeys(name for names in found.values() for name in names))

    def _shown(self, asked: list[TopicInfo], graph: TopicGraph
               ) -> dict[TopicInfo, tuple[ShownTopic, ...]]:
        """Return the bag topics, without those whose types are not installed."""
        found = {}
        for info in asked:
            shown = graph.shown(info.name, info.type_name)
            types = dict.fromkeys(each.facts.type_name for each in shown)
            unknown = [name for name in types if not is_known(name)]
            self.unknown_types += [f'topic {info.name} is not recorded: {name} is not installed'
                                   for name in unknown]
            there = tuple(each for each in shown if each.facts.type_name not in unknown)
            if there:
                found[info] = there
        return found

    def _kept(self, taps: Collection[str], wanted: Wanted, graph: TopicGraph) -> list[TopicInfo]:
        """Return the topics for a replay: all, or if topics were named these and the inputs."""
        inputs = {each.topic for each in graph.settings.topics}
        return [info for name, info in self._known.items() if name in taps or (
            is_known(info.type_name) and (
                not wanted.topics or info in self.shown
                or (name in inputs and info.max_size <= _INPUT_BYTES_MOST)))]
