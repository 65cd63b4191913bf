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
Writes what is on the air as a pcap file, which Wireshark and tshark read.

Times are in ns. The link type is 802.15.4 with checksum (195) or without (230).
"""

from __future__ import annotations

from binascii import crc_hqx
from struct import Struct
from typing import BinaryIO
from typing import Final

from rt_robot_os.units import NS_PER_S

WITH_FCS: Final = 195
WITHOUT_FCS: Final = 230
# The magic number of a file with times in ns.
MAGIC: Final = 0xA1B23C4D
LONGEST: Final = 127

_HEADER: Final = Struct('<IHHiIII')
_RECORD: Final = Struct('<IIII')
_REVERSED: Final = bytes(int(f'{value:08b}'[::-1], 2) for value in range(256))


def fcs(frame: bytes) -> bytes:
    """Return the checksum of a frame as it follows it on the air: CRC-16 of ITU-T, reflected."""
    crc = crc_hqx(frame.translate(_REVERSED), 0)
    return bytes((_REVERSED[crc >> 8], _REVERSED[crc & 0xFF]))


class PcapWriter:
    """
    A file of frames.

    :param file: opened for writing bytes; the caller closes it.
    :param with_fcs: the frames have their checksum at the end, and the link type says so.
    :ivar frames: how many were written.
    """

    def __init__(self, file: BinaryIO, with_fcs: bool = True) -> None:
        self._file = file
        self._with_fcs = with_fcs
        self.frames = 0
        file.write(_HEADER.pack(MAGIC, 2, 4, 0, 0, LONGEST,
                                WITH_FCS if with_fcs else WITHOUT_FCS))

    def write(self, time_ns: int, frame: bytes) -> None:
        """
        Append a frame.

        :param frame: without length byte and without checksum.
        :raises OSError: it cannot be written.
        """
        data = frame + fcs(frame) if self._with_fcs else frame
        seconds, ns = divmod(time_ns, NS_PER_S)
        self._file.write(_RECORD.pack(seconds, ns, len(data), len(data)) + data)
        self.frames += 1
