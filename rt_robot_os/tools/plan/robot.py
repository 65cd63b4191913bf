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

"""The tasks of a robot, from its settings: those of devices, of modules, and the core's own."""

from __future__ import annotations

from dataclasses import replace

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.base.units import period_from_rate
from rt_robot_os.devices.manager import RECOVERY_RATE_HZ
from rt_robot_os.link.server import BEAT_RATE_HZ
from rt_robot_os.link.server import LIVENESS_EXECUTION_NS
from rt_robot_os.link.server import LIVENESS_PRIORITY
from rt_robot_os.link.server import LIVENESS_RATE_HZ
from rt_robot_os.link.server import LIVENESS_TASK
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings.model import TaskSettings
from rt_robot_os.settings.problems import did_you_mean
from rt_robot_os.settings.run_on import moving_boards
from rt_robot_os.settings.tasks import without_watchdog
from rt_robot_os.tools.plan.given import Given
from rt_robot_os.tools.plan.given import JOB_OVERHEAD_NS
from rt_robot_os.tools.plan.given import RobotTasks
from rt_robot_os.tools.plan.given import TICK_OVERHEAD_NS
from rt_robot_os.tools.plan.measured import FEW_RUNS
from rt_robot_os.tools.plan.measured import Measured
from rt_robot_os.tools.plan.measured import MeasuredTask
from rt_robot_os.tools.plan.task import Event
from rt_robot_os.tools.plan.task import Overhead
from rt_robot_os.tools.plan.task import PlannedTask
from rt_robot_os.tools.plan.typical import times_of
from rt_robot_os.tools.plan.typical import TypicalTimes
from rt_robot_os.tools.plan.wiring import COMMANDS
from rt_robot_os.tools.plan.wiring import Wiring

# The node's supervisor beats three times in each core.heartbeat_s.
_BEATS_PER_HEARTBEAT = 3
_RECOVERY_PRIORITY = 3
_WATCH_PRIORITY = 1
_WATCH_RATE_HZ = 10.0
# Of the watchdog: its priority, checks in each timeout, the shortest time between two.
_WATCHDOG_PRIORITY = 99
_WATCHDOG_CHECKS = 8
_WATCHDOG_SHORTEST_NS = NS_PER_MS
_NO_TASK = TaskSettings()


def robot_tasks(
    settings: RobotSettings, measured: Measured | None = None, given: Given = Given(),
) -> RobotTasks:
    """
    Make the tasks of a robot.

    :raises ConfigError: an option or the measurement names a task that the robot does not have.
    """
    return _Builder(settings, measured, given).build()


