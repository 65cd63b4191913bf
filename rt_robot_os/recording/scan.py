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
Scan an MCAP file that may be truncated or damaged anywhere.

A damaged record gets a private record type, which readers skip. If the length of a record is
damaged, the next chunk is searched, and the bytes in between become one skipped record. The file
is not changed here; the changes are returned as ``patches``.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from mmap import ACCESS_READ
from mmap import mmap
from pathlib import Path
import struct
from typing import Final
import zlib

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment
from mcap.records import AttachmentIndex
from mcap.records import Channel
from mcap.records import ChunkIndex
from mcap.records import Footer
from mcap.records import Header
from mcap.records import MessageIndex
from mcap.records import Metadata
from mcap.records import MetadataIndex
from mcap.records import Schema

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.recording.chunk import message_indices
from rt_robot_os.recording.mcap_records import chunk_records
from rt_robot_os.recording.mcap_records import DamagedRecordError
from rt_robot_os.recording.mcap_records import MESSAGE
from rt_robot_os.recording.mcap_records import Message
from rt_robot_os.recording.mcap_records import parsed
from rt_robot_os.recording.mcap_records import RECORD
from rt_robot_os.recording.mcap_records import RECORD_BYTES_MAXIMUM
from rt_robot_os.recording.mcap_records import summary_definitions
from rt_robot_os.recording.mcap_records import unpacked
from rt_robot_os.recording.summary import Contents
from rt_robot_os.recording.summary import FOOTER_BYTES
from rt_robot_os.recording.summary import MAGIC
from rt_robot_os.recording.summary import PROFILE

# Kinds from 0x80 on are private; readers skip them.
_SKIPPED: Final = 0x80
_DATA: Final = frozenset((
    Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK,
    Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT, Opcode.METADATA))
_KINDS: Final = frozenset(range(Opcode.HEADER, Opcode.DATA_END + 1))
_DATA_END_BYTES: Final = 4
_LENGTH: Final = struct.Struct('<Q')
_FOOTER: Final = struct.Struct('<BQQQ')
# From the beginning of a chunk to the name of its compression, by which chunks are found.
_BEFORE_NAME: Final = RECORD.size + 28
_NAMES: Final = (b'\4\0\0\0zstd', b'\3\0\0\0lz4')
_JUMPS_MOST: Final = 1000


def scan(path: Path) -> Contents:
    """
    Find the intact records of a file.

    :raises RecordingError: it is not an MCAP file, or cannot be read.
    """
    try:
        with path.open('rb') as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise RecordingError(f'{path} is not an MCAP file')
            with mmap(file.fileno(), 0, access=ACCESS_READ) as data:
                found = _Scan(data, *summary_definitions(path)).found
    except OSError as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(f'{path} cannot be read: {error.strerror}') from error
    if not found.has_header and found.end > len(MAGIC):
        raise RecordingError(f'{path} cannot be repaired: it does not begin with a header')
    return found


def header(length: int | None = None) -> bytes:
    """
    Make the first record of a file whose header was lost.

    :param length: of the whole record; None for the shortest.
    """
    spare = 0 if length is None else length - len(header())
    builder = RecordBuilder()
    Header(PROFILE, ' ' * spare).write(builder)
    return bytes(builder.end())


