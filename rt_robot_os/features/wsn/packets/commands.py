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
Commands to nodes as strings, and their packets.

The strings are ``rate NODE MS``, ``sleep NODE``, ``wake NODE``, ``focus NODE``, ``unfocus NODE``;
NODE is an address or ``all``. The packets are Surge's commands. Focus is broadcast, because it
changes all nodes: one sends often, the others seldom.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.packets.surge import SurgeCmd
from rt_robot_os.features.wsn.packets.surge import SurgeCmdT2
from rt_robot_os.features.wsn.packets.surge import SurgeType
from rt_robot_os.features.wsn.packets.tos_msg import GROUP
from rt_robot_os.features.wsn.packets.tos_msg import MICA
from rt_robot_os.features.wsn.packets.tos_msg import MicaMsg
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg

ALL: Final = 0xFFFF
_WORDS: Final[Mapping[str, SurgeType]] = {
    'rate': SurgeType.SET_RATE, 'sleep': SurgeType.SLEEP, 'wake': SurgeType.WAKE_UP,
    'focus': SurgeType.FOCUS, 'unfocus': SurgeType.UNFOCUS}
_TO_ALL: Final = (SurgeType.FOCUS, SurgeType.UNFOCUS)
_MOST_PERIOD_MS: Final = 86_400_000


class Command(NamedTuple):
    """
    A command to a node.

    :ivar destination: its address, or the broadcast address.
    :ivar value: the period in 1/1024 s, the address to focus on, or 0.
    """

    destination: int
    command: SurgeType
    value: int


def parse_command(text: str) -> Command:
    """
    Parse a command.

    :raises ValueError: with the problem and the correct form.
    """
    words = text.split()
    command = _WORDS.get(words[0]) if words else None
    if command is None:
        raise ValueError(f'{text[:40]!r} is not a command: must start with one of '
                         f'{", ".join(_WORDS)}, such as rate 5 2000 or sleep all')
    needed = 3 if command is SurgeType.SET_RATE else 2
    if len(words) != needed:
        form = 'rate NODE MS' if needed == 3 else f'{words[0]} NODE'
        raise ValueError(f'{text[:40]!r}: must be {form}, such as '
                         f'{words[0]} 5{" 2000" if needed == 3 else ""}')
    node = _node(text, words[1])
    if command is SurgeType.SET_RATE:
        return Command(node, command, _binary_ms(text, words[2]))
    return Command(ALL, command, node) if command in _TO_ALL else Command(node, command, 0)


def command_packet(command: Command, stack: str, platform: str = '', group: int = GROUP) -> bytes:
    """
    Return the packet of a command, without framing.

    :param stack: ``tinyos1`` or ``tinyos2``.
    :param platform: of motes under TinyOS 1.x: ``mica``, or others with the radio CC2420.
    :param group: of the network, under TinyOS 1.x.
    """
    destination, kind, value = command
    if stack == 'tinyos2':
        payload = SurgeCmdT2(kind, value).pack()
        return SerialAm(destination, 0, SurgeCmdT2.AM_TYPE, payload).pack()
    payload = SurgeCmd(kind, value).pack()
    if platform == MICA:
        return MicaMsg(destination, SurgeCmd.AM_TYPE, payload[:1] + payload[2:], group).pack()
    return TelosMsg(destination, SurgeCmd.AM_TYPE, payload, group).pack()


def _node(text: str, word: str) -> int:
    if word == 'all':
        return ALL
    try:
        node = int(word, 0)
    except ValueError:
        node = -1
    if not 0 <= node <= ALL:
        raise ValueError(f'{text[:40]!r}: the node {word[:20]!r} must be a number from 0 to '
                         '65535, or all')
    return node


def _binary_ms(text: str, word: str) -> int:
    try:
        period_ms = float(word)
    except ValueError:
        period_ms = 0.0
    if not 1 <= period_ms <= _MOST_PERIOD_MS:
        raise ValueError(f'{text[:40]!r}: the period {word[:20]!r} must be milliseconds from 1 '
                         f'to {_MOST_PERIOD_MS}')
    return max(1, round(period_ms * 1.024))
