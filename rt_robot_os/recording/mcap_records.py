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
Read the records of an MCAP file with limits: a file may be damaged or come from an unknown source.

A few kilobytes can decompress to gigabytes, and any length may be wrong. So nothing is read or
allocated beyond the limits below, and every problem of a record is a :class:`DamagedRecordError`.
Messages are parsed here, at a microsecond each; rare records are parsed by the library.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
import struct
from typing import Final
from typing import NamedTuple
from typing import TypeVar
import zlib

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel
from mcap.records import Schema

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.base.needs import lacking
from rt_robot_os.recording.summary import MAGIC

# The limit of a chunk; the recorder writes 1 MiB and a message.
CHUNK_BYTES_MAXIMUM: Final = 64 << 20
RECORD_BYTES_MAXIMUM: Final = 2 * CHUNK_BYTES_MAXIMUM
# Messages differ in number and time, which needs more than a byte each in any compression.
MESSAGES_ALLOWED: Final = 4096
RECORD: Final = struct.Struct('<BQ')
_CHUNK: Final = struct.Struct('<QQQII')
_LENGTH: Final = struct.Struct('<Q')
# Channel, sequence, log time, publish time.
MESSAGE: Final = struct.Struct('<HIQQ')

_T = TypeVar('_T')


class DamagedRecordError(RecordingError):
    """A record that is not valid; the message gives the problem."""


class Message(NamedTuple):
    """
    A message of a chunk.

    :ivar offset: of its record in the chunk.
    """

    channel: int
    sequence: int
    log_ns: int
    publish_ns: int
    data: bytes
    offset: int


class ChunkData(NamedTuple):
    """
    A chunk, decompressed.

    :ivar packed_bytes: its length in the file.
    """

    first_ns: int
    last_ns: int
    compression: str
    packed_bytes: int
    data: bytes


def summary_definitions(path: Path) -> tuple[dict[int, Schema], dict[int, Channel]]:
    """
    Read the schemas and channels from the summary of a file.

    :return: by number; empty for a file without a valid summary.
    """
    try:
        with path.open('rb') as stream:
            found = make_reader(stream, validate_crcs=True).get_summary()
    except Exception:  # noqa: B902 - it raises whatever its parts do
        return {}, {}
    return ({}, {}) if found is None else (dict(found.schemas), dict(found.channels))


class _WholeReads(ReadDataStream):
    """A stream that returns the requested number of bytes, or raises."""

    def read(self, length: int) -> bytes:
        data: bytes = super().read(length)
        if len(data) != length:
            raise EOFError(f'{len(data)} bytes where {length} should be')
        return data


def file_records(path: Path, offset: int = len(MAGIC)) -> Iterator[tuple[int, int, bytes]]:
    """
    Yield offset, kind and content of each complete record, up to an incomplete one.

    :param offset: of the first record.
    :raises DamagedRecordError: a record is longer than the limit.
    :raises RecordingError: it is not an MCAP file.
    :raises OSError: it cannot be read.
    """
    size = path.stat().st_size
    with path.open('rb') as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f'{path} is not an MCAP file')
        file.seek(offset)
        while offset + RECORD.size <= size:
            kind, length = RECORD.unpack(file.read(RECORD.size))
            if offset + RECORD.size + length > size:
                return
            if length > RECORD_BYTES_MAXIMUM:
                raise DamagedRecordError(f'at byte {offset}: a record of {length} bytes; at most '
                                         f'{RECORD_BYTES_MAXIMUM} can be read')
            yield offset, kind, file.read(length)
            offset += RECORD.size + length


def parsed(read: Callable[[ReadDataStream], _T], content: bytes) -> _T:
    """
    Parse a record with the library.

    :param read: such as ``Metadata.read``.
    :raises DamagedRecordError: it is not valid.
    """
    stream = _WholeReads(BytesIO(content))
    try:
        found = read(stream)
    except Exception as error:  # noqa: B902 - it raises whatever its parts do
        raise DamagedRecordError(f'{type(error).__name__} {error}'.strip()) from error
    if stream.count != len(content):
        raise DamagedRecordError(f'{len(content) - stream.count} bytes too many')
    return found


