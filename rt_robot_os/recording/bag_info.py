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

"""``metadata.yaml``, which makes a folder of MCAP files a bag of ROS 2 Jazzy (version 9)."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace
import os
from pathlib import Path
from typing import Any
from typing import Final

import yaml

METADATA: Final = 'metadata.yaml'
# In the metadata of a channel: the topic of the core.
CORE_TOPIC: Final = 'rt_robot_os.topic'
_VERSION: Final = 9
_QOS_TEXT_MOST: Final = 1 << 16
_QOS_READ: Final = {'reliability': str, 'durability': str, 'depth': int}
_FOREVER: Final = {'sec': 9223372036, 'nsec': 854775807}


@dataclass(frozen=True)
class TopicFacts:
    """
    A topic in a bag.

    :ivar name: in ROS, with its slash.
    :ivar core_topic: its name in the core; empty for a second topic with the same samples.
    """

    name: str
    type_name: str
    type_hash: str = ''
    reliability: str = 'reliable'
    durability: str = 'volatile'
    depth: int = 10
    core_topic: str = ''

    def qos(self) -> list[dict[str, Any]]:
        """Return the quality of service for `ros2 bag play`."""
        return [{
            'history': 'keep_last', 'depth': self.depth, 'reliability': self.reliability,
            'durability': self.durability, 'deadline': dict(_FOREVER),
            'lifespan': dict(_FOREVER), 'liveliness': 'automatic',
            'liveliness_lease_duration': dict(_FOREVER),
            'avoid_ros_namespace_conventions': False}]

    def metadata(self) -> dict[str, str]:
        """Return the metadata of the channel."""
        return {'offered_qos_profiles': str(yaml.safe_dump(self.qos(), sort_keys=False)),
                'topic_type_hash': self.type_hash,
                **({CORE_TOPIC: self.core_topic} if self.core_topic else {})}

    @classmethod
    def read(cls, name: str, type_name: str, metadata: Mapping[str, str]) -> TopicFacts:
        """Parse the result of :meth:`metadata`; malformed parts are ignored."""
        known = cls(name, type_name, metadata.get('topic_type_hash', ''),
                    core_topic=metadata.get(CORE_TOPIC, ''))
        text = metadata.get('offered_qos_profiles', '')
        try:
            offered = yaml.safe_load(text)[0] if len(text) < _QOS_TEXT_MOST else {}
            return replace(known, **{
                key: kind(offered[key]) for key, kind in _QOS_READ.items() if key in offered})
        except (yaml.YAMLError, LookupError, TypeError, ValueError, RecursionError):
            return known


@dataclass
class FileFacts:
    """A file of a bag: its name, the times of its first and last message, and their numbers."""

    name: str
    first_ns: int = 0
    last_ns: int = 0
    counts: dict[TopicFacts, int] = field(default_factory=dict)

    @property
    def messages(self) -> int:
        """Return the number of messages."""
        return sum(self.counts.values())


def bag_text(files: Sequence[FileFacts]) -> str:
    """Return the metadata of a bag, as YAML."""
    counts: dict[TopicFacts, int] = {}
    for file in files:
        for topic, count in file.counts.items():
            counts[topic] = counts.get(topic, 0) + count
    filled = [file for file in files if file.messages]
    first_ns = min((file.first_ns for file in filled), default=0)
    last_ns = max((file.last_ns for file in filled), default=0)
    return str(yaml.safe_dump({'rosbag2_bagfile_information': {
        'version': _VERSION, 'storage_identifier': 'mcap',
        'duration': {'nanoseconds': last_ns - first_ns},
        'starting_time': {'nanoseconds_since_epoch': first_ns},
        'message_count': sum(counts.values()),
        'topics_with_message_count': [{
            'topic_metadata': {
                'name': topic.name, 'type': topic.type_name, 'serialization_format': 'cdr',
                'offered_qos_profiles': topic.qos(), 'type_description_hash': topic.type_hash},
            'message_count': count} for topic, count in counts.items()],
        'compression_format': '', 'compression_mode': '',
        'relative_file_paths': [file.name for file in files],
        'files': [{
            'path': file.name,
            'starting_time': {'nanoseconds_since_epoch': file.first_ns},
            'duration': {'nanoseconds': file.last_ns - file.first_ns},
            'message_count': file.messages} for file in files],
        'custom_data': None, 'ros_distro': 'jazzy'}}, sort_keys=False))


def write_bag_info(folder: Path, files: Sequence[FileFacts]) -> None:
    """
    Write ``metadata.yaml`` atomically.

    :raises OSError: it cannot be written; the old file stays.
    """
    temporary = folder / f'.{METADATA}'
    try:
        temporary.write_text(bag_text(files))
        os.replace(temporary, folder / METADATA)
    finally:
        temporary.unlink(missing_ok=True)
