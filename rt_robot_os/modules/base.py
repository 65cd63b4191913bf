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
The base class of function modules.

A module declares its inputs, outputs and settings at class level, and does its work in
:meth:`Module.step`::

    class Tilt(Module):
        imu = Input('imu/data')
        tilt = Output('tilt', 'std_msgs/msg/Float64')

        def step(self):
            while self.imu.take():
                x, y, z = self.imu.msg.linear_acceleration
                self.tilt.msg.data = math.atan2(math.hypot(x, y), z)
                self.tilt.publish(self.imu.stamp_ns)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import TopicError
from rt_robot_os.base.logger import Logger
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import period_from_rate
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Resource
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import Ticks
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.run_on import RunOn
from rt_robot_os.topics import Bus
from rt_robot_os.topics import MAX_SUBSCRIBERS
from rt_robot_os.topics.ports import Output
from rt_robot_os.topics.ports import PortOwner


_JOB_GRID_NS: Final = 10 * NS_PER_MS


class Module(PortOwner):
    """
    A function module.

    :param name: unique among tasks.
    :param settings: a validated value for each of :meth:`fields`.
    :cvar SETTINGS: the settings, in addition to rate, priority and topics.
    :cvar RATE_HZ: the default rate; 0 when inputs release it, None for the common default.
    :ivar mountings: the mountings of all devices, by name, from :meth:`configure` on; see
        :func:`rt_robot_os.motion.mounting.in_base`.
    :ivar run_on: stopping distance of the robot after a failure of this computer, as its motor
        boards declare it; from :meth:`configure` on.
    :ivar log: the module's logger: ``self.log.info('%.1f m', range_m, throttle_s=1.0)``.
    """

    NOUN = 'module'
    CONNECTED_FROM = 'configure()'
    RATE_HZ: ClassVar[float | None] = None
    mountings: Mapping[str, Mounting] = MappingProxyType({})
    run_on: RunOn = RunOn()

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        super().__init__(name, settings)
        self.log = Logger(name)
        self.task: Task | None = None
        self.kernel: Kernel | None = None
        self._rate_hz = 0.0

    # ---- to be overridden by the author ------------------------------------------------------

    def configure(self) -> None:
        """Prepare: the topics exist, no task runs yet; may take long."""

    def activate(self) -> None:
        """Do the last preparations, right before the kernel starts."""

    def step(self) -> None:
        """Do one job, in the real-time loop."""
        raise NotImplementedError(f'{type(self).__name__} has no step()')

    async def run(self) -> None:
        """
        Do the work as a coroutine, instead of :meth:`step`; each segment between awaits is a job.

        It can await ``self.<input>.next()``, ``self.kernel.sleep(ns)``, events, and
        ``self.ticks().next()`` for its rate. Only a module that overrides it is a coroutine.
        """
        raise NotImplementedError(f'{type(self).__name__} has no run()')

    def awaits(self) -> tuple[str, ...]:
        """
        Return the inputs that ``run()`` awaits, by attribute; for ``plan``.

        Without them, and without :meth:`own_rounds_hz`, the releases of a coroutine are unknown.
        """
        return ()

    def own_rounds_hz(self) -> float:
        """Return the maximum rate at which ``run()`` awaits a time; for ``plan``."""
        return 0.0

    def ticks(self) -> Ticks:
        """
        Return a grid of times at the module's rate, to be awaited in ``run()``.

        :raises TaskError: it has no rate.
        """
        if self.kernel is None:
            raise TopicError(f'module {self.name!r}: there are no ticks before it runs')
        return self.kernel.every(self._rate_hz)

    def deactivate(self) -> None:
        """
        Leave a safe state: called after the kernel stopped, also after a failure.

        With ``failure: restart`` it is also called before each restart; activate() follows,
        configure() does not.
        """

    def safe_state(self) -> None:
        """
        Bring the outputs to a safe state, once, on a request of the failure policy or watchdog.

        No step follows until the task is re-armed. Only a module that overrides it has a safe
        state.
        """
        raise NotImplementedError(f'{type(self).__name__} has no safe_state()')

    def resource(self, name: str) -> Resource:
        """
        Return a resource of the section's ``resources``, to be entered with ``with`` in a step.

        :raises ConfigError: the section does not list it.
        """
        if self.kernel is None or self.task is None:
            raise ConfigError([f'module {self.name!r}: resource {name!r} is available from '
                               'configure() on, not in __init__'])
        found = self.kernel.resource(name)
        if self.task not in found.users:
            raise ConfigError([f'{self.name}.resources does not list {name!r}, which the module '
                               f'uses: add it'])
        return found

    def statistics(self) -> Mapping[str, Any]:
        """
        Return counters and state for ``/diagnostics``; called by the lowest-priority task.

        :return: numbers and strings by name; a non-empty ``warning`` reports a problem.
        """
        return {}

    # ---- declarations ------------------------------------------------------------------------

    @property
    def period_ns(self) -> int:
        """
        Return the configured time from one step to the next; 0 without a rate.

        It has the same value in a replay, where the recording releases the module.
        """
        return period_from_rate(self._rate_hz) if self._rate_hz else 0

    @property
    def job_ns(self) -> int:
        """
        Return the start of the current job, rounded down to 10 ms; 0 outside of a job.

        For times that have to be the same in a replay: there jobs begin some us earlier or later,
        and ``now_ns()`` differs. This differs in one of a thousand jobs.
        """
        start_ns = self.task.start_ns if self.task is not None else 0
        return max(0, start_ns - start_ns % _JOB_GRID_NS)

    @classmethod
    def is_coroutine(cls) -> bool:
        """Return whether it overrides ``run()``, which replaces ``step()``."""
        return cls.run is not Module.run

    @classmethod
    def has_safe_state(cls) -> bool:
        """Return whether it overrides ``safe_state()``."""
        return cls.safe_state is not Module.safe_state

    def output_rate_hz(self) -> float:
        """Return the module's rate."""
        return self._rate_hz

    # ---- used by the core --------------------------------------------------------------------

    def job(self) -> None:
        """Apply changed settings, then do one step; the function of the module's task."""
        if self.changes:
            self.apply_changes()
        self.step()

    def change(self, name: str, value: Any) -> Any:
        """
        Change a live setting, or ``rate_hz`` of the module's task, as of its next release.

        :raises ConfigError: as for :meth:`LiveSettings.change`.
        :raises TaskError: the rate is out of range, or the module has none.
        """
        if name == 'rate_hz' and self.task is not None:
            self.task.set_rate_hz(value)
            self._rate_hz = float(value)
            return self._rate_hz
        return super().change(name, value)

    def declare(self, bus: Bus, rate_hz: float, max_subscribers: int = MAX_SUBSCRIBERS) -> None:
        """
        Declare the outputs, so that all topics exist before the first subscription.

        :param max_subscribers: the maximum for each of them.
        """
        self._rate_hz = rate_hz
        sources = {self.topic_of(attribute): self.topic_of(port.follows)
                   for attribute, port in self.used(Output).items() if port.follows}
        rates_hz = {topic.name: topic.rate_hz for topic in bus.topics}
        for spec in self.publications():
            source_hz = rates_hz.get(sources.get(spec.topic, ''), 0.0)
            if 0.0 < source_hz < spec.rate_hz:
                spec = replace(spec, rate_hz=source_hz)
            bus.add(spec, max_subscribers)

    def bind(self, bus: Bus, task: Task) -> None:
        """
        Connect inputs and outputs.

        :raises TopicError: an input's topic is not declared.
        """
        self.task = task
        self.kernel = bus.kernel
        self.connect(bus, task)
