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


"""The settings of the robot itself; drivers, simulators and modules bring their own."""

from __future__ import annotations

from typing import Final

from rt_robot_os.schema import Field
from rt_robot_os.schema import REQUIRED

SLOWEST_HZ: Final = 0.1
FASTEST_HZ: Final = 10_000.0

LISTS: Final = ('devices', 'modules', 'topics', 'mirrors')

# Parameters that ROS 2 itself gives a node; a dumped file contains them.
ROS_OWN: Final = frozenset({'use_sim_time', 'start_type_description_service', 'qos_overrides'})


def _priority(default: int, description: str) -> Field:
    return Field('priority', int, default, description, minimum=1, maximum=99)


def _rate(default: float, description: str) -> Field:
    return Field('rate_hz', float, default, description, 'Hz', SLOWEST_HZ, FASTEST_HZ, live=True)


ROBOT: Final = (
    Field('autostart', bool, True, 'the node configures and activates itself'),
    Field('diagnostics_rate_hz', float, 1.0, 'how often /diagnostics is published',
          'Hz', SLOWEST_HZ, 100.0),
    Field('devices', list, (), 'names of the devices, each with a section of that name'),
    Field('modules', list, (), 'names of the modules, each with a section of that name'),
    Field('topics', list, (), 'names of further core topics, each with a section of that name'),
    Field('mirrors', list, (), 'names of the mirrors to ROS, each with a section of that name'),
)

CORE: Final = (
    Field('spawn', bool, True, 'start the core as a child; false: attach to one that runs'),
    Field('cpu', int, -1, 'CPU it is pinned to; -1: the last one allowed; -2: not pinned',
          minimum=-2, maximum=1023),
    Field('scheduler_priority', int, 80, 'SCHED_FIFO priority; 0: stay an ordinary process',
          minimum=0, maximum=99),
    Field('lock_memory', bool, True, 'keep all memory resident'),
    Field('heartbeat_s', float, 1.0, 'silence after which the other side counts as dead',
          's', 0.1, 60.0),
    Field('link_priority', int, 2, 'kernel priority of what serves clients: below what matters',
          minimum=1, maximum=99),
    Field('command_priority', int, 50, 'kernel priority at which samples from ROS are published',
          minimum=1, maximum=99),
)

DEVICE: Final = (
    Field('type', str, REQUIRED, "the driver's name"),
    _rate(100.0, 'how often the device is polled'),
    _priority(60, 'priority of its task; higher runs first'),
    Field('read', str, 'poll', 'when it is read: poll at rate_hz; interrupt as bytes arrive too',
          choices=('poll', 'interrupt')),
    Field('timeout_s', float, 1.0, 'silence after which the device counts as faulty',
          's', 0.01, 3600.0),
    Field('retry_s', float, 0.5, 'wait before it is opened again; doubles with each failure',
          's', 0.01, 3600.0),
    Field('retry_max_s', float, 10.0, 'longest wait between two tries', 's', 0.01, 3600.0),
)

MODULE: Final = (
    Field('type', str, REQUIRED, "the module's name, or package.module:Class"),
    _rate(50.0, 'how often the module steps'),
    _priority(40, 'priority of its task; higher runs first'),
)

TOPIC: Final = (
    Field('topic', str, '', 'its name in the core; the name of the section when absent'),
    Field('message', str, REQUIRED, 'its type, such as geometry_msgs/msg/Twist'),
    Field('depth', int, 8, 'slots in the ring; a power of two', minimum=1, maximum=65536),
    Field('rate_hz', float, 0.0, 'rate expected; 0: unknown', 'Hz', 0.0, FASTEST_HZ),
    Field('tail', int, 0, 'most bytes of the one sequence of variable length; 0: there is none',
          'bytes', 0, 64 * 1024 * 1024),
)

MIRROR: Final = (
    Field('topic', str, REQUIRED, 'the topic in the core'),
    Field('direction', str, 'out', 'where it goes: out to ROS or in from it',
          choices=('out', 'in')),
    Field('ros_topic', str, '', 'the topic in ROS; the same name when absent'),
    Field('policy', str, 'drain', 'what is handed on: drain every sample, latest the newest',
          choices=('drain', 'latest'), live=True),
    Field('max_rate_hz', float, 0.0, 'most samples a second; 0: no limit', 'Hz', 0.0, FASTEST_HZ,
          live=True),
    Field('reliability', str, 'reliable', 'quality of service',
          choices=('reliable', 'best_effort')),
    Field('durability', str, 'volatile', 'quality of service',
          choices=('volatile', 'transient_local')),
    Field('depth', int, 10, 'length of the ROS queue', 'samples', 1, 10_000),
)
