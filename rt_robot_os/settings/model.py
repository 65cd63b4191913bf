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

from rt_robot_os.schema import TopicSpec

# The port of a simulated device.
SIM_PORT: Final = 'sim'


def _nothing() -> Mapping[str, Any]:
    return MappingProxyType({})


@dataclass(frozen=True, slots=True)
class CoreSettings:
    """
    The process that runs the kernel.

    :ivar spawn: start it as a child; False attaches to one that runs.
    :ivar cpu: the CPU it is pinned to; -1 the least used one allowed, -2 none.
    :ivar scheduler_priority: SCHED_FIFO 1..99; 0 stays an ordinary process.
    :ivar lock_memory: keep all pages in memory.
    :ivar heartbeat_s: silence after which the other side counts as dead.
    :ivar link_priority: kernel priority of the tasks that serve clients, 1..99.
    :ivar command_priority: kernel priority at which samples from clients are published, 1..99.
    :ivar spin_us: how early it wakes to spin up to a release; 0 sleeps.
    :ivar cpu_latency_us: asked of ``/dev/cpu_dma_latency``; -1 leaves it.
    :ivar dispatcher: ``preemptive`` or ``cooperative``.
    :ivar black_box_records: how many the black box keeps.
    :ivar black_box_folder: where it is written; empty for ROS's folder of logs.
    :ivar record_bytes: devices' bytes and the schedule are tapped from the start.
    :ivar link_gather_ms: samples mirrored within this time go out together; 0 for each at once.
    """

    spawn: bool
    cpu: int
    scheduler_priority: int
    lock_memory: bool
    heartbeat_s: float
    link_priority: int
    command_priority: int
    spin_us: float = 0.0
    cpu_latency_us: int = -1
    dispatcher: str = 'preemptive'
    black_box_records: int = 2048
    black_box_folder: str = ''
    record_bytes: bool = False
    link_gather_ms: float = 5.0


@dataclass(frozen=True, slots=True)
class LogSettings:
    """
    The file of the log, which the node writes.

    :ivar file: whether there is one.
    :ivar folder: empty for ROS's folder of logs.
    :ivar file_mb: size at which a new one is begun.
    :ivar files: how many are kept.
    """

    file: bool = True
    folder: str = ''
    file_mb: float = 10.0
    files: int = 5


@dataclass(frozen=True, slots=True)
class WatchdogSettings:
    """
    What happens when a critical task is unhealthy.

    :ivar timeout_s: for how long it may be; 0 without watchdog.
    :ivar action: ``log``, ``safe_state`` or ``exit``.
    :ivar exit_code: of the core, after ``exit``.
    :ivar device: a hardware watchdog that is fed as well; empty without.
    """

    timeout_s: float = 0.0
    action: str = 'log'
    exit_code: int = 70
    device: str = ''


@dataclass(frozen=True, slots=True)
class TaskSettings:
    """
    What a device or a module declares of its task, besides rate and priority.

    :ivar phase_us: first release after the start.
    :ivar deadline_us: from release to end; 0 the period, or none without one.
    :ivar budget_us: computing time of a job; 0 any.
    :ivar on_budget: ``warn`` or ``abort``.
    :ivar overrun: ``skip``, ``rephase``, ``catch_up`` or ``stop``.
    :ivar catch_up: most releases made up for, when ``overrun`` is ``catch_up``.
    :ivar overrun_limit: overruns after which ``failure`` is applied; 0 never.
    :ivar overrun_leak: jobs without overrun that take one away.
    :ivar failure: ``continue``, ``restart``, ``stop`` or ``safe_state``.
    :ivar restart_s: wait before the first restart; doubled with each.
    :ivar restart_max_s: longest wait.
    :ivar critical: the watchdog watches it.
    :ivar resources: names of what it may lock.
    :ivar logical_execution: outputs are published at the deadline.
    :ivar execution_us: declared worst case, for planning; 0 unknown.
    """

    phase_us: float = 0.0
    deadline_us: float = 0.0
    budget_us: float = 0.0
    on_budget: str = 'warn'
    overrun: str = 'skip'
    catch_up: int = 1
    overrun_limit: int = 0
    overrun_leak: int = 100
    failure: str = 'continue'
    restart_s: float = 0.1
    restart_max_s: float = 10.0
    critical: bool = False
    resources: tuple[str, ...] = ()
    logical_execution: bool = False
    execution_us: float = 0.0


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
    :ivar task: what it declares of its task.
    :ivar log_level: the least severity that it logs, such as ``info``.
    :ivar max_subscribers: how many modules may read each of its topics.
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
    task: TaskSettings = TaskSettings()
    log_level: str = 'info'
    max_subscribers: int = 64


@dataclass(frozen=True, slots=True)
class ModuleSettings:
    """
    One function module.

    :ivar type: its name in the registry, or ``package.module:Class``.
    :ivar rate_hz: how often it steps; 0 when only its inputs wake it.
    :ivar settings: every key of the module's own ``SETTINGS``, defaults filled in.
    :ivar task: what it declares of its task.
    :ivar log_level: the least severity that it logs, such as ``info``.
    :ivar max_subscribers: how many modules may read each of its topics.
    """

    name: str
    type: str  # noqa: A003
    rate_hz: float
    priority: int
    settings: Mapping[str, Any] = field(default_factory=_nothing)
    task: TaskSettings = TaskSettings()
    log_level: str = 'info'
    max_subscribers: int = 64


@dataclass(frozen=True)
class TopicSettings(TopicSpec):
    """
    A topic of the core that no device and no module declares.

    :ivar name: its section.
    :ivar max_subscribers: how many modules may read it.
    """

    name: str = ''
    max_subscribers: int = 64


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
    :ivar stamped: the ROS topic has the type with a header.
    :ivar frame_id: in the header of what goes out.
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
    stamped: bool = False
    frame_id: str = ''


@dataclass(frozen=True, slots=True)
class RobotSettings:
    """
    The whole robot, checked.

    :ivar parameters_file: where what was changed while it ran is saved; empty: ROS's folder.
    :ivar files: real paths of the parameter files that it was read from.
    :ivar simulation_asked: somebody wanted the devices simulated; False when it is only for want
        of another configuration.
    """

    autostart: bool
    diagnostics_rate_hz: float
    core: CoreSettings
    devices: tuple[DeviceSettings, ...] = ()
    modules: tuple[ModuleSettings, ...] = ()
    topics: tuple[TopicSettings, ...] = ()
    mirrors: tuple[MirrorSettings, ...] = ()
    watchdog: WatchdogSettings = WatchdogSettings()
    log: LogSettings = LogSettings()
    parameters_file: str = ''
    files: tuple[str, ...] = field(default=(), compare=False)
    simulation_asked: bool = field(default=True, compare=False)

    @property
    def simulated(self) -> tuple[str, ...]:
        """Give the names of the devices that are simulated."""
        return tuple(device.name for device in self.devices if device.port == SIM_PORT)


def frozen(value: Any) -> Any:
    """Turn lists into tuples and dictionaries into read-only mappings, all the way down."""
    if isinstance(value, Mapping):
        return MappingProxyType({key: frozen(item) for key, item in value.items()})
    if isinstance(value, list | tuple):
        return tuple(frozen(item) for item in value)
    return value
