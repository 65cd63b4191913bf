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

"""The end of an MCAP file: the summary, with which readers find what they look for."""

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


@dataclass
class Contents:
    """
    What a file holds.

    :ivar end: where the last whole record of the data ends.
    :ivar whole: the file has its summary; nothing is to be mended.
    :ivar chunks: of each the index, the messages of each channel, and the indices after it.
    """

    end: int = len(MAGIC)
    whole: bool = False
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[tuple[ChunkIndex, dict[int, int], bytes]] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)


def summary(found: Contents, offset: int) -> bytes:
    """Make what follows the data, which ends at an offset."""
    builder = RecordBuilder()
    DataEnd(0).write(builder)
    start = offset + builder.count
    data_end = bytes(builder.end())
    counts: dict[int, int] = defaultdict(int)
    for _, inside, _ in found.chunks:
        for channel, count in inside.items():
            counts[channel] += count
    for schema in found.schemas.values():
        schema.write(builder)
    for each in found.channels.values():
        each.write(builder)
    Statistics(
        attachment_count=len(found.attachments), channel_count=len(found.channels),
        channel_message_counts=dict(counts), chunk_count=len(found.chunks),
        message_count=sum(counts.values()), metadata_count=len(found.metadata),
        message_start_time=min((i.message_start_time for i, _, _ in found.chunks), default=0),
        message_end_time=max((i.message_end_time for i, _, _ in found.chunks), default=0),
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
