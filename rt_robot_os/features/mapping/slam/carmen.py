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
Scans of CARMEN's logs: ``FLASER`` and ``ROBOTLASER1`` lines with the odometry of the wheels.

The odometry of a scan is in one of three places. A log that a mapper has corrected
(GMapping's ``gfs2log`` and others) has the corrected pose in the line of the scan, and again in
the ``ODOM`` line behind it, from which the next ``ODOM`` lines continue: only the steps between
are measured. A raw log has the pose of the wheels in the line of the scan. Some have both.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
import math
from typing import Final
from typing import NamedTuple

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats

#: Beams of a scan; a line with more is not a scan.
BEAMS_MOST: Final = 100_000
#: Beam counts of half a turn, with or without the last one.
_HALF_TURN: Final = (180, 360)
#: Lines of scans from which the format of a log is inferred.
_JUDGED: Final = 200
_SAME: Final = 1e-6
#: Largest distance of the poses of the wheels in their own line and in that of the scan.
_NEAR_M: Final = 0.5
_STILL_M: Final = 0.5
_KINDS: Final = ('ROBOTLASER1', 'FLASER')


class WheelPoseSource(Enum):
    """Where a log has the odometry of a scan."""

    #: The steps between the lines of odometry behind one scan and before the next.
    STEPS = 'steps'
    #: The last line of odometry.
    LINES = 'lines'
    #: The pose of the robot in the line of the scan.
    ROBOT = 'robot'
    #: The pose of the laser there.
    LASER = 'laser'


class LaserLine(NamedTuple):
    """
    A line with a scan.

    :ivar laser: shape (3,): the first pose of the line, of the laser.
    :ivar robot: the second, of the robot.
    """

    stamp_s: float
    ranges: Floats
    start: float
    step: float
    laser: Floats
    robot: Floats


@dataclass(frozen=True)
class Judged:
    """
    The format of a log.

    :ivar kind: of the lines that are read.
    :ivar has_wheels: there is odometry at all.
    """

    kind: str
    wheels: WheelPoseSource
    has_wheels: bool


def laser_line(words: list[str]) -> LaserLine:
    """
    Read a ``FLASER`` or ``ROBOTLASER1`` line.

    :raises ValueError: it is damaged; so :exc:`IndexError`.
    """
    if words[0] == 'FLASER':
        count, first, start, step = int(words[1]), 2, -math.pi / 2, 0.0
        after = first + count
        step = math.pi / (count if count in _HALF_TURN else max(1, count - 1))
        stamp = after + 6
    else:
        start, step, count, first = float(words[2]), float(words[4]), int(words[8]), 9
        # The intensities follow the ranges.
        after = first + count
        after += 1 + int(words[after])
        stamp = after + 11
    if not 0 < count < BEAMS_MOST:
        raise ValueError('no scan')
    ranges = np.array([float(each) for each in words[first:first + count]])
    poses = np.array([float(each) for each in words[after:after + 6]])
    stamp_s = float(words[stamp])
    if len(ranges) != count or len(poses) != 6 or not np.isfinite((*poses, stamp_s, start,
                                                                   step)).all() or not step:
        raise ValueError('no scan')
    return LaserLine(stamp_s, ranges, start, step, poses[:3], poses[3:])


def _wheels_line(words: list[str]) -> Floats:
    found = np.array([float(each) for each in words[1:4]])
    if len(found) != 3 or not np.isfinite(found).all():
        raise ValueError('no odometry')
    return found


def judge(lines: Iterable[str]) -> Judged | None:
    """
    Infer the format from the beginning of a log.

    :return: None when there is no scan in it.
    """
    kind, lasers, before = '', [], []
    restarts = steps = 0
    last: Floats | None = None
    pending: Floats | None = None
    for line in lines:
        words = line.split()
        try:
            if words[:1] == ['ODOM']:
                now = _wheels_line(words)
                if pending is not None:
                    restarts += bool(np.abs(now - pending).max() < _SAME)
                elif last is not None:
                    steps += not np.array_equal(last, now)
                last, pending = now, None
            elif words and words[0] in _KINDS and kind in ('', words[0]):
                kind = words[0]
                found = laser_line(words)
                lasers.append((found.laser, found.robot))
                before.append(last)
                pending = found.laser
                if len(lasers) >= _JUDGED:
                    break
        except (ValueError, IndexError):
            continue
    return _judged(kind, lasers, before, restarts, steps) if lasers else None


def _judged(kind: str, poses: list[tuple[Floats, Floats]], before: list[Floats | None],
            restarts: int, steps: int) -> Judged:
    lasers, robots = np.array(poses).transpose(1, 0, 2)
    moved = float(np.hypot(*(lasers - lasers[0])[:, :2].T).max()) > _STILL_M
    if moved and restarts > len(lasers) // 2:
        return Judged(kind, WheelPoseSource.STEPS, steps > len(lasers) // 2)
    mounted = between(robots, lasers)
    if np.abs(mounted - mounted[0]).max() > 1e-3:
        return Judged(kind, WheelPoseSource.ROBOT, True)  # the laser's was corrected
    known = [np.hypot(*(laser - each)[:2]) for laser, each in zip(lasers, before)
             if each is not None]
    far = known and float(np.median(known)) > _NEAR_M + float(np.hypot(*mounted[0][:2]))
    return Judged(kind, WheelPoseSource.LINES if far else WheelPoseSource.LASER, True)


class CarmenReader:
    """
    Read the lines of a log, one after the other.

    :ivar bad_lines: lines that could not be read.
    :ivar others: scans of another kind, which were skipped.
    :ivar references: corrected poses of the scans; None for a raw log.
    """

    def __init__(self, judged: Judged) -> None:
        self.bad_lines = self.others = 0
        self.references: list[Floats] | None = (
            None if judged.wheels is WheelPoseSource.LASER else [])
        self._judged = judged
        self._last: Floats | None = None
        self._pending: Floats | None = None
        self._track = np.zeros(3)

    def scans(self, lines: Iterable[str]) -> Iterator[Scan]:
        """Yield the scans of a log."""
        for line in lines:
            words = line.split()
            try:
                if words[:1] == ['ODOM']:
                    self._take_wheels(_wheels_line(words))
                elif words and words[0] in _KINDS:
                    if words[0] != self._judged.kind:
                        self.others += 1
                        continue
                    yield self._scan(laser_line(words))
            except (ValueError, IndexError):
                self.bad_lines += 1

    def _take_wheels(self, now: Floats) -> None:
        again = self._pending is not None and bool(np.abs(now - self._pending).max() < _SAME)
        if self._last is not None and not again:
            self._track = composed(self._track, between(self._last, now))
        self._last, self._pending = now, None

    def _scan(self, line: LaserLine) -> Scan:
        wheels = self._judged.wheels
        if wheels is WheelPoseSource.STEPS:
            odometry, self._pending = self._track, line.laser
        elif wheels is WheelPoseSource.LINES and self._last is not None:
            odometry = self._last
        else:
            odometry = line.laser if wheels is WheelPoseSource.LASER else line.robot
        if self.references is not None:
            self.references.append(line.laser)
        return Scan(round(line.stamp_s * NS_PER_S), odometry, line.ranges, line.start, line.step)
