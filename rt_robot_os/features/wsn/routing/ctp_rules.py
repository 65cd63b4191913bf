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


"""Differences of implementations of the Collection Tree Protocol."""

from __future__ import annotations

from typing import NamedTuple


class CtpRules(NamedTuple):
    """
    Rules of CTP; the defaults are those of TinyOS 2.1.2, its last release, on a CC2420.

    :ivar white_lqi: a beacon with a higher LQI has the white bit: the channel was good. None for
        a radio without LQI, such as TOSSIM's.
    :ivar root_drops_duplicates: the sink has a duplicate cache. TinyOS' sources have one since
        2014; with its releases a packet may reach the serial line more than once.
    :ivar congestion: a node whose queue is half full sets the congestion bit, and its children
        wait. TEP 123 describes it; TinyOS has it disabled.
    :ivar packet_ms: time unit of the delays between transmissions, in 1/1024 s; 32 on slower
        radios.
    :ivar forward_queue: largest number of forwarded packets in the queue, besides one of its own.
    :ivar transmissions: largest number for one packet.
    :ivar longest_interval_ms: longest time between beacons, in 1/1024 s; must be short at a
        moving sink, because only its beacons show that it has arrived.
    :ivar sent_cache: size of the cache of sent packets.
    :ivar payload_size: of an active message; limits the neighbours in a beacon.
    """

    white_lqi: int | None = 105
    root_drops_duplicates: bool = False
    congestion: bool = False
    packet_ms: int = 7
    forward_queue: int = 12
    transmissions: int = 30
    longest_interval_ms: int = 512_000
    sent_cache: int = 4
    payload_size: int = 28


#: TinyOS' own simulator, with TinyOS' sources of 2014 and later. It has no platform, and so the
#: delays of slow radios.
TOSSIM = CtpRules(white_lqi=None, root_drops_duplicates=True, packet_ms=32)
