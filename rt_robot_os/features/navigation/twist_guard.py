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

"""A guard between velocity commands and the wheels: limits them, and stops when none come."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.gaps import Gaps
from rt_robot_os.modules.base import Module
from rt_robot_os.modules.run_on import RUN_ON_MAX
from rt_robot_os.modules.run_on import run_on_speed_m_s
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_TWIST: Final = 'geometry_msgs/msg/Twist'


def _limited(value: float, limit: float) -> float:
    # A NaN compares false with everything: it must not pass.
    return value if -limit <= value <= limit else limit if value > limit else (
        -limit if value < -limit else 0.0)


class TwistGuard(Module):
    """
    Pass velocity commands on, limited, and zero when they are too old or not a number.

    The speed is low for a motor board that runs on for long when this computer stops.

    The age of a command counts from its stamp, the time at which it entered, and from its arrival:
    a dead sender, a stalled network and a killed ROS side all end in a standstill after
    ``timeout_s``. After a gap, in which the core or the machine stood still, only commands that
    were given afterwards count.
    """

    command = Input('cmd_vel', message=_TWIST)
    safe = Output('cmd_vel_safe', _TWIST)

    SETTINGS = (
        Field('timeout_s', float, 0.5, 'age of a command at which the robot is stopped', 's',
              0.01, 60.0, live=True),
        Field('linear_max_m_s', float, 1.0, 'largest speed along each axis', 'm/s', 0.0, 100.0,
              live=True),
        Field('angular_max_rad_s', float, 2.0, 'largest turning rate about each axis', 'rad/s',
              0.0, 100.0, live=True),
        RUN_ON_MAX,
    )

    _arrived_ns = 0
    _late_ns = 0
    _late = 0
    _awake_ns = 0
    _gaps: Gaps | None = None

    def safe_state(self) -> None:
        """Publish a standstill."""
        message = self.safe.msg
        message.linear = message.angular = (0.0, 0.0, 0.0)
        self.safe.publish()

    def step(self) -> None:
        """Publish the active command."""
        command = self.command
        now_ns = command.topic.kernel.now_ns()
        if self._gaps is None:
            self._gaps = Gaps(command.topic.kernel.clock)
        if self._gaps.round(now_ns, self.period_ns):
            self._awake_ns = now_ns
        if command.latest():
            self._arrived_ns = now_ns
            self._late_ns = 0
        message = self.safe.msg
        age_ns = max(command.age_ns, now_ns - self._arrived_ns)
        timeout_ns = self.settings['timeout_s'] * NS_PER_S
        if command.seq < 0 or age_ns > timeout_ns or command.stamp_ns < self._awake_ns:
            if command.seq >= 0 and now_ns == self._arrived_ns:
                self._late_ns = age_ns if age_ns > timeout_ns else 0
                self._late += 1
            elif now_ns - self._arrived_ns > timeout_ns:
                self._late_ns = 0  # commands have stopped
            message.linear = message.angular = (0.0, 0.0, 0.0)
        else:
            linear, angular = self._linear_max_m_s(), self.settings['angular_max_rad_s']
            message.linear = [_limited(v, linear) for v in command.msg.linear]
            message.angular = [_limited(v, angular) for v in command.msg.angular]
        self.safe.publish()

    def _linear_max_m_s(self) -> float:
        return min(float(self.settings['linear_max_m_s']), run_on_speed_m_s(self))

    def statistics(self) -> Mapping[str, Any]:
        """Return how many commands were too old when they came."""
        warning = ''
        if self._late_ns:
            warning = (f'commands come, but their stamps are {self._late_ns / NS_PER_S:.1f} s old '
                       f'(timeout_s {self.settings["timeout_s"]:g}): the robot is held; are the '
                       'clocks synchronised?')
        return {'too_old': self._late, 'speed_limit_m_s': self._linear_max_m_s(),
                'gaps': self._gaps.count if self._gaps is not None else 0,
                'warning': warning}
