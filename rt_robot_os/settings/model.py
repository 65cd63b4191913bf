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


"""The checked settings: frozen facts that the node, the core and the tools share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
from types import MappingProxyType
from typing import Any, Final

# The port of a simulated device.
SIM_PORT: Final = 'sim'


def _nothing() -> Mapping[str, Any]:
    return MappingProxyType({})


@dataclass(frozen=True, slots=True)
class CoreSettings:
    """
    The process that runs the kernel.

    :ivar spawn: start it as a child; False attaches to one that runs.
    :ivar cpu: the CPU it is pinned to; -1 the last one allowed, -2 none.
    :ivar scheduler_priority: SCHED_FIFO 1..99; 0 stays an ordinary process.
    :ivar lock_memory: keep all pages in memory.
    :ivar heartbeat_s: silence after which the other side counts as dead.
    :ivar link_priority: kernel priority of the tasks that serve clients, 1..99.
    :ivar command_priority: kernel priority at which samples from clients are published, 1..99.
    """

    spawn: bool
    cpu: int
    scheduler_priority: int
    lock_memory: bool
    heartbeat_s: float
    link_priority: int
    command_priority: int


@dataclass(frozen=True, slots=True)
class DeviceSettings:
    """
    One device in the SensorManager's list.

    :ivar name: its section; unique in the robot.
    :ivar type: the driver's name in the registry.
    :ivar port: where it is; ``SIM_PORT`` for a simulated one, empty when the driver has no port.
    :ivar rate_hz: how often it is polled.
    :ivar priority: of its task, 1..99, higher runs first.
    :ivar timeout_s: silence after which it counts as faulty.
    :ivar retry_s: first wait before it is opened again.
    :ivar retry_max_s: longest wait between two tries.
    :ivar settings: every key of the driver's own ``SETTINGS``, defaults filled in.
    :ivar sim: the simulator's settings; None unless the port is ``SIM_PORT``.
    :ivar read: ``poll`` at the rate, or ``interrupt`` as bytes arrive too.
    """

    name: str
    type: str  # noqa: A003
    port: str
    rate_hz: float
    priority: int
    timeout_s: float
    retry_s: float
    retry_max_s: float
    settings: Mapping[str, Any] = field(default_factory=_nothing)
    sim: Mapping[str, Any] | None = None
    read: str = 'poll'


@dataclass(frozen=True, slots=True)
class ModuleSettings:
    """
    One function module.

    :ivar type: its name in the registry, or ``package.module:Class``.
    :ivar settings: every key of the module's own ``SETTINGS``, defaults filled in.
    """

    name: str
    type: str  # noqa: A003
    rate_hz: float
    priority: int
    settings: Mapping[str, Any] = field(default_factory=_nothing)


@dataclass(frozen=True, slots=True)
class TopicSettings:
    """
    A topic of the core that no device and no module declares.

    :ivar name: its section.
    :ivar topic: its name in the core; the section's unless given.
    :ivar message: its type, such as ``geometry_msgs/msg/Twist``.
    :ivar depth: slots in the ring, a power of two.
    :ivar rate_hz: the rate expected; 0 when unknown.
    :ivar fixed: strings and lengths of sequences fixed at declaration, by dotted field name.
    :ivar tail: bytes reserved for the one sequence of variable length; None without.
    """

    name: str
    topic: str
    message: str
    depth: int
    rate_hz: float
    fixed: Mapping[str, Any] = field(default_factory=_nothing)
    tail: int | None = None


@dataclass(frozen=True, slots=True)
class MirrorSettings:
    """
    A topic of the core mirrored to or from a ROS topic.

    :ivar topic: in the core.
    :ivar message: its type.
    :ivar direction: ``out`` to ROS or ``in`` from it.
    :ivar ros_topic: as the user wrote it; relative names follow the node's namespace.
    :ivar policy: ``drain`` hands on every sample, ``latest`` the newest.
    :ivar max_rate_hz: 0 for no limit.
    :ivar reliability: ``reliable`` or ``best_effort``.
    :ivar durability: ``volatile`` or ``transient_local``.
    :ivar depth: of the ROS queue.
    """

    name: str
    topic: str
    message: str
    direction: str
    ros_topic: str
    policy: str
    max_rate_hz: float
    reliability: str
    durability: str
    depth: int


@dataclass(frozen=True, slots=True)
class RobotSettings:
    """The whole robot, checked."""

    autostart: bool
    diagnostics_rate_hz: float
    core: CoreSettings
    devices: tuple[DeviceSettings, ...] = ()
    modules: tuple[ModuleSettings, ...] = ()
    topics: tuple[TopicSettings, ...] = ()
    mirrors: tuple[MirrorSettings, ...] = ()


def frozen(value: Any) -> Any:
    """Turn lists into tuples and dictionaries into read-only mappings, all the way down."""
    if isinstance(value, Mapping):
        return MappingProxyType({key: frozen(item) for key, item in value.items()})
    if isinstance(value, list | tuple):
        return tuple(frozen(item) for item in value)
    return value
