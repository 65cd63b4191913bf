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
The serial side of a sink's mote: what a root or base station of TinyOS sends and receives.

It has no port and no clock: a callable receives the bytes for the host, and the caller passes the
time. Bytes leave at the speed of the line, so a burst fills the queue of frames.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Mapping
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.debug import CollectionDebug
from rt_robot_os.features.wsn.packets.debug import LqiDebug
from rt_robot_os.features.wsn.packets.framing import Frame
from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import Protocols
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.framing import TINYOS_2
from rt_robot_os.features.wsn.packets.framing import UNKNOWN_PROTOCOL
from rt_robot_os.features.wsn.packets.multihop_lqi import UART_ADDRESS
from rt_robot_os.features.wsn.packets.oscilloscope import Oscilloscope
from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.packets.surge import SurgeCmd
from rt_robot_os.features.wsn.packets.tos_msg import FCF_DATA
from rt_robot_os.features.wsn.packets.tos_msg import FCF_DATA_ACK
from rt_robot_os.features.wsn.packets.tos_msg import GROUP
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.features.wsn.routing.protocol import BROADCAST

#: Capacity of the queues for the serial line and the radio, as in TOSBase and BaseStation.
QUEUE: Final = 12
GROUP_T2: Final = 0x22
_BITS_PER_BYTE: Final = 10
_NS_PER_S: Final = 1_000_000_000
_U16: Final = 0xFFFF
_ROOT_SOURCE: Final = b'\0\0'
# Event of a routing protocol -> event of TinyOS' debug messages, and whether it is about routing.
_EVENTS: Final[Mapping[str, tuple[int, bool]]] = {
    'data_heard': (0x21, False), 'loop': (0x18, False), 'given_up': (0x26, False),
    'no_parent': (0x30, True), 'no_route': (0x30, True), 'parent': (0x31, True),
    'beacon_sent': (0x33, True), 'beacon_heard': (0x34, True),
}


class Station(NamedTuple):
    """
    A program on the sink's mote.

    :ivar name: of the program.
    :ivar protocols: of its generation of TinyOS.
    :ivar baud: usual speed of its line.
    :ivar sniffs: it forwards each frame that its radio receives, and sends any frame.
    :ivar debug: its debug messages; None: it has none.
    """

    name: str
    protocols: Protocols
    baud: int
    sniffs: bool = False
    debug: type[CollectionDebug] | None = None


#: By the names of the settings.
STATIONS: Final = {each.name: each for each in (
    Station('surge', TINYOS_1, 57600),
    Station('tosbase', TINYOS_1, 57600, sniffs=True),
    Station('multihop_oscilloscope', TINYOS_2, 115200, debug=CollectionDebug),
    Station('multihop_oscilloscope_lqi', TINYOS_2, 115200, debug=LqiDebug),
    Station('base_station', TINYOS_2, 115200, sniffs=True),
)}


class Outgoing(NamedTuple):
    """
    A packet from the host, for the radio.

    :ivar destination: of the frame on the air.
    :ivar payload: of the active message.
    """

    destination: int
    am_type: int
    payload: bytes


