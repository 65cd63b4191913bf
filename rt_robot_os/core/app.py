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
from collections.abc import Mapping
from contextlib import suppress
import functools
import os
from pathlib import Path

from rt_robot_os.core.answers import Answers
from rt_robot_os.core.dump_keeper import BlackBoxKeeper
from rt_robot_os.core.dump_keeper import BlackBoxWriter
from rt_robot_os.core.failure_log import FailureLog
from rt_robot_os.core.garbage import SlackCollector
from rt_robot_os.core.lifecycle import ModuleLifecycle
from rt_robot_os.core.parameters import LiveParameters
from rt_robot_os.core.process_guard import ProcessGuard
from rt_robot_os.core.simulators import Simulators
from rt_robot_os.core.tap import Taps
from rt_robot_os.core.tasks import declaration
from rt_robot_os.core.threads import ThreadWatch
from rt_robot_os.core.watchdog import Watchdog
from rt_robot_os.devices.capture.device import CaptureDevice
from rt_robot_os.devices.manager import SensorManager
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.state import RecoverySettings
from rt_robot_os.kernel import Clock
from rt_robot_os.kernel import CooperativeClock
from rt_robot_os.kernel import Kernel
from rt_robot_os.link import LinkServer
from rt_robot_os.linux import realtime
from rt_robot_os.linux.cpu_latency import HeldCpuLatency
from rt_robot_os.linux.cpu_latency import hold_cpu_latency
from rt_robot_os.linux.realtime import RtResult
from rt_robot_os.logger import Logger
from rt_robot_os.modules import Module
from rt_robot_os.reports import Report
from rt_robot_os.reports import Reports
from rt_robot_os.reports import Severity
from rt_robot_os.settings import RobotSettings
from rt_robot_os.topics import Bus
from rt_robot_os.units import NS_PER_MS
from rt_robot_os.units import NS_PER_S
from rt_robot_os.units import NS_PER_US

UNPINNED = -2
# From the order to stop until jobs that have not ended are ended.
STOP_GRACE_NS = 500 * NS_PER_MS
_LOOKS_A_SECOND = 10


