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

"""Run the real core of a robot for a while and note what its tasks take."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from operator import attrgetter
from pathlib import Path
import time
from typing import Any
from typing import Protocol

from rt_robot_os.base.errors import LinkError
from rt_robot_os.kernel import TaskStatistics
from rt_robot_os.link import LinkClient
from rt_robot_os.link.core_statistics import CoreStatistics
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import SIM_PORT
from rt_robot_os.settings import TopicSettings
from rt_robot_os.tools.plan.measured import Measured
from rt_robot_os.tools.plan.measured import MeasuredTask
from rt_robot_os.topics import Layout

START_TIMEOUT_S = 20.0
WARM_UP_S = 1.0
ACTIVE_TIMEOUT_S = 8.0
_TRY_S = 0.05
_LONGEST_PUMP_S = 0.05
_TIMEOUT_S = 5.0

Tell = Callable[[str], None]
Longest = Callable[[TaskStatistics], int]


class CoreRunner(Protocol):
    """What runs the core: :class:`~rt_robot_os.ros.core_process.CoreProcess`."""

    exit_code: int | None

    @property
    def pid(self) -> int:
        """Return its process id."""

    def start(self) -> None:
        """Start it."""

    def alive(self) -> bool:
        """Return whether it runs."""

    def stop(self) -> None:
        """End it."""


def measure(settings: RobotSettings, process: CoreRunner, path: Path, seconds: float,
            progress: Tell, of: Longest = attrgetter('execution.maximum_ns'),
            begun: Callable[[], object] | None = None) -> Measured:
    """
    Start a core, do what the node of the robot would do, and take its statistics.

    Samples from ROS are published only while all devices are simulated: nothing real moves.

    :param path: of the core's socket.
    :param seconds: how long, after the devices deliver and everything is warm.
    :param progress: called with what happens, for people.
    :param of: what counts as the longest execution time of a task.
    :param begun: called when the devices deliver, for what is to go on meanwhile: then no samples
        from ROS are published, which would disturb it.
    :raises LinkError: the core did not start, or ended.
    """
    process.start()
    try:
        with _connect(process, path) as client:
            robot = _StandIn(settings, client, feeds=begun is None)
            progress(f'the core runs (pid {process.pid}); waiting for its devices')
            _until_active(robot)
            if begun is not None:
                begun()
            robot.run(WARM_UP_S)
            client.request('reset_statistics')
            before_ns, before = _cpu_ns(process.pid), client.statistics()
            progress(f'measuring for {seconds:g} s')
            robot.run(seconds)
            after_ns, after = _cpu_ns(process.pid), client.statistics()
            return _result(before, after, after_ns - before_ns, robot, of)
    finally:
        process.stop()


def _connect(process: CoreRunner, path: Path) -> LinkClient:
    deadline_s = time.monotonic() + START_TIMEOUT_S
    while True:
        try:
            return LinkClient(path, 'plan', _TIMEOUT_S)
        except LinkError as error:
            if not process.alive():
                raise LinkError(f'the core ended with code {process.exit_code}; see its message '
                                'above') from None
            if time.monotonic() > deadline_s:
                raise LinkError(f'the core did not answer within {START_TIMEOUT_S:g} s: '
                                f'{error}') from error
        time.sleep(_TRY_S)


class _StandIn:
    """A client that behaves as the node of the robot: mirrors, samples, heartbeats, requests."""

    def __init__(self, settings: RobotSettings, client: LinkClient, feeds: bool) -> None:
        self.client = client
        self.settings = settings
        self.fed = False
        # (period, next time, what to do)
        self._actions: list[list[Any]] = [
            [settings.core.heartbeat_s / 3, 0.0, client.beat],
            [1.0 / settings.diagnostics_rate_hz, 0.0, client.statistics]]
        for mirror in settings.mirrors:
            if mirror.direction == 'out':
                # A topic that is too large for the link, or is not there: the robot reports it.
                with suppress(LinkError):
                    client.mirror(mirror.topic, mirror.policy, mirror.max_rate_hz)
        if feeds and all(device.port in (SIM_PORT, '') for device in settings.devices):
            self._feed()

    def _feed(self) -> None:
        self.fed = True
        topics = {topic.topic: topic for topic in self.settings.topics}
        for mirror in self.settings.mirrors:
            declared = topics.get(mirror.topic)
            if mirror.direction == 'in' and declared is not None and declared.rate_hz:
                channel, sample = self.client.advertise(mirror.topic), _sample(declared)
                self._actions.append([1.0 / declared.rate_hz, 0.0,
                                      lambda c=channel, s=sample: self.client.publish(c, s)])

    def run(self, seconds: float) -> None:
        """Do all that is due, for a time."""
        end_s = time.monotonic() + seconds
        while (now_s := time.monotonic()) < end_s:
            for action in self._actions:
                if now_s >= action[1]:
                    action[1] = max(action[1] + action[0], now_s)
                    action[2]()
            next_s = min([end_s, *(action[1] for action in self._actions)])
            self.client.pump(min(_LONGEST_PUMP_S, max(0.0, next_s - time.monotonic())))


def _sample(topic: TopicSettings) -> bytes:
    layout = Layout.compile(topic.message, topic.fixed, tail=topic.tail)
    return bytes(layout.prototype)


def _until_active(robot: _StandIn) -> None:
    deadline_s = time.monotonic() + ACTIVE_TIMEOUT_S
    while time.monotonic() < deadline_s:
        if all(device['state'] == 'active' for device in robot.client.statistics().devices):
            return
        robot.run(4 * _TRY_S)


def _cpu_ns(pid: int) -> int:
    """Return the computing time of a process so far; 0 when Linux does not report it."""
    try:
        return int(Path(f'/proc/{pid}/schedstat').read_text().split()[0])
    except (OSError, ValueError, IndexError):
        return 0


def _result(before: CoreStatistics, after: CoreStatistics, cpu_ns: int, robot: _StandIn,
            of: Longest) -> Measured:
    elapsed_ns = max(1, after.core['now_ns'] - before.core['now_ns'])
    idle = {device['name']: device['reason'] or f"the device was {device['state']}"
            for device in after.devices if device['state'] != 'active'}
    refused = tuple(each['step'] for each in after.core['realtime'] if not each['ok'])
    return Measured(
        elapsed_ns, {task.name: _task(task, of) for task in after.tasks},
        tick_ns=_tick_ns(before, after, cpu_ns),
        resources={each['name']: each['held_maximum_ns'] for each in after.resources},
        idle=idle, refused=refused, fed=robot.fed)


def _task(task: TaskStatistics, of: Longest) -> MeasuredTask:
    return MeasuredTask(
        priority=task.priority, period_ns=task.period_ns, releases=task.releases, runs=task.runs,
        execution_ns=of(task), native_ns=task.blocked_maximum_ns,
        latency_ns=task.latency.maximum_ns, response_ns=task.response_maximum_ns)


def _tick_ns(before: CoreStatistics, after: CoreStatistics, cpu_ns: int) -> int:
    """Divide what the process computed outside of its tasks by the releases by a signal."""
    jobs_ns = sum(task.execution_total_ns for task in after.tasks) - sum(
        task.execution_total_ns for task in before.tasks)
    ticks = sum(task.releases for task in after.tasks if task.period_ns) - sum(
        task.releases for task in before.tasks if task.period_ns)
    spent_ns = cpu_ns - jobs_ns
    return spent_ns // ticks if ticks > 0 and spent_ns > 0 else 0
