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

"""The packets between the device and the process that writes its journal."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
import json
from typing import Any
from typing import Final

from rt_robot_os.features.alarms.alarm_service import RECORD_BYTES

#: The longest packet: a record and how old it is.
PACKET_BYTES: Final = RECORD_BYTES + 256


class JournalPacket(IntEnum):
    """The first byte of a packet; text follows, JSON but for FAULT."""

    #: To the process: the folder and what else it has to know; a record; are you there?
    OPEN = 1
    KEEP = 2
    PING = 3
    #: From it: a record of before, that there are no more, up to which record all is safe, what is
    #: wrong; that it is there, and how much room is kept on the disk.
    RECORD = 4
    RESTORED = 5
    STORED = 6
    FAULT = 7
    PONG = 8


def packet(kind: JournalPacket, text: str = '') -> bytes:
    """Write a packet."""
    return bytes((kind,)) + text.encode()


def json_packet(kind: JournalPacket, values: Mapping[str, Any]) -> bytes:
    """Write a packet of JSON."""
    return packet(kind, json.dumps(values, ensure_ascii=False, separators=(',', ':')))
