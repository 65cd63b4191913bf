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
Mend files that were cut short: a killed recorder, a full disk, a card pulled out.

What is whole stays, what is cut is taken off, and the summary at the end, with which readers find
things fast, is written anew. It is done in place: a full disk has no room for a copy.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from io import BytesIO
import os
from pathlib import Path
import struct
from typing import Final

from mcap._chunk_builder import ChunkBuilder
from mcap.data_stream import ReadDataStream
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment
from mcap.records import AttachmentIndex
from mcap.records import Channel
from mcap.records import Chunk
from mcap.records import ChunkIndex
from mcap.records import Message
from mcap.records import Metadata
from mcap.records import MetadataIndex
from mcap.records import Schema
from mcap.stream_reader import breakup_chunk

from rt_robot_os.errors import RecordingError
from rt_robot_os.recording.bag_info import FileFacts
from rt_robot_os.recording.bag_info import METADATA
from rt_robot_os.recording.bag_info import TopicFacts
from rt_robot_os.recording.bag_info import write_bag_info
from rt_robot_os.recording.definitions import type_hash
from rt_robot_os.recording.summary import Contents
from rt_robot_os.recording.summary import FOOTER_BYTES
from rt_robot_os.recording.summary import MAGIC
from rt_robot_os.recording.summary import summary

_RECORD: Final = struct.Struct('<BQ')


def _records(path: Path) -> Iterator[tuple[int, int, bytes]]:
    """Give offset, kind and content of each whole record."""
    size = path.stat().st_size
    with path.open('rb') as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f'{path} is no MCAP file')
        offset = len(MAGIC)
        while offset + _RECORD.size <= size:
            kind, length = _RECORD.unpack(file.read(_RECORD.size))
            if offset + _RECORD.size + length > size:
                return
            yield offset, kind, file.read(length)
            offset += _RECORD.size + length


def scan(path: Path) -> Contents:
    """
    Read a file as far as it is whole.

    :raises RecordingError: it is no MCAP file, or cannot be read.
    """
    found = Contents()
    try:
        for offset, kind, content in _records(path):
            if kind == Opcode.DATA_END:
                found.whole = _has_footer(path)
                break
            if kind == Opcode.CHUNK and not _take_chunk(found, offset, content):
                break
            _take(found, offset, kind, content)
            found.end = offset + _RECORD.size + len(content)
    except OSError as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(f'{path} cannot be read: {error.strerror}') from error
    return found


def _has_footer(path: Path) -> bool:
    with path.open('rb') as file:
        file.seek(-len(MAGIC) - FOOTER_BYTES - _RECORD.size, os.SEEK_END)
        tail = file.read()
    return tail.endswith(MAGIC) and _RECORD.unpack_from(tail) == (Opcode.FOOTER, FOOTER_BYTES)


def _take_chunk(found: Contents, offset: int, content: bytes) -> bool:
    chunk = Chunk.read(ReadDataStream(BytesIO(content)))
    try:
        inside = breakup_chunk(chunk, validate_crc=True)
    except Exception:  # noqa: B902 - each compression has errors of its own
        return False
    builder = ChunkBuilder()
    counts: dict[int, int] = defaultdict(int)
    for record in inside:
        if isinstance(record, Schema):
            found.schemas[record.id] = record
            builder.add_schema(record)
        elif isinstance(record, Channel):
            found.channels[record.id] = record
            builder.add_channel(record)
        elif isinstance(record, Message):
            counts[record.channel_id] += 1
            builder.add_message(record)
    length = _RECORD.size + len(content)
    indices = RecordBuilder()
    offsets = {}
    for channel, index in builder.message_indices.items():
        offsets[channel] = offset + length + indices.count
        index.write(indices)
    written = indices.end()
    found.chunks.append((ChunkIndex(
        message_start_time=chunk.message_start_time, message_end_time=chunk.message_end_time,
        chunk_start_offset=offset, chunk_length=length, message_index_offsets=offsets,
        message_index_length=len(written), compression=chunk.compression,
        compressed_size=len(chunk.data), uncompressed_size=chunk.uncompressed_size),
        dict(counts), written))
    return True


