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

"""Who publishes what in a robot, and how often: from that follows who releases whom."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rt_robot_os.drivers.registry import DRIVERS
from rt_robot_os.modules.registry import module_class
from rt_robot_os.plan.task import Event
from rt_robot_os.settings import DeviceSettings
from rt_robot_os.settings import ModuleSettings
from rt_robot_os.settings import RobotSettings
from rt_robot_os.units import period_from_rate

COMMANDS = 'link/commands'


@dataclass(frozen=True, slots=True)
class Source:
    """
    A task that publishes a topic.

    :ivar task: its name.
    :ivar priority: of the task.
    :ivar task_rate_hz: how often it runs by its timer; 0 without.
    :ivar topic_rate_hz: how often it publishes the topic; 0 when it may in each job.
    """

    task: str
    priority: int
    task_rate_hz: float
    topic_rate_hz: float


class Wiring:
    """
    The topics of a robot.

    Devices and modules are made, as the core makes them, and asked; none is opened.
    """

    def __init__(self, settings: RobotSettings) -> None:
        self._settings = settings
        self._sources: dict[str, list[Source]] = {}
        self._waking: dict[str, tuple[str, ...]] = {}
        for device in settings.devices:
            self._add_device(device)
        for module in settings.modules:
            self._add_module(module)
        rates = {topic.topic: topic.rate_hz for topic in settings.topics}
        #: Topics that ROS feeds, with the rate that is expected; 0 when unknown.
        self.inputs: dict[str, float] = {}
        for mirror in settings.mirrors:
            if mirror.direction == 'in':
                self.inputs[mirror.topic] = rates.get(mirror.topic, 0.0)
        for topic, rate_hz in self.inputs.items():
            self._add(topic, Source(COMMANDS, settings.core.command_priority, 0.0, rate_hz))

    def _add(self, topic: str, source: Source) -> None:
        self._sources.setdefault(topic, []).append(source)

    def _add_device(self, device: DeviceSettings) -> None:
        made = DRIVERS.load(device.type)(device.name, dict(device.settings))
        for each in made.publications():
            self._add(each.topic, Source(device.name, device.priority, device.rate_hz,
                                         each.rate_hz))

    def _add_module(self, entry: ModuleSettings) -> None:
        module = module_class(entry.type)(entry.name, entry.settings)
        for each in module.publications():
            self._add(each.topic, Source(entry.name, entry.priority, entry.rate_hz, 0.0))
        self._waking[entry.name] = module.waking_topics()

    def outputs(self) -> tuple[str, ...]:
        """Give the topics that ROS sees, each once."""
        return tuple(dict.fromkeys(
            mirror.topic for mirror in self._settings.mirrors if mirror.direction == 'out'))

    def waking(self, module: str) -> tuple[str, ...]:
        """Give the topics whose publications release a module."""
        return self._waking.get(module, ())

    def events(self, topics: Sequence[str], priority: int) -> tuple[Event, ...]:
        """
        Say what releases a task of a priority that wakes on topics.

        What one job of a task at or above this priority publishes, on any of the topics, makes
        one release: the others find it waiting already.
        """
        by_task: dict[str, list[Source]] = {}
        for topic in topics:
            for source in self._sources.get(topic, ()):
                by_task.setdefault(source.task, []).append(source)
        found: list[Event] = []
        for name, sources in by_task.items():
            rates = [source.topic_rate_hz for source in sources]
            task_rate_hz = sources[0].task_rate_hz
            seldom = all(rates) and (not task_rate_hz or sum(rates) < task_rate_hz)
            if seldom or (all(rates) and priority > sources[0].priority):
                # What arrived since the poll before comes together: a jitter of one poll.
                jitter_ns = period_from_rate(task_rate_hz) if task_rate_hz else 0
                found += (Event(name, period_from_rate(rate), jitter_ns) for rate in rates)
            else:
                found.append(Event(name))
        return tuple(found)
