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
Select the velocity source that steers: of several the one of highest priority.

Names and rules are those of twist_mux: sources with priorities and time-outs, locks that block
sources below them. In addition, a source that has steered holds the robot for a while after its
last command, and there are a dead-man switch and an e-stop that stays until it is released. A
command is published immediately; when no source steers any more a single standstill is.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.motor_faults import NEWS
from rt_robot_os.features.navigation.velocity_mux.settings import locks_of
from rt_robot_os.features.navigation.velocity_mux.settings import SETTINGS
from rt_robot_os.features.navigation.velocity_mux.settings import sources_of
from rt_robot_os.features.navigation.velocity_mux.sources import chosen
from rt_robot_os.features.navigation.velocity_mux.sources import holder
from rt_robot_os.features.navigation.velocity_mux.sources import Latch
from rt_robot_os.features.navigation.velocity_mux.sources import LATE
from rt_robot_os.features.navigation.velocity_mux.sources import REFUSED
from rt_robot_os.features.navigation.velocity_mux.sources import STANDSTILL
from rt_robot_os.features.navigation.velocity_mux.sources import Switch
from rt_robot_os.features.navigation.velocity_mux.sources import Triple
from rt_robot_os.features.navigation.velocity_mux.sources import VelocitySource
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.run_on import run_on_speed_m_s
from rt_robot_os.modules.wake_up import WakeUp
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_TWIST: Final = 'geometry_msgs/msg/Twist'
_BOOL: Final = 'std_msgs/msg/Bool'
_NOBODY: Final = 'nobody'
_NEWS: Final = int(NEWS)
_SELDOM_S: Final = 600.0
# A release that is older on arrival is rejected: it was meant for another situation.
_RELEASE_AGE_NS: Final = 2 * NS_PER_S