def unpacked(content: bytes) -> ChunkData:
    """
    Decompress a chunk and check its checksum.

    :raises DamagedRecordError: it is damaged, or longer than ``CHUNK_BYTES_MAXIMUM``.
    """
    try:
        first_ns, last_ns, size, crc, length = _CHUNK.unpack_from(content)
        start = _CHUNK.size + length + _LENGTH.size
        compression = content[_CHUNK.size:start - _LENGTH.size].decode('ascii')
        packed_bytes, = _LENGTH.unpack_from(content, start - _LENGTH.size)
    except (struct.error, UnicodeDecodeError) as error:
        raise DamagedRecordError(f'a chunk without a header: {error}') from error
    if start + packed_bytes != len(content):
        raise DamagedRecordError(f'a chunk of {packed_bytes} bytes in {len(content)}')
    if size > CHUNK_BYTES_MAXIMUM:
        raise DamagedRecordError(f'a chunk of {size} bytes when decompressed; at most '
                                 f'{CHUNK_BYTES_MAXIMUM} can be read')
    data = _decompressed(compression, content[start:], size)
    if len(data) != size or (crc and zlib.crc32(data) != crc):
        raise DamagedRecordError('a chunk with a wrong checksum')
    return ChunkData(first_ns, last_ns, compression, packed_bytes, data)


def _decompressed(compression: str, packed: bytes, size: int) -> bytes:
    """Decompress a complete frame, at most one byte more than expected."""
    try:
        if not compression:
            return packed
        if compression == 'zstd':
            import zstandard
            # The length in a frame overrides any limit.
            if zstandard.frame_content_size(packed) not in (-1, size):
                raise DamagedRecordError('a chunk with two different lengths')
            return bytes(zstandard.ZstdDecompressor().decompress(packed, size))
        if compression == 'lz4':
            import lz4.frame
            lz4_frame = lz4.frame.LZ4FrameDecompressor()
            data = bytes(lz4_frame.decompress(packed, size + 1))
            if not lz4_frame.eof:
                raise DamagedRecordError('a chunk that does not end')
            return data
    except ImportError as error:
        raise RecordingError(
            lacking(f'a chunk that is compressed with {compression}',
                    'zstandard' if compression == 'zstd' else 'lz4') or str(error)) from error
    except DamagedRecordError:
        raise
    except Exception as error:  # noqa: B902 - each compression has errors of its own
        raise DamagedRecordError(f'a chunk cannot be decompressed: {error}') from error
    raise DamagedRecordError(f'a chunk compressed with {compression!r}, which is unknown')


def chunk_records(chunk: ChunkData) -> Iterator[Schema | Channel | Message]:
    """
    Yield the records of a chunk.

    :raises DamagedRecordError: a record is not valid in a chunk, or there are more messages than
        distinct ones can fit in the compressed length.
    """
    data = chunk.data
    offset, size, left = 0, len(data), MESSAGES_ALLOWED + chunk.packed_bytes
    head, message = RECORD.unpack_from, MESSAGE.unpack_from
    while offset < size:
        begin = offset + RECORD.size
        kind, length = head(data, offset) if begin <= size else (0, size)
        end = begin + length
        if end > size:
            raise DamagedRecordError('a chunk that ends within a record')
        if kind == Opcode.MESSAGE:
            if length < MESSAGE.size:
                raise DamagedRecordError(f'a message of {length} bytes')
            left -= 1
            if left < 0:
                raise DamagedRecordError(f'more messages than {chunk.packed_bytes} bytes can hold')
            channel, sequence, log_ns, publish_ns = message(data, begin)
            yield Message(channel, sequence, log_ns, publish_ns, data[begin + MESSAGE.size:end],
                          offset)
        elif kind == Opcode.SCHEMA:
            yield parsed(Schema.read, data[begin:end])
        elif kind == Opcode.CHANNEL:
            yield parsed(Channel.read, data[begin:end])
        else:
            raise DamagedRecordError(f'a record of kind {kind} in a chunk')
        offset = end
