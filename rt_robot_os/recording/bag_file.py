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
Write one MCAP file.

If this process crashes, the file ends with a complete record, once a chunk was written.

Data that only a replay needs is in attachments named ``rt_robot_os.replay``: each is a chunk of
the same form, whose channels are topics of the core. Readers of MCAP list attachments but do not
play them, so they add neither topics nor time to the bag.
"""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path
from typing import Any
from typing import Final

from mcap.data_stream import RecordBuilder
from mcap.records import Attachment
from mcap.records import AttachmentIndex
from mcap.records import Channel
from mcap.records import Header
from mcap.records import Metadata
from mcap.records import MetadataIndex
from mcap.records import Schema

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.recording.bag_info import FileFacts
from rt_robot_os.recording.bag_info import TopicFacts
from rt_robot_os.recording.chunk import ChunkWriter
from rt_robot_os.recording.definitions import definition
from rt_robot_os.recording.summary import Contents
from rt_robot_os.recording.summary import MAGIC
from rt_robot_os.recording.summary import PROFILE
from rt_robot_os.recording.summary import summary

REPLAY: Final = 'rt_robot_os.replay'
_REPLAY_MEDIA_TYPE: Final = 'application/x-mcap-chunk'
_CHUNK_BYTES: Final = 1 << 20


class BagFile:
    """
    Write one file.

    :param library: name of the writer, for the header of the file.
    :raises RecordingError: the file exists, or cannot be created.
    :ivar size: bytes on the disk.
    :ivar facts: the content that is on the disk.
    """

    def __init__(self, path: Path, library: str, compression: str = 'zstd') -> None:
        self.path = path
        self.facts = FileFacts(path.name)
        self.size = 0
        self._contents = Contents()
        self._topics: list[TopicFacts] = []
        self._schemas: dict[str, int] = {}
        self._chunk = ChunkWriter(compression)
        self._kept_topics = 0
        self._kept = ChunkWriter(compression, repeats=True)
        try:
            self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise RecordingError(f'{path} cannot be created: {error.strerror}') from error
        self._write(MAGIC)
        self._write_record(Header(PROFILE, library))

    def channel(self, topic: TopicFacts) -> int:
        """
        Add a topic.

        :return: its number, for :meth:`add`.
        :raises LayoutError: its type is not installed.
        """
        name, contents = topic.type_name, self._contents
        if name not in self._schemas:
            number = self._schemas[name] = len(self._schemas) + 1
            schema = Schema(id=number, name=name, encoding='ros2msg',
                            data=definition(name).encode())
            contents.schemas[number] = schema
            self._chunk.define(schema)
        self._topics.append(topic)
        self.facts.counts[topic] = 0
        number = len(self._topics)
        channel = Channel(
            id=number, topic=topic.name, message_encoding='cdr', schema_id=self._schemas[name],
            metadata=topic.metadata())
        contents.channels[number] = channel
        self._chunk.define(channel)
        return number

    def kept_channel(self, core_topic: str) -> int:
        """
        Add a topic whose messages only a replay needs.

        :return: its number, for :meth:`keep`.
        """
        self._kept_topics += 1
        self._kept.define(Channel(
            id=self._kept_topics, topic=core_topic, message_encoding='cdr', schema_id=0,
            metadata={}))
        return self._kept_topics

    def keep(self, channel: int, wall_ns: int, cdr: Any, sequence: int) -> None:
        """
        Add a message that only a replay needs.

        :raises OSError: the disk is full.
        """
        self._kept.add(channel, wall_ns, cdr, wall_ns, sequence)
        if self._kept.size > _CHUNK_BYTES:
            self.flush()

    def add(self, channel: int, log_ns: int, cdr: Any, sequence: int, publish_ns: int) -> None:
        """
        Add a message.

        :param log_ns: its time of day in the bag.
        :param cdr: bytes, or a buffer that no longer changes.
        :param publish_ns: the time of day of its data.
        :raises OSError: the disk is full.
        """
        self._chunk.add(channel, log_ns, cdr, publish_ns, sequence)
        facts = self.facts
        if log_ns > facts.last_ns:
            facts.last_ns = log_ns
        if log_ns < facts.first_ns or not facts.first_ns:
            facts.first_ns = log_ns
        if self._chunk.size > _CHUNK_BYTES:
            self.flush()

    def note(self, name: str, values: Mapping[str, str]) -> None:
        """Write metadata that applies to the following messages."""
        self.flush()
        offset = self.size
        length = self._write_record(Metadata(name, dict(values)))
        self._contents.metadata.append(MetadataIndex(offset, length, name))

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Write a file into the file."""
        self.flush()
        self._attach(name, media_type, data)

    def _attach(self, name: str, media_type: str, data: bytes) -> None:
        offset = self.size
        length = self._write_record(Attachment(
            create_time=0, log_time=0, name=name, media_type=media_type, data=data))
        self._contents.attachments.append(AttachmentIndex(
            offset=offset, length=length, create_time=0, log_time=0, data_size=len(data),
            name=name, media_type=media_type))

    def flush(self) -> None:
        """Write what is there as a chunk: from now on it survives this process."""
        if not self._chunk.empty:
            record, place, counts, indices = self._chunk.take(self.size)
            self._write(record + indices)
            self._contents.chunks.append((place, counts, b''))
            for number, count in counts.items():
                self.facts.counts[self._topics[number - 1]] += count
        if not self._kept.empty:
            self._attach(REPLAY, _REPLAY_MEDIA_TYPE, self._kept.take(0)[0])

    def finish(self) -> None:
        """Write the summary and close."""
        self.flush()
        self._write(summary(self._contents, self.size))
        self.abandon()

    def abandon(self) -> None:
        """Close as it is; see :mod:`rt_robot_os.recording.repair`."""
        fd, self._fd = self._fd, -1
        if fd >= 0:
            os.close(fd)

    def _write_record(self, record: Header | Metadata | Attachment) -> int:
        builder = RecordBuilder()
        record.write(builder)
        return self._write(bytes(builder.end()))

    def _write(self, data: bytes) -> int:
        left = memoryview(data)
        while left:
            written = os.write(self._fd, left)
            self.size += written
            left = left[written:]
        return len(data)
