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
The checked settings: frozen facts that the node, the core and the tools share.

Each setting is declared here and nowhere else; see :func:`rt_robot_os.base.schema.setting`.
Drivers, simulators and modules bring their own.
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

_TRANSFORMS_DEPTH: Final = 100  # as tf2_ros has it
_LONGEST_US: Final = 1e9  # a period, a deadline, a budget


def _nothing() -> Mapping[str, Any]:
    return MappingProxyType({})


def _values(kind: type[Enum]) -> tuple[Any, ...]:
    return tuple(each.value for each in kind)


def _enabled() -> Any:
    return setting(True, 'false: it is left out, and its topics are silent')


def _max_subscribers() -> Any:
    return setting(int(MAX_SUBSCRIBERS), 'most modules that may read one of its topics (of '
                   'several sections that publish it the largest number counts); mirrors and '
                   'recordings do not count', minimum=1, maximum=SUBSCRIBERS_MAXIMUM)


def _log_level() -> Any:
    return setting('info', 'the least severity that it logs', choices=LEVELS, live=True)


@dataclass(frozen=True, slots=True)
class TaskSettings:
    """What a device or a module declares of its task, besides rate and priority."""

    phase_us: float = setting(0.0, 'first release after the start', 'us', 0.0, _LONGEST_US)
    deadline_us: float = setting(
        0.0, 'time from a release to the latest end of its job; 0: the period, without a rate '
        'none', 'us', 0.0, _LONGEST_US)
    budget_us: float = setting(
        0.0, 'computing time a job may use, what preempts it not counted; 0: any', 'us', 0.0,
        _LONGEST_US)
    on_budget: str = setting(
        TaskSpec.on_budget.value, 'what happens to a job that uses more: count it, or abort it',
        choices=_values(BudgetPolicy))
    overrun: str = setting(
        TaskSpec.overrun.value, 'what happens to a release that finds the job before unfinished',
        choices=_values(OverrunPolicy))
    catch_up: int = setting(
        TaskSpec.catch_up, 'most releases made up for, with overrun: catch_up', minimum=1,
        maximum=BACKLOG_MAXIMUM)
    overrun_limit: int = setting(
        TaskSpec.overrun_limit, 'overruns after which the failure policy is applied; 0: never',
        minimum=0, maximum=OVERRUN_LIMIT_MAXIMUM)
    overrun_leak: int = setting(
        TaskSpec.overrun_leak, 'jobs without overrun that take one overrun away', minimum=1,
        maximum=1_000_000)
    failure: str = setting(
        TaskSpec.failure.value, 'what follows an exception, an abort or too many overruns',
        choices=_values(FailurePolicy))
    restart_s: float = setting(
        TaskSpec.restart_ns / NS_PER_S, 'wait before the first restart; doubled with each', 's',
        0.001, 3600.0)
    restart_max_s: float = setting(
        TaskSpec.restart_maximum_ns / NS_PER_S, 'longest wait before a restart', 's', 0.001,
        3600.0)
    critical: bool = setting(TaskSpec.critical, 'the watchdog watches it')
    resources: tuple[str, ...] = setting(
        (), 'names of what it may lock; tasks that name the same share it')
    logical_execution: bool = setting(
        TaskSpec.logical, 'inputs are those of the release, outputs are published at the deadline')
    execution_us: float = setting(
        0.0, 'longest computing time of a job as you know it, for plan; 0: unknown', 'us', 0.0,
        _LONGEST_US)


