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
Reader of recordings: bytes of a serial line, CSV of frames or air, pcap; also gzipped.

The first bytes of a file, not its name, determine its format.
"""

from __future__ import annotations

from collections.abc import Iterator
import csv
import gzip
import io
from itertools import chain
import math
import os
import re
import stat
from struct import Struct
import sys
from typing import cast
from typing import Final
import zlib

from rt_robot_os.base.errors import RecordingError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.cli.captured_packet import AIR
from rt_robot_os.features.wsn.cli.captured_packet import CapturedPacket
from rt_robot_os.features.wsn.cli.captured_packet import SERIAL
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import read_content
from rt_robot_os.features.wsn.packets.ieee802154 import fcs

STANDARD_INPUT: Final = '-'
_CHUNK: Final = 65_536
_GZIP: Final = b'\x1f\x8b'
# Magic numbers of pcap, in the order of the bytes in the file -> byte order, times in ns.
_PCAP: Final = {b'\xd4\xc3\xb2\xa1': ('<', False), b'\xa1\xb2\xc3\xd4': ('>', False),
                b'\x4d\x3c\xb2\xa1': ('<', True), b'\xa1\xb2\x3c\x4d': ('>', True)}
_PCAPNG: Final = b'\x0a\x0d\x0d\x0a'
_WITH_FCS, _WITHOUT_FCS, _TAP = 195, 230, 283
_LONGEST_RECORD: Final = 262_144
_CSV: Final = re.compile(rb'[ -~]*hex[ -~]*\r?\n|[\d.]+,(\d+,)?[0-9A-Fa-f ]+(,[ \d]*)?\r?\n')
_US: Final = 1e-6


class PacketRecording:
    """
    A file; iterating it yields its packets.

    :ivar reader: of the frames, with the counters of rejected ones.
    :ivar bad_lines: number of CSV lines without a frame.
    """

    def __init__(self, path: str) -> None:
        """
        Open a file.

        :param path: ``-`` is the standard input.
        :raises RecordingError: it cannot be read.
        """
        self.path = path
        self.reader = FrameReader()
        self.bad_lines = 0
        try:
            self._opened = (
                cast(io.BufferedReader, sys.stdin.buffer) if path == STANDARD_INPUT
                else open(path, 'rb'))
            is_gzip = self._opened.peek(2)[:2] == _GZIP
        except OSError as error:
            raise RecordingError(f'{path} cannot be read: {error.strerror}') from error
        self._file = gzip.GzipFile(fileobj=self._opened) if is_gzip else self._opened

    def __iter__(self) -> Iterator[CapturedPacket]:
        """
        Yield the packets, in order.

        :raises RecordingError: the rest cannot be read.
        """
        try:
            head = self._file.peek(512)[:512]
            if head[:4] in _PCAP:
                yield from self._pcap(*_PCAP[head[:4]])
            elif head[:4] == _PCAPNG:
                raise RecordingError(f'{self.path} is a pcapng: convert it with '
                                     'tshark -F pcap -r FILE -w NEW')
            elif _CSV.match(head):
                yield from self._csv()
            else:
                yield from self._line()
        except RecordingError:
            raise
        except (OSError, EOFError, zlib.error) as error:
            raise RecordingError(f'{self.path} cannot be read any further: {error}') from error

    def close(self) -> None:
        """Close the file; may be repeated."""
        if self.path != STANDARD_INPUT:
            self._file.close()
            self._opened.close()

    def _line(self) -> Iterator[CapturedPacket]:
        # Partial reads, so that a pipe is read as it is written.
        while data := self._file.read1(_CHUNK):
            for each in self.reader.feed(data):
                yield CapturedPacket(None, SERIAL, each.protocol, each.token, each.packet)
        self.reader.reset()

    def _csv(self) -> Iterator[CapturedPacket]:
        # Lines of bytes end only at line feeds.
        text: Iterator[str] = (line.decode(errors='replace') for line in self._file)
        first = next(text)
        names = next(csv.reader([first]))
        if 'hex' not in first:  # no header: the first line is a frame
            names = ['t_us', 'hex'] if len(names) == 2 else ['t_us', 'source', 'mpdu_hex']
            text = chain([first], text)
        content = next(name for name in names if 'hex' in name)
        for line in text:
            try:
                row = dict(zip(names, next(csv.reader([line]), [])))
                time_s = float(row.get('t_us') or 'nan') * _US
                data = bytes.fromhex(row[content])
            except (ValueError, KeyError, csv.Error):
                self.bad_lines += 1
            else:
                yield from self._row(time_s, data, 'mpdu' in content)

    def _row(self, time_s: float, data: bytes, is_air: bool) -> Iterator[CapturedPacket]:
        when = time_s if math.isfinite(time_s) else None
        if is_air:
            # Some recordings lack the length byte.
            if not data or data[0] != len(data) - 1:
                data = bytes((len(data) & 0xFF,)) + data
            yield CapturedPacket(when, AIR, -1, -1, data)
            return
        found = [read_content(data)] if data[:1] != b'\x7e' else self.reader.feed(data)
        for each in found:
            if each is None:
                self.reader.rejected_frames += 1
                self.reader.rejected_bytes += len(data)
            else:
                yield CapturedPacket(when, SERIAL, each.protocol, each.token, each.packet)

    def _pcap(self, order: str, in_ns: bool) -> Iterator[CapturedPacket]:
        header = self._file.read(24)
        link = Struct(f'{order}I').unpack(header[20:24])[0] & 0xFFFF if len(header) == 24 else -1
        if link not in (_WITH_FCS, _WITHOUT_FCS, _TAP):
            raise RecordingError(f'{self.path} is not of 802.15.4 (link type {link}): must be '
                                 f'{_WITH_FCS}, {_WITHOUT_FCS} or {_TAP}')
        record = Struct(f'{order}IIII')
        while len(head := self._file.read(record.size)) == record.size:
            seconds, part, size, _ = record.unpack(head)
            data = self._file.read(min(size, _LONGEST_RECORD))
            if size > _LONGEST_RECORD or len(data) < size:
                raise RecordingError(
                    f'{self.path} is truncated or damaged: a frame of {size} bytes')
            time_s = seconds + part / (NS_PER_S if in_ns else 1_000_000)
            if link == _TAP and len(data) >= 4:
                data = data[int.from_bytes(data[2:4], 'little'):]
            if link == _WITHOUT_FCS:
                data += fcs(data)
            yield CapturedPacket(time_s, AIR, -1, -1, bytes((len(data) & 0xFF,)) + data)


def is_recording(where: str) -> bool:
    """Return whether it is a file, not a port or an address."""
    return where == STANDARD_INPUT or '://' not in where and not _is_port(where)


def _is_port(path: str) -> bool:
    try:
        return stat.S_ISCHR(os.stat(path).st_mode)
    except OSError:
        return path.startswith('/dev/')