class VelocityMux(Module):
    """Pass on the commands of the source that may steer."""

    estop = Input('estop', wake=True, message=_BOOL)
    estop_release = Input('estop_release', wake=True, message=_BOOL)
    dead_man = Input('', wake=True, message=_BOOL)
    motor_faults = Input('', wake=True, message='std_msgs/msg/UInt32')
    command = Output('cmd_vel_mux', _TWIST)
    steering = Output('steering', 'std_msgs/msg/String', tail=200)

    SETTINGS = SETTINGS

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Check that the lists are consistent.

        :raises ConfigError: they are not.
        """
        super().__init__(name, settings)
        self._sources = sources_of(name, settings)
        self._locks = locks_of(name, settings)
        self._dead_man = Switch(round(settings['dead_man_timeout_s'] * NS_PER_S))
        # Without a switch, fresh commands show that an operator is present.
        self._has_dead_man = bool(settings['dead_man_topic'])
        self._latch = Latch()
        if settings['estop_at_start']:
            self._latch.set('start', 'held since the start')
            self._latch.end('start')
        self._steers: VelocitySource | None = None
        self._told = ''
        self._switches = self._lost = self._slowed = self._stopped_ns = 0

    # ---- ports -------------------------------------------------------------------------------

    def connected(self, attribute: str) -> bool:
        """Do not subscribe to inputs without a topic."""
        return bool(self.topic_of(attribute))

    def listed_inputs(self) -> Mapping[str, Input]:
        """Return an input for each source and each lock."""
        s = self.settings
        return {
            **{f'source {name}': Input(topic, wake=True, message=_TWIST)
               for name, topic in zip(s['sources'], s['source_topics'])},
            **{f'lock {name}': Input(topic, wake=True, message=_BOOL)
               for name, topic in zip(s['locks'], s['lock_topics'])}}

    # ---- life --------------------------------------------------------------------------------

    def configure(self) -> None:
        """Look up the topics of each source and lock."""
        self._commands = [(each, self.listed[f'source {each.name}']) for each in self._sources]
        self._lock_inputs = [(each, self.listed[f'lock {each.name}']) for each in self._locks]
        self._wake_up = WakeUp(self.kernel, self.task)

    def safe_state(self) -> None:
        """Publish a standstill, and discard all commands."""
        for source in self._sources:
            source.forget()
        self._steers = None
        self._publish(STANDSTILL, STANDSTILL, 0)

    def step(self) -> None:
        """Read the inputs, and pass on the command of the source that steers."""
        now_ns = self.command.topic.kernel.now_ns()
        self._read_switches(now_ns)
        was_stopped = bool(self._latch.reason)
        stopped = self._read_estop(now_ns)
        self._read_commands(now_ns)
        if was_stopped or stopped:
            for source in self._sources:
                source.forget()  # commands from before the release are invalid
        held = not self._has_dead_man or self._dead_man.is_held(now_ns)
        steers = chosen(self._sources, self._locks, held, now_ns)
        if steers is not self._steers:
            self._switches += 1
        if steers is not None:
            steers.hold()
        if steers is not None and (steers.is_new or steers is not self._steers):
            self._publish(steers.linear, steers.angular, steers.stamp_ns)
        elif steers is None and (stopped or self._steers is not None):
            self._publish(STANDSTILL, STANDSTILL, now_ns)
        self._steers = steers
        for source in self._sources:
            source.is_new = False
        self._watch(steers, now_ns)
        self._report_steering(steers, now_ns)

    def statistics(self) -> Mapping[str, Any]:
        """Return which source steers, or why none does, and the counters of each source."""
        refused = [s.name for s in self._sources if s.last == REFUSED]
        late = [s.name for s in self._sources if s.last == LATE]
        warning = ''
        if self._latch.reason:
            warning = f'e-stop: {self._latch.reason}; it is left by {self._release_topic()}'
        elif refused:
            warning = f'not a number, or absurdly large: commands of {", ".join(refused)}'
        elif late:
            warning = f'too old when they came: commands of {", ".join(late)}; are the clocks set?'
        limit_m_s = run_on_speed_m_s(self)
        found: dict[str, Any] = {
            'slowed': self._slowed, **({'speed_limit_m_s': limit_m_s} if limit_m_s < math.inf
                                       else {}),
            'warning': warning, 'steering': self._told, 'estop': self._latch.reason or 'free',
            'estops': self._latch.stops, 'releases_refused': self._latch.refused,
            'switches': self._switches, 'estop_samples_lost': self._lost}
        for source in self._sources:
            found[f'{source.name}_commands'] = source.commands
            found[f'{source.name}_refused'] = source.refused
            found[f'{source.name}_late'] = source.late
        return found

    # ---- work --------------------------------------------------------------------------------

    def _read_switches(self, now_ns: int) -> None:
        for lock, source in self._lock_inputs:
            while source.take():
                lock.update(bool(source.msg.data), min(source.stamp_ns, now_ns))
        if self._has_dead_man:
            while self.dead_man.take():
                self._dead_man.update(bool(self.dead_man.msg.data),
                                      min(self.dead_man.stamp_ns, now_ns))

    def _read_estop(self, now_ns: int) -> bool:
        """Return whether it has just been set."""
        latch, stopped = self._latch, False
        if self.connected('estop'):
            while self.estop.take():
                if self.estop.msg.data:
                    self._stopped_ns = now_ns
                    stopped |= latch.set('estop', f'asked for on {self.topic_of("estop")}')
                else:
                    latch.end('estop')
            if self.estop.lost != self._lost:
                # Their values are unknown: the worst case is assumed.
                self._lost = self.estop.lost
                self._stopped_ns = now_ns
                stopped |= latch.set('lost', 'samples of the e-stop were lost')
                latch.end('lost')
        if self.connected('motor_faults'):
            while self.motor_faults.take():
                bits = int(self.motor_faults.msg.data) & ~_NEWS
                if bits:
                    self._stopped_ns = now_ns
                    stopped |= latch.set('motors', f'motor faults {bits:#x}')
                else:
                    latch.end('motors')
        if self.connected('estop_release'):
            while self.estop_release.take():
                if self.estop_release.msg.data and latch.reason:
                    self._release(now_ns)
        if stopped:
            self.log.warn('e-stop: %s', latch.reason)
        return stopped

    def _release(self, now_ns: int) -> None:
        stamp_ns = self.estop_release.stamp_ns
        if stamp_ns < self._stopped_ns or now_ns - stamp_ns > _RELEASE_AGE_NS:
            self._latch.refused += 1
            self.log.warn('e-stop not released: the release is %.1f s old, or precedes the stop; '
                          'release it again', (now_ns - stamp_ns) / NS_PER_S, throttle_s=1.0)
            return
        lasting = self._latch.release()
        if lasting:
            self.log.warn('e-stop not released: %s is still active; clear it first', lasting,
                          throttle_s=1.0)
        else:
            self.log.info('e-stop released')

    def _read_commands(self, now_ns: int) -> None:
        linear_limit: float = self.settings['linear_absurd_m_s']
        angular_limit: float = self.settings['angular_absurd_rad_s']
        for source, command in self._commands:
            while command.take():
                msg = command.msg
                refused = source.refused
                source.receive((msg.linear.x, msg.linear.y, msg.linear.z),
                               (msg.angular.x, msg.angular.y, msg.angular.z),
                               command.stamp_ns, now_ns, linear_limit, angular_limit)
                if source.refused != refused:
                    self.log.warn('%s commands %s m/s, %s rad/s: treated as a standstill',
                                  source.name, tuple(msg.linear), tuple(msg.angular),
                                  throttle_s=1.0)

    def _publish(self, linear: Triple, angular: Triple, stamp_ns: int) -> None:
        message = self.command.msg
        message.linear, message.angular = self._slow(linear, angular)
        # The stamp stays that of the command, so that the receiver knows its age.
        self.command.publish(stamp_ns)

    def _slow(self, linear: Triple, angular: Triple) -> tuple[Triple, Triple]:
        """Return the velocity slowed to the run-on limit, on the same arc."""
        fastest_m_s, limit_m_s = math.hypot(*linear), run_on_speed_m_s(self)
        if fastest_m_s <= limit_m_s:
            return linear, angular
        self._slowed += 1
        self.log.warn('slowed to %.2f m/s: without this computer the motors run on for %.1f s, '
                      'and run_on_max_m is %g', limit_m_s, self.run_on.total_s,
                      self.settings['run_on_max_m'], throttle_s=_SELDOM_S)
        share = limit_m_s / fastest_m_s
        return ((linear[0] * share, linear[1] * share, linear[2] * share),
                (angular[0] * share, angular[1] * share, angular[2] * share))

    def _watch(self, steers: VelocitySource | None, now_ns: int) -> None:
        """Wake up when a time-out changes which source may steer."""
        if steers is None:
            held_by = holder(self._sources, now_ns)
            if held_by is not None:
                self._wake_up.no_later_than(held_by.held_until_ns)
            return
        next_ns: float = steers.deadline_ns
        if steers.needs_dead_man and self._has_dead_man:
            next_ns = min(next_ns, self._dead_man.silent_at_ns())
        for lock in self._locks:
            if lock.priority > steers.priority:
                next_ns = min(next_ns, lock.silent_at_ns())
        self._wake_up.no_later_than(next_ns)

    def _report_steering(self, steers: VelocitySource | None, now_ns: int) -> None:
        if steers is not None:
            text = steers.name
        elif self._latch.reason:
            text = f'{_NOBODY}: e-stop, {self._latch.reason}'
        else:
            text = self._idle_reason(now_ns)
        if text != self._told:
            self._told = text
            self.steering.msg.data = text[:200]
            self.steering.publish(now_ns)

    def _idle_reason(self, now_ns: int) -> str:
        fresh = [source for source in self._sources if source.is_fresh(now_ns)]
        if not fresh:
            return _NOBODY
        held_by = holder(self._sources, now_ns)
        if held_by is not None and held_by not in fresh and (
                held_by.priority >= fresh[0].priority):
            return f'{_NOBODY}: held for {held_by.name}'
        locks = [lock for lock in self._locks
                 if lock.is_locked(now_ns) and lock.priority > fresh[0].priority]
        if not locks:
            return f'{_NOBODY}: the dead-man switch is not held'
        lock = max(locks, key=lambda each: each.priority)
        silent = '' if lock.value else ', which is silent'
        return f'{_NOBODY}: locked by {lock.name}{silent}'

    def _release_topic(self) -> str:
        topic = self.topic_of('estop_release')
        return f'true on {topic}' if topic else 'nothing, as estop_release_topic is empty'
