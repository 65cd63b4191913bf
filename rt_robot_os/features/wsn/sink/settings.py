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

"""What can be set of a sink."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.devices.serial.device import serial_settings
from rt_robot_os.features.wsn.packets.framing import TINYOS_1
from rt_robot_os.features.wsn.packets.framing import TINYOS_2
from rt_robot_os.features.wsn.packets.tos_msg import PLATFORMS
from rt_robot_os.features.wsn.packets.tos_msg import TELOS
from rt_robot_os.features.wsn.sink.importance import DEFAULT_CLASSES
from rt_robot_os.features.wsn.sink.importance import DEFAULT_RULES

ROOT: Final = 'root'
SNIFFER: Final = 'sniffer'
ANY_GROUP: Final = -1

_SERIAL: Final = {field.name: field for field in serial_settings(
    baud=57600, frame_id='', topic='wsn/packets', rate_hz=10.0)}

SINK_SETTINGS: Final = (
    Field('port', str, REQUIRED, 'Serial port, best one of /dev/serial/by-id; or sf://host:port, '
          'a serial forwarder; or tcp://host:port, the bytes of a serial line; sim is a simulated '
          'network.'),
    Field('baud', int, 57600, 'Speed of the serial line: 57600 under TinyOS 1.x on telos, tmote, '
          'micaz and mica2, 19200 on mica and mica2dot, 115200 on telosb under TinyOS 2.x; 0 for '
          'a pty. Nothing on a network.', 'bit/s', 0, 4_000_000),
    Field('stack', str, TINYOS_1.name, 'Generation of TinyOS on the motes: tinyos1 or tinyos2.',
          choices=(TINYOS_1.name, TINYOS_2.name)),
    Field('platform', str, TELOS, 'Family of the motes under TinyOS 1.x: telos (also tmote and '
          'micaz) or mica (also mica2 and mica2dot).', choices=PLATFORMS),
    Field('mode', str, ROOT, 'What the mote is: root, the base of the network, which sends what '
          'is for it; or sniffer (TOSBase, BaseStation), which sends whatever it overhears.',
          choices=(ROOT, SNIFFER)),
    Field('groups', list, (), 'AM groups whose packets are taken; empty: 125 under TinyOS 1.x, 0 '
          f'and 34 under 2.x; {ANY_GROUP}: all.', item=int, minimum=ANY_GROUP, maximum=255),
    Field('root', int, 0, 'Address of the root of the network: no other node is at no cost from '
          'the sink.', minimum=0, maximum=0xFFFF),
    Field('payloads', list, (), "Payloads of your own, a text each, such as 'soil 0x42 "
          "origin:H seqno:H moisture:H', see docs/packets.md: their types are known, and copies "
          'of them are left out.'),
    Field('classes', list, DEFAULT_CLASSES, 'Classes of packets, the most important first; each '
          'is a topic of its own below topic.'),
    Field('rules', list, DEFAULT_RULES, "Which packets are of which class: 'CLASS if FACT VALUES "
          "and FACT VALUES', where a fact is type (AM), kind (of reading), origin or group, and "
          'values are numbers, spans such as 3-7, or names of kinds. The first that fits counts; '
          'what none fits is of the last class.'),
    Field('topic', str, 'wsn/packets', 'Beginning of the names of the topics: wsn/packets/alarm.'),
    replace(_SERIAL['depth'], default=64, description='Packets that each topic keeps.'),
    Field('queue', int, 128, 'Packets of each class that the sink keeps when more come than it '
          'hands on; then the oldest of that class is lost, and counted.', '', 1, 4096),
    Field('node_rate_hz', float, 20.0, 'Packets that one node may send, by each relay, in all '
          'classes but the last; twice as many at once after a silence. Others are dropped, and '
          'counted: a node that floods, also in the name of another, displaces no alarm. 0 '
          'accepts all.', 'Hz', 0.0, 10_000.0, before=0.0),
    Field('packets_per_job', int, 16, 'Packets that one job hands on, the most important first; '
          'what else there is waits for the next, a millisecond later. At most depth, so that '
          'readers of lower priority lose none.', '', 1, 1024),
    Field('duplicates_s', float, 60.0, 'Time in which a packet that says the same again is a copy '
          'and is left out; 0 leaves nothing out.', 's', 0.0, 3600.0),
    Field('quiet_s', float, 60.0, 'Time in which all nodes may be silent, if that is more than '
          'timeout_s; then the port is opened anew.', 's', 0.0, 3600.0),
    Field('output_rate_hz', float, 10.0, 'Packets a second that are expected of all nodes '
          'together.', 'Hz', 0.01, 10_000.0),
    Field('command_topic', str, '', 'Topic of commands to nodes, std_msgs/String such as '
          "'rate 5 2000', 'sleep 5', 'wake all'; wsn/command as a rule, empty takes none."),
)
