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

"""Wire a robot from its settings: kernel, topics, devices, modules, link."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import asdict
import functools
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rt_robot_os.base.compiled import state as compiled_state
from rt_robot_os.base.live_settings import LiveSettings
from rt_robot_os.base.logger import Logs
from rt_robot_os.base.reports import LogEntry
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.core.black_box_saver import BlackBoxSaver
from rt_robot_os.core.black_box_saver import BlackBoxWriter
from rt_robot_os.core.failure_log import FailureLog
from rt_robot_os.core.frames import FrameRequests
from rt_robot_os.core.garbage import SlackCollector
from rt_robot_os.core.kernel_requests import KernelRequests
from rt_robot_os.core.lifecycle import ModuleLifecycle
from rt_robot_os.core.parameters import LiveParameters
from rt_robot_os.core.part import CorePart
from rt_robot_os.core.part import Host
from rt_robot_os.core.part import Parts
from rt_robot_os.core.process_guard import ProcessGuard
from rt_robot_os.core.realtime_process import RealtimeProcess
from rt_robot_os.core.statistics import module_rows
from rt_robot_os.core.statistics import Statistics
from rt_robot_os.core.tap import Taps
from rt_robot_os.core.tasks import declaration
from rt_robot_os.core.tasks import resource_names
from rt_robot_os.core.threads import ThreadWatch
from rt_robot_os.core.watch import WatchTask
from rt_robot_os.core.watchdog import Watchdog
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.state import RecoverySettings
from rt_robot_os.kernel import Clock
from rt_robot_os.kernel import CooperativeClock
from rt_robot_os.kernel import Kernel
from rt_robot_os.link import LinkServer
from rt_robot_os.link.core_statistics import SHIPPED_IN_USE
from rt_robot_os.link.requests import Requests
from rt_robot_os.modules import Module
from rt_robot_os.motion.mounting import mounted_on_base
from rt_robot_os.motion.run_on import slowest
from rt_robot_os.settings import CoreSettings
from rt_robot_os.settings import RobotSettings
from rt_robot_os.topics import Bus

# From the request to stop until remaining jobs are aborted.
STOP_GRACE_NS = 500 * NS_PER_MS


def _kernel(settings: CoreSettings, clock: Clock | None) -> Kernel:
    if clock is None and settings.dispatcher == 'cooperative':
        clock = CooperativeClock()
    kernel = Kernel(clock, spin_ns=round(settings.spin_us * NS_PER_US),
                    black_box_records=settings.black_box_records)
    kernel.stop_grace_ns = STOP_GRACE_NS
    return kernel


class Core:
    """
    Everything that runs in the real-time process.

    :param settings: checked already.
    :param path: of the link's socket.
    :param ports: the real path of each simulated device's port, by device.
    :param clock: by default CLOCK_MONOTONIC, with the dispatcher of the settings.
    :param writer: of the black box; None saves nothing.
    :param loaded: the settings of the files, if they were changed since.
    :param services: by name, for the devices that require them.
    :param parts: plug-ins of this process.
    :param cpu: to be pinned to; None for that of the settings.
    :param make_bus: a replay has its own.
    :param liveness_fd: of the liveness page that a node has created; -1 for none.
    :ivar on_open: called when clients can connect, right before the kernel runs.
    :raises RtRobotError: the parts do not fit together; nothing is open then.
    """

    def __init__(self, settings: RobotSettings, path: Path, *,
                 ports: Mapping[str, str] = MappingProxyType({}), clock: Clock | None = None,
                 writer: BlackBoxWriter | None = None,
                 loaded: RobotSettings | None = None,
                 services: Mapping[str, Any] = MappingProxyType({}),
                 parts: Sequence[type[CorePart]] = (), cpu: int | None = None,
                 make_bus: Callable[[Kernel], Bus] = Bus, liveness_fd: int = -1) -> None:
        self.settings = settings
        self.on_open: Callable[[], object] = lambda: None
        core = settings.core
        self.kernel = _kernel(core, clock)
        self.bus = make_bus(self.kernel)
        self.reports = Reports()
        self.requests = Requests()
        warn = functools.partial(self.note, Severity.WARN, 'core')
        self.logs = Logs(self.reports, self.kernel.now_ns)
        self.sensors = SensorManager(self.kernel, self.bus, self.reports, services=services)
        for topic in settings.topics:
            self.bus.add(topic, topic.max_subscribers)
        self._add_devices(ports)
        self._lifecycle = ModuleLifecycle(self.note)
        self._lifecycle.add(settings.modules, self.kernel, self.bus, self.logs.connect)
        run_on = slowest(each.device.run_on(each.device.settings) for each in self.sensors.devices)
        for module in self.modules:
            module.mountings, module.run_on = settings.mountings, run_on
        self.sensors.connect()
        owners: dict[str, LiveSettings] = {
            each.name: each for each in (*(m.device for m in self.sensors.devices), *self.modules)}
        self.parameters = LiveParameters(
            settings, loaded or settings, self.kernel, owners, self.logs.by_name)
        self.taps = Taps(self.kernel, self.bus, self.sensors, [m.name for m in self.modules], warn)
        if core.record_bytes:
            self.taps.turn_on()
        self.link = LinkServer(
            self.kernel, self.bus, path, self.requests, self.reports,
            service_priority=core.link_priority, command_priority=core.command_priority,
            gather_ns=round(core.link_gather_ms * NS_PER_MS), liveness_fd=liveness_fd)
        self.watch = WatchTask(self.kernel, self.reports)
        self.black_box = BlackBoxSaver(self.kernel, self.reports, path.stem, writer)
        self.guard = ProcessGuard(settings.watchdog)
        self.process = RealtimeProcess(core, core.cpu if cpu is None else cpu)
        self.host = Host(settings, self.kernel, self.bus, self.requests,
                         Statistics(self.kernel, self.requests, warn), self.watch, self.note)
        self._attach(owners)
        self.parts = Parts(parts, self.host)
        self.watchdog = self._watchdog()  # it watches the tasks that exist now

    @property
    def modules(self) -> list[Module]:
        """All modules, in the order of the configuration."""
        return self._lifecycle.modules

    # ---- wiring ------------------------------------------------------------------------------

    def _add_devices(self, ports: Mapping[str, str]) -> None:
        for device in self.settings.devices:
            values = mounted_on_base(device.settings, self.settings.mountings)
            if device.name in ports:
                values['port'] = ports[device.name]
            driver = DRIVERS.load(device.type)(device.name, values)
            if told := DRIVERS.deprecation(device.type):
                self.note(Severity.WARN, device.name, told)
            self.logs.connect(driver.log, device.log_level)
            self.sensors.add(
                driver, rate_hz=device.rate_hz,
                priority=device.priority, interrupt=device.read == 'interrupt',
                recovery=RecoverySettings(
                    round(device.timeout_s * NS_PER_S), round(device.retry_s * NS_PER_S),
                    round(device.retry_max_s * NS_PER_S)),
                declared=declaration(device.task, self.kernel),
                max_subscribers=device.max_subscribers)

    def _attach(self, owners: Mapping[str, object]) -> None:
        """Attach the parts; the order of requests, statistics and the watch follows from it."""
        host, statistics = self.host, self.host.statistics
        self.taps.attach(host)
        KernelRequests(self.kernel, self.stop, self.note).attach(host)
        self.watch.add(FailureLog(
            self.kernel, functools.partial(self.note, Severity.ERROR),
            lambda failure: self.black_box.fault(f'task {failure.task!r}: {failure.error}')).watch)
        self.black_box.attach(host)
        self.watch.add(self.guard.ready)
        self.watch.add(self.logs.sweep)
        ThreadWatch(functools.partial(self.note, Severity.WARN, 'core'), owners).attach(host)
        self.parameters.attach(host)
        FrameRequests(self.settings).attach(host)
        statistics.add_rows('topic', lambda: map(asdict, self.bus.statistics()))
        statistics.add_rows('device', lambda: map(asdict, self.sensors.statistics()))
        statistics.add_rows('module', lambda: module_rows(self.modules, self.requests))
        statistics.add_rows('client', lambda: (c.as_json() for c in self.link.statistics()))
        statistics.add_rows('resource', self._resources)
        statistics.add_facts(self.link.facts)
        statistics.add_facts(self._facts)

    def _resources(self) -> Iterator[dict[str, Any]]:
        for name in resource_names(self.settings):
            yield asdict(self.kernel.resource(name).statistics())

    def _facts(self) -> dict[str, Any]:
        watchdog = self.watchdog
        return {'watchdog': 'off' if watchdog is None else watchdog.reason or 'healthy',
                'log_lines': self.reports.total, 'simulated': self.settings.simulated,
                'simulation_asked': self.settings.simulation_asked,
                'realtime': [asdict(result) for result in self.process.results]}

    def _watchdog(self) -> Watchdog | None:
        if not self.settings.watchdog.timeout_s:
            return None
        watchdog = Watchdog(self.kernel, self.settings.watchdog, self.reports,
                            self.guard.manager.watchdog_ns)
        watchdog.on_fault = self._save_fault
        return watchdog

    # ---- running -----------------------------------------------------------------------------

    def prepare_process(self) -> None:
        """Request real-time properties from Linux; refused requests are reported."""
        results = self.process.prepare(self.guard, self.watchdog)
        names = self.settings.simulated
        if names:
            asked = self.settings.simulation_asked
            self.note(Severity.INFO if asked else Severity.WARN, 'core', 'simulated: '
                      f'{", ".join(names)}{"" if asked else f"; {SHIPPED_IN_USE}"}')
        build = compiled_state()
        self.note(Severity.WARN if build.stale else Severity.INFO, 'core', f'kernel: {build.text}')
        for result in results:
            self.note(Severity.INFO if result.ok else Severity.WARN, 'core', str(result))

    def run(self, duration_ns: int | None = None) -> str:
        """
        Run until the kernel is stopped; closes everything afterwards in any case.

        :return: why it stopped.
        :raises RtRobotError: a module or the link could not be prepared.
        """
        collector = SlackCollector(self.kernel.now_ns, self.kernel.clock.computed_ns)
        collector.on_overdue = functools.partial(self.note, Severity.WARN, 'core')
        self.kernel.on_idle = collector.idle
        try:
            self.prepare_modules()
            self.link.open()
            collector.prime()
            self.on_open()
            return self._run_kernel(duration_ns)
        finally:
            self.close()

    def _run_kernel(self, duration_ns: int | None) -> str:
        try:
            return self.kernel.run(duration_ns)
        except Exception as error:
            self.black_box.ask(f'the kernel failed: {type(error).__name__}: {error}')
            raise

    def prepare_modules(self) -> None:
        """
        Configure and activate all modules, and open parts; :meth:`run` does it.

        :raises RtRobotError: a module or a part could not be prepared.
        """
        self._lifecycle.prepare()
        self.parts.open()

    def stop(self, reason: str) -> None:
        """
        End :meth:`run`, in order or by force; safe in the real-time loop.

        Jobs have a grace period, then TaskAborted ends them; so are modules that do not complete
        their deactivation. Anything left then ends with the process.
        """
        self.guard.begin_end()
        self.kernel.stop(reason)

    @property
    def forced(self) -> list[str]:
        """Return the names of tasks, modules and devices that had to be ended by force."""
        return [*self.kernel.ended, *self._lifecycle.forced]

    def close(self) -> None:
        """Bring the outputs to a safe state and close everything; may be called twice."""
        self.guard.begin_end()
        if self.watchdog is not None:
            self.watchdog.leave()
        self.guard.leave()
        self.sensors.rest(functools.partial(self._lifecycle.call, step='safe_state'))
        self._lifecycle.end()
        self.sensors.close(self._lifecycle.call)
        self.parts.close(self._lifecycle.call)
        self.guard.release()
        self.watch.poll()
        self.link.close()
        self.black_box.close()
        self.watch.write_reports()
        self.process.close()
        self.guard.close(stop=not self.tripped)

    @property
    def tripped(self) -> bool:
        """Whether the watchdog ended it: the process ends with the configured exit code."""
        return self.watchdog is not None and bool(self.watchdog.tripped)

    def _save_fault(self, reason: str) -> None:
        if self.tripped:
            # The process may end before the lowest task runs again; priorities no longer matter.
            self.black_box.save(reason)
        else:
            self.black_box.fault(reason)

    def note(self, severity: Severity, source: str, text: str) -> None:
        """Log a report; safe in the real-time loop."""
        self.reports.note(LogEntry(self.kernel.now_ns(), severity, source, text))
