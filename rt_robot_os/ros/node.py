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

"""The node `robot`: starts and supervises the core, and mirrors topics both ways."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.lifecycle import LifecycleNode
from rclpy.lifecycle import LifecycleState
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.needs import ros_remedy
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.link import LinkClient
from rt_robot_os.link import socket_path
from rt_robot_os.link.conversions import TRANSFORMS
from rt_robot_os.link.stamp_mapper import StampMapper
from rt_robot_os.linux.paths import robot_name
from rt_robot_os.ros.arrivals import OwnGaps
from rt_robot_os.ros.console import Console
from rt_robot_os.ros.core_process import CoreProcess
from rt_robot_os.ros.diagnostics import Diagnostics
from rt_robot_os.ros.log_relay import LogRelay
from rt_robot_os.ros.mirrors import Mirrors
from rt_robot_os.ros.parameters import NodeParameters
from rt_robot_os.ros.responses import Responses
from rt_robot_os.ros.ros_time import RosTime
from rt_robot_os.ros.services import Services
from rt_robot_os.ros.static_transforms import StaticTransforms
from rt_robot_os.ros.supervisor import Supervisor
from rt_robot_os.settings import RobotParameters
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import to_json
from rt_robot_os.settings.saved import describe_saved
from rt_robot_os.settings.saved import save
from rt_robot_os.settings.saved import saved_path
from rt_robot_os.settings.static_frames import loose_parents
from rt_robot_os.settings.static_frames import published_frames
from rt_robot_os.settings.static_frames import TOPIC
from std_srvs.srv import Trigger

_START_TIMEOUT_S = 10.0


class RobotNode(LifecycleNode):
    """
    The ROS 2 node of one robot.

    configure: start the core and connect. activate: mirror. deactivate: stop mirroring, the core
    runs on. cleanup and shutdown: end the core.

    :param settings: checked already.
    :param name: of the node, before remapping.
    :param console: counts the lines that were not read; None counts none.
    :param stopping: returns whether the program must end without waiting.
    :param core: that is loaded already, for the first configuration of this node.
    :ivar is_blocked: a thread is blocked at the end, because the console is not read.
    """

    def __init__(self, settings: RobotSettings, name: str = 'robot',
                 console: Console | None = None,
                 stopping: Callable[[], bool] = lambda: False,
                 core: CoreProcess | None = None) -> None:
        super().__init__(name)
        self._loaded = settings
        self._robot_parameters = RobotParameters(settings)
        self._loaded_values = self._robot_parameters.live_values()
        self._stopping = stopping
        self._core = core
        if core is not None and not (settings.core.spawn and settings.autostart):
            core.stop()  # it is not known whether and when it is needed
        self._adopting = False
        self._digest: int | None = None
        self.robot = robot_name(self.get_name(), self.get_namespace())
        self.path: Path = socket_path(self.robot)
        self._time = RosTime(self.get_clock(), lambda text: self._log.note(
            int(Severity.WARN), text))
        self._mapper = StampMapper(wall_ns=self._time.now_ns)
        self._log = LogRelay(self, self._mapper, settings.log, self.robot, console)
        self.is_blocked = False
        self._mirrors: Mirrors | None = None
        self._static: StaticTransforms | None = None
        self._supervisor: Supervisor | None = None
        rearm = self.create_service(Trigger, '~/rearm', self._on_rearm)
        self.create_service(Trigger, '~/save_parameters', self._on_save)
        self._text_services = Services(self, settings.services, settings.mirrors, settings.files)
        self._diagnostics = Diagnostics(self.robot, rearm.service_name)
        self._status_publisher = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        # On a steady clock: /diagnostics is independent of ROS time.
        self._status_timer = self.create_timer(
            1.0 / settings.diagnostics_rate_hz, self._diagnose,
            clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._gaps = OwnGaps()
        self._gaps.watch()
        self._ros_parameters = NodeParameters(
            self, self._robot_parameters.known.values(), self._change)
        self._responses = Responses(self, self._warn)  # of all services, including those of rclpy

    @property
    def settings(self) -> RobotSettings:
        """Return the current settings, including changes at run time."""
        return self._robot_parameters.settings

    # ---- lifecycle ---------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start the core and wait for it."""
        process = self._core_process() if self.settings.core.spawn else None
        self._mirrors = Mirrors(self, self.settings.mirrors, self._mapper, self._warn,
                                self._text_services.answer_topics, self._gaps)
        frames = published_frames(self.settings)
        self._static = StaticTransforms(self, frames)
        self._warn_of_missing_packages()
        for parent in loose_parents(frames):
            self._log.note(int(Severity.INFO), f'/tf_static: frames are mounted on {parent!r}, '
                           'which is not a frame of a device: a robot description must publish it')
        self._supervisor = Supervisor(
            self.path, process, self._mapper, self._log.note, self._log.relay, name=self.robot,
            on_connect=self._connect, on_disconnect=self._disconnect,
            heartbeat_s=self.settings.core.heartbeat_s,
            statistics_period_s=1.0 / self.settings.diagnostics_rate_hz,
            watchdog_code=(self.settings.watchdog.exit_code if self.settings.watchdog.timeout_s
                           else 0))
        self._supervisor.start()
        connected = self._supervisor.wait(_START_TIMEOUT_S, self._stopping)
        if self.fatal:
            self._stop_core()
            return TransitionCallbackReturn.FAILURE
        if process is not None and not connected and not self._stopping():
            # The supervisor continues to try, and /diagnostics reports it meanwhile.
            self._log.note(int(Severity.WARN), f'the core has not answered after '
                           f'{_START_TIMEOUT_S:g} s: '
                           f'{self._supervisor.starved or "is the machine overloaded?"}')
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start mirroring."""
        try:
            if self._mirrors is not None:
                self._mirrors.activate()
            self._text_services.activate()
            if self._static is not None:
                self._static.publish(self._time.now_ns())
        except LinkError as error:
            self._log.note(int(Severity.ERROR), str(error))
            return TransitionCallbackReturn.FAILURE
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop mirroring; the core runs on."""
        self._text_services.deactivate()
        try:
            if self._mirrors is not None:
                self._mirrors.deactivate()
        except LinkError as error:
            self._log.note(int(Severity.WARN), str(error))
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the core."""
        self._stop_core()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the core."""
        self._stop_core()
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the core; the node may be configured again."""
        self._stop_core()
        return TransitionCallbackReturn.SUCCESS

    def destroy_node(self) -> None:
        """
        End the core and the node; may be called twice.

        If a thread is blocked by a console that is not read, :attr:`is_blocked` is set and the
        node is not destroyed: that would wait for the thread.
        """
        self._stop_core()
        self._gaps.close()
        self.is_blocked = not self._log.close()
        if not self.is_blocked:
            super().destroy_node()

    @property
    def fatal(self) -> str:
        """Why no core can run with this configuration; empty otherwise."""
        return self._supervisor.fatal if self._supervisor is not None else ''

    def _connect(self, client: LinkClient) -> None:
        """
        Use a new connection; called by the supervisor's thread.

        :raises LinkError: the core refuses.
        """
        if self._mirrors is not None:
            self._mirrors.connect(client)
        self._text_services.connect(client)

    def _disconnect(self) -> None:
        self._text_services.disconnect()
        if self._mirrors is not None:
            self._mirrors.disconnect()

    def _core_process(self) -> CoreProcess:
        process, self._core = self._core or CoreProcess('', self.path), None
        process.set_settings(self._for_core(self.settings))
        return process

    def _stop_core(self) -> None:
        self._text_services.active = False
        if self._supervisor is not None:
            self._supervisor.stop()
        if self._mirrors is not None:
            self._mirrors.destroy()
            self._mirrors = None
        if self._static is not None:
            self._static.destroy()
            self._static = None

    def _warn(self, text: str) -> None:
        self._log.note(int(Severity.WARN), text)

    def _warn_of_missing_packages(self) -> None:
        """Log the topics that are missing because their type is not installed."""
        mirrors, static = self._mirrors, self._static
        topics: dict[str, list[str]] = {}
        for mirror in mirrors.lacking if mirrors is not None else ():
            topics.setdefault(mirror.as_, []).append(mirror.ros_topic)
        if static is not None and static.lacking:
            topics.setdefault(TRANSFORMS, []).append(TOPIC)
        for message, names in topics.items():
            package = message.partition('/')[0]
            remedy = ros_remedy(package)
            self._warn(f'no {" and ".join(dict.fromkeys(names))}: the ROS package {package} is '
                       f'not installed{f" ({remedy})" if remedy else ""}; everything else runs')

    def _on_rearm(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Let every task that is held run again."""
        client = self._client()
        try:
            if client is None:
                raise LinkError('no core is connected')
            names = client.request('rearm')['tasks']
            response.success = True
            response.message = f're-armed: {", ".join(names)}' if names else 'no task was held'
        except LinkError as error:
            response.message = str(error)
        return response

    # ---- diagnostics -------------------------------------------------------------------------

    def _diagnose(self) -> None:
        self._time.check()
        self._mapper.follows = self._time.followed
        message = DiagnosticArray()
        seconds, rest_ns = divmod(self._time.now_ns(), NS_PER_S)
        message.header.stamp = Time(sec=seconds, nanosec=rest_ns)
        try:
            message.status = self._statuses()
            self._status_publisher.publish(message)
        except Exception as error:
            # An error in a timer would end the node; the core may have sent anything.
            message.status = self._diagnostics.silent(
                f'the statistics of the core are not valid: {type(error).__name__}: {error}')
            self._status_publisher.publish(message)

    def _statuses(self) -> list[DiagnosticStatus]:
        supervisor, mirrors = self._supervisor, self._mirrors
        if supervisor is None or mirrors is None:
            return self._diagnostics.silent('not configured')
        statistics = supervisor.statistics
        if not supervisor.connected.is_set() or statistics is None:
            return self._diagnostics.silent(
                supervisor.fatal or supervisor.reason or 'no core is connected')
        digest = statistics.core.get('parameters')
        if digest != self._digest:
            self._adopt()
            self._digest = digest
        static = self._static.counters() if self._static is not None else []
        return self._diagnostics.judge(
            statistics, self._mapper, [*mirrors.counters(), *static], self._log.statistics(),
            supervisor.starved, self._text_services.counters())

    # ---- parameters --------------------------------------------------------------------------

    def _change(self, values: Mapping[str, Any]) -> None:
        """
        Apply changes, all of them or none.

        :raises RtRobotError: a change is refused.
        """
        parameters = self._robot_parameters
        reasons = [reason for name, value in values.items()
                   if (reason := parameters.refusal(name, value))]
        if reasons:
            raise ConfigError(['; '.join(reasons)])
        before = parameters.live_values()
        made: list[str] = []
        try:
            for name, value in values.items():
                self._change_in_core(name, value)
                made.append(name)
                self._store(name, value)
        except RtRobotError:
            for name in reversed(made):
                with suppress(LinkError):
                    self._store(name, before[name])
                with suppress(LinkError):  # the next core starts with the stored value
                    self._change_in_core(name, before[name])
            raise

    def _change_in_core(self, name: str, value: Any) -> None:
        client = None if self._adopting else self._client()
        if client is not None and self._robot_parameters.known[name].in_core:
            client.change(name, value)

    def _store(self, name: str, value: Any) -> None:
        """Store a change, for a restarted core and for the mirrors."""
        self._robot_parameters.set(name, value)
        if self._supervisor is not None and self._supervisor.process is not None:
            self._supervisor.process.set_settings(
                self._for_core(self.settings), self._for_core(self._loaded))
        if self._mirrors is not None:
            self._mirrors.follow(self.settings.mirrors)

    def _for_core(self, settings: RobotSettings) -> str:
        """Write settings with the resolved ROS names of mirrors, which recorders need."""
        return to_json(replace(settings, mirrors=tuple(
            replace(mirror, ros_topic=self.resolve_topic_name(mirror.ros_topic))
            for mirror in settings.mirrors)))

    def _adopt(self) -> None:
        """Adopt changes that modules and other clients have made in the core."""
        client = self._client()
        if client is None:
            return
        try:
            facts = client.parameters()[1]
        except LinkError:
            return  # tried again after the reconnection
        known = self._robot_parameters.live_values()
        self._adopting = True
        try:
            for name, parameter in facts.items():
                value = parameter['value']
                if name in known and known[name] != value:
                    reason = self._take_over(name, value)
                    if reason:
                        self._log.note(
                            int(Severity.WARN), f'{name} is {value!r} in the core, but the '
                            f'parameter cannot have this value: {reason}')
        finally:
            self._adopting = False

    def _take_over(self, name: str, value: Any) -> str:
        """Set a parameter to its value in the core; return why it is refused, or ''."""
        try:
            result = self.set_parameters([Parameter(name, value=value)])[0]
        except (TypeError, ValueError) as error:  # for example a string that ROS cannot encode
            return str(error)
        return '' if result.successful else str(result.reason)

    def _on_save(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Save the parameters that were changed since the start."""
        self._adopt()
        try:
            path = saved_path(self.settings.parameters_file, self.robot)
            values = save(path, self.robot, self._loaded_values,
                          self._robot_parameters.live_values(), files=self.settings.files)
        except RtRobotError as error:
            response.message = str(error)
            return response
        response.success = True
        response.message = describe_saved(path, values)
        return response

    def _client(self) -> LinkClient | None:
        return self._supervisor.client if self._supervisor is not None else None
