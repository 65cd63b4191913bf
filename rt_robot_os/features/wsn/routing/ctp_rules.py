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


"""What implementations of the Collection Tree Protocol differ in."""

from __future__ import annotations

from typing import NamedTuple


class CtpRules(NamedTuple):
    """
    Rules of CTP; as they stand, those of TinyOS 2.1.2, its last release, on a CC2420.

    :ivar white_lqi: a beacon that comes in with more has the white bit: the channel was good.
        None for a radio that cannot tell, such as TOSSIM's.
    :ivar root_drops_duplicates: the sink remembers what it has taken. TinyOS' sources do since
        2014; with its releases the same packet may reach the serial line more than once.
    :ivar congestion: a node whose queue is half full says so, and its children wait. TEP 123
        describes it; TinyOS has it switched off.
    :ivar packet_ms: time unit of the waits between transmissions, in 1/1024 s; 32 on slower
        radios.
    :ivar forward_queue: packets of others that a node keeps; one more is its own.
    :ivar transmissions: of one packet, until it is given up.
    :ivar longest_interval_ms: between beacons of a node that sees nothing wrong, in 1/1024 s; at
        a sink that moves it must be short, since nobody else can tell that the sink has come.
    :ivar sent_cache: packets that a node remembers having passed on.
    :ivar payload_size: of an active message; beacons tell of as many neighbours as fit.
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


#: TinyOS' own simulator, with TinyOS' sources of 2014 and later. It is built for no platform, and
#: so it has the waits of slow radios.
TOSSIM = CtpRules(white_lqi=None, root_drops_duplicates=True, packet_ms=32)
