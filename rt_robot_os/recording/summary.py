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

"""The summary at the end of an MCAP file, with the indices for readers."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from dataclasses import field
import struct
from typing import Final
import zlib

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex
from mcap.records import Channel
from mcap.records import ChunkIndex
from mcap.records import DataEnd
from mcap.records import Footer
from mcap.records import MetadataIndex
from mcap.records import Schema
from mcap.records import Statistics

MAGIC: Final = b'\x89MCAP0\r\n'
FOOTER_BYTES: Final = 20
PROFILE: Final = 'ros2'


@dataclass
class Loose:
    """Messages outside of any chunk: their number by channel, and their times."""

    counts: dict[int, int] = field(default_factory=dict)
    first_ns: int = 0
    last_ns: int = 0

    def add(self, channel: int, log_ns: int) -> None:
        """Count a message."""
        self.first_ns = min(self.first_ns, log_ns) if self.counts else log_ns
        self.last_ns = max(self.last_ns, log_ns)
        self.counts[channel] = self.counts.get(channel, 0) + 1


@dataclass
class Contents:
    """
    The content of a file.

    :ivar end: offset of the end of the last complete record of the data.
    :ivar whole: the file has its summary; no repair is needed.
    :ivar has_header: it begins with a header.
    :ivar patches: offsets and bytes to be written, so that readers can read the file.
    :ivar damaged: number of lost records, or ranges of them, in the middle.
    :ivar loose: messages outside of chunks; they count only in a file without chunks.
    :ivar chunks: for each the index, the messages of each channel, and the indices after it.
    """

    end: int = len(MAGIC)
    whole: bool = False
    has_header: bool = False
    damaged: int = 0
    patches: list[tuple[int, bytes]] = field(default_factory=list)
    loose: Loose = field(default_factory=Loose)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[tuple[ChunkIndex, dict[int, int], bytes]] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)

    def counts(self) -> dict[int, int]:
        """Return the number of messages of each channel."""
        counts: dict[int, int] = defaultdict(int)
        for inside in [inside for _, inside, _ in self.chunks] or [self.loose.counts]:
            for channel, count in inside.items():
                counts[channel] += count
        return dict(counts)

    def times_ns(self) -> tuple[int, int]:
        """Return the times of the first and the last message; 0 if there is none."""
        if not self.chunks:
            return self.loose.first_ns, self.loose.last_ns
        filled = [index for index, counts, _ in self.chunks if counts]
        return (min((index.message_start_time for index in filled), default=0),
                max((index.message_end_time for index in filled), default=0))


def summary(found: Contents, offset: int) -> bytes:
    """Make the records after the data, which ends at an offset."""
    builder = RecordBuilder()
    DataEnd(0).write(builder)
    start = offset + builder.count
    data_end = bytes(builder.end())
    counts = found.counts()
    first_ns, last_ns = found.times_ns()
    for schema in found.schemas.values():
        schema.write(builder)
    for each in found.channels.values():
        each.write(builder)
    Statistics(
        attachment_count=len(found.attachments), channel_count=len(found.channels),
        channel_message_counts=counts, chunk_count=len(found.chunks),
        message_count=sum(counts.values()), metadata_count=len(found.metadata),
        message_start_time=first_ns, message_end_time=last_ns,
        schema_count=len(found.schemas)).write(builder)
    for index, _, _ in found.chunks:
        index.write(builder)
    for attachment in found.attachments:
        attachment.write(builder)
    for metadata in found.metadata:
        metadata.write(builder)
    text = bytes(builder.end())
    crc = zlib.crc32(struct.pack('<BQQQ', Opcode.FOOTER, FOOTER_BYTES, start, 0),
                     zlib.crc32(text))
    Footer(summary_start=start, summary_offset_start=0, summary_crc=crc).write(builder)
    return data_end + text + bytes(builder.end()) + MAGIC