def _take(found: Contents, offset: int, kind: int, content: bytes) -> None:
    stream, length = ReadDataStream(BytesIO(content)), _RECORD.size + len(content)
    if kind == Opcode.METADATA:
        found.metadata.append(MetadataIndex(offset, length, Metadata.read(stream).name))
    elif kind == Opcode.ATTACHMENT:
        one = Attachment.read(stream)
        found.attachments.append(AttachmentIndex(
            offset=offset, length=length, create_time=one.create_time, log_time=one.log_time,
            data_size=len(one.data), name=one.name, media_type=one.media_type))


def mend(path: Path) -> int:
    """
    Mend a file in place.

    :return: bytes that were taken off; -1 when nothing was to be mended.
    :raises RecordingError: it cannot be mended.
    """
    found = scan(path)
    if found.whole:
        return -1
    size = path.stat().st_size
    try:
        with path.open('r+b', buffering=0) as file:
            while True:
                end, indices = _end_of(found)
                tail = indices + summary(found, end + len(indices))
                file.truncate(end)
                file.seek(end)
                try:
                    left = memoryview(tail)
                    while left:
                        left = left[file.write(left):]
                    return size - end
                except OSError:
                    if not found.chunks:
                        raise
                    # No room even for that: the last second makes it.
                    found.end = found.chunks.pop()[0].chunk_start_offset
                    file.truncate(end)
                    found.metadata = [m for m in found.metadata if m.offset < found.end]
                    found.attachments = [a for a in found.attachments if a.offset < found.end]
    except OSError as error:
        raise RecordingError(f'{path} cannot be mended: {error.strerror}') from error


def _end_of(found: Contents) -> tuple[int, bytes]:
    """Give where the data ends, and the indices of the last chunk if they are not all there."""
    if found.chunks:
        index, _, written = found.chunks[-1]
        after = index.chunk_start_offset + index.chunk_length
        if after <= found.end < after + len(written):
            return after, written
    return found.end, b''


def file_facts(path: Path) -> FileFacts:
    """
    Say what a file holds, for ``metadata.yaml``.

    :raises RecordingError: as for :func:`scan`.
    """
    found = scan(path)
    facts = FileFacts(path.name)
    facts.first_ns = min((i.message_start_time for i, _, _ in found.chunks), default=0)
    facts.last_ns = max((i.message_end_time for i, _, _ in found.chunks), default=0)
    for number, channel in found.channels.items():
        schema = found.schemas[channel.schema_id]
        topic = TopicFacts(channel.topic, schema.name, channel.metadata.get(
            'topic_type_hash', type_hash(schema.name)))
        facts.counts[topic] = sum(inside.get(number, 0) for _, inside, _ in found.chunks)
    return facts


def bag_files(path: Path) -> list[Path]:
    """
    List the files of a recording in their order.

    :param path: a folder, or one file.
    :raises RecordingError: there is none.
    """
    if not path.is_dir():
        if not path.exists():
            raise RecordingError(f'{path} does not exist')
        return [path]

    def number(file: Path) -> tuple[int, str]:
        digits = file.stem.rpartition('_')[2]
        return (int(digits) if digits.isdigit() else -1, file.name)

    found = sorted(path.glob('*.mcap'), key=number)
    if not found:
        raise RecordingError(f'{path} holds no .mcap file')
    return found


def mend_all(path: Path) -> list[str]:
    """
    Mend all files of a recording and write its ``metadata.yaml`` anew.

    :param path: a folder, or one file of it.
    :return: what was done, a line a file.
    :raises RecordingError: one cannot be mended.
    """
    lines = []
    for file in bag_files(path):
        taken = mend(file)
        lines.append(f'{file}: whole' if taken < 0 else
                     f'{file}: mended, {taken} bytes at its end were taken off')
    folder = path if path.is_dir() else path.parent
    if path.is_dir() or (folder / METADATA).exists():
        try:
            write_bag_info(folder, [file_facts(file) for file in bag_files(folder)])
        except OSError as error:
            if isinstance(error, RecordingError):
                raise
            raise RecordingError(f'{folder / METADATA} cannot be written: '
                                 f'{error.strerror}') from error
        lines.append(f'{folder / METADATA}: written')
    return lines
