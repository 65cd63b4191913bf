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
References: a path with a time law, which gives the desired position on it.

The time law is a trapezoid as a rule: it keeps the speed, the accelerations along and across, the
turning rate and the wheels within their limits. With a limited jerk it is that trapezoid averaged
over the time that the acceleration needs to change, which makes an S-curve of it. The jerk of a
mean is the change of the acceleration over its window, divided by the window. So where speeding up
meets braking the window is as long as both together need.
"""

from __future__ import annotations

from bisect import bisect_right
from itertools import accumulate
import math
from typing import Final
from typing import NamedTuple

import numpy as np

from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.reference_path import Array
from rt_robot_os.motion.reference_path import Path
from rt_robot_os.motion.velocity_limits import VelocityLimits

# The law needs part of the accelerations to correct errors; the reference uses the rest.
_SHARE: Final = 0.8
# Lag of the robot at which a reference slows down, and at which it stops.
_LAG_M: Final = 0.10
# The window of the mean is as long as the largest change of the acceleration needs; a first try
# shows that change, and what begins later for a longer window may change once more.
_TRIES: Final = 3
_ROUNDING: Final = 1e-6
_LAG_MAXIMUM_M: Final = 0.30


class Target(NamedTuple):
    """
    The desired pose now, and the desired velocity until the next step.

    :ivar linear_m_s: the mean over the period that follows; so is the next.
    """

    x_m: float
    y_m: float
    heading_rad: float
    linear_m_s: float
    angular_rad_s: float


class TimeLaw:
    """
    The distance along a path over time; safe in the real-time loop.

    :param start_m: distance along the path at which it begins.
    :param start_m_s: speed there; a speed that is too high is reduced.
    :ivar duration_s: until the end of the path.
    """

    def __init__(self, path: Path, limits: VelocityLimits, start_m: float = 0.0,
                 start_m_s: float = 0.0) -> None:
        self._start_m_s = max(0.0, start_m_s)
        self._length_m = path.length_m
        self._up, self._down = (_SHARE * limits.acceleration_m_s2,
                                _SHARE * limits.deceleration_m_s2)
        jerk_m_s3 = limits.jerk_max_m_s3
        window_s = max(self._up, self._down) / jerk_m_s3 if jerk_m_s3 > 0.0 else 0.0
        for _ in range(_TRIES):
            self._window_s = window_s
            self._make(path, limits, start_m)
            if jerk_m_s3 > 0.0:
                window_s = max(window_s, self._window_needed_s(jerk_m_s3))
            if window_s == self._window_s:
                break

    def _make(self, path: Path, limits: VelocityLimits, start_m: float) -> None:
        """Make the trapezoid, which begins where a mean over the window is there."""
        # A mean lags by half its window: what is driven meanwhile at the first speed.
        self._start_m = min(path.length_m, start_m + self._start_m_s * self._window_s / 2)
        distance = max(0.0, path.length_m - self._start_m)
        count = max(4, math.ceil(distance / path.spacing_m)) + 1
        self._spacing_m = distance / (count - 1)
        squares = self._squares(path, limits, count)
        speeds = np.sqrt(squares)
        together = speeds[1:] + speeds[:-1]
        # A piece with both ends at rest is shorter than the last digit.
        each = np.where(together > 1e-9, 2.0 * self._spacing_m / np.maximum(together, 1e-9), 0.0)
        self._speeds: list[float] = speeds.tolist()
        self._times: list[float] = [0.0, *accumulate(each.tolist())]
        # The integral of the distance over time, at each sample.
        before = self._spacing_m * np.arange(count - 1)
        areas = np.cumsum(each * (before + each * (2 * speeds[:-1] + speeds[1:]) / 6))
        self._areas: list[float] = [0.0, *areas.tolist()]
        self.duration_s = self._times[-1] + self._window_s

    def _window_needed_s(self, jerk_m_s3: float) -> float:
        """Return the window that keeps a jerk: this one, or that of the largest change."""
        times, speeds = np.array(self._times), np.array(self._speeds)
        each = np.diff(times)
        driven = each > 0.0
        # Before and after the way the acceleration is 0.
        changes = np.concatenate([[0.0], np.diff(speeds)[driven] / each[driven], [0.0]])
        begins = np.concatenate([times[:-1][driven], times[-1:]])
        instants = np.concatenate([begins, begins + self._window_s])
        now = changes[np.searchsorted(begins, instants, 'right')]
        before = changes[np.searchsorted(begins, instants - self._window_s, 'right')]
        if np.abs(now - before).max() <= jerk_m_s3 * self._window_s * (1.0 + _ROUNDING):
            return self._window_s
        return float(changes.max() - changes.min()) / jerk_m_s3

    def _squares(self, path: Path, limits: VelocityLimits, count: int
                 ) -> Array:
        """Return the squares of the speeds at equal distances: braking and speeding up meet."""
        along = self._start_m + self._spacing_m * np.arange(count)
        samples = path.spacing_m * np.arange(path.last + 1)
        bend = np.abs(np.interp(along, samples, path.curvature)) + 1e-12
        change = np.abs(np.interp(along, samples, np.gradient(path.curvature, path.spacing_m)))
        most = np.minimum.reduce([
            np.full(count, min(limits.speed_m_s, limits.linear_max_m_s)),
            limits.angular_max_rad_s / bend,
            np.sqrt(limits.lateral_max_m_s2 / bend),
            np.sqrt(_SHARE * limits.angular_acceleration_rad_s2 / (change + 1e-12)),
            limits.wheel_m_s / (1.0 + bend * limits.wheel_separation_m / 2)]) ** 2
        most[-1] = 0.0
        down = 2 * self._down * self._spacing_m * np.arange(count)
        squares: Array = np.minimum.accumulate((most - down[::-1])[::-1])[::-1] + down[::-1]
        up = 2 * self._up * self._spacing_m * np.arange(count)
        if squares[0] >= self._start_m_s ** 2:
            squares[0] = self._start_m_s ** 2
            found: Array = np.minimum.accumulate(squares - up) + up
            return found
        # Too fast for what follows: brake as hard as is allowed until it fits.
        braked = self._start_m_s ** 2 - 2 * limits.deceleration_m_s2 * (
            self._spacing_m * np.arange(count))
        fits = int(np.argmax(braked <= squares)) if (braked <= squares).any() else count - 1
        squares[fits:] = np.minimum.accumulate(squares[fits:] - up[fits:]) + up[fits:]
        squares[:fits] = np.maximum(braked[:fits], 0.0)
        squares[-1] = 0.0
        squares[squares < 0.0] = 0.0
        return squares

    def _trapezoid(self, time_s: float) -> tuple[float, float]:
        """Return the distance without limit of jerk, and its integral over time."""
        if time_s <= 0.0:
            return self._start_m_s * time_s, self._start_m_s * time_s * time_s / 2
        times = self._times
        i = bisect_right(times, time_s) - 1
        if i >= len(times) - 1:
            distance = self._length_m - self._start_m
            return distance, self._areas[-1] + distance * (time_s - times[-1])
        t = time_s - times[i]
        v0, v1 = self._speeds[i], self._speeds[i + 1]
        a = (v1 - v0) / (times[i + 1] - times[i])
        s = i * self._spacing_m
        return (s + t * (v0 + a * t / 2), self._areas[i] + t * (s + t * (v0 / 2 + a * t / 6)))

    def at(self, time_s: float) -> float:
        """Return the length on the path at a time since the beginning."""
        window = self._window_s
        if window <= 0.0:
            return self._start_m + self._trapezoid(time_s)[0]
        area = self._trapezoid(time_s)[1] - self._trapezoid(time_s - window)[1]
        return min(self._length_m, self._start_m + area / window)


class PathReference:
    """
    A path, its time law, and the desired position on it; safe in the real-time loop.

    :param limits: of the time law.
    :param start_m: distance along the path at which it begins.
    :param start_m_s: speed of the robot there.
    :ivar path: what is followed.
    :ivar time_s: how much of the time law is done; it waits for a robot that lags behind.
    :ivar nearest_m: the length at the point nearest to the robot, see :meth:`locate`.
    """

    def __init__(self, path: Path, limits: VelocityLimits, start_m: float = 0.0,
                 start_m_s: float = 0.0) -> None:
        self.path = path
        self.limits = limits
        self.law = TimeLaw(path, limits, start_m, start_m_s)
        self.time_s = 0.0
        self.along_m = self.nearest_m = start_m

    @property
    def finished(self) -> bool:
        """Return whether the time law is at its end."""
        return self.time_s >= self.law.duration_s

    def target(self, period_s: float) -> Target:
        """
        Return the desired pose, and the mean velocity until the next step.

        The mean, because a command holds for a whole period: at its end the robot has followed the
        reference, for any period.
        """
        begin = self.along_m
        end = self.law.at(self.time_s + period_s)
        x, y, heading, _ = self.path.at(begin)
        turned = self.path.at(end)[2] - heading if end != begin else 0.0
        return Target(x, y, heading, (end - begin) / period_s, turned / period_s)

    def advance(self, period_s: float, lag_m: float = 0.0) -> None:
        """
        Let a period pass.

        :param lag_m: how far the robot is behind; the time law slows down with it, so that it
            waits for a blocked robot.
        """
        part = 1.0
        if lag_m > _LAG_M:
            part = max(0.0, (_LAG_MAXIMUM_M - lag_m) / (_LAG_MAXIMUM_M - _LAG_M))
        self.time_s += period_s * part
        self.along_m = self.law.at(self.time_s)

    def locate(self, pose: Pose) -> tuple[float, float]:
        """
        Find the point of the path that is nearest to the robot, starting at the last one.

        :return: how far the robot is to the left of the path in m, how far its heading is to the
            left of the path's in rad, not wrapped.
        """
        x, y, yaw = pose
        self.nearest_m = self.path.nearest(x, y, self.nearest_m)
        px, py, heading, _ = self.path.at(self.nearest_m)
        return (math.cos(heading) * (y - py) - math.sin(heading) * (x - px), yaw - heading)
