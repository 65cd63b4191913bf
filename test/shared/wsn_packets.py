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

"""Packets of sensor nodes, as a sink hands them on."""

from __future__ import annotations

from rt_robot_os.features.wsn.packets.ctp import CtpData
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.oscilloscope import Oscilloscope
from rt_robot_os.features.wsn.packets.paper import BeaconMsg
from rt_robot_os.features.wsn.packets.paper import DataMsg
from rt_robot_os.features.wsn.packets.paper import Kind
from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg
from rt_robot_os.testing.module_bench import ModuleBench
from rt_robot_os.topics import Publisher

UART = 0x7E
VOLTS_2_8 = round(2.8 / 3.0 * 4096)


def data_msg(origin: int, number: int, kind: int = Kind.TEMPERATURE, reading: int = 6100, *,
             parent: int = 0, hops: int = 1, voltage: int = VOLTS_2_8, group: int = 0x7D) -> bytes:
    """Return a data packet of the paper's network, as its root sends it to the host."""
    return TelosMsg(UART, DataMsg.AM_TYPE, MultihopMsg(
        0, origin, number & 0x7FFF, number & 0x7FFF, hops, DataMsg(
            0, reading, parent, number, kind, voltage).pack()).pack(), group).pack()


def beacon(sender: int, parent: int, cost: int, hops: int, number: int = 1) -> bytes:
    """Return a beacon of that network, as a sniffer hears it."""
    return TelosMsg(0xFFFF, BeaconMsg.AM_TYPE, MultihopMsg(
        sender, 0, number, number, hops, BeaconMsg(parent, cost, hops).pack()).pack()).pack()


def ctp_data(origin: int, number: int, source: int, thl: int = 0) -> bytes:
    """Return a data packet of CTP on its way to the sink, as a sniffer hears it."""
    return SerialAm(0, source, CtpData.AM_TYPE, CtpData(
        0, thl, 10, origin, number & 0xFF, 0x93, Oscilloscope(
            0, 1024, origin, number & 0xFFFF, b'\0\1' * 5).pack()).pack()).pack()


class Sink:
    """A topic of packets, and how to let them come."""

    def __init__(self, bench: ModuleBench, name: str = 'wsn/packets/rest') -> None:
        bench.bus.declare(name, 'std_msgs/msg/UInt8MultiArray', {'layout.dim': 0}, depth=64,
                          rate_hz=10.0, tail=256)
        self._bench = bench
        self._publisher: Publisher = bench.bus.publisher(name)

    def send(self, packet: bytes) -> None:
        """Let a packet come now."""
        self._publisher.fill(memoryview(packet))
        self._publisher.publish()

    def at(self, time_s: float, packet: bytes) -> None:
        """Let a packet come at a time of the next run."""
        self._bench.at(time_s, lambda: self.send(packet))
