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

"""Which task publishes which topic, and how often: from that follows which task releases which."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace
import math

from rt_robot_os.base.schema import STAR
from rt_robot_os.base.schema import star_match
from rt_robot_os.base.units import period_from_rate
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.modules.registry import module_class
from rt_robot_os.settings import DeviceSettings
from rt_robot_os.settings import ModuleSettings
from rt_robot_os.settings import RobotSettings
from rt_robot_os.tools.plan.task import Event
from rt_robot_os.topics.ports import PortOwner
from rt_robot_os.topics.ports import WAKE_ON_ALL

COMMANDS = 'link/commands'


@dataclass(frozen=True, slots=True)
class Source:
    """
    A task that publishes a topic.

    :ivar task: its name; empty for the world outside.
    :ivar priority: of the task.
    :ivar task_rate_hz: how often it runs by its timer; 0 without.
    :ivar topic_rate_hz: how often it publishes the topic; 0 when it may in each job.
    :ivar promised: that is what it promises in the long run, not what its timer makes.
    """

    task: str
    priority: int
    task_rate_hz: float
    topic_rate_hz: float
    promised: bool = False


class Wiring:
    """
    The topics of a robot.

    Devices and modules are made, as the core makes them, and asked; none is opened.
    """

    def __init__(self, settings: RobotSettings) -> None:
        self._settings = settings
        self._sources: dict[str, list[Source]] = {}
        self._wakes: dict[str, dict[str, bool | int | str]] = {}
        self._own_rounds_hz: dict[str, float] = {}
        self._coroutines: set[str] = set()
        self._awaited: dict[str, frozenset[str]] = {}
        for device in settings.devices:
            self._add_device(device)
        for module in settings.modules:
            self._add_module(module)
        rates = {topic.topic: topic.rate_hz for topic in settings.topics}
        #: Topics that ROS feeds, with the rate that is expected; 0 when unknown.
        self.inputs: dict[str, float] = {}
        for mirror in settings.mirrors:
            if mirror.direction == 'in':
                # A topic that modules write as well has no section of its own.
                self.inputs[mirror.topic] = rates.get(mirror.topic) or mirror.max_rate_hz
        # Nothing in the configuration feeds these: clients of the core may, such as `mapping`.
        not_fed = [topic for topic in rates if topic not in self._sources | self.inputs.keys()]
        for wakes in self._wakes.values():
            for pattern in [topic for topic in wakes if STAR in topic]:
                wake = wakes.pop(pattern)
                wakes.update((topic, wake) for topic in self._sources
                             if star_match(pattern, topic) is not None)
        #: Those of them that release a task; the cost of that is not counted.
        self.not_counted = tuple(
            topic for topic in not_fed if any(topic in wakes for wakes in self._wakes.values()))
        for topic, rate_hz in self.inputs.items():
            self._add(topic, Source(COMMANDS, settings.core.command_priority, 0.0, rate_hz))

    def _add(self, topic: str, source: Source) -> None:
        self._sources.setdefault(topic, []).append(source)

    def _add_device(self, device: DeviceSettings) -> None:
        made = DRIVERS.load(device.type)(device.name, dict(device.settings))
        for each in made.publications():
            self._add(each.topic, Source(device.name, device.priority, device.rate_hz,
                                         each.rate_hz or each.most_hz))
        if made.is_released:
            self._wakes[device.name] = _wakes_of(made)
            self._own_rounds_hz[device.name] = made.own_rounds_hz()

    def _add_module(self, entry: ModuleSettings) -> None:
        module = module_class(entry.type)(entry.name, entry.settings)
        for each in module.publications():
            self._add(each.topic, Source(entry.name, entry.priority, entry.rate_hz,
                                         each.most_hz, promised=bool(each.most_hz)))
        self._wakes[entry.name] = _wakes_of(module)
        if module.is_coroutine():
            awaited = {module.topic_of(each): True for each in module.awaits()}
            self._wakes[entry.name].update(awaited)
            self._awaited[entry.name] = frozenset(awaited)
            self._own_rounds_hz[entry.name] = module.own_rounds_hz()
            if not (self._wakes[entry.name] or module.own_rounds_hz()):
                self._coroutines.add(entry.name)

    def outputs(self) -> tuple[str, ...]:
        """Return the topics that ROS sees, each once."""
        return tuple(dict.fromkeys(
            mirror.topic for mirror in self._settings.mirrors if mirror.direction == 'out'))

    def samples_hz(self, device: str) -> float:
        """Return how many samples a second a device is expected to give: of its fastest topic."""
        return max((source.topic_rate_hz for sources in self._sources.values()
                    for source in sources if source.task == device), default=0.0)

    def is_coroutine(self, module: str) -> bool:
        """
        Return whether a module is an ``async def run`` that decides itself when it continues.

        One that declares which inputs it awaits, or its own rounds, continues with those.
        """
        return module in self._coroutines

    def outputs_events(self, priority: int) -> tuple[Event, ...]:
        """
        Return what releases the task of a priority that carries topics to ROS.

        At most: publications that go out together release it once.
        """
        return self._events(dict.fromkeys(self.outputs(), 1), priority)

    def is_released(self, device: str) -> bool:
        """Return whether a device has rounds besides those of its rate and its bytes."""
        return device in self._own_rounds_hz

    def reader_events(self, name: str, priority: int) -> tuple[Event, ...]:
        """Return what releases a device or a module that wakes on topics."""
        wakes = self._wakes.get(name, {})
        together = [topic for topic, wake in wakes.items() if wake == WAKE_ON_ALL]
        single = {topic: int(wake) for topic, wake in wakes.items() if wake != WAKE_ON_ALL}
        own_hz = self._own_rounds_hz.get(name, 0.0)
        own = (Event('', period_from_rate(own_hz)),) if own_hz else ()
        return self._events(single, priority, name) + self._together(together, priority) + own

    def _together(self, topics: Sequence[str], priority: int) -> tuple[Event, ...]:
        """
        Return what releases a task when each of some topics has something new.

        It is released once for each publication of any of them at most, and once more for what
        was there before: the one that comes least often counts.
        """
        if not topics:
            return ()
        slowest = min(topics, key=self._rate_hz)
        return tuple(replace(event, waits=True) for event in self._events({slowest: 1}, priority))

    def _rate_hz(self, topic: str) -> float:
        """Return the rate of a topic; infinity when it is not known."""
        return sum(source.topic_rate_hz or source.task_rate_hz or math.inf
                   for source in self._sources.get(topic, ()))

    def _events(self, topics: Mapping[str, int], priority: int, reader: str = ''
                ) -> tuple[Event, ...]:
        """
        Return what releases a task of a priority that wakes on every n-th sample of topics.

        What one job of a task at or above this priority publishes, on any of the topics, makes
        one release: the others find it waiting already.
        """
        by_task: dict[str, list[tuple[Source, int]]] = {}
        for topic, every in topics.items():
            for source in self._sources.get(topic, ()):
                source = self._answering(source, reader)
                by_task.setdefault(source.task, []).append((source, every))
        found: list[Event] = []
        for name, sources in by_task.items():
            rates = [source.topic_rate_hz / every for source, every in sources]
            first = sources[0][0]
            if all(source.promised for source, _ in sources):
                found += (Event(name, period_from_rate(rate), promised=True) for rate in rates)
                continue
            above = priority > first.priority
            seldom = all(rates) and (not first.task_rate_hz or sum(rates) < first.task_rate_hz)
            if seldom or (all(rates) and above):
                # What arrived since the poll before comes together: a jitter of one poll.
                jitter_ns = period_from_rate(first.task_rate_hz) if first.task_rate_hz else 0
                found += (Event(name, period_from_rate(rate), jitter_ns) for rate in rates)
            elif above or len(sources) == 1:
                found += (Event(name, every=every) for _, every in sources)
            else:
                found.append(Event(name))
        return tuple(found)

    def _answering(self, source: Source, reader: str) -> Source:
        """
        Return a source as its reader has to count with it.

        A coroutine may answer those whose topics it awaits. The answer releases them, but is not
        answered in turn without end: it comes at most as often as the coroutine has rounds, and is
        counted as what comes from outside, for a circle of releases has no bound.
        """
        rounds_hz = self._own_rounds_hz.get(source.task, 0.0)
        if rounds_hz and not source.promised and any(
                each.task == reader for topic in self._awaited.get(source.task, ())
                for each in self._sources.get(topic, ())):
            return Source('', source.priority, 0.0, rounds_hz)
        return source


def _wakes_of(owner: PortOwner) -> dict[str, bool | int | str]:
    return {each.topic: each.wake for each in owner.reads() if each.wake}
