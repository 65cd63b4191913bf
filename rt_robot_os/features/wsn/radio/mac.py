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
Medium access and acknowledgements of TinyOS: CSMA/CA.

A mote waits for a random back-off, assesses the channel (CCA), and sends when it is clear; else it
waits again. The profiles differ in these times and in the acknowledgement.
"""

from __future__ import annotations

from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.radio.cc2420 import ACK_MPDU_BYTES
from rt_robot_os.features.wsn.radio.cc2420 import air_time_ns
from rt_robot_os.features.wsn.radio.cc2420 import CCA_THRESHOLD_DBM
from rt_robot_os.features.wsn.radio.cc2420 import TURNAROUND_NS

#: The tick of TinyOS' radio timers: 1/32768 s.
_JIFFY_NS: Final = 1_000_000_000 / 32_768
#: The time unit of TOSSIM: 65,536 symbols in a second.
_SYMBOL_NS: Final = 1_000_000_000 / 65_536


class MacProfile(NamedTuple):
    """
    Rules of the medium access.

    :ivar name: for scenarios and messages.
    :ivar version: of TinyOS: 1 or 2; determines the format of frames.
    :ivar unit_ns: of the back-offs.
    :ivar initial: back-off before a frame: minimum, number of values, step.
    :ivar congestion: the same, after a busy channel.
    :ivar second_cca_ns: from a clear channel to a second CCA, which avoids interrupting an
        acknowledgement; 0: none.
    :ivar turnaround_ns: from receiving to sending.
    :ivar cca_dbm: threshold of a busy channel.
    :ivar overhead_bytes: of a frame besides the payload of the active message.
    :ivar ack_delay_ns: from the end of a frame to the start of its acknowledgement.
    :ivar ack_wait_ns: timeout of the acknowledgement, from the end of the frame.
    :ivar ack_air_ns: air time of an acknowledgement.
    :ivar broadcast_acks: receivers acknowledge broadcast frames that request it.
    :ivar is_tossim: acknowledgements are not on the air but decided at the frame's end; a frame
        must be received at its start and at its end; one lost frame in a thousand is acknowledged.
    :ivar keeps_cut_off: a frame whose reception is cut off by a transmission stays in the
        receive FIFO, as on emulated motes with TinyOS 2; see ``simulator/receive_fifo.py``.
    """

    name: str
    version: int
    unit_ns: float
    initial: tuple[int, int, int]
    congestion: tuple[int, int, int]
    second_cca_ns: int
    turnaround_ns: int
    cca_dbm: float
    overhead_bytes: int
    ack_delay_ns: int
    ack_wait_ns: int
    ack_air_ns: int
    broadcast_acks: bool
    is_tossim: bool = False
    keeps_cut_off: bool = False

    def air_time_ns(self, payload_bytes: int, acknowledge: bool) -> int:
        """Return how long a frame occupies the channel."""
        if self.is_tossim:
            # In TOSSIM the channel stays busy for the acknowledgement.
            symbols = _TOSSIM_PREAMBLE + 2 * (payload_bytes + self.overhead_bytes)
            return round((symbols + _TOSSIM_ACK * acknowledge) * _SYMBOL_NS)
        return air_time_ns(payload_bytes + self.overhead_bytes)


_TOSSIM_PREAMBLE: Final = 12
_TOSSIM_ACK: Final = 34

TINYOS1: Final = MacProfile(
    name='tinyos1', version=1, unit_ns=_JIFFY_NS, initial=(10, 16, 10), congestion=(10, 64, 10),
    second_cca_ns=0, turnaround_ns=TURNAROUND_NS, cca_dbm=CCA_THRESHOLD_DBM, overhead_bytes=11,
    ack_delay_ns=TURNAROUND_NS, ack_wait_ns=round(75 * _JIFFY_NS),
    ack_air_ns=air_time_ns(ACK_MPDU_BYTES), broadcast_acks=False)
TINYOS2: Final = MacProfile(
    name='tinyos2', version=2, unit_ns=_JIFFY_NS, initial=(10, 310, 1), congestion=(10, 70, 1),
    second_cca_ns=round(7 * _JIFFY_NS), turnaround_ns=TURNAROUND_NS, cca_dbm=CCA_THRESHOLD_DBM,
    overhead_bytes=13, ack_delay_ns=783_000, ack_wait_ns=round(256 * _JIFFY_NS),
    ack_air_ns=air_time_ns(ACK_MPDU_BYTES), broadcast_acks=True)
TOSSIM: Final = MacProfile(
    name='tossim', version=2, unit_ns=_SYMBOL_NS, initial=(20, 620, 1), congestion=(20, 140, 1),
    second_cca_ns=0, turnaround_ns=round(11 * _SYMBOL_NS), cca_dbm=-72.0, overhead_bytes=9,
    ack_delay_ns=0, ack_wait_ns=round(11 * _SYMBOL_NS), ack_air_ns=0, broadcast_acks=False,
    is_tossim=True)

#: By name.
MAC_PROFILES: Final = {profile.name: profile for profile in (TINYOS1, TINYOS2, TOSSIM)}