class _Scan:
    """
    Scan the bytes of a file once.

    :param schemas: of the summary, as are the channels: a chunk that defines them may be lost.
    :ivar found: the intact content.
    """

    def __init__(self, data: mmap, schemas: dict[int, Schema], channels: dict[int, Channel]
                 ) -> None:
        self.found = Contents(schemas=schemas, channels=channels)
        self._data = data
        self._size = len(data)
        self._jumps = 0
        self._loose: list[int] = []
        offset = self.found.end
        while offset >= 0:
            offset = self._step(offset)
        if self.found.patches and not self.found.has_header:
            self._make_header()
        if self.found.chunks and not self.found.whole:
            # Messages outside of chunks are the rest of damaged chunks.
            self.found.patches += [(place, bytes((_SKIPPED | Opcode.MESSAGE,)))
                                   for place in self._loose]

    def _make_header(self) -> None:
        """Replace a skipped first record by a header, if it is long enough."""
        offset, patch = self.found.patches[0]
        length = RECORD.size + (RECORD.unpack(patch) if len(patch) == RECORD.size else
                                self._head(offset))[1]
        if offset == len(MAGIC) and length >= len(header()):
            self.found.patches[0] = (offset, header(length))
            self.found.has_header = True
        elif not (self.found.chunks or self.found.attachments or self.found.metadata):
            self.found.patches.clear()
            self.found.end = len(MAGIC)

    def _step(self, offset: int) -> int:
        """Read the record at an offset; return the offset of the next, -1 for none."""
        found = self.found
        kind, length = self._head(offset)
        end = offset + RECORD.size + length
        if kind < 0 or end > self._size or not self._plausible(end):
            return self._jump(offset)
        if offset == len(MAGIC) and kind != Opcode.HEADER:
            found.end = end
            self._skip(offset, kind)
        elif kind in _DATA:
            found.end = end
            try:
                self._add(offset, kind, self._data[offset + RECORD.size:end])
            except DamagedRecordError:
                self._skip(offset, kind)
        elif kind >= _SKIPPED:
            found.end = end
        else:
            # The end of the data, unless the type of a record in the middle is damaged.
            if kind == Opcode.DATA_END and length == _DATA_END_BYTES and self._has_summary(end):
                found.whole = not found.patches and self._adds_up(offset)
                return -1
            if self._next_chunk(end) < 0:
                return -1
            found.end = end
            self._skip(offset, kind)
        return found.end

    def _head(self, offset: int) -> tuple[int, int]:
        """Return kind and length of the record at an offset; -1 if it is not valid."""
        if offset + RECORD.size > self._size:
            return -1, 0
        kind, length = RECORD.unpack_from(self._data, offset)
        return (kind, length) if length <= RECORD_BYTES_MAXIMUM else (-1, 0)

    def _plausible(self, offset: int) -> bool:
        """Whether a record may begin at an offset, or the file ends."""
        if offset + RECORD.size > self._size:
            return True
        kind, _ = self._head(offset)
        return kind in _KINDS or kind >= _SKIPPED

    def _skip(self, offset: int, kind: int) -> None:
        self.found.patches.append((offset, bytes((_SKIPPED | kind,))))
        self.found.damaged += 1

    def _jump(self, offset: int) -> int:
        """Skip everything up to the next chunk; without one the file ends here."""
        self._jumps += 1
        following = self._next_chunk(offset + RECORD.size)
        if following < 0 or self._jumps > _JUMPS_MOST:
            return -1
        self.found.patches.append(
            (offset, RECORD.pack(_SKIPPED, following - offset - RECORD.size)))
        self.found.damaged += 1
        self.found.end = following
        return following

    def _next_chunk(self, offset: int) -> int:
        """Find the next compressed chunk; -1 for none."""
        places = []
        for name in _NAMES:
            place = offset - 1
            while (place := self._data.find(name, place + 1)) >= 0:
                begin = place - _BEFORE_NAME
                if begin < offset:
                    continue
                kind, length = self._head(begin)
                if kind == Opcode.CHUNK and begin + RECORD.size + length <= self._size and (
                        self._plausible(begin + RECORD.size + length)):
                    places.append(begin)
                    break
        return min(places, default=-1)

    def _adds_up(self, data_end: int) -> bool:
        """Whether the checksum of the data is right, or missing."""
        crc = int.from_bytes(self._data[data_end + RECORD.size:][:_DATA_END_BYTES], 'little')
        return crc in (0, zlib.crc32(memoryview(self._data)[:data_end]) if crc else 0)

    def _has_summary(self, start: int) -> bool:
        """Whether the summary at an offset is intact."""
        tail = self._size - len(MAGIC) - FOOTER_BYTES - RECORD.size
        if tail < start or self._data[-len(MAGIC):] != MAGIC or (
                self._head(tail) != (Opcode.FOOTER, FOOTER_BYTES)):
            return False
        footer = parsed(Footer.read, self._data[tail + RECORD.size:-len(MAGIC)])
        crc = zlib.crc32(_FOOTER.pack(
            Opcode.FOOTER, FOOTER_BYTES, footer.summary_start, footer.summary_offset_start),
            zlib.crc32(self._data[start:tail]))
        return footer.summary_start in (0, start) and footer.summary_crc in (0, crc)

    # ---- records -----------------------------------------------------------------------------

    def _add(self, offset: int, kind: int, content: bytes) -> None:
        """
        Add a record of the data to the contents.

        :raises DamagedRecordError: it is damaged.
        """
        found = self.found
        length = RECORD.size + len(content)
        if kind == Opcode.MESSAGE:
            self._add_loose(offset, content)
        elif kind == Opcode.SCHEMA:
            schema = parsed(Schema.read, content)
            found.schemas[schema.id] = schema
        elif kind == Opcode.CHANNEL:
            channel = parsed(Channel.read, content)
            found.channels[channel.id] = channel
        elif kind == Opcode.HEADER:
            parsed(Header.read, content)
            found.has_header = True
        elif kind == Opcode.CHUNK:
            self._add_chunk(offset, content)
        elif kind == Opcode.MESSAGE_INDEX:
            parsed(MessageIndex.read, content)  # without a chunk: harmless
        elif kind == Opcode.METADATA:
            name = parsed(Metadata.read, content).name
            found.metadata.append(MetadataIndex(offset, length, name))
        elif kind == Opcode.ATTACHMENT:
            one = parsed(Attachment.read, content)
            crc = int.from_bytes(content[-4:], 'little')
            if crc and crc != zlib.crc32(content[:-4]):
                raise DamagedRecordError('an attachment with a wrong checksum')
            found.attachments.append(AttachmentIndex(
                offset=offset, length=length, create_time=one.create_time, log_time=one.log_time,
                data_size=len(one.data), name=one.name, media_type=one.media_type))

    def _add_loose(self, offset: int, content: bytes) -> None:
        """Add a message outside of any chunk, as other writers may write all messages."""
        if len(content) < MESSAGE.size:
            raise DamagedRecordError(f'a message of {len(content)} bytes')
        channel, _, log_ns, _ = MESSAGE.unpack_from(content)
        if channel not in self.found.channels:
            raise DamagedRecordError(f'a message of channel {channel}, which is not defined')
        self.found.loose.add(channel, log_ns)
        self._loose.append(offset)

    def _add_chunk(self, offset: int, content: bytes) -> None:
        found, chunk = self.found, unpacked(content)
        schemas, channels = dict(found.schemas), dict(found.channels)
        indices: dict[int, array[int]] = {}
        for record in chunk_records(chunk):
            if isinstance(record, Message):
                index = indices.get(record.channel)
                if index is None:
                    if record.channel not in channels:
                        raise DamagedRecordError(f'a message of channel {record.channel}, which '
                                                 'is in no chunk before')
                    index = indices[record.channel] = array('Q')
                index.append(record.log_ns)
                index.append(record.offset)
            elif isinstance(record, Schema):
                schemas[record.id] = record
            elif record.schema_id in schemas:
                channels[record.id] = record
            else:
                raise DamagedRecordError(f'a channel of schema {record.schema_id}, which is not '
                                         'defined')
        found.schemas, found.channels = schemas, channels
        written, offsets, counts = message_indices(indices, found.end)
        chunk_length = found.end - offset
        length = len(written)
        if self._data[found.end:found.end + length] != written[:self._size - found.end]:
            kind, following = self._head(found.end)
            if kind != Opcode.MESSAGE_INDEX and (kind in _KINDS or kind >= _SKIPPED) and (
                    found.end + RECORD.size + following <= self._size
                    and written[1:RECORD.size] != _LENGTH.pack(following)):
                offsets, length, written = {}, 0, b''  # it has no indices
            elif (others := self._other_indices(indices)) is not None:
                offsets, length = others
                written = b''
            elif self._plausible(found.end + length):
                found.patches.append((found.end, written))
                found.damaged += 1
            else:
                offsets, length, written = {}, 0, b''
        found.end = min(found.end + length, self._size)
        times = (min((min(index[::2]) for index in indices.values()), default=chunk.first_ns),
                 max((max(index[::2]) for index in indices.values()), default=chunk.last_ns))
        if times != (chunk.first_ns, chunk.last_ns):  # not protected by a checksum
            found.patches.append((offset + RECORD.size, struct.pack('<QQ', *times)))
        found.chunks.append((ChunkIndex(
            message_start_time=times[0], message_end_time=times[1],
            chunk_start_offset=offset, chunk_length=chunk_length,
            message_index_offsets=offsets, message_index_length=length,
            compression=chunk.compression, compressed_size=chunk.packed_bytes,
            uncompressed_size=len(chunk.data)), counts, written))

    def _other_indices(self, indices: Mapping[int, array[int]]
                       ) -> tuple[dict[int, int], int] | None:
        """Search the same indices in another order, as other writers write them."""
        left = {channel: sorted(zip(index[::2], index[1::2]))
                for channel, index in indices.items()}
        offsets: dict[int, int] = {}
        offset = start = self.found.end
        while True:
            kind, length = self._head(offset)
            end = offset + RECORD.size + length
            if kind != Opcode.MESSAGE_INDEX or end > self._size:
                return None if left else (offsets, offset - start)
            try:
                one = parsed(MessageIndex.read, self._data[offset + RECORD.size:end])
            except DamagedRecordError:
                return None
            if one.records and left.pop(one.channel_id, None) != sorted(one.records):
                return None
            offsets[one.channel_id] = offset
            offset = end
