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


"""Records the frames on the air in a pcap file, byte for byte as a sniffer receives them."""

from __future__ import annotations

from heapq import heappop
from heapq import heappush
from typing import BinaryIO
from typing import Final

from rt_robot_os.features.wsn.packets.ieee802154 import ACK_REQUEST
from rt_robot_os.features.wsn.packets.ieee802154 import AckFrame
from rt_robot_os.features.wsn.packets.ieee802154 import FCF_T2_DATA
from rt_robot_os.features.wsn.packets.ieee802154 import PAN_T2
from rt_robot_os.features.wsn.packets.ieee802154 import T1Frame
from rt_robot_os.features.wsn.packets.ieee802154 import T2Frame
from rt_robot_os.features.wsn.packets.tos_msg import FCF_DATA
from rt_robot_os.features.wsn.packets.tos_msg import GROUP
from rt_robot_os.features.wsn.radio.mac import MacProfile
from rt_robot_os.features.wsn.simulator.air import ACK
from rt_robot_os.features.wsn.simulator.air import Transmission
from rt_robot_os.features.wsn.simulator.pcap import PcapWriter

# The longest time that a frame is on the air.
_LONGEST_NS: Final = 10_000_000


def bytes_of(frame: Transmission, version: int) -> bytes:
    """
    Return a frame from the length byte to the frame check sequence.

    :param version: of TinyOS.
    """
    if frame.am_type == ACK:
        return AckFrame(frame.dsn).pack()
    asks = ACK_REQUEST if frame.acknowledge else 0
    pan = frame.sender.pan
    if version == 1:
        return T1Frame(frame.destination, frame.am_type, frame.payload, GROUP + pan, frame.dsn,
                       FCF_DATA | asks).pack()
    return T2Frame(frame.destination, frame.sender.address, frame.am_type, frame.payload,
                   dsn=frame.dsn, fcf=FCF_T2_DATA | asks, pan=PAN_T2 + pan).pack()


class AirLog:
    """
    Writes every frame that is sent, including frames that no node receives.

    :param file: opened for writing bytes; the caller closes it.
    :param with_fcs: see :class:`.PcapWriter`.
    """

    def __init__(self, file: BinaryIO, mac: MacProfile, with_fcs: bool = True) -> None:
        self._writer = PcapWriter(file, with_fcs)
        self._version = mac.version
        self._waiting: list[tuple[int, int, bytes]] = []
        self._number = 0

    @property
    def frames(self) -> int:
        """Return the number of frames written."""
        return self._writer.frames

    def __call__(self, frame: Transmission) -> None:
        """Write a frame; see ``OnFrame``."""
        self._number += 1
        heappush(self._waiting, (frame.begin_ns, self._number,
                                 bytes_of(frame, self._version)[1:]))
        self._write_before(frame.end_ns - _LONGEST_NS)

    def flush(self) -> None:
        """Write the frames that are still buffered."""
        self._write_before(None)

    def _write_before(self, time_ns: int | None) -> None:
        """Write frames in order of their begin; they are reported at their end."""
        while self._waiting and (time_ns is None or self._waiting[0][0] < time_ns):
            begin_ns, _, data = heappop(self._waiting)
            self._writer.write(begin_ns, data)
