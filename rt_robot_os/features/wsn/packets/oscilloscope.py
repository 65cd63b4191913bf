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

"""Messages of Oscilloscope and MultihopOscilloscope, applications of TinyOS 2.x."""

from __future__ import annotations

from struct import Struct
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.message import Header

#: Number of readings in a packet of each application.
READINGS = 10
MULTIHOP_READINGS = 5


class _OscilloscopeFields(NamedTuple):
    version: int
    interval: int
    node: int
    number: int
    data: bytes = b''


class Oscilloscope(Header, _OscilloscopeFields):
    """
    Readings of one sensor, big-endian; of both applications.

    :ivar version: of the interval; nodes adopt the highest that they receive.
    :ivar interval: between two readings, in 1/1024 s.
    :ivar node: address of the origin.
    :ivar number: counts the packets since the node started. Nodes adopt a higher number that they
        receive, so that it is a common clock: it identifies a packet, but gaps are not losses.
    :ivar data: the readings, see :attr:`readings`.
    """

    __slots__ = ()
    AM_TYPE = 0x93
    LAYOUT = Struct('>4H')

    @property
    def readings(self) -> tuple[int, ...]:
        """Return the readings, 16 bits each; an odd last byte is ignored."""
        count = len(self.data) // 2
        return tuple(self.data[2 * at] << 8 | self.data[2 * at + 1] for at in range(count))

    @classmethod
    def of(cls, version: int, interval: int, node: int, number: int,
           readings: tuple[int, ...]) -> Oscilloscope:
        """Return a message with readings."""
        return cls(version, interval, node, number,
                   b''.join(each.to_bytes(2, 'big') for each in readings))


class _OscopeMsgFields(NamedTuple):
    node: int
    last_sample: int
    channel: int
    data: bytes = b''


class OscopeMsg(Header, _OscopeMsgFields):
    """
    The message of TinyOS 1.x, little-endian.

    :ivar node: address of the origin.
    :ivar last_sample: number of the last reading in it.
    :ivar channel: of the sensor.
    :ivar data: the readings, 16 bits each.
    """

    __slots__ = ()
    AM_TYPE = 10
    LAYOUT = Struct('<3H')

    @property
    def readings(self) -> tuple[int, ...]:
        """Return the readings, 16 bits each; an odd last byte is ignored."""
        count = len(self.data) // 2
        return tuple(self.data[2 * at] | self.data[2 * at + 1] << 8 for at in range(count))