class _Builder:
    """Collects the tasks of one robot, and where their numbers come from."""

    def __init__(self, settings: RobotSettings, measured: Measured | None, given: Given) -> None:
        self._settings = settings
        self._measured = measured
        self._given = given
        self._wiring = Wiring(settings)
        self._tasks: list[PlannedTask] = []
        self._origins: dict[str, str] = {}
        self._owners: dict[str, str] = {}
        self._notes: list[str] = []
        self._few: dict[str, int] = {}
        self._typical = TypicalTimes()
        if given.typical is not None and measured is None:
            self._typical = times_of(settings, self._wiring, given.typical)
        self._jitter_ns = given.jitter_ns if given.jitter_ns is not None else (
            measured.lateness_ns() if measured else 0)

    def build(self) -> RobotTasks:
        self._add_devices()
        self._add_modules()
        self._add_core()
        self._check_names()
        if self._measured is not None:
            self._note_measurement(self._measured)
        if self._wiring.not_counted:
            self._notes.append(
                f'{", ".join(self._wiring.not_counted)}: no device, module or mirror publishes '
                'it; what a client that does makes others compute is not counted')
        self._notes += [str(board) for board in moving_boards(self._settings)]
        if self._given.typical is not None and 'typical' in self._origins.values():
            self._notes.append(
                'typical execution times are no bounds and are those of another machine: '
                f'{self._given.typical.source}; plan --measure 10 takes those of yours')
        return RobotTasks(tuple(self._tasks), self._overhead(), self._origins, self._owners,
                          tuple(self._notes), self._responses())

    def _responses(self) -> dict[str, int]:
        found = {task.name: self._seen(task.name) for task in self._tasks}
        if any(seen and (seen.priority, seen.period_ns) != (task.priority, task.period_ns)
               for task in self._tasks if (seen := found[task.name])):
            return {}
        return {name: seen.response_ns for name, seen in found.items() if seen}

    def _overhead(self) -> Overhead:
        job_ns, tick_ns = self._given.job_ns, self._given.tick_ns
        if tick_ns is None:
            measured_ns = self._measured.tick_ns if self._measured else 0
            tick_ns = measured_ns or TICK_OVERHEAD_NS
        return Overhead(JOB_OVERHEAD_NS if job_ns is None else job_ns, tick_ns)

    # ---- tasks -------------------------------------------------------------------------------

    def _add_devices(self) -> None:
        for device in self._settings.devices:
            self._add(device.name, 'device', device.priority, device.rate_hz, device.task)
            interrupt = device.read == 'interrupt'
            if interrupt or self._wiring.is_released(device.name):
                events = self._wiring.reader_events(device.name, device.priority)
                self._add_arrival(f'{device.name}/arrival', device.priority, device.task,
                                  interrupt, events)

    def _add_arrival(self, name: str, priority: int, declared: TaskSettings, interrupt: bool,
                     events: tuple[Event, ...]) -> None:
        unknown = '' if events or interrupt else 'it is not known what releases it'
        if interrupt:
            outside, unknown = self._outside(name, 'how often bytes arrive is not known')
            events += outside
        # It does what the polling task does, but for writing; it has no deadline of its own.
        self._add(name, 'device', priority, 0.0, replace(declared, deadline_us=0.0), events,
                  unknown, judged=False)

    def _add_modules(self) -> None:
        for module in self._settings.modules:
            rate_hz = module.rate_hz
            if self._wiring.is_coroutine(module.name):
                rate_hz = 0.0
                events, unknown = self._outside(
                    module.name, 'it is a coroutine, which decides itself when it continues')
            else:
                events = self._wiring.reader_events(module.name, module.priority)
                unknown = '' if events or rate_hz else 'nothing is known that releases it'
            self._add(module.name, 'module', module.priority, rate_hz, module.task, events,
                      unknown)

    def _add_core(self) -> None:
        core = self._settings.core
        self._add_service('sensors/recovery', _RECOVERY_PRIORITY, RECOVERY_RATE_HZ)
        requests_ns = period_from_rate(self._settings.diagnostics_rate_hz)
        beats_ns = round(core.heartbeat_s * NS_PER_S / _BEATS_PER_HEARTBEAT)
        commands = [Event('', beats_ns), Event('', requests_ns)]
        unknown = ''
        for topic, rate_hz in self._wiring.inputs.items():
            if rate_hz:
                commands.append(Event('', period_from_rate(rate_hz)))
            elif COMMANDS not in self._given.rates_hz:
                unknown = (f'how often ROS publishes {topic!r} is not known: set rate_hz in the '
                           f'section of that topic (or max_rate_hz in that of the mirror), or '
                           f'--rate {COMMANDS}=HZ')
        if COMMANDS in self._given.rates_hz:
            commands.append(Event('', period_from_rate(self._given.rates_hz[COMMANDS])))
        self._add(COMMANDS, 'core', core.command_priority, 0.0, _NO_TASK, tuple(commands),
                  unknown, judged=False)
        service = self._wiring.outputs_events(core.link_priority)
        self._add_service('link/service', core.link_priority, 0.0,
                          (*service, Event(COMMANDS, requests_ns)))
        events, unknown = self._outside('link/accept', 'how often clients connect is not known')
        self._add_service('link/accept', core.link_priority, 0.0, events, unknown)
        self._add_service('link/beat', core.link_priority, BEAT_RATE_HZ)
        self._add_service(LIVENESS_TASK, LIVENESS_PRIORITY, LIVENESS_RATE_HZ)
        self._add_service('core/watch', _WATCH_PRIORITY, _WATCH_RATE_HZ)
        timeout_ns = round(self._settings.watchdog.timeout_s * NS_PER_S)
        unwatched = without_watchdog(self._settings)
        if unwatched:
            self._notes.append(unwatched)
        if timeout_ns:
            interval_ns = max(timeout_ns // _WATCHDOG_CHECKS, _WATCHDOG_SHORTEST_NS)
            self._add_service('core/watchdog', _WATCHDOG_PRIORITY, NS_PER_S / interval_ns)

    def _add_service(self, name: str, priority: int, rate_hz: float,
                     events: tuple[Event, ...] = (), unknown: str = '') -> None:
        self._add(name, 'core', priority, rate_hz, _NO_TASK, events, unknown, judged=False)

    def _add(self, name: str, owner: str, priority: int, rate_hz: float, declared: TaskSettings,
             events: tuple[Event, ...] = (), unknown: str = '', judged: bool = True) -> None:
        execution_ns, origin = self._execution(name, declared)
        if declared.budget_us and (execution_ns or 0) > declared.budget_us * NS_PER_US:
            then = 'aborted' if declared.on_budget == 'abort' else 'counted as too long'
            self._notes.append(
                f'{name}: budget_us is {declared.budget_us:g}, and a job may take '
                f'{(execution_ns or 0) / NS_PER_US:.0f} us: such a job is {then}')
        seen = self._seen(name)
        period_ns = period_from_rate(rate_hz) if rate_hz else 0
        self._tasks.append(PlannedTask(
            name, priority, period_ns=period_ns,
            phase_ns=round(declared.phase_us * NS_PER_US) if period_ns else 0,
            deadline_ns=round(declared.deadline_us * NS_PER_US), execution_ns=execution_ns,
            jitter_ns=self._jitter_ns if period_ns else 0,
            sections={resource: self._section(resource, execution_ns)
                      for resource in declared.resources},
            native_ns=self._given.native_ns.get(
                name, self._with_margin(seen.native_ns) if seen else 0),
            preemptible=self._settings.core.dispatcher != 'cooperative', events=events,
            backlog=declared.catch_up if declared.overrun == 'catch_up' else 0,
            logical=declared.logical_execution, judged=judged, unknown=unknown))
        self._origins[name] = origin
        self._owners[name] = owner

    # ---- numbers -----------------------------------------------------------------------------

    def _with_margin(self, length_ns: int) -> int:
        return round(length_ns * self._given.margin)

    def _seen(self, name: str) -> MeasuredTask | None:
        """Find what was measured of a task, if it did its work meanwhile."""
        if self._measured is None or name.removesuffix('/arrival') in self._measured.idle:
            return None
        found = self._measured.tasks.get(name)
        return found if found is not None and found.runs else None

    def _execution(self, name: str, declared: TaskSettings) -> tuple[int | None, str]:
        seen = self._seen(name)
        if name in self._given.execution_ns:
            return self._given.execution_ns[name], 'option'
        if declared.execution_us:
            length_ns = max(1, round(declared.execution_us * NS_PER_US))
            if seen and seen.execution_ns > length_ns:
                self._notes.append(
                    f'{name}: execution_us is {declared.execution_us:g}, but '
                    f'{seen.execution_ns / NS_PER_US:.0f} us were measured: raise it')
            return length_ns, 'declared'
        if seen:
            if seen.runs < FEW_RUNS:
                self._few[name] = seen.runs
            return max(1, self._with_margin(seen.execution_ns)), 'measured'
        if name in self._typical.execution_ns:
            return self._typical.execution_ns[name], 'typical'
        if declared.budget_us and declared.on_budget == 'abort':
            return max(1, round(declared.budget_us * NS_PER_US)), 'budget'
        if name == LIVENESS_TASK:  # above all others: unknown, all others were unknown too
            return LIVENESS_EXECUTION_NS, 'declared'
        return None, 'unknown'

    def _section(self, resource: str, execution_ns: int | None) -> int | None:
        """Return the longest time that a resource is held, by whomever; None when unknown."""
        if resource in self._given.held_ns:
            given_ns = self._given.held_ns[resource]
            return min(execution_ns, given_ns) if execution_ns else given_ns
        held_ns = self._measured.resources.get(resource, 0) if self._measured else 0
        if not held_ns or not execution_ns:
            return None
        return min(execution_ns, self._with_margin(held_ns))

    def _outside(self, name: str, reason: str) -> tuple[tuple[Event, ...], str]:
        """Return how often an outside event releases a task: as given, else as measured."""
        rate_hz = self._given.rates_hz.get(name, 0.0)
        seen = self._seen(name)
        if not rate_hz and seen and self._measured:
            rate_hz = seen.releases * self._given.margin * NS_PER_S / self._measured.elapsed_ns
        rate_hz = rate_hz or self._typical.rates_hz.get(name, 0.0)
        if rate_hz:
            return (Event('', period_from_rate(rate_hz)),), ''
        return (), f'{reason}: measure it, or give --rate {name}=HZ'

    # ---- checks ------------------------------------------------------------------------------

    def _check_names(self) -> None:
        problems = []
        known = [task.name for task in self._tasks]
        for option, names in (('--execution', self._given.execution_ns),
                              ('--native', self._given.native_ns),
                              ('--rate', self._given.rates_hz)):
            problems += [f'{option} {name}: no such task, {did_you_mean(name, known)}'
                         for name in names if name not in known]
        resources = {name for task in self._tasks for name in task.sections}
        problems += [f'--held {name}: no such resource, {did_you_mean(name, resources)}'
                     for name in self._given.held_ns if name not in resources]
        released = {COMMANDS, 'link/accept', *(
            name for name in known
            if name.endswith('/arrival') or self._wiring.is_coroutine(name))}
        problems += [f'--rate {name}: it is not released from outside; what is: '
                     f'{", ".join(sorted(released))}'
                     for name in self._given.rates_hz if name in known and name not in released]
        for name, seen in (self._measured.tasks if self._measured else {}).items():
            problems += self._mismatch(name, seen)
        if problems:
            raise ConfigError(problems)

    def _mismatch(self, name: str, seen: MeasuredTask) -> list[str]:
        planned = {task.name: task for task in self._tasks}.get(name)
        if planned is None:
            if not name.startswith(('core/', 'link/', 'sensors/')):
                return [f'measurement: task {name!r} is not in this configuration: measure again']
            # A task that the core has and this program does not know: it runs all the same.
            self._add_service(name, seen.priority, NS_PER_S / seen.period_ns
                              if seen.period_ns else 0.0, *(
                                  () if seen.period_ns else self._outside(name, 'unknown')))
        return []

    def _note_measurement(self, measured: Measured) -> None:
        self._notes += [f'{name}: was not measured, {reason}'
                        for name, reason in measured.idle.items()]
        if self._few:
            few = ', '.join(f'{name} ({runs})' for name, runs in self._few.items())
            self._notes.append(f'few jobs were measured of {few}: measure for longer')
        if measured.refused:
            self._notes.append(f'measured without {" and ".join(measured.refused)}: times may be '
                               'too long; see the program doctor for real-time scheduling')
        if self._wiring.inputs and not measured.fed:
            self._notes.append(
                f'{", ".join(self._wiring.inputs)}: was not published while measuring, since '
                'devices are real: what it makes others compute is not in the numbers')
