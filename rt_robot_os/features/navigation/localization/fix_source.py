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

"""Check measured poses: they must be finite, on the map, and have a plausible stamp."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.navigation.odometry.planar import planar_covariance
from rt_robot_os.motion.angles import yaw_of
from rt_robot_os.motion.localizer import fix_covariance
from rt_robot_os.motion.pose_history import PoseFix
from rt_robot_os.topics import Subscription

# Clocks of one machine differ by less; a stamp further ahead is wrong.
_FUTURE_NS: Final = NS_PER_S // 10
# No map is that large, in m.
_FURTHEST_M: Final = 1e6
# A single bad sample is counted; this many in a row are reported.
_BAD_IN_ROW: Final = 3


@dataclass
class IntakeCounters:
    """
    Unusable samples.

    :ivar not_finite: a number is missing, infinite or impossible.
    :ivar bad_covariance: not finite, or negative.
    :ivar future: stamped ahead of now.
    :ivar stopped: with the stamp of the one before, but another pose.
    :ivar duplicates: repeated.
    """

    not_finite: int = 0
    bad_covariance: int = 0
    future: int = 0
    stopped: int = 0
    duplicates: int = 0


class PoseFixSource:
    """
    Read one topic of ``geometry_msgs/msg/PoseWithCovarianceStamped``.

    :param number: of the source, for statistics.
    :param topic: for messages.
    :param frame_id: of the map.
    :param least_m: smallest accepted standard deviation of x and y.
    :param least_rad: the same of the heading.
    :param correlation_s: correlation time of its errors.
    :param timed: check the stamps; not for poses that an operator sets, whose machine has its own
        clock.
    :raises ConfigError: the topic is in another frame.
    :ivar number: of the source.
    :ivar refused: poses that could not be used.
    :ivar problem: why the last pose cannot be used; empty when it can.
    """

    def __init__(self, source: Subscription, number: int, topic: str, frame_id: str,
                 least_m: float, least_rad: float, correlation_s: float = 0.0,
                 timed: bool = True) -> None:
        frame = source.msg.header.frame_id
        if frame != frame_id:
            raise ConfigError([f'{topic} is in the frame {frame!r}, but poses on the map '
                               f'must be in {frame_id!r}: set map_frame_id, or the frame of the '
                               'source'])
        self.counters = IntakeCounters()
        self.topic = topic
        self._source = source
        self.number = number
        self._least = least_m, least_rad
        self._correlation_ns = correlation_s * NS_PER_S
        self._timed = timed
        self._unpack = source.topic.layout.packer('pose.pose').unpack
        self._covariance = source.msg.pose.covariance
        self._stamp_ns = self._before_ns = 0
        self._values: tuple[float, ...] = ()
        self._bad = self.refused = 0
        self.problem = ''

    def next(self, now_ns: int) -> PoseFix | None:  # noqa: A003
        """Return the next measured pose that can be used; safe in the real-time loop."""
        source = self._source
        while source.take():
            why = self._problem(now_ns)
            found = None
            if not why:
                covariance = fix_covariance(planar_covariance(self._covariance), *self._least)
                x, y, _, *orientation = self._values
                if covariance is not None:
                    found = PoseFix(source.stamp_ns, (x, y, yaw_of(*orientation)), covariance,
                                    self.number, self._inflation(source.stamp_ns))
                else:
                    self.counters.bad_covariance += 1
                    why = 'their covariance is invalid'
            self._bad = self._bad + 1 if why else 0
            self.refused += bool(why)
            self.problem = why
            if found is not None:
                return found
        return None

    def warning(self) -> str:
        """Return the problem of the source; empty without one."""
        if self._bad < _BAD_IN_ROW:
            return ''
        return f'the last {self._bad} poses of {self.topic} cannot be used: {self.problem}'

    def _inflation(self, stamp_ns: int) -> float:
        """
        Return the inflation of the variance for errors that are correlated in time.

        Errors whose correlation falls as exp(-t/T), measured f times a second, are equivalent to
        independent ones of 2 f T times the variance.
        """
        dt_ns, self._before_ns = abs(stamp_ns - self._before_ns), stamp_ns
        return max(1.0, 2.0 * self._correlation_ns / dt_ns) if dt_ns else 1.0

    def _problem(self, now_ns: int) -> str:
        counters, stamp_ns = self.counters, self._source.stamp_ns
        values = self._unpack(self._source.buffer)
        same, self._values = values == self._values, values
        x, y, _, qx, qy, qz, qw = values
        if not (abs(x) < _FURTHEST_M and abs(y) < _FURTHEST_M
                and 0.5 < math.hypot(qx, qy, qz, qw) < 2.0):
            counters.not_finite += 1
            return 'they are not finite, or have no direction'
        if not self._timed:
            return ''
        if stamp_ns > now_ns + _FUTURE_NS:
            counters.future += 1
            return (f'they are stamped {(stamp_ns - now_ns) / NS_PER_S:.1f} s ahead of now: are '
                    'the clocks synchronised?')
        if stamp_ns == self._stamp_ns:
            if same:
                counters.duplicates += 1
            else:
                counters.stopped += 1
            return 'the clock of the source stands still'
        self._stamp_ns = stamp_ns
        return ''
