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

"""The pose of odometry at any time of the last seconds."""

from __future__ import annotations

import bisect
from typing import Final

import numpy as np
import numpy.typing as npt

from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.transforms import wrapped

#: Samples that are kept: 40 s at 50 Hz.
_KEPT: Final = 2048
_SLACK: Final = 512
#: Largest time between two samples over which poses are interpolated.
GAP_NS: Final = 500_000_000


class OdometryTrack:
    """
    The last samples of odometry, by time, with linear interpolation.

    One thread at a time.

    :ivar last_ns: stamp of the newest; 0 without one.
    """

    def __init__(self) -> None:
        self.last_ns = 0
        self._stamps: list[int] = []
        self._poses: list[tuple[float, float, float]] = []

    def __len__(self) -> int:
        return len(self._stamps)

    def add(self, stamp_ns: int, pose: tuple[float, float, float]) -> bool:
        """
        Add the next sample.

        :param pose: x, y in m, yaw in rad.
        :return: False when it is not newer than the last, and is dropped.
        """
        if self._stamps and stamp_ns <= self.last_ns:
            return False
        if len(self._stamps) >= _KEPT + _SLACK:
            del self._stamps[:_SLACK], self._poses[:_SLACK]
        self._stamps.append(stamp_ns)
        self._poses.append(pose)
        self.last_ns = stamp_ns
        return True

    def clear(self) -> None:
        """Discard all samples."""
        self._stamps.clear()
        self._poses.clear()
        self.last_ns = 0

    @property
    def first_ns(self) -> int:
        """Return the stamp of the oldest that is kept; 0 without one."""
        return self._stamps[0] if self._stamps else 0

    @property
    def last(self) -> tuple[float, float, float]:
        """Return the newest pose; at 0 without one."""
        return self._poses[-1] if self._poses else (0.0, 0.0, 0.0)

    def covers(self, first_ns: int, last_ns: int) -> bool:
        """Return whether it covers an interval without gaps."""
        if not self._stamps or first_ns < self._stamps[0] or last_ns > self.last_ns:
            return False
        begin = bisect.bisect_right(self._stamps, first_ns) - 1
        end = bisect.bisect_left(self._stamps, last_ns)
        known = self._stamps[begin:end + 1]
        return all(after - before <= GAP_NS for before, after in zip(known, known[1:]))

    def at(self, stamps_ns: npt.NDArray[np.int64]) -> Floats:
        """
        Return poses of odometry.

        :param stamps_ns: shape (n,), in any order, of times that it covers.
        :return: shape (n, 3).
        """
        begin = max(0, bisect.bisect_right(self._stamps, int(stamps_ns.min())) - 1)
        end = bisect.bisect_left(self._stamps, int(stamps_ns.max())) + 1
        zero = self._stamps[begin]
        # Differences, as a 64-bit float cannot represent nanoseconds since boot exactly.
        times = np.array([each - zero for each in self._stamps[begin:end]], np.float64)
        poses = np.array(self._poses[begin:end])
        wanted = (stamps_ns - zero).astype(np.float64)
        yaws = np.unwrap(poses[:, 2])
        return np.stack((np.interp(wanted, times, poses[:, 0]),
                         np.interp(wanted, times, poses[:, 1]),
                         wrapped(np.interp(wanted, times, yaws))), -1)
