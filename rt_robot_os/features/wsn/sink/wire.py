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

"""Identification of a sink by its bytes."""

from __future__ import annotations

from typing import Final

from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import Protocols
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.framing import TINYOS_2

# Number of frames with a valid CRC and protocol byte that identify a sink.
_FRAMES_NEEDED: Final = 2


def is_tinyos1(data: bytes) -> bool:
    """Return whether bytes are frames of a mote under TinyOS 1.x."""
    return _is_of(data, TINYOS_1)


def is_tinyos2(data: bytes) -> bool:
    """Return whether bytes are frames of a mote under TinyOS 2.x."""
    return _is_of(data, TINYOS_2)


def _is_of(data: bytes, protocols: Protocols) -> bool:
    frames = FrameReader().feed(data)
    return sum(each.protocol in protocols[1:] for each in frames) >= _FRAMES_NEEDED
