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
The two packets of a service robot's sensor network with a moving sink.

*Real-time control architecture using Xenomai for intelligent service robots in USN environments*
(2009), section 3, specifies: TinyOS' SurgeTelos is the basis; ``BeaconMsg`` has parent, cost and
hopcount, is originated by the sink alone every 4,096 ms, and every node forwards it, updated;
``DataMsg`` carries data to the sink every 800 ms. Section 3 leaves open, and is chosen here:

* both follow TinyOS 1.x's header of 10 bytes (:class:`.multihop_lqi.MultihopMsg`), all
  little-endian, with the AM types of SurgeTelos, 250 and 17;
* in a beacon the header's ``origin`` is the sink and its ``origin_seqno`` the number of the
  round; ``source`` and ``seqno`` are of the node that forwarded it;
* ``DataMsg`` starts like SurgeTelos' message, and adds the kind of quantity of the reading and
  the battery's voltage: one packet carries one quantity.
"""

from __future__ import annotations

from enum import IntEnum
from struct import Struct
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.message import Message

#: In the time unit of the motes, 1/1024 s.
BEACON_PERIOD_BINARY_MS: Final = 4096
DATA_PERIOD_BINARY_MS: Final = 800


class Kind(IntEnum):
    """Quantity and unit of a reading."""

    NONE = 0
    #: Raw value of the SHT1x, 14 bits.
    TEMPERATURE = 1
    #: Raw value of the SHT1x, 12 bits.
    HUMIDITY = 2
    #: Of the light sensor at the 12-bit converter.
    LIGHT = 3
    #: As ``voltage``.
    BATTERY = 4
    #: 1/min.
    PULSE = 5
    #: 1/min.
    RESPIRATION = 6
    #: %.
    SPO2 = 7
    #: 0.01 K, so that no sign is needed: 310.15 K (37 deg C) is 31015.
    BODY_TEMPERATURE = 8
    #: mg, the length of the vector: 1000 at rest.
    ACCELERATION = 9
    #: The code of an alarm; 0 ends it.
    ALARM = 10
    #: 1 while there is smoke, else 0.
    SMOKE = 11
    #: 1 while there is water, else 0.
    WATER = 12
    #: mmHg.
    SYSTOLIC = 13
    #: mmHg.
    DIASTOLIC = 14
    #: 0.1 l/min; 0 is air.
    OXYGEN = 15
    #: 0 alert, 1 newly confused, 2 answers to a voice, 3 to pain, 4 to nothing.
    CONSCIOUSNESS = 16
    #: 1 while a person is there, else 0.
    PRESENCE = 17
    #: Id of the fixed node nearest to a worn one.
    NEAREST_NODE = 18


class _BeaconMsgFields(NamedTuple):
    parent: int
    cost: int
    hopcount: int


class BeaconMsg(Message, _BeaconMsgFields):
    """
    The body of a beacon, after a :class:`.multihop_lqi.MultihopMsg`.

    :ivar parent: of the node that sent it; of the sink, the sink.
    :ivar cost: from the node that sent it to the sink.
    :ivar hopcount: from the node that sent it to the sink.
    """

    __slots__ = ()
    AM_TYPE = 250
    LAYOUT = Struct('<HHH')


class _DataMsgFields(NamedTuple):
    message_type: int
    reading: int
    parent: int
    seq_no: int
    kind: int
    voltage: int


class DataMsg(Message, _DataMsgFields):
    """
    The body of a data packet, after a :class:`.multihop_lqi.MultihopMsg`.

    :ivar message_type: 0, a reading, as in SurgeTelos.
    :ivar reading: the number; ``kind`` is its quantity.
    :ivar parent: of the origin, when it made the packet.
    :ivar seq_no: counter of the origin's application since it started, from 0.
    :ivar kind: a :class:`Kind`; others are unknown in this version.
    :ivar voltage: raw value of the battery at the 12-bit converter: half of it
        against 1.5 V, so V = voltage / 4096 * 3.
    """

    __slots__ = ()
    AM_TYPE = 17
    LAYOUT = Struct('<HHHIHH')
