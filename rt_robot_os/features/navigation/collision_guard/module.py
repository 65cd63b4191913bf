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
A guard against collisions between velocity commands and the wheels.

It runs with each command and each measurement. Commands pass as far as the robot can still brake
before obstacles on their path; other obstacles have no effect. Every stop has a reason.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.collision_guard.blind_sectors import BlindSectors
from rt_robot_os.features.navigation.collision_guard.obstacle_map import FREE
from rt_robot_os.features.navigation.collision_guard.obstacle_map import ObstacleMap
from rt_robot_os.features.navigation.collision_guard.obstacle_map import UNSEEN
from rt_robot_os.features.navigation.collision_guard.obstacle_map import VelocityVerdict
from rt_robot_os.features.navigation.collision_guard.sensors import BEARINGS
from rt_robot_os.features.navigation.collision_guard.sensors import Bumper
from rt_robot_os.features.navigation.collision_guard.sensors import DistanceSensor
from rt_robot_os.features.navigation.collision_guard.sensors import RangeFinder
from rt_robot_os.features.navigation.collision_guard.sensors import Scanner
from rt_robot_os.features.navigation.collision_guard.sensors import sensor_mounting
from rt_robot_os.features.navigation.collision_guard.settings import check_sensors
from rt_robot_os.features.navigation.collision_guard.settings import footprint_of
from rt_robot_os.features.navigation.collision_guard.settings import SETTINGS
from rt_robot_os.features.navigation.collision_guard.settings import STOP
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.wake_up import WakeUp
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.zones import Circle
from rt_robot_os.topics import Subscription
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_TWIST: Final = 'geometry_msgs/msg/Twist'
# A command beyond these is an error, in m/s and rad/s.
_ABSURD_M_S: Final = 100.0
_ABSURD_RAD_S: Final = 1000.0
# A smaller change of the allowed share is not published by itself.
_WORTH: Final = 0.02
_REASON_MAXIMUM: Final = 200