class Core:
    """
    Everything that runs in the real-time process.

    :param settings: checked already.
    :param path: of the link's socket.
    :param ports: the real path of each simulated device's port, by device.
    :param clock: by default CLOCK_MONOTONIC, with the dispatcher that is set.
    :param writer: of the black box; None saves it nowhere.
    :param loaded: what the files said, when something was changed since.
    :param captures: socket of what starts the processes of cameras and microphones.
    :param cpu: the one to be pinned to; None for that of the settings.
    :param make_bus: a replay has one of its own.
    :param life_fd: the page for the sign of life that a node has made; -1 for none.
    :raises RtRobotError: the parts do not fit together; nothing is open then.
    """

    def __init__(self, settings: RobotSettings, path: Path, *,
                 ports: Mapping[str, str] | None = None, clock: Clock | None = None,
                 writer: BlackBoxWriter | None = None,
                 loaded: RobotSettings | None = None,
                 captures: Path | None = None, cpu: int | None = None,
                 make_bus: Callable[[Kernel], Bus] = Bus, life_fd: int = -1) -> None:
        self.settings = settings
        self.parameters = LiveParameters(self, loaded or settings)
        self._cpu = settings.core.cpu if cpu is None else cpu
        core = settings.core
        if clock is None and core.dispatcher == 'cooperative':
            clock = CooperativeClock()
        self.kernel = Kernel(clock, spin_ns=round(core.spin_us * NS_PER_US),
                             black_box_records=core.black_box_records)
        self.kernel.stop_grace_ns = STOP_GRACE_NS
        self.bus = make_bus(self.kernel)
        self.reports = Reports()
        self.threads = ThreadWatch(functools.partial(self.note, Severity.WARN, 'core'))
        self._looks = 0
        self.black_box = BlackBoxKeeper(self.kernel, self.reports, path.stem, writer)
        self._failures = FailureLog(
            self.kernel, functools.partial(self.note, Severity.ERROR),
            lambda failure: self.black_box.fault(f'task {failure.task!r}: {failure.error}'))
        self.realtime: tuple[RtResult, ...] = ()
        self.sensors = SensorManager(self.kernel, self.bus, self.reports)
        self.loggers: dict[str, Logger] = {}
        self.simulators: Simulators | None = None
        self._output: int | None = None
        self._written = 0
        self._told_dropped = False
        self._cpu_latency: HeldCpuLatency | None = None
        for topic in settings.topics:
            self.bus.add(topic, topic.max_subscribers)
        self._add_devices(ports or {}, captures)
        self._lifecycle = ModuleLifecycle(self.note)
        self._lifecycle.add(settings.modules, self.kernel, self.bus, self._connect_log)
        self.taps = Taps(self.kernel, self.bus, self.sensors)
        if core.record_bytes:
            self.turn_on_taps()
        self.link = LinkServer(
            self.kernel, self.bus, path, Answers(self), self.reports,
            service_priority=settings.core.link_priority,
            command_priority=settings.core.command_priority,
            gather_ns=round(settings.core.link_gather_ms * NS_PER_MS), life_fd=life_fd)
        self.kernel.add_task('core/watch', self._watch, priority=1, rate_hz=float(_LOOKS_A_SECOND))
        self.guard = ProcessGuard(settings.watchdog)
        self.watchdog: Watchdog | None = None
        if settings.watchdog.timeout_s:
            self.watchdog = Watchdog(self.kernel, settings.watchdog, self.reports,
                                     self.guard.manager.watchdog_ns)
            self.watchdog.on_fault = self._save_fault

    def _add_devices(self, ports: Mapping[str, str], captures: Path | None) -> None:
        for device in self.settings.devices:
            values = dict(device.settings)
            if device.name in ports:
                values['port'] = ports[device.name]
            driver = DRIVERS.load(device.type)(device.name, values)
            if told := DRIVERS.deprecation(device.type):
                self.note(Severity.WARN, device.name, told)
            if isinstance(driver, CaptureDevice):
                driver.host = captures
            self._connect_log(driver.log, device.log_level)
            self.sensors.add(
                driver, rate_hz=device.rate_hz,
                priority=device.priority, interrupt=device.read == 'interrupt',
                recovery=RecoverySettings(
                    round(device.timeout_s * NS_PER_S), round(device.retry_s * NS_PER_S),
                    round(device.retry_max_s * NS_PER_S)),
                declared=declaration(device.task, self.kernel),
                max_subscribers=device.max_subscribers)

    @property
    def modules(self) -> list[Module]:
        """All modules, in the order of the configuration."""
        return self._lifecycle.modules

    def _connect_log(self, log: object, level: str) -> None:
        if not isinstance(log, Logger):  # a class of somebody who has another use for the name
            return
        log.connect(self.reports, self.kernel.now_ns)
        log.level = int(Severity[level.upper()])
        self.loggers[log.name] = log

    def turn_on_taps(self) -> None:
        """
        Begin to note bytes and schedule for a recorder; not for the real-time loop.

        :raises TopicError: a topic of the robot has one of the names.
        """
        self.taps.turn_on([module.name for module in self.modules])

    def prepare_process(self) -> None:
        """Ask Linux for real time; what it refuses is reported, and kept in ``realtime``."""
        wanted = self.settings.core
        results = [realtime.set_timer_slack()]
        if self._cpu != UNPINNED:
            results.append(realtime.set_affinity(self._cpu))
        if wanted.lock_memory:
            results.append(realtime.lock_memory())
        if wanted.cpu_latency_us >= 0:
            result, self._cpu_latency = hold_cpu_latency(wanted.cpu_latency_us)
            results.append(result)
        results += self.guard.equip(self.watchdog)
        results.append(realtime.freeze_garbage())
        # Last, so that the slow steps before do not hold up others at this priority.
        if wanted.scheduler_priority:
            results.append(realtime.set_fifo(wanted.scheduler_priority, alone=True))
        self.realtime = tuple(results)
        self._tell_simulated()
        for result in results:
            self.note(Severity.INFO if result.ok else Severity.WARN, 'core', str(result))

    def _tell_simulated(self) -> None:
        names = self.settings.simulated
        if names:
            asked = self.settings.simulation_asked
            self.note(Severity.INFO if asked else Severity.WARN, 'core', 'simulated: '
                      f'{", ".join(names)}{"" if asked else "; no parameter file was given"}')

    def run(self, duration_ns: int | None = None) -> str:
        """
        Run until the kernel is stopped; closes everything afterwards, whatever happened.

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
        Configure and activate all modules; :meth:`run` does it.

        :raises RtRobotError: one of them could not be prepared.
        """
        self._lifecycle.prepare()

    def stop(self, reason: str) -> None:
        """
        End :meth:`run`, in order or by force; safe in the real-time loop.

        Jobs have a while to end, then TaskAborted ends them; modules that do not let themselves be
        deactivated are stopped as well, and what is left then ends with the process.
        """
        self.guard.begin_end()
        self.kernel.stop(reason)

    @property
    def forced(self) -> list[str]:
        """Name the tasks, modules and devices that did not end by themselves."""
        return [*self.kernel.ended, *self._lifecycle.forced]

    def close(self) -> None:
        """Leave a safe state and close everything; may be called twice."""
        self.guard.begin_end()
        if self.watchdog is not None:
            self.watchdog.leave()
        self.guard.leave()
        self._lifecycle.end()
        self.sensors.close(self._lifecycle.call)
        self.guard.release()
        self._watch()
        self.link.close()
        self.black_box.close()
        self._write_reports()
        if self._cpu_latency is not None:
            self._cpu_latency.close()
        self.guard.close(stop=not self.tripped)

    @property
    def tripped(self) -> bool:
        """Whether the watchdog ended it: its process ends with the exit code that is set."""
        return self.watchdog is not None and bool(self.watchdog.tripped)

    def write_reports_to(self, fd: int) -> None:
        """
        Write reports to a file descriptor, for a core that is run by hand.

        The lowest-priority task does it: a terminal that blocks holds up nothing else.
        """
        self._output = fd

    def _watch(self) -> None:
        """Tell people of failed jobs and save the black box, at the lowest priority."""
        self._drain_taps()
        self.kernel.guard_handlers()
        self._failures.watch()
        self.black_box.watch()
        self.guard.ready()
        for text in self.simulators.news() if self.simulators is not None else ():
            self.note(Severity.WARN, 'simulator', text)
        now_ns = self.kernel.now_ns()
        for log in self.loggers.values():
            log.sweep(now_ns)
        self._looks += 1
        if self._looks % _LOOKS_A_SECOND == 0 and self.kernel.clock.has_signals:
            self.threads.look([*((m.name, m) for m in self.modules),
                               *((d.device.name, d.device) for d in self.sensors.devices)])
        self._write_reports()

    def _drain_taps(self) -> None:
        self.taps.drain()
        if self.taps.dropped and not self._told_dropped:
            self._told_dropped = True
            self.note(Severity.WARN, 'core', f'{self.taps.dropped} records of what a replay needs '
                      'were dropped: core/watch, the lowest task, does not run often enough to '
                      'publish them; a replay of this recording may differ (tap_dropped counts '
                      'them)')

    def _save_fault(self, reason: str) -> None:
        if self.tripped:
            # It may be over before the lowest task runs again. Nothing else matters any more.
            self.black_box.save(reason)
        else:
            self.black_box.fault(reason)

    def _write_reports(self) -> None:
        if self._output is not None:
            self._written, dropped, reports = self.reports.since(self._written)
            lines = [f'{dropped} reports dropped'] * bool(dropped) + [str(r) for r in reports]
            if lines:
                with suppress(OSError):  # nobody reads them any more
                    os.write(self._output, ('\n'.join(lines) + '\n').encode())

    def note(self, severity: Severity, source: str, text: str) -> None:
        """Tell people something; safe in the real-time loop."""
        self.reports.note(Report(self.kernel.now_ns(), severity, source, text))
