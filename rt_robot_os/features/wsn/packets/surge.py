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
Messages of Surge, an application of TinyOS 1.x that sends readings to a sink and obeys commands.

SurgeTelos (telos, micaz) and the original Surge of mica2 differ in their layout.
"""

from __future__ import annotations

from enum import IntEnum
from struct import Struct
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.message import Message


class SurgeType(IntEnum):
    """Type of a message of Surge, or its command."""

    READING = 0
    ROOT_BEACON = 1
    SET_RATE = 2
    SLEEP = 3
    WAKE_UP = 4
    FOCUS = 5
    UNFOCUS = 6


class _SurgeMsgFields(NamedTuple):
    message_type: int
    reading: int
    parent: int
    seq_no: int


class SurgeMsg(Message, _SurgeMsgFields):
    """
    A reading of SurgeTelos, after a :class:`.multihop_lqi.MultihopMsg`.

    :ivar message_type: a :class:`SurgeType`.
    :ivar reading: of the converter, 12 bits.
    :ivar parent: of the origin, when it made the packet.
    :ivar seq_no: counter of the origin's application since it started.
    """

    __slots__ = ()
    AM_TYPE = 17
    LAYOUT = Struct('<HHHI')


class _MicaSurgeMsgFields(NamedTuple):
    message_type: int
    reading: int
    parent: int


class MicaSurgeMsg(Message, _MicaSurgeMsgFields):
    """
    A reading of mica2's Surge, after a :class:`.multihop_lqi.MicaMultihopMsg`.

    :ivar message_type: a :class:`SurgeType`.
    :ivar reading: of the converter.
    :ivar parent: of the origin, when it made the packet.
    """

    __slots__ = ()
    AM_TYPE = 17
    LAYOUT = Struct('<BHH')


class _SurgeCmdFields(NamedTuple):
    command: int
    value: int = 0


class SurgeCmd(Message, _SurgeCmdFields):
    """
    A command to nodes of SurgeTelos: the value is in a union of 4 bytes.

    :ivar command: ``SET_RATE`` and above of :class:`SurgeType`.
    :ivar value: the new period in 1/1024 s, or the address to focus on; else 0.
    """

    __slots__ = ()
    AM_TYPE = 18
    LAYOUT = Struct('<HI')


class SurgeCmdT2(Message, _SurgeCmdFields):
    """The same for applications under TinyOS 2.x, big-endian."""

    __slots__ = ()
    AM_TYPE = 18
    LAYOUT = Struct('>HI')
