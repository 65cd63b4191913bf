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
Writes frames as a pcap file for Wireshark and tshark.

Times are in ns. The link type is 802.15.4 with checksum (195) or without (230).
"""

from __future__ import annotations

from struct import Struct
from typing import BinaryIO
from typing import Final

from rt_robot_os.base.units import NS_PER_S

WITH_FCS: Final = 195
WITHOUT_FCS: Final = 230
# The magic number of a file with times in ns.
MAGIC: Final = 0xA1B23C4D
LONGEST: Final = 127

_HEADER: Final = Struct('<IHHiIII')
_RECORD: Final = Struct('<IIII')
# Size of the frame check sequence.
_FCS_SIZE: Final = 2


class PcapWriter:
    """
    A pcap file of frames.

    :param file: opened for writing bytes; the caller closes it.
    :param with_fcs: include the frame check sequence; the link type depends on it.
    :ivar frames: number of frames written.
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

        :param frame: without length byte, with frame check sequence.
        :raises OSError: the file cannot be written.
        """
        data = frame if self._with_fcs else frame[:-_FCS_SIZE]
        seconds, ns = divmod(time_ns, NS_PER_S)
        self._file.write(_RECORD.pack(seconds, ns, len(data), len(data)) + data)
        self.frames += 1
