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
Build chunks of messages in batches.

The library's writer needs an object and six small writes for each message; at 10 000 messages per
second that is most of a recorder's time. Here a message costs two appends to a list. The other
records (chunk, index, schema, channel) are made by the library.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable
from collections.abc import Mapping
import struct
import sys
from typing import Any
from typing import Final
import zlib

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel
from mcap.records import Chunk
from mcap.records import ChunkIndex
from mcap.records import Schema

COMPRESSIONS: Final = ('zstd', 'lz4', 'none')
# Kind and length of the record, channel, sequence, log time, publish time.
_MESSAGE: Final = struct.Struct('<BQHIQQ')
_BODY_BYTES: Final = _MESSAGE.size - 9
_INDEX: Final = struct.Struct('<BQHI')
_ZSTD_LEVEL: Final = 1

Compress = Callable[[bytes], bytes]


def compressor(name: str) -> Compress:
    """Return the function that compresses a chunk."""
    if name == 'zstd':
        import zstandard
        return zstandard.ZstdCompressor(level=_ZSTD_LEVEL).compress
    if name == 'lz4':
        import lz4.frame
        compress: Compress = lz4.frame.compress
        return compress
    return bytes


def message_indices(indices: Mapping[int, array[int]], offset: int
                    ) -> tuple[bytes, dict[int, int], dict[int, int]]:
    """
    Make the message indices after a chunk: the offsets of the messages of each channel.

    :param indices: by channel, alternately time and offset of each message.
    :param offset: of the indices in the file.
    :return: the records, the offset of each in the file, the number of messages; by channel.
    """
    made, offsets, counts = bytearray(), {}, {}
    for channel, index in indices.items():
        offsets[channel] = offset + len(made)
        counts[channel] = len(index) // 2
        if sys.byteorder == 'big':
            index.byteswap()
        body = index.tobytes()
        made += _INDEX.pack(Opcode.MESSAGE_INDEX, 6 + len(body), channel, len(body)) + body
    return bytes(made), offsets, counts


class ChunkWriter:
    """
    Collect messages for a chunk.

    :param repeats: each chunk repeats all definitions, so that it can be read on its own.
    :ivar size: bytes collected.
    """

    def __init__(self, compression: str, repeats: bool = False) -> None:
        self.size = 0
        self._repeats = repeats
        self._defined: list[bytes] = []
        self._name = '' if compression == 'none' else compression
        self._compress = compressor(compression)
        self._parts: list[Any] = []
        self._indices: dict[int, array[int]] = {}

    @property
    def empty(self) -> bool:
        """Whether there is no message."""
        return not self._indices

    def define(self, record: Schema | Channel) -> None:
        """Add a schema or a channel."""
        builder = RecordBuilder()
        record.write(builder)
        data = bytes(builder.end())
        self._parts.append(data)
        self.size += len(data)
        if self._repeats:
            self._defined.append(data)

    def add(self, channel: int, log_ns: int, cdr: Any, publish_ns: int, sequence: int) -> None:
        """Add a message."""
        index = self._indices.get(channel)
        if index is None:
            index = self._indices[channel] = array('Q')
        index.append(log_ns)
        index.append(self.size)
        length = len(cdr)
        self._parts.append(_MESSAGE.pack(Opcode.MESSAGE, _BODY_BYTES + length, channel, sequence,
                                         log_ns, publish_ns))
        self._parts.append(cdr)
        self.size += _MESSAGE.size + length

    def take(self, offset: int) -> tuple[bytes, ChunkIndex, dict[int, int], bytes]:
        """
        Return the collected chunk, and start the next one.

        :param offset: of the chunk in the file.
        :return: the record, its index for the summary, messages of each channel, the indices.
        """
        data = b''.join(self._parts)
        packed = self._compress(data)
        first_ns = min(min(index[::2]) for index in self._indices.values())
        last_ns = max(max(index[::2]) for index in self._indices.values())
        builder = RecordBuilder()
        Chunk(compression=self._name, data=packed, message_start_time=first_ns,
              message_end_time=last_ns, uncompressed_crc=zlib.crc32(data),
              uncompressed_size=len(data)).write(builder)
        record = bytes(builder.end())
        indices, offsets, counts = message_indices(self._indices, offset + len(record))
        place = ChunkIndex(
            message_start_time=first_ns, message_end_time=last_ns, chunk_start_offset=offset,
            chunk_length=len(record), message_index_offsets=offsets,
            message_index_length=len(indices), compression=self._name,
            compressed_size=len(packed), uncompressed_size=len(data))
        self._parts = list(self._defined)
        self._indices.clear()
        self.size = sum(map(len, self._defined))
        return record, place, counts, indices
