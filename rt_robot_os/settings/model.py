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
The checked settings: immutable values that the node, the core and the tools share.

Each setting is declared only here; see :func:`rt_robot_os.base.schema.setting`. Drivers,
simulators and modules declare their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field
from dataclasses import is_dataclass
from dataclasses import replace
from enum import Enum
from types import MappingProxyType
from typing import Any
from typing import ClassVar
from typing import Final
from typing import get_args

from rt_robot_os.base.logger import LEVELS
from rt_robot_os.base.schema import declared
from rt_robot_os.base.schema import hints_of
from rt_robot_os.base.schema import inline
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.schema import setting
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel.spec import BACKLOG_MAXIMUM
from rt_robot_os.kernel.spec import BudgetPolicy
from rt_robot_os.kernel.spec import FailurePolicy
from rt_robot_os.kernel.spec import OVERRUN_LIMIT_MAXIMUM
from rt_robot_os.kernel.spec import OverrunPolicy
from rt_robot_os.kernel.spec import TaskSpec
from rt_robot_os.link.conversions import PATH
from rt_robot_os.link.conversions import TRANSFORMS
from rt_robot_os.link.mirror import DELAY_MAXIMUM_MS
from rt_robot_os.link.mirror import Policy
from rt_robot_os.messages.diagnostic_array import DIAGNOSTICS
from rt_robot_os.messages.marker_array import MARKERS
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.settings.process_model import CoreSettings
from rt_robot_os.settings.process_model import LogSettings
from rt_robot_os.settings.process_model import priority_setting
from rt_robot_os.settings.process_model import WatchdogSettings
from rt_robot_os.settings.service_model import ServiceSettings
from rt_robot_os.sim.world_settings import WorldSettings
from rt_robot_os.topics.topic import DEPTH_MAXIMUM
from rt_robot_os.topics.topic import MAX_SUBSCRIBERS
from rt_robot_os.topics.topic import SUBSCRIBERS_MAXIMUM

# The port of a simulated device.
SIM_PORT: Final = 'sim'

SLOWEST_HZ: Final = 0.1
FASTEST_HZ: Final = 10_000.0

_TRANSFORMS_DEPTH: Final = 100  # the depth of tf2_ros
_LONGEST_US: Final = 1e9  # a period, a deadline, a budget


def _nothing() -> Mapping[str, Any]:
    return MappingProxyType({})


def _values(kind: type[Enum]) -> tuple[Any, ...]:
    return tuple(each.value for each in kind)


def _enabled() -> Any:
    return setting(True, 'false: it does not run, and its topics get no samples')


def _max_subscribers() -> Any:
    return setting(int(MAX_SUBSCRIBERS), 'maximum number of modules that may read one of its '
                   'topics (if several sections publish a topic, the largest number counts); '
                   'mirrors and recordings do not count', minimum=1, maximum=SUBSCRIBERS_MAXIMUM)


def _log_level() -> Any:
    return setting('info', 'minimum severity that it logs', choices=LEVELS, live=True)