@dataclass(frozen=True, slots=True)
class DeviceSettings:
    """
    One device in the SensorManager's list.

    :ivar name: its section; unique in the robot.
    :ivar port: where it is; ``SIM_PORT`` for a simulated one, empty when the driver has no port.
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
        'poll', 'when it is read: poll at rate_hz; interrupt as bytes arrive too (a device on I2C '
        'always, but with logical_execution)', choices=('poll', 'interrupt'))
    timeout_s: float = setting(
        1.0, 'silence after which the device counts as faulty', 's', 0.01, 3600.0)
    retry_s: float = setting(
        0.5, 'wait before it is opened again; doubles with each failure', 's', 0.01, 3600.0)
    retry_max_s: float = setting(10.0, 'longest wait between two tries', 's', 0.01, 3600.0)
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
        50.0, 'how often the module steps; 0: only when an input wakes it', 'Hz', 0.0, FASTEST_HZ,
        live=True)
    priority: int = priority_setting(40, 'priority of its task; higher runs first')
    max_subscribers: int = _max_subscribers()
    log_level: str = _log_level()
    task: TaskSettings = inline(TaskSettings())
    settings: Mapping[str, Any] = field(default_factory=_nothing)


@dataclass(frozen=True, kw_only=True)
class TopicSettings(TopicSpec):
    """
    A topic of the core that no device and no module declares.

    :ivar name: its section, and its name in the core unless ``topic`` says another.
    :ivar tail: None for 0.
    """

    name: str
    topic: str = setting('', 'its name in the core; the name of the section when absent')
    message: str = setting(REQUIRED, 'its type, such as geometry_msgs/msg/Twist')
    depth: int = setting(
        8, 'slots in the ring; a power of two', minimum=1, maximum=DEPTH_MAXIMUM)
    rate_hz: float = setting(0.0, 'rate expected; 0: unknown', 'Hz', 0.0, FASTEST_HZ)
    tail: int | None = setting(
        0, 'most bytes of the one sequence of variable length; 0: there is none', 'bytes', 0,
        64 * 1024 * 1024)
    max_subscribers: int = _max_subscribers()

    def __post_init__(self) -> None:
        object.__setattr__(self, 'topic', self.topic or self.name)
        object.__setattr__(self, 'tail', self.tail or None)


@dataclass(frozen=True, slots=True, kw_only=True)
class MirrorSettings:
    """
    A topic of the core mirrored to or from a ROS topic.

    :ivar name: its section; all topics that one pattern stands for have the same.
    :ivar message: the type of the topic in the core.
    :ivar core_frame_id: the frame that all messages of the topic in the core are in.
    :ivar pattern: what was written as ``topic``, such as ``wsn/*``; empty where it names one.
    :ivar ros_pattern: what was written as ``ros_topic`` beside it.
    :ivar ros_topic: as the user wrote it; relative names follow the node's namespace.
    :ivar reliability: never ``auto``: that is decided when it is made.
    """

    name: str
    topic: str = setting(
        REQUIRED, 'the topic in the core; each * stands for any text: wsn/* goes to ROS with all '
        'topics that begin so and that no other mirror names or has matched before')
    message: str
    core_frame_id: str = ''
    pattern: str = ''
    ros_pattern: str = ''
    direction: str = setting(
        'out', 'where it goes: out to ROS or in from it', choices=('out', 'in'))
    ros_topic: str = setting(
        '', 'the topic in ROS; the same name when absent; beside a topic with * it has as many, '
        'for the same texts')
    policy: str = setting(
        Policy.DRAIN.value, 'what is handed on: drain every sample, latest the newest',
        choices=_values(Policy), live=True)
    max_rate_hz: float = setting(
        0.0, 'most samples a second; 0: no limit', 'Hz', 0.0, FASTEST_HZ, live=True)
    delay_ms: float = setting(
        0.0, 'longest time a sample may wait on its way out to go with others: core and node '
        'spend less on each; 0: no longer than core.link_gather_ms', 'ms', 0.0, DELAY_MAXIMUM_MS,
        live=True)
    reliability: str = setting(
        'auto', 'quality of service; auto: reliable outward, inward best_effort, which hears '
        'every publisher, and reliable with transient_local',
        choices=('auto', 'reliable', 'best_effort'))
    durability: str = setting(
        'volatile', 'quality of service', choices=('volatile', 'transient_local'))
    depth: int = setting(10, 'length of the ROS queue', 'samples', 1, 10_000)
    stamped: bool = setting(
        False, 'the ROS topic has the type with a header, such as TwistStamped where the core has '
        'Twist; inward its age counts as that of the sample')
    as_: str = setting(
        '', 'the type that the ROS topic has in place of that in the core: '
        f'{TRANSFORMS} (several on one topic, /tf when ros_topic is absent), {PATH}, {MARKERS} '
        f'(of a sensor network), {DIAGNOSTICS} (of diagnoses in JSON, such as alarms/list)')
    frame_id: str = setting(
        '', 'in the header of what goes out, with stamped: true or as; of a path, map when '
        'absent: with another one it is refused')

    def __post_init__(self) -> None:
        object.__setattr__(self, 'ros_topic', self.ros_topic or (
            '/tf' if self.as_ == TRANSFORMS else self.topic))
        if self.as_ == TRANSFORMS:
            # Several share the queue.
            object.__setattr__(self, 'depth', max(self.depth, _TRANSFORMS_DEPTH))
        if self.reliability == 'auto':
            hears_all = self.direction == 'in' and self.durability == 'volatile'
            object.__setattr__(self, 'reliability', 'best_effort' if hears_all else 'reliable')

    def as_written(self) -> MirrorSettings:
        """Return it with the pattern that it comes from in place of the topic."""
        return replace(self, topic=self.pattern, ros_topic=self.ros_pattern
                       ) if self.pattern else self


@dataclass(frozen=True, slots=True)
class MountedFrame:
    """
    Where a frame of a device is.

    :ivar stated: the configuration says where; False for a device with the default mounting.
    """

    frame_id: str
    mounting: Mounting
    stated: bool = True


@dataclass(frozen=True, slots=True)
class RobotSettings:
    """
    The whole robot, checked.

    :ivar frames: those of all devices, each once.
    :ivar files: real paths of the parameter files that it was read from.
    :ivar simulation_asked: somebody wanted the devices simulated; False when it is only for want
        of another configuration.
    """

    autostart: bool = setting(True, 'the node configures and activates itself')
    diagnostics_rate_hz: float = setting(
        1.0, 'how often /diagnostics is published', 'Hz', SLOWEST_HZ, 100.0)
    static_transforms: str = setting(
        'mounted', 'which frames of devices the node publishes on /tf_static: those that say '
        'where they are mounted; all; or none, where a robot description does it',
        choices=('mounted', 'all', 'none'))
    core: CoreSettings = CoreSettings()
    parameters_file: str = setting(
        '', 'where ~/save_parameters writes what was changed; when absent the name of the robot '
        'and .saved.yaml, in $ROS_HOME or ~/.ros')
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
        """Return where the frames of all devices are, by name."""
        return MappingProxyType({each.frame_id: each.mounting for each in self.frames})

    @property
    def simulated(self) -> tuple[str, ...]:
        """Return the names of the devices that are simulated."""
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


# The sections with a name of their own, and the lists of names of sections: what each holds.
SECTIONS, LISTS = _nested()


def frozen(value: Any) -> Any:
    """Turn lists into tuples and dictionaries into read-only mappings, all the way down."""
    if isinstance(value, Mapping):
        return MappingProxyType({key: frozen(item) for key, item in value.items()})
    if isinstance(value, list | tuple):
        return tuple(frozen(item) for item in value)
    return value
