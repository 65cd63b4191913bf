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
A report of the core as a message of ``/rosout``: ``rcl_interfaces/msg/Log`` as CDR bytes.

Used by the node and by the recorder.
"""

from __future__ import annotations

import struct
from typing import Final

from rt_robot_os.base.reports import Severity
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.cdr import LITTLE_ENDIAN
from rt_robot_os.messages.cdr import padding
from rt_robot_os.messages.cdr import text_bytes

LOG: Final = 'rcl_interfaces/msg/Log'
#: The QoS of rclpy: reliable and transient_local, with this depth.
TOPIC: Final = '/rosout'
DEPTH: Final = 1000
#: Offset of the stamp in a message.
LOG_STAMP_OFFSET: Final = len(LITTLE_ENDIAN)

_STAMP_AND_LEVEL: Final = struct.Struct('<iIB')
_LINE: Final = struct.Struct('<I')
_COUNT_BYTES: Final = 4


def nearest_severity(severity: int) -> Severity:
    """Return the ROS severity nearest to a number, which may come from an untrusted peer."""
    return min(Severity, key=lambda each: abs(each - severity))


def logger_name(node_logger: str, source: str) -> str:
    """
    Return the logger name of a part of the core, a child of the node's logger.

    :param node_logger: of the node: its namespace and name, joined by dots.
    :param source: device, task or part of the core.
    """
    return f"{node_logger}.{source.replace('/', '.').replace(' ', '_').strip('.') or 'core'}"


def log_message(wall_ns: int, severity: int, name: str, text: str) -> bytes:
    """
    Write a message.

    :param wall_ns: when it was logged, since 1970.
    :param name: of the logger.
    :raises ValueError: the name or the text cannot be encoded.
    :raises struct.error: the time does not fit a message.
    """
    body = bytearray(_STAMP_AND_LEVEL.pack(*divmod(wall_ns, NS_PER_S), severity))
    for each in (name, text, '', ''):  # file and function are not known
        body += bytes(padding(len(body), _COUNT_BYTES)) + text_bytes(each)
    return LITTLE_ENDIAN + bytes(body) + bytes(
        padding(len(body), _LINE.size)) + _LINE.pack(0)
