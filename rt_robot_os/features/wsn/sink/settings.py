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

"""The settings of a sink."""

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
          'a serial forwarder; or tcp://host:port, a serial line over TCP; or sim, a simulated '
          'network.'),
    Field('baud', int, 57600, 'Speed of the serial line: 57600 under TinyOS 1.x on telos, tmote, '
          'micaz and mica2, 19200 on mica and mica2dot, 115200 on telosb under TinyOS 2.x; 0 for '
          'a pty. Unused on a network.', 'bit/s', 0, 4_000_000),
    Field('stack', str, TINYOS_1.name, 'Generation of TinyOS on the motes: tinyos1 or tinyos2.',
          choices=(TINYOS_1.name, TINYOS_2.name)),
    Field('platform', str, TELOS, 'Family of the motes under TinyOS 1.x: telos (also tmote and '
          'micaz) or mica (also mica2 and mica2dot).', choices=PLATFORMS),
    Field('mode', str, ROOT, 'Role of the mote: root, the base of the network, which sends the '
          'packets addressed to it; or sniffer (TOSBase, BaseStation), which sends all packets '
          'that it receives.',
          choices=(ROOT, SNIFFER)),
    Field('groups', list, (), 'Accepted AM groups; empty: 125 under TinyOS 1.x, 0 '
          f'and 34 under 2.x; {ANY_GROUP}: all.', item=int, minimum=ANY_GROUP, maximum=255),
    Field('root', int, 0, 'Address of the root of the network, the only node that may advertise '
          'a cost of 0.', minimum=0, maximum=0xFFFF),
    Field('payloads', list, (), "User-defined payloads, a string each, such as 'soil 0x42 "
          "origin:H seqno:H moisture:H', see docs/packets.md: their types are known, and "
          'their duplicates are dropped.'),
    Field('classes', list, DEFAULT_CLASSES, 'Classes of packets, the most important first; each '
          'has a topic of its own below topic.'),
    Field('rules', list, DEFAULT_RULES, "Rules for the class of packets: 'CLASS if FACT VALUES "
          "and FACT VALUES', where a fact is type (AM), kind (of reading), origin or group, and "
          'values are numbers, spans such as 3-7, or names of kinds. The first rule that '
          'matches applies; packets without a match are of the last class.'),
    Field('topic', str, 'wsn/packets', 'First part of the names of the topics, as in '
          'wsn/packets/alarm.'),
    replace(_SERIAL['depth'], default=64, description='Number of packets that each topic stores.'),
    Field('queue', int, 128, 'Capacity of the queue of each class, for packets that arrive faster '
          'than they are published; when full, its oldest packet is lost and counted.',
          '', 1, 4096),
    Field('node_rate_hz', float, 20.0, 'Largest rate of packets from one node through one '
          'relay, in all classes but the last, with bursts of 2 s. Further packets are dropped '
          'and counted, so that a flood, even in the name of another node, displaces no alarms. '
          '0: no limit.', 'Hz', 0.0, 10_000.0, before=0.0),
    Field('packets_per_job', int, 16, 'Largest number of packets published by one job, the most '
          'important first; the next job is a millisecond later. At most depth, so that readers '
          'of lower priority lose none.', '', 1, 1024),
    Field('duplicates_s', float, 60.0, 'Time in which a packet with the same content is '
          'a duplicate and is dropped; 0 disables this.', 's', 0.0, 3600.0),
    Field('quiet_s', float, 60.0, 'Time for which all nodes may be silent, if more than '
          'timeout_s; then the port is reopened.', 's', 0.0, 3600.0),
    Field('output_rate_hz', float, 10.0, 'Expected packets per second of all nodes '
          'together.', 'Hz', 0.01, 10_000.0),
    Field('command_topic', str, '', 'Topic of commands to nodes, std_msgs/String such as '
          "'rate 5 2000', 'sleep 5', 'wake all'; usually wsn/command; empty: none."),
)