class BaseStation:
    """
    What a sink's mote does between its radio and its serial line.

    :ivar station: its program.
    :ivar sent: packets sent on the line.
    :ivar line_full: packets dropped because the queue for the line was full.
    :ivar taken: packets accepted from the host.
    :ivar radio_full: packets from the host dropped by a full queue, without an acknowledgement.
    :ivar refused: packets from the host that were invalid or not for this program.
    """

    def __init__(self, station: Station, to_host: Callable[[bytes, int], object],
                 to_radio: Callable[[Outgoing], bool], baud: int = 0, group: int = -1,
                 am_type: int = Oscilloscope.AM_TYPE) -> None:
        """
        Create a base station with empty queues.

        :param to_host: called with bytes for the line, and the start of their transmission in ns.
        :param to_radio: starts to send a packet; returns False while another one is being sent.
        :param baud: of the line; 0: transmission takes no time.
        :param group: of the network; -1: the default group.
        :param am_type: of data on the line, if a root of TinyOS 2.x removes the routing header.
        """
        self.station = station
        self.sent = self.line_full = self.taken = self.radio_full = self.refused = 0
        self._to_host = to_host
        self._to_radio = to_radio
        self._byte_ns = _BITS_PER_BYTE * _NS_PER_S // baud if baud else 0
        usual = GROUP if station.protocols is TINYOS_1 else GROUP_T2
        self._group = usual if group < 0 else group
        self._am_type = am_type
        self._reader = FrameReader()
        self._debug_seqno = 0
        # End of transmission of each frame queued for the line.
        self._leaves_ns: deque[int] = deque()
        self._free_ns = 0
        self._for_radio: deque[Outgoing] = deque()

    def reset(self) -> None:
        """Clear the state, as a reset of the mote does; the counters stay."""
        self._reader = FrameReader()
        self._debug_seqno = 0
        self._leaves_ns.clear()
        self._for_radio.clear()

    # ---- to the host -------------------------------------------------------------------------

    def delivered(self, am_type: int, payload: bytes, application: bytes, now_ns: int) -> None:
        """
        Send a data packet that reached the root to the host.

        :param payload: of the active message, with the routing header.
        :param application: the payload behind that header.
        """
        if self.station.sniffs:
            return
        if self.station.protocols is TINYOS_1:
            # The root is the last hop to the host.
            packet = TelosMsg(UART_ADDRESS, am_type, _ROOT_SOURCE + payload[2:], self._group)
            self._send(packet.pack(), now_ns)
        else:
            # MultihopOscilloscope forwards the application's payload without a header.
            self._send(SerialAm(BROADCAST, 0, self._am_type, application).pack(), now_ns)

    def heard(self, destination: int, source: int, am_type: int, payload: bytes, dsn: int,
              acknowledge: bool, now_ns: int) -> None:
        """Send a frame that a sniffer received to the host, whatever its destination."""
        if not self.station.sniffs:
            return
        if self.station.protocols is TINYOS_1:
            fcf = FCF_DATA_ACK if acknowledge else FCF_DATA
            self._send(TelosMsg(destination, am_type, payload, self._group, dsn, fcf).pack(),
                       now_ns)
        else:
            self._send(SerialAm(destination, source, am_type, payload, self._group).pack(), now_ns)

    def noted(self, event: str, numbers: tuple[int, ...], now_ns: int) -> None:
        """Send a routing event of the root to the host, if the program does so."""
        known = _EVENTS.get(event)
        if self.station.debug is None or known is None:
            return
        code, is_routing = known
        first, second, third = (*(each & _U16 for each in numbers), 0, 0, 0)[:3]
        if is_routing:
            # parent u16, hop count u8, metric u16
            second, third = (second & 0xFF) << 8 | third >> 8, (third & 0xFF) << 8
        self._debug_seqno = (self._debug_seqno + 1) & _U16
        debug = self.station.debug(code, first, second, third, self._debug_seqno)
        self._send(SerialAm(BROADCAST, 0, debug.AM_TYPE, debug.pack()).pack(), now_ns)

    def _send(self, packet: bytes, now_ns: int) -> None:
        leaves_ns = self._leaves_ns
        while leaves_ns and leaves_ns[0] <= now_ns:
            leaves_ns.popleft()
        if len(leaves_ns) >= QUEUE:
            self.line_full += 1
            return
        self.sent += 1
        self._leave(frame(self.station.protocols.plain, packet), now_ns)
        leaves_ns.append(self._free_ns)

    def _leave(self, data: bytes, now_ns: int) -> None:
        start_ns = max(now_ns, self._free_ns)
        self._free_ns = start_ns + len(data) * self._byte_ns
        self._to_host(data, start_ns)

    # ---- from the host -----------------------------------------------------------------------

    def take(self, data: bytes, now_ns: int) -> None:
        """Parse bytes from the host, acknowledge packets, and send them by radio."""
        for each in self._reader.feed(data):
            self._take_frame(each, now_ns)
        self.radio_ready()

    def radio_ready(self) -> None:
        """Send the next queued packet; called when one of this queue has been sent."""
        while self._for_radio and self._to_radio(self._for_radio[0]):
            self._for_radio.popleft()

    def _take_frame(self, each: Frame, now_ns: int) -> None:
        protocols = self.station.protocols
        if each.protocol not in (protocols.acked, protocols.plain):
            self.refused += each.protocol != protocols.ack
            if protocols is TINYOS_1 and each.protocol != protocols.ack:
                self._leave(frame(UNKNOWN_PROTOCOL, bytes((each.protocol,))), now_ns)
            return
        outgoing = self._read(each.packet)
        if outgoing is None:
            self.refused += 1
            return
        if len(self._for_radio) >= QUEUE:
            self.radio_full += 1
            return
        self.taken += 1
        self._for_radio.append(outgoing)
        if each.protocol == protocols.acked:
            self._leave(frame(protocols.ack, bytes((each.token,))), now_ns)

    def _read(self, packet: bytes) -> Outgoing | None:
        """Return the packet to send; None if it is invalid, no command, or of another group."""
        try:
            if self.station.protocols is TINYOS_1:
                telos = TelosMsg.unpack(packet)
                if telos.group != self._group:
                    return None
                found = Outgoing(telos.destination, telos.am_type, telos.payload)
            else:
                serial = SerialAm.unpack(packet)
                found = Outgoing(serial.destination, serial.am_type, serial.payload)
        except ValueError:
            return None
        return found if self.station.sniffs or found.am_type == SurgeCmd.AM_TYPE else None
