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

"""Apply movements of the map, such as after loop closures of a SLAM, to the estimate."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.logger import Logger
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.localizer import Localizer
from rt_robot_os.motion.poses import composed
from rt_robot_os.topics import Subscription

_FUTURE_NS: Final = NS_PER_S // 10
_FURTHEST_M: Final = 1e6
# A floor stays a floor.
_TILT_MOST: Final = 0.02
# No loop turns a map by more.
_TURN_MOST_RAD: Final = math.pi / 2
# Movements from which on they are logged, and from which on that is a warning.
_TOLD_M: Final = 0.02
_TOLD_RAD: Final = math.radians(0.5)
_WARNED_M: Final = 0.2
_WARNED_RAD: Final = math.radians(5.0)


@dataclass
class CorrectionCounters:
    """
    Corrections that were not applied.

    :ivar corrections_refused: not finite, without direction, tilted, from the future, or too far.
    :ivar corrections_again: with a stamp that is not newer than the last one.
    :ivar corrections_late: older than the history.
    """

    corrections_refused: int = 0
    corrections_again: int = 0
    corrections_late: int = 0


class MapCorrections:
    """
    Read a topic of ``geometry_msgs/msg/PoseWithCovarianceStamped``, and move the estimate.

    A correction is the movement of the map: what was at p is at ``composed(correction, p)``.
    Its covariance is not used.

    :param most_m: a correction that moves the robot by more is refused.
    :param log: for refusals and jumps.
    :raises ConfigError: the topic is in another frame.
    :ivar refusal: why the last one was refused; empty when it was not.
    """

    def __init__(self, source: Subscription, topic: str, frame_id: str, most_m: float,
                 log: Logger) -> None:
        frame = source.msg.header.frame_id
        if frame != frame_id:
            raise ConfigError([f'{topic} is in the frame {frame!r}, but movements of the map '
                               f'must be in {frame_id!r}: set map_frame_id, or the frame of the '
                               'source'])
        self.counters = CorrectionCounters()
        self.topic = topic
        self.refusal = ''
        self._source = source
        self._most_m = most_m
        self._log = log
        self._unpack = source.topic.layout.packer('pose.pose').unpack
        self._stamp_ns = 0

    def apply(self, localizer: Localizer, now_ns: int) -> None:
        """Apply all new ones; safe in the real-time loop."""
        source = self._source
        while source.take():
            stamp_ns = source.stamp_ns
            movement = self._movement(stamp_ns, now_ns)
            if movement is None or not self._is_near(localizer, movement):
                self.counters.corrections_refused += bool(self.refusal)
                if self.refusal:
                    self._log.warn('a correction on %s was refused: %s', self.topic, self.refusal)
                continue
            self._stamp_ns = stamp_ns
            if not localizer.displace(stamp_ns, movement):
                self.counters.corrections_late += 1
                self._log.warn('a correction on %s was %.1f s late, and was not applied',
                               self.topic, (now_ns - stamp_ns) / NS_PER_S)
            elif localizer.located:
                self._log_jump(*localizer.jump)

    def _log_jump(self, distance_m: float, turn_rad: float) -> None:
        """Log a visible jump; each loop moves a map by a little."""
        if distance_m > _TOLD_M or turn_rad > _TOLD_RAD:
            tell = (self._log.warn if distance_m > _WARNED_M or turn_rad > _WARNED_RAD
                    else self._log.info)
            tell('the map was moved: the pose jumps by %.2f m and %.1f degrees', distance_m,
                 math.degrees(turn_rad))

    def warning(self) -> str:
        """Return the problem of the last correction; empty without one."""
        if not self.refusal:
            return ''
        return f'the last correction on {self.topic} was refused: {self.refusal}'

    def _movement(self, stamp_ns: int, now_ns: int) -> Pose | None:
        x, y, z, qx, qy, qz, qw = self._unpack(self._source.buffer)
        length = math.hypot(qx, qy, qz, qw)
        self.refusal = ''
        if not (abs(x) < _FURTHEST_M and abs(y) < _FURTHEST_M and 0.5 < length < 2.0):
            self.refusal = 'it is not finite, or has no direction'
        elif not (abs(z) < 1.0 and math.hypot(qx, qy) < _TILT_MOST):
            self.refusal = 'it would tilt or lift the map'
        elif stamp_ns > now_ns + _FUTURE_NS:
            self.refusal = (f'it is stamped {(stamp_ns - now_ns) / NS_PER_S:.1f} s ahead of now: '
                            'are the clocks synchronised?')
        elif stamp_ns <= self._stamp_ns:
            self.counters.corrections_again += 1
            return None
        return None if self.refusal else (x, y, yaw_of(qx, qy, qz, qw))

    def _is_near(self, localizer: Localizer, movement: Pose) -> bool:
        if not localizer.located:
            return True
        x, y, _ = localizer.state.pose
        there = composed(movement, (x, y, 0.0))
        distance = math.hypot(there[0] - x, there[1] - y)
        if distance > self._most_m or abs(there[2]) > _TURN_MOST_RAD:
            self.refusal = (f'it would move the robot by {distance:.1f} m and '
                            f'{math.degrees(abs(there[2])):.0f} degrees: correction_max_m is '
                            f'{self._most_m:g}')
            return False
        return True
