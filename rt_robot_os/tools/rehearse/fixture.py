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
The fixture of scenarios: a core with a robot's own settings on the virtual clock.

The core creates all modules that make decisions (readings, assessments, rules, alarms, the agent)
from the settings, as on the robot. Devices and the modules for localization, planning and driving
are omitted: participants publish their messages.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from typing import Final
from typing import Protocol

from rt_robot_os.base.errors import TopicError
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.core.app import Core
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.modules.registry import module_class
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import TopicSettings
from rt_robot_os.settings import WatchdogSettings
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription

#: Types of modules that participants simulate, because they need a body or much computing time.
SIMULATED: Final = frozenset({
    'attitude', 'collision_guard', 'localization', 'odometry', 'person_finder', 'planner',
    'trajectory', 'velocity_mux'})
_STAGE: Final = 'rehearsal/fixture'
_ABOVE_ALL: Final = 99
#: The period of participants.
STEP_NS: Final = 50_000_000


class Participant(Protocol):
    """Simulates some of the omitted devices and modules."""

    def attach(self, fixture: CoreFixture) -> None:
        """Find the topics; called once for each core, also after a crash."""

    def step(self, now_ns: int) -> None:
        """Simulate one step; called every :data:`STEP_NS` of virtual time."""


class CoreFixture:
    """
    One run of a core.

    :param settings: of the robot.
    :param participants: called in this order.
    :param start_ns: start time; after a crash the time continues.
    :raises RtRobotError: the settings are inconsistent.
    :ivar core: the real core, on a virtual clock.
    """

    def __init__(self, settings: RobotSettings, participants: Sequence[Participant],
                 start_ns: int = 0) -> None:
        kept = tuple(each for each in settings.modules if each.type not in SIMULATED)
        simulated = _simulated_topics(settings, {each.name for each in kept})
        self.core = Core(
            replace(settings, devices=(), modules=kept, mirrors=(), watchdog=WatchdogSettings(),
                    topics=(*settings.topics, *simulated),
                    core=replace(settings.core, record_bytes=False, dispatcher='preemptive',
                                 spin_us=0.0)),
            Path('rehearsal'), clock=VirtualClock(start_ns))
        self.bus = self.core.bus
        self._participants = tuple(participants)
        self.core.kernel.add_task(_STAGE, self._step, priority=_ABOVE_ALL,
                                  rate_hz=NS_PER_S / STEP_NS)
        for participant in self._participants:
            participant.attach(self)

    @property
    def now_ns(self) -> int:
        """Return the virtual time."""
        return self.core.kernel.now_ns()

    def publisher(self, topic: str) -> Publisher | None:
        """Return a publisher of a topic; None if no module reads it."""
        try:
            return self.bus.publisher(topic)
        except TopicError:
            return None

    def reader(self, topic: str) -> Subscription | None:
        """Return a subscription; None if there is no topic with this name."""
        try:
            return self.bus.subscribe(topic, _STAGE)
        except TopicError:
            return None

    def run(self, until_ns: int) -> None:
        """
        Run up to a time in one call, because timers end with a run of the kernel.

        :raises AssertionError: a job failed; the message says which.
        """
        kernel = self.core.kernel
        kernel.run(max(until_ns - self.now_ns, 1))
        if kernel.failures:
            raise AssertionError(f'jobs that failed: {kernel.failures_total}; the last: '
                                 f'{kernel.failures[-1]}')

    def end(self) -> None:
        """End the run early."""
        self.core.kernel.stop('settled')

    def close(self) -> None:
        """Close the core, as at the end of a robot's run; may be called twice."""
        self.core.close()

    def _step(self) -> None:
        now_ns = self.now_ns
        for participant in self._participants:
            participant.step(now_ns)


def _simulated_topics(settings: RobotSettings, kept: set[str]) -> Iterator[TopicSettings]:
    """Yield the topics of all omitted devices and modules, each once."""
    known = {topic.topic for topic in settings.topics}
    for each in settings.modules:
        if each.name in kept:
            known.update(spec.topic for spec in _made(module_class(each.type), each))
    for each in settings.modules:
        if each.name not in kept:
            yield from _new(_made(module_class(each.type), each), known)
    for device in settings.devices:
        yield from _new(_made(DRIVERS.load(device.type), device), known)


def _made(kind: type[Any], each: Any) -> Sequence[TopicSpec]:
    found: Sequence[TopicSpec] = kind(each.name, each.settings).publications()
    return found


def _new(specs: Sequence[TopicSpec], known: set[str]) -> Iterator[TopicSettings]:
    for spec in specs:
        if spec.topic and spec.topic not in known:
            known.add(spec.topic)
            yield TopicSettings(
                name=spec.topic, topic=spec.topic, message=spec.message, fixed=spec.fixed,
                depth=spec.depth, rate_hz=spec.rate_hz, tail=spec.tail)