class CollisionGuard(Module):
    """Pass velocity commands on, as fast as the robot can still brake."""

    command = Input('cmd_vel_mux', wake=True, message=_TWIST)
    bumper = Input('', wake=True, message='std_msgs/msg/UInt8')
    speed_limit = Input('', initial=True, message='std_msgs/msg/Float64')
    safe = Output('cmd_vel_safe', _TWIST)
    stop_reason = Output('stop_reason', 'std_msgs/msg/String', tail=_REASON_MAXIMUM)

    SETTINGS = SETTINGS

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Check the sensors and the footprint.

        :raises ConfigError: there is no sensor, or the footprint is invalid.
        """
        super().__init__(name, settings)
        check_sensors(name, settings)
        self._footprint = footprint_of(name, settings)
        self._bumper = Bumper(self._footprint) if settings['bumper_topic'] else None
        self._sensors: list[tuple[DistanceSensor, str]] = []
        self._v = self._w = 0.0  # as commanded
        self._limits: Subscription | None = None
        self._asked_m_s = math.inf
        self._stamp_ns = self._deadline_ns = 0
        self._out_v = self._out_w = 0.0  # as published last
        self._driven_m, self._driven_ns = 0.0, 0
        self._pose: Pose = (0.0, 0.0, 0.0)  # as commanded, from the start
        self._verdict = FREE
        self._told = ''
        self._commands = self._refused = self._late = self._stops = self._timeouts = 0

    # ---- ports -------------------------------------------------------------------------------

    def connected(self, attribute: str) -> bool:
        """Do not subscribe to inputs without a topic."""
        return bool(self.topic_of(attribute))

    def listed_inputs(self) -> Mapping[str, Input]:
        """Return an input for each sensor."""
        return {topic: Input(topic, wake=True, message=f'sensor_msgs/msg/{message}')
                for key, message in (('scan_topics', 'LaserScan'), ('range_topics', 'Range'))
                for topic in self.settings[key]}

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """
        Look up the mounting of each sensor.

        :raises ConfigError: there is no transform for one.
        """
        self._sensors = [
            (Scanner(read, self._mounting(read), self._footprint, self.settings['scan_minimum_m'])
             if topic in self.settings['scan_topics']
             else RangeFinder(read, self._mounting(read), self._footprint),
             'scan_timeout_s' if topic in self.settings['scan_topics'] else 'range_timeout_s')
            for topic, read in self.listed.items()]
        self._sights = {sensor.topic: BlindSectors(sensor, self._footprint, self.settings)
                        for sensor, _ in self._sensors if isinstance(sensor, Scanner)}
        self._obstacle_map = ObstacleMap(
            self._footprint, [sensor for sensor, _ in self._sensors], [*self._sights.values()],
            self._bumper, self.settings, self.run_on)
        self._obstacle_map.rebuild()
        self._window_m = self._obstacle_map.window_m()
        self._limits = self.speed_limit if self.connected('speed_limit') else None
        self._wake_up = WakeUp(self.kernel, self.task)

    def changed(self, name: str) -> None:
        """Apply a limit."""
        self._window_m = self._obstacle_map.window_m()

    def safe_state(self) -> None:
        """Publish a standstill, and discard the command."""
        self._deadline_ns = 0
        self._publish(0.0, 0.0, 0)

    def step(self) -> None:
        """Read the inputs, and publish the allowed share of the command."""
        now_ns = self.safe.topic.kernel.now_ns()
        self._count_way(now_ns)
        self._read_sensors(now_ns)
        is_new = self._take_command(now_ns)
        if not self._deadline_ns:
            return
        if now_ns >= self._deadline_ns:
            self._end(now_ns)
            return
        self._forward(is_new, now_ns)
        self._wake_up.no_later_than(min(self._deadline_ns, self._next_silence_ns(now_ns)))

    def statistics(self) -> Mapping[str, Any]:
        """Return the present limit with its reason, and the counters."""
        verdict = self._verdict
        warning = ''
        if self._told:
            warning = f'stopped: {verdict.reason}'
        elif verdict.cause.endswith(UNSEEN):
            warning = f'slowed: {verdict.reason}'
        state = 'stop' if verdict.share == 0.0 else 'slow' if verdict.share < 1.0 else 'free'
        return {
            'warning': warning, 'state': state, 'limited_by': verdict.reason,
            'share': verdict.share, 'commands': self._commands, 'refused': self._refused,
            'speed_limit_m_s': min(self.settings['linear_max_m_s'], self._asked_m_s),
            'late_commands': self._late, 'command_timeouts': self._timeouts,
            'stops': self._stops,
            **{f'{sensor.topic}_unusable': sensor.unusable for sensor, _ in self._sensors},
            **{f'{topic}_blind_deg': math.degrees(sight.blind_rad)
               for topic, sight in self._sights.items()}}

    # ---- work --------------------------------------------------------------------------------

    def _end(self, now_ns: int) -> None:
        """Stop, as commands have ended, unless the last one was a standstill."""
        self._deadline_ns = 0
        self._verdict = FREE
        if self._v or self._w:
            self._timeouts += 1
            self._publish(0.0, 0.0, now_ns)
        self._log_stop('', '', now_ns)

    def _mounting(self, read: Subscription) -> Mounting:
        return sensor_mounting(read, self.mountings, self.name)

    def _count_way(self, now_ns: int) -> None:
        """Add the distance that the fastest point may have driven since the last job."""
        dt_s = (now_ns - self._driven_ns) / NS_PER_S
        self._driven_m += self._speed_bound() * dt_s
        self._pose = moved(self._pose, self._out_v * dt_s, self._out_w * dt_s)
        self._driven_ns = now_ns

    def _speed_bound(self) -> float:
        return abs(self._out_v) + abs(self._out_w) * self._footprint.reach_m

    def _read_sensors(self, now_ns: int) -> None:
        """Read the sensors."""
        speed, is_new = self._speed_bound(), False
        for sensor, _ in self._sensors:
            if sensor.update(now_ns, self._window_m, self._driven_m, speed):
                is_new = True
                self._update_blind_sectors(sensor, now_ns)
        if self._bumper is not None:
            hold_ns = round(self.settings['bumper_hold_s'] * NS_PER_S)
            while self.bumper.take():
                self._bumper.update(int(self.bumper.msg.data), now_ns, hold_ns)
            before = self._bumper.contacts
            self._wake_up.no_later_than(self._bumper.evaluate(now_ns))
            is_new |= before is not self._bumper.contacts
        if is_new:
            self._obstacle_map.rebuild()

    def _update_blind_sectors(self, sensor: DistanceSensor, now_ns: int) -> None:
        """Update the blind sectors of a scanner, from the pose at its scan."""
        sight = self._sights.get(sensor.topic)
        if sight is not None:
            ago_s = min((now_ns - sensor.stamp_ns) / NS_PER_S, 1.0)
            sight.update(moved(self._pose, -self._out_v * ago_s, -self._out_w * ago_s),
                         self._window_m)

    def _take_command(self, now_ns: int) -> bool:
        """Return whether there is a new one."""
        command = self.command
        if not command.latest():
            return False
        self._commands += 1
        v, w = command.msg.linear.x, command.msg.angular.z
        stamp_ns = min(command.stamp_ns, now_ns)
        deadline_ns = stamp_ns + round(self.settings['timeout_s'] * NS_PER_S)
        if deadline_ns <= now_ns:
            self._late += 1
            return False
        if not (abs(v) <= _ABSURD_M_S and abs(w) <= _ABSURD_RAD_S):
            self._refused += 1
            self.log.warn('command %s m/s, %s rad/s: treated as a standstill', v, w,
                          throttle_s=1.0)
            v = w = 0.0
        self._v, self._w = self._limited(v, w)
        self._stamp_ns, self._deadline_ns = stamp_ns, deadline_ns
        return True

    def _limited(self, v: float, w: float) -> tuple[float, float]:
        """Limit both alike, so that the arc stays the same."""
        s = self.settings
        if self._limits is not None and self._limits.latest():
            asked_m_s = float(self._limits.msg.data)
            if not math.isnan(asked_m_s):
                self._asked_m_s = asked_m_s if asked_m_s > 0.0 else math.inf
        fastest = min(s['linear_max_m_s'], self._asked_m_s)
        if v < 0.0 and not any(sensor.looks_back for sensor, _ in self._sensors):
            fastest = min(fastest, s['backward_max_m_s'], self._obstacle_map.unseen_m_s())
        turning = s['angular_max_rad_s']
        if self._swings_unseen(v, w):
            slow_m_s = min(s['slow_m_s'], self._obstacle_map.unseen_m_s())
            turning = min(turning, slow_m_s / self._footprint.reach_m)
        share = min(1.0, fastest / abs(v) if v else 1.0, turning / abs(w) if w else 1.0)
        return v * share, w * share

    def _swings_unseen(self, v: float, w: float) -> bool:
        """Return whether corners turn, about on the spot, where no sensor may look."""
        if isinstance(self._footprint, Circle) or abs(v) >= abs(w) * self._footprint.reach_m:
            return False
        return len(frozenset[int]().union(
            *(sensor.bearings for sensor, _ in self._sensors))) < BEARINGS

    def _forward(self, is_new: bool, now_ns: int) -> None:
        verdict = self._judge(now_ns)
        if verdict.share == 0.0 and self._verdict.share != 0.0:
            self._stops += 1
            self.log.warn('%s', verdict.reason, throttle_s=1.0)
        self._verdict = verdict
        v, w = self._v * verdict.share, self._w * verdict.share
        moves, moved = (v, w) != (0.0, 0.0), (self._out_v, self._out_w) != (0.0, 0.0)
        shift = self._footprint.speed(v - self._out_v, w - self._out_w)
        if is_new or moves != moved or shift > _WORTH * self._footprint.speed(self._v, self._w):
            # The stamp stays that of the command, so that the base knows its age.
            self._publish(v, w, self._stamp_ns if moves else now_ns)
        stopped = verdict.share == 0.0
        self._log_stop(verdict.cause if stopped else '', verdict.reason, now_ns)

    def _judge(self, now_ns: int) -> VelocityVerdict:
        speed = self._footprint.speed(self._v, self._w)
        if speed == 0.0:
            return self._obstacle_map.judge(0.0, 0.0, self._driven_m)
        if self._bumper is not None and self._bumper.lifted:
            return VelocityVerdict(0.0, 'wheel drop', 'a wheel hangs in the air')
        silent = self._timed_out_sensor(now_ns)
        if silent and self.settings['silent'] == STOP:
            return VelocityVerdict(0.0, f'{silent}: silent', f'{silent}: nothing is heard')
        verdict = self._obstacle_map.judge(self._v, self._w, self._driven_m)
        slow_m_s = min(self.settings['slow_m_s'], self._obstacle_map.unseen_m_s())
        if silent and verdict.share * speed > slow_m_s:
            return VelocityVerdict(slow_m_s / speed, f'{silent}: silent',
                                   f'{silent}: nothing is heard')
        return verdict

    def _sensor_timeouts(self) -> Iterator[tuple[int, str]]:
        """Yield the time at which each sensor times out, and its name."""
        for sensor, key in self._sensors:
            yield sensor.times_out_at_ns(round(self.settings[key] * NS_PER_S)), sensor.topic
        if self._bumper is not None and self.settings['bumper_timeout_s']:
            yield self._bumper.times_out_at_ns(
                round(self.settings['bumper_timeout_s'] * NS_PER_S)), self.topic_of('bumper')

    def _timed_out_sensor(self, now_ns: int) -> str:
        """Return a sensor that has timed out; empty when none has."""
        return next((name for at_ns, name in self._sensor_timeouts() if now_ns >= at_ns), '')

    def _next_silence_ns(self, now_ns: int) -> float:
        return min((at_ns for at_ns, _ in self._sensor_timeouts() if at_ns > now_ns),
                   default=math.inf)

    def _publish(self, v: float, w: float, stamp_ns: int) -> None:
        message = self.safe.msg
        message.linear.x, message.angular.z = v, w
        self._out_v, self._out_w = v, w
        self.safe.publish(stamp_ns)

    def _log_stop(self, cause: str, why: str, now_ns: int) -> None:
        """Log why it stands, once for each reason."""
        if cause == self._told:
            return
        self._told = cause
        self.stop_reason.msg.data = why[:_REASON_MAXIMUM] if cause else ''
        self.stop_reason.publish(now_ns)
