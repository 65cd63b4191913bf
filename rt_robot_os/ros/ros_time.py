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
The time of day of the node: that of the system, or of /clock with ``use_sim_time``.

The core always runs in real time. With ``use_sim_time`` messages to ROS are stamped with the time
of /clock, once it is published.
"""

from __future__ import annotations

from collections.abc import Callable
import time

from rclpy.clock import Clock

_PATIENCE_S = 5.0


class RosTime:
    """
    The time of day for stamps.

    :param clock: of the node.
    :param warn: called once if ROS time should come from /clock, which is not published.
    """

    def __init__(self, clock: Clock, warn: Callable[[str], object]) -> None:
        self._clock = clock
        self._warn = warn
        self._since_s: float | None = None
        self._warned = False

    @property
    def simulated(self) -> bool:
        """Whether ROS time should come from /clock."""
        return bool(getattr(self._clock, 'ros_time_is_active', False))

    @property
    def followed(self) -> bool:
        """Whether ROS time comes from /clock, and /clock was received."""
        return self.simulated and self._clock.now().nanoseconds > 0

    def now_ns(self) -> int:
        """Return the time of day in nanoseconds: of /clock if it is used and was received."""
        if self.simulated:
            now_ns = int(self._clock.now().nanoseconds)
            if now_ns > 0:
                self._since_s = None
                return now_ns
        return time.time_ns()

    def check(self) -> None:
        """Warn, once, if /clock is not received; call it a few times a second or less."""
        if self._warned or not self.simulated or self.followed:
            return
        now_s = time.monotonic()
        self._since_s = self._since_s or now_s
        if now_s - self._since_s >= _PATIENCE_S:
            self._warned = True
            self._warn('use_sim_time is set but /clock is not published: until then stamps have '
                       'the time of the system; the core runs in real time in any case')
