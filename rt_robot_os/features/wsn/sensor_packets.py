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

"""Settings, survey, decoder and input of the modules that read packets of a sink."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.features.wsn.packets.decode import PacketDecoder
from rt_robot_os.features.wsn.packets.decode import STACKS
from rt_robot_os.features.wsn.packets.payload_text import known_payloads
from rt_robot_os.features.wsn.packets.tos_msg import PLATFORMS
from rt_robot_os.features.wsn.survey_files import load_survey
from rt_robot_os.messages.survey import numbered
from rt_robot_os.messages.survey import survey_of
from rt_robot_os.messages.survey import SurveyedNode
from rt_robot_os.topics import Subscription

PACKETS: Final = 'std_msgs/msg/UInt8MultiArray'
ANY_GROUP: Final = -1
_AUTO: Final = 'auto'

PACKET_SETTINGS: Final = (
    Field('nodes_file', str, '', 'Survey of the nodes: a YAML file with nodes, such as that of '
          'a simulated world; each is "name x y height [id N] [quantity ...]"', is_file=True),
    Field('nodes', list, [], 'Further nodes, in the same format'),
    Field('stack', str, _AUTO, 'Generation of TinyOS on the motes, as in the section of the sink; '
          'auto determines it for each packet', choices=STACKS),
    Field('platform', str, _AUTO, 'Family of the motes under TinyOS 1.x', choices=(
        _AUTO, *PLATFORMS)),
    Field('group', int, ANY_GROUP, 'AM group of the network; packets of other groups are counted '
          f'and not used; {ANY_GROUP}: all that the sink publishes', '', ANY_GROUP, 255),
    Field('payloads', list, [], "User-defined payloads: 'NAME AM_TYPE FIELD ...', where a field "
          "is 'name:code[unit]=quantity,scale'; see docs/packets.md"),
)


def survey_from(name: str, settings: Mapping[str, Any]) -> tuple[SurveyedNode, ...]:
    """
    Read the survey of a module's settings; not for the real-time loop.

    :param name: of the module, for errors.
    :raises ConfigError: with every problem.
    """
    found: tuple[SurveyedNode, ...] = ()
    if settings['nodes_file']:
        found = load_survey(settings['nodes_file'], f'{name}.nodes_file')
    more = survey_of(settings['nodes'], f'{name}.nodes', len(found) + 1)
    return numbered((*found, *more), f'{name}.nodes')


def decoder_from(name: str, settings: Mapping[str, Any]) -> PacketDecoder:
    """
    Create the decoder for a module's settings.

    :raises ConfigError: with every problem of the payloads.
    """
    try:
        return PacketDecoder(settings['stack'], known_payloads(settings['payloads']),
                             settings['platform'], group_from(settings))
    except ConfigError as error:
        raise ConfigError([f'{name}.payloads: {problem}' for problem in error.problems]) from error


def group_from(settings: Mapping[str, Any]) -> int | None:
    """Return the AM group of the network; None for all groups."""
    group = settings['group']
    return None if group == ANY_GROUP else int(group)


class PacketReader:
    """
    Read packets from a topic of a sink; safe in the real-time loop.

    :param read: a ``std_msgs/msg/UInt8MultiArray`` with the bytes of a packet as its tail.
    """

    __slots__ = ('_read', '_start')

    def __init__(self, read: Subscription) -> None:
        self._read = read
        self._start = read.topic.layout.bulk[0]

    def take(self) -> bytes | None:
        """Return the oldest unread packet; None when there is none."""
        read = self._read
        return bytes(read.buffer[self._start:read.length]) if read.take() else None

    @property
    def stamp_ns(self) -> int:
        """Return the arrival time of the last packet."""
        return self._read.stamp_ns

    @property
    def lost(self) -> int:
        """Return the number of packets that were overwritten before they were read."""
        return self._read.lost
