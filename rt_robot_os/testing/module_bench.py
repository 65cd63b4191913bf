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

"""Modules on a kernel with a virtual clock: an hour passes as fast as it can be computed."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from types import TracebackType
from typing import Any
from typing import TypeVar

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.kernel.spec import RATE_MINIMUM_HZ
from rt_robot_os.modules import Module
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.run_on import RunOn
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription

ModuleT = TypeVar('ModuleT', bound=Module)


class ModuleBench:
    """
    Run modules with inputs from a test, and read their outputs.

    Order: :meth:`topic` for each input, :meth:`add` for each module, :meth:`watch` for each
    output, :meth:`at` for later events, then :meth:`run`.

    :ivar kernel: on the virtual clock.
    :ivar bus: its topics.
    :ivar mountings: mountings of the frames of devices, for the modules.
    :ivar run_on: how far the robot continues without commands, for the modules.
    """

    def __init__(self) -> None:
        self.kernel = Kernel(VirtualClock())
        self.bus = Bus(self.kernel)
        self.mountings: dict[str, Mounting] = {}
        self.run_on = RunOn()
        self._modules: list[Module] = []
        self._prepared = 0
        self._events = 0

    def topic(self, name: str, message: str, fixed: Mapping[str, Any] | None = None, *,
              depth: int = 16, rate_hz: float = 0.0) -> Publisher:
        """
        Declare a topic that the test publishes.

        :param message: its type, such as ``sensor_msgs/msg/Imu``.
        :param fixed: its strings and lengths, as a driver declares them.
        """
        self.bus.declare(name, message, fixed or {}, depth=depth, rate_hz=rate_hz)
        return self.bus.publisher(name)

    def add(self, module: type[ModuleT], name: str = 'dut', *, rate_hz: float = 0.0,
            priority: int = 40, **settings: Any) -> ModuleT:
        """
        Add a module as the core does; it is configured and activated by :meth:`run`.

        :param rate_hz: 0 if only its inputs release it.
        :param settings: other than the defaults.
        """
        made = module(name, settings_of(module, **settings))
        made.mountings, made.run_on = self.mountings, self.run_on
        made.declare(self.bus, rate_hz)
        made.bind(self.bus, self._task_of(made, priority, rate_hz))
        self._modules.append(made)
        return made

    def _task_of(self, made: Module, priority: int, rate_hz: float) -> Task:
        if not made.is_coroutine():
            return self.kernel.add_task(
                made.name, made.job, priority=priority, rate_hz=rate_hz or None)
        return self.kernel.add_async_task(made.name, made.run, priority=priority)

    def watch(self, topic: str) -> Subscription:
        """Subscribe to a topic; ``take()`` its samples after :meth:`run`."""
        return self.bus.subscribe(topic, 'test')

    def at(self, time_s: float, do: Callable[[], object]) -> None:
        """
        Call a function once, such as a publication, before the tasks of that time run.

        :param time_s: since the beginning of the next :meth:`run`.
        """
        left = [do]

        def once() -> None:
            if left:
                left.pop()()

        self._events += 1
        self.kernel.add_task(f'test/event {self._events}', once, priority=99,
                             rate_hz=RATE_MINIMUM_HZ, phase_ns=round(time_s * NS_PER_S))

    def run(self, seconds: float) -> None:
        """
        Let time pass.

        :raises AssertionError: a job or an event of :meth:`at` failed; the message says where.
        """
        for module in self._modules[self._prepared:]:
            module.configure()
            module.activate()
        self._prepared = len(self._modules)
        self.kernel.run(round(seconds * NS_PER_S))
        if self.kernel.failures:
            raise AssertionError(f'jobs that failed: {self.kernel.failures_total}; the last: '
                                 f'{self.kernel.failures[-1]}')

    def close(self) -> None:
        """Deactivate the modules."""
        while self._modules:
            self._modules.pop().deactivate()

    def __enter__(self) -> ModuleBench:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: TracebackType | None) -> None:
        self.close()