@dataclass(frozen=True, slots=True)
class TaskSettings:
    """The settings of the task of a device or a module, other than rate and priority."""

    phase_us: float = setting(0.0, 'first release after the start', 'us', 0.0, _LONGEST_US)
    deadline_us: float = setting(
        0.0, 'time from a release to the latest end of its job; 0: the period, without a rate '
        'none', 'us', 0.0, _LONGEST_US)
    budget_us: float = setting(
        0.0, 'computing time a job may use, without preemptions; 0: unlimited', 'us', 0.0,
        _LONGEST_US)
    on_budget: str = setting(
        TaskSpec.on_budget.value, 'reaction to a job that uses more: count it, or abort it',
        choices=_values(BudgetPolicy))
    overrun: str = setting(
        TaskSpec.overrun.value, 'reaction to a release while the previous job is unfinished',
        choices=_values(OverrunPolicy))
    catch_up: int = setting(
        TaskSpec.catch_up, 'maximum number of releases to make up for, with overrun: catch_up',
        minimum=1, maximum=BACKLOG_MAXIMUM)
    overrun_limit: int = setting(
        TaskSpec.overrun_limit, 'overruns after which the failure policy is applied; 0: never',
        minimum=0, maximum=OVERRUN_LIMIT_MAXIMUM)
    overrun_leak: int = setting(
        TaskSpec.overrun_leak, 'number of jobs without overrun that cancel one overrun',
        minimum=1, maximum=1_000_000)
    failure: str = setting(
        TaskSpec.failure.value, 'reaction to an exception, an abort or too many overruns',
        choices=_values(FailurePolicy))
    restart_s: float = setting(
        TaskSpec.restart_ns / NS_PER_S, 'wait before the first restart; doubles each time', 's',
        0.001, 3600.0)
    restart_max_s: float = setting(
        TaskSpec.restart_maximum_ns / NS_PER_S, 'longest wait before a restart', 's', 0.001,
        3600.0)
    critical: bool = setting(TaskSpec.critical, 'the watchdog watches it')
    resources: tuple[str, ...] = setting(
        (), 'names of resources that it may lock; tasks with the same name share the resource')
    logical_execution: bool = setting(
        TaskSpec.logical, 'inputs are read at the release, outputs are published at the deadline')
    execution_us: float = setting(
        0.0, 'longest known computing time of a job, for plan; 0: unknown', 'us', 0.0,
        _LONGEST_US)


