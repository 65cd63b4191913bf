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

"""The speed limits of remote driving, and how long a command is active."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.messages.uplink.speed_limit import bounded

#: Topic of the commands, a ``geometry_msgs/msg/Twist``.
TOPIC: Final = 'cmd_vel_teleop'
#: Published when the dead-man switch is pressed: the goal must not go on after its release.
CANCEL_TOPIC: Final = 'trajectory_cancel'
#: How often a ticket is issued while a driver has the lease.
BEAT_HZ: Final = 20.0


@dataclass(frozen=True)
class TeleopLimits:
    """
    The limits of the robot for all commands.

    :ivar linear_m_s: highest speed; 0 disables driving.
    :ivar angular_rad_s: highest angular velocity.
    :ivar hold_s: how long a command is active; then the robot is stopped. Shorter than the
        time-out of ``teleop`` in the multiplexer of velocities.
    :ivar ticket_s: a command has no effect later than this after its ticket was issued.
    """

    linear_m_s: float = 0.3
    angular_rad_s: float = 0.8
    hold_s: float = 0.1
    ticket_s: float = 0.3

    @property
    def may_drive(self) -> bool:
        """Return whether it can be driven."""
        return self.linear_m_s > 0.0

    @property
    def hold_ns(self) -> int:
        """Return how long a command holds."""
        return round(self.hold_s * NS_PER_S)

    @property
    def ticket_ns(self) -> int:
        """Return how long a ticket is valid."""
        return round(self.ticket_s * NS_PER_S)

    def bounded(self, linear_m_s: float, angular_rad_s: float) -> tuple[float, float]:
        """Return a command within the limits, with the same curvature."""
        return bounded(linear_m_s, angular_rad_s, self.linear_m_s, self.angular_rad_s)
