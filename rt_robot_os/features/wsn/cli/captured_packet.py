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

"""A packet that was received on a line or on the air, before it is decoded."""

from __future__ import annotations

from typing import Final
from typing import NamedTuple

SERIAL: Final = 'serial'
FORWARDER: Final = 'forwarder'
AIR: Final = 'air'


class CapturedPacket(NamedTuple):
    """
    A packet.

    :ivar time_s: since 1970, or of the recording; None when the recording has no times.
    :ivar medium: ``serial``, ``forwarder`` or ``air``.
    :ivar protocol: P of its frame; -1 without.
    :ivar token: of its frame; -1 without.
    :ivar data: a packet without framing; on the air from the length byte to the checksum.
    """

    time_s: float | None
    medium: str
    protocol: int
    token: int
    data: bytes