@dataclass(frozen=True, slots=True)
class DeviceSettings:
    """
    One device of the SensorManager.

    :ivar name: its section; unique in the robot.
    :ivar port: ``SIM_PORT`` for a simulated device, empty when the driver has no port.
    :ivar settings: every key of the driver's own ``SETTINGS``, defaults filled in.
    :ivar sim: the simulator's settings; None unless the port is ``SIM_PORT``.
    """

    name: str
    type: str = setting(REQUIRED, "the driver's name")  # noqa: A003
    port: str = ''
    enabled: ClassVar[bool] = _enabled()
    rate_hz: float = setting(
        100.0, 'how often the device is polled', 'Hz', SLOWEST_HZ, FASTEST_HZ, live=True)
    priority: int = priority_setting(60, 'priority of its task; higher runs first')
    read: str = setting(
        'poll', 'when it is read: poll: at rate_hz; interrupt: also when bytes arrive (devices on '
        'I2C always, except with logical_execution)', choices=('poll', 'interrupt'))
    timeout_s: float = setting(
        1.0, 'time without data after which the device is faulty', 's', 0.01, 3600.0)
    retry_s: float = setting(
        0.5, 'wait before it is opened again; doubles with each failure', 's', 0.01, 3600.0)
    retry_max_s: float = setting(10.0, 'longest wait between two attempts', 's', 0.01, 3600.0)
    max_subscribers: int = _max_subscribers()
    log_level: str = _log_level()
    task: TaskSettings = inline(TaskSettings())
    settings: Mapping[str, Any] = field(default_factory=_nothing)
    sim: Mapping[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class ModuleSettings:
    """
    One function module.

    :ivar name: its section; unique in the robot.
    :ivar settings: every key of the module's own ``SETTINGS``, defaults filled in.
    """

    name: str
    type: str = setting(  # noqa: A003
        REQUIRED, "the module's name, or package.module:Class")
    enabled: ClassVar[bool] = _enabled()
    rate_hz: float = setting(
        50.0, 'how often the module runs; 0: only when an input releases it', 'Hz', 0.0,
        FASTEST_HZ, live=True)
    priority: int = priority_setting(40, 'priority of its task; higher runs first')
    max_subscribers: int = _max_subscribers()
    log_level: str = _log_level()
    task: TaskSettings = inline(TaskSettings())
    settings: Mapping[str, Any] = field(default_factory=_nothing)


@dataclass(frozen=True, kw_only=True)
class TopicSettings(TopicSpec):
    """
    A topic of the core that no device and no module declares.

    :ivar name: its section, and its name in the core unless ``topic`` is set.
    :ivar tail: None for 0.
    """

    name: str
    topic: str = setting('', 'its name in the core; the name of the section when absent')
    message: str = setting(REQUIRED, 'its type, such as geometry_msgs/msg/Twist')
    depth: int = setting(
        8, 'slots in the ring; a power of two', minimum=1, maximum=DEPTH_MAXIMUM)
    rate_hz: float = setting(0.0, 'expected rate; 0: unknown', 'Hz', 0.0, FASTEST_HZ)
    tail: int | None = setting(
        0, 'maximum bytes of the one sequence of variable length; 0: none', 'bytes', 0,
        64 * 1024 * 1024)
    max_subscribers: int = _max_subscribers()

    def __post_init__(self) -> None:
        object.__setattr__(self, 'topic', self.topic or self.name)
        object.__setattr__(self, 'tail', self.tail or None)


@dataclass(frozen=True, slots=True, kw_only=True)
class MirrorSettings:
    """
    A topic of the core mirrored to or from a ROS topic.

    :ivar name: its section; all topics of one pattern have the same.
    :ivar message: the type of the topic in the core.
    :ivar core_frame_id: the frame of all messages of the topic in the core.
    :ivar pattern: the ``topic`` as written, such as ``wsn/*``; empty if it is not a pattern.
    :ivar ros_pattern: the ``ros_topic`` of the pattern as written.
    :ivar ros_topic: as written; relative names follow the node's namespace.
    :ivar reliability: never ``auto``: that is resolved by the constructor.
    """

    name: str
    topic: str = setting(
        REQUIRED, 'the topic in the core; each * matches any string: wsn/* mirrors all topics '
        'that begin with wsn/ and that no other mirror names or has matched before')
    message: str
    core_frame_id: str = ''
    pattern: str = ''
    ros_pattern: str = ''
    direction: str = setting(
        'out', 'direction: out to ROS or in from it', choices=('out', 'in'))
    ros_topic: str = setting(
        '', 'the topic in ROS; the same name when absent; for a topic with * it has as many *, '
        'for the same strings')
    policy: str = setting(
        Policy.DRAIN.value, 'samples that are sent: drain: all; latest: the newest',
        choices=_values(Policy), live=True)
    max_rate_hz: float = setting(
        0.0, 'maximum samples per second; 0: no limit', 'Hz', 0.0, FASTEST_HZ, live=True)
    delay_ms: float = setting(
        0.0, 'longest time a sample to ROS may wait for others, which costs the core and the node '
        'less per sample; 0: no longer than core.link_gather_ms', 'ms', 0.0, DELAY_MAXIMUM_MS,
        live=True)
    reliability: str = setting(
        'auto', 'quality of service; auto: reliable to ROS; from ROS best_effort, which matches '
        'every publisher, or reliable with transient_local',
        choices=('auto', 'reliable', 'best_effort'))
    durability: str = setting(
        'volatile', 'quality of service', choices=('volatile', 'transient_local'))
    depth: int = setting(10, 'length of the ROS queue', 'samples', 1, 10_000)
    stamped: bool = setting(
        False, 'the ROS topic has the type with a header, such as TwistStamped where the core has '
        'Twist; from ROS the age of the header is that of the sample')
    as_: str = setting(
        '', 'the type of the ROS topic, if it differs from that in the core: '
        f'{TRANSFORMS} (several on one topic, /tf when ros_topic is absent), {PATH}, {MARKERS} '
        f'(of a sensor network or a pose graph), {DIAGNOSTICS} (of diagnostics in JSON, such as '
        'alarms/list)')
    frame_id: str = setting(
        '', 'in the header of messages to ROS, with stamped: true or as; for a path, map when '
        'absent: a path from ROS in another frame is refused')

    def __post_init__(self) -> None:
        object.__setattr__(self, 'ros_topic', self.ros_topic or (
            '/tf' if self.as_ == TRANSFORMS else self.topic))
        if self.as_ == TRANSFORMS:
            # Several share the queue.
            object.__setattr__(self, 'depth', max(self.depth, _TRANSFORMS_DEPTH))
        if self.reliability == 'auto':
            match_all = self.direction == 'in' and self.durability == 'volatile'
            object.__setattr__(self, 'reliability', 'best_effort' if match_all else 'reliable')

    def as_written(self) -> MirrorSettings:
        """Return the mirror with its pattern in place of the topic."""
        return replace(self, topic=self.pattern, ros_topic=self.ros_pattern
                       ) if self.pattern else self


@dataclass(frozen=True, slots=True)
class MountedFrame:
    """
    The mounting of a frame of a device.

    :ivar stated: the configuration has the mounting; False for the default mounting.
    """

    frame_id: str
    mounting: Mounting
    stated: bool = True


@dataclass(frozen=True, slots=True)
class RobotSettings:
    """
    The settings of a whole robot, checked.

    :ivar frames: of all devices, each once.
    :ivar files: real paths of the parameter files.
    :ivar simulation_asked: the user asked for simulated devices; False when they are simulated
        only because no other configuration was given.
    """

    autostart: bool = setting(True, 'the node configures and activates itself')
    diagnostics_rate_hz: float = setting(
        1.0, 'how often /diagnostics is published', 'Hz', SLOWEST_HZ, 100.0)
    static_transforms: str = setting(
        'mounted', 'frames of devices that the node publishes on /tf_static: mounted: those with '
        'a mounting; all; none: if a robot description publishes them',
        choices=('mounted', 'all', 'none'))
    core: CoreSettings = CoreSettings()
    parameters_file: str = setting(
        '', 'file for the changed parameters, written by ~/save_parameters; when absent the name '
        'of the robot and .saved.yaml, in $ROS_HOME or ~/.ros')
    devices: tuple[DeviceSettings, ...] = setting(
        (), 'names of the devices, each with a section of that name')
    modules: tuple[ModuleSettings, ...] = setting(
        (), 'names of the modules, each with a section of that name')
    topics: tuple[TopicSettings, ...] = setting(
        (), 'names of further core topics, each with a section of that name')
    mirrors: tuple[MirrorSettings, ...] = setting(
        (), 'names of the mirrors to ROS, each with a section of that name')
    services: tuple[ServiceSettings, ...] = setting(
        (), 'names of services of the node, each with a section of that name')
    watchdog: WatchdogSettings = WatchdogSettings()
    log: LogSettings = LogSettings()
    frames: tuple[MountedFrame, ...] = ()
    world: WorldSettings = WorldSettings()
    files: tuple[str, ...] = field(default=(), compare=False)
    simulation_asked: bool = field(default=True, compare=False)

    @property
    def mountings(self) -> Mapping[str, Mounting]:
        """Return the mountings of the frames of all devices, by frame name."""
        return MappingProxyType({each.frame_id: each.mounting for each in self.frames})

    @property
    def simulated(self) -> tuple[str, ...]:
        """Return the names of the simulated devices."""
        return tuple(device.name for device in self.devices if device.port == SIM_PORT)


def _nested() -> tuple[Mapping[str, type], Mapping[str, type]]:
    sections: dict[str, type] = {}
    lists: dict[str, type] = {}
    written = {each.name for each in declared(RobotSettings)}
    for name, hint in hints_of(RobotSettings).items():
        item = next(iter(get_args(hint)), None)
        if isinstance(hint, type) and is_dataclass(hint):
            sections[name] = hint
        elif name in written and isinstance(item, type) and is_dataclass(item):
            lists[name] = item
    return MappingProxyType(sections), MappingProxyType(lists)


# The types of the sections with a fixed name, and of those that are named in a list.
SECTIONS, LISTS = _nested()


def frozen(value: Any) -> Any:
    """Turn lists into tuples and dictionaries into read-only mappings, recursively."""
    if isinstance(value, Mapping):
        return MappingProxyType({key: frozen(item) for key, item in value.items()})
    if isinstance(value, list | tuple):
        return tuple(frozen(item) for item in value)
    return value
