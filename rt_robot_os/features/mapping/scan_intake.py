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
Synchronise the scans of the core with odometry.

The thread of the link adds samples, the mapping thread receives scans. A scan waits until odometry
covers its last beam. When several are ready, mapping is late: then the newest is processed and
those before it are skipped.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import dataclass
import math
import threading
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.input_diagnostics import InputDiagnostics
from rt_robot_os.features.mapping.input_diagnostics import TIMEOUT_NS
from rt_robot_os.features.mapping.messages import odometry_in
from rt_robot_os.features.mapping.messages import pose_in
from rt_robot_os.features.mapping.messages import PoseMessage
from rt_robot_os.features.mapping.messages import scan_in
from rt_robot_os.features.mapping.messages import ScanMessage
from rt_robot_os.features.mapping.slam.deskew import beam_seconds
from rt_robot_os.features.mapping.slam.deskew import LaserMount
from rt_robot_os.features.mapping.slam.deskew import scan_of
from rt_robot_os.features.mapping.slam.deskew import Sweep
from rt_robot_os.features.mapping.slam.max_range import echo_ranges
from rt_robot_os.features.mapping.slam.odometry_track import OdometryTrack
from rt_robot_os.features.mapping.slam.scan import Scan
from rt_robot_os.features.mapping.slam.transforms import between
from rt_robot_os.features.mapping.slam.transforms import composed
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.features.mapping.slam.two_lasers import TwoLasers

#: Scans that wait at most; beyond that the oldest are dropped.
SCANS_MOST: Final = 16
#: Ready scans from which on only the newest is processed, so that skipped ones are evenly spaced.
LATE_SCANS: Final = 2
#: How long a scan waits for odometry, by the stamps of the samples.
WAIT_NS: Final = NS_PER_S // 2
#: Odometry that moves faster than this has been reset.
_FASTEST_M_S: Final = 4.0
_FASTEST_RAD_S: Final = 12.0
_JUMP_M: Final = 0.1
_JUMP_RAD: Final = 0.2
#: A scan plane that is tilted by more hits floor and ceiling.
_TILT_MOST_RAD: Final = math.radians(15.0)


@dataclass(frozen=True)
class PosedScan:
    """
    A scan with the pose of odometry.

    :ivar base: shape (3,): ``base_link`` in the frame of odometry, at its stamp.
    :ivar left_out: scans since the one before that were skipped.
    :ivar is_cut: odometry since the one before is not reliable.
    :ivar are_two: two lasers publish on this topic.
    """

    scan: Scan
    base: Floats
    mount: LaserMount
    left_out: int = 0
    is_cut: bool = False
    are_two: bool = False


class ScanIntake:
    """
    Scans, odometry and poses of the core.

    :param mount_of: returns the mounting of the laser of a frame; None when it is unknown.
    :param deskew: whether scans are corrected for the motion of the laser.
    :ivar counts: of samples, by what became of them.
    :ivar problem: why scans cannot be used; empty while they can.
    """

    def __init__(self, mount_of: Callable[[str], LaserMount | None], deskew: bool = True) -> None:
        self.counts: dict[str, int] = dict.fromkeys((
            'scans', 'scans_missed', 'scans_skipped', 'scans_overflowed', 'scans_too_early',
            'scans_without_odometry', 'scans_backwards', 'scans_unusable', 'malformed',
            'odometry', 'odometry_missed', 'odometry_backwards', 'odometry_gaps',
            'odometry_jumps', 'odometry_restarts'), 0)
        self.problem = ''
        self.track = OdometryTrack()
        self.new = threading.Event()
        self._mount_of = mount_of
        self._deskew = deskew
        self._lock = threading.Lock()
        self._waiting: deque[tuple[Sweep, LaserMount]] = deque()
        self._last_scan_ns = self._left_out = 0
        self._lasers = TwoLasers()
        # Offset of odometry, so that it continues from the same pose after a restart.
        self._offset: Floats | None = None
        self._raw: tuple[float, float, float] | None = None
        self._is_restarted = False
        self._cut_ns: int | None = None  # from this stamp on odometry is discontinuous
        self._missed = {'scans': 0, 'odometry': 0}
        self._diagnostics = InputDiagnostics(self.counts)
        self._poses: dict[str, tuple[int, PoseMessage]] = {}

    # ---- in the thread of the link -----------------------------------------------------------

    def connected(self) -> None:
        """Start to wait for scans and odometry: a core is connected."""
        with self._lock:
            for what in self._missed:
                self._diagnostics.record_arrival(what)

    def core_restarted(self) -> None:
        """Expect odometry to restart: the robot is assumed to have stood still."""
        with self._lock:
            self._is_restarted = self._raw is not None
            self._missed = dict.fromkeys(self._missed, 0)
            self._waiting.clear()
            self._poses.clear()

    def add_odometry(self, stamp_ns: int, missed: int, cdr: memoryview) -> None:
        """Add a ``nav_msgs/msg/Odometry``."""
        with self._lock:
            was_lost = self._count('odometry', missed) > 0
            self._diagnostics.record_arrival('odometry')
            try:
                raw = odometry_in(bytes(cdr))
            except ValueError as error:
                self._count_malformed(f'odometry: {error}')
                return
            self._add(stamp_ns, raw, was_lost)
        self.new.set()

    def add_scan(self, stamp_ns: int, missed: int, cdr: memoryview) -> None:
        """Add a ``sensor_msgs/msg/LaserScan``."""
        with self._lock:
            self._count('scans', missed)
            self._diagnostics.record_arrival('scans')
            try:
                message = scan_in(bytes(cdr))
                mount = self._usable_mount(message)
            except ValueError as error:
                self._count_malformed(f'scan: {error}')
                return
            if stamp_ns <= self._last_scan_ns:
                self.counts['scans_backwards'] += 1
                if stamp_ns > self._last_scan_ns - NS_PER_S:
                    return
                self._waiting.clear()  # the clock of the laser was set back
            self._last_scan_ns = stamp_ns
            self.problem = ''
            if len(self.track):
                self._diagnostics.record_stamps(stamp_ns, self.track.last_ns)
            if len(self._waiting) >= SCANS_MOST:
                self._waiting.popleft()
                self.counts['scans_overflowed'] += 1
                self._left_out += 1
            sweep = self._sweep(stamp_ns, message)
            self._lasers.update(sweep.ranges)  # here, where every scan passes
            self._waiting.append((sweep, mount))
        self.new.set()

    def add_pose(self, topic: str, stamp_ns: int, cdr: memoryview) -> None:
        """Store a ``geometry_msgs/msg/PoseWithCovarianceStamped`` as the newest of its topic."""
        try:
            pose = pose_in(bytes(cdr))
        except ValueError as error:
            with self._lock:
                self._count_malformed(f'{topic}: {error}')
            return
        with self._lock:
            self._poses[topic] = stamp_ns, pose

    def _count(self, what: str, missed: int) -> int:
        """Count a sample; return how many were lost in transit since the one before."""
        lost = max(0, missed - self._missed[what])
        self.counts[what] += 1
        self.counts[f'{what}_missed'] += lost
        self._missed[what] = missed
        return lost

    def _count_malformed(self, text: str) -> None:
        self.counts['malformed'] += 1
        self.problem = text

    def _usable_mount(self, message: ScanMessage) -> LaserMount:
        """
        Return the mounting of the laser.

        :raises ValueError: the scan cannot be used.
        """
        if not (len(message.ranges) > 1 and math.isfinite(message.angle_min)
                and 0.0 < abs(message.angle_increment) * len(message.ranges) < 2.1 * math.tau):
            raise ValueError(f'{len(message.ranges)} beams from {message.angle_min:g} by '
                             f'{message.angle_increment:g} rad are not from a rotating laser')
        mount = self._mount_of(message.frame_id)
        if mount is None:
            raise ValueError(f'no transform for frame {message.frame_id!r}: set mounting_m of its '
                             'device, or mounting_m and mounting_rad of mapping')
        if mount.tilt_rad > _TILT_MOST_RAD:
            raise ValueError(f'{message.frame_id!r} is tilted by '
                             f'{math.degrees(mount.tilt_rad):.0f} degrees (mounting_rad): it must '
                             'be level')
        return mount

    def _sweep(self, stamp_ns: int, message: ScanMessage) -> Sweep:
        ranges = echo_ranges(message.ranges, message.range_min, message.range_max)
        beam_s = beam_seconds(message.time_increment_s, message.scan_time_s,
                              message.angle_increment, len(ranges)) if self._deskew else 0.0
        return Sweep(stamp_ns, ranges, message.angle_min, message.angle_increment, beam_s)

    def _add(self, stamp_ns: int, raw: tuple[float, float, float], was_lost: bool) -> None:
        """
        Add odometry to the track, in one frame across restarts.

        :param was_lost: samples before it were lost in transit: that is no pause.
        """
        track = self.track
        dt_s = (stamp_ns - track.last_ns) / NS_PER_S
        if len(track) and dt_s <= 0.0:
            self.counts['odometry_backwards'] += 1
            if dt_s > -1.0:
                return
            track.clear()
            self._is_restarted = True
        if len(track) and dt_s * NS_PER_S > TIMEOUT_NS and not was_lost:
            self.counts['odometry_gaps'] += 1
            self._cut_ns = stamp_ns
        if self._raw is not None and (self._is_restarted or self._jumped(raw, dt_s)):
            self._cut_ns = stamp_ns
            self.counts['odometry_restarts' if self._is_restarted else 'odometry_jumps'] += 1
            before = self._placed(self._raw)
            # From there on odometry continues from the same pose, whatever its own origin is now.
            self._offset = composed(before, between(np.array(raw), np.zeros(3)))
        self._is_restarted = False
        self._raw = raw
        x, y, yaw = self._placed(raw).tolist() if self._offset is not None else raw
        track.add(stamp_ns, (x, y, yaw))

    def _jumped(self, raw: tuple[float, float, float], dt_s: float) -> bool:
        assert self._raw is not None
        way = math.hypot(raw[0] - self._raw[0], raw[1] - self._raw[1])
        turn = abs(math.remainder(raw[2] - self._raw[2], math.tau))
        return (way > _JUMP_M + _FASTEST_M_S * dt_s
                or turn > _JUMP_RAD + _FASTEST_RAD_S * dt_s)

    def _placed(self, raw: tuple[float, float, float]) -> Floats:
        return np.array(raw) if self._offset is None else composed(self._offset, np.array(raw))

    # ---- in the mapping thread --------------------------------------------------------------

    def next(self) -> PosedScan | None:  # noqa: A003
        """Return the next scan that odometry covers; None when there is none yet."""
        with self._lock:
            ready = self._ready()
            if not ready:
                return None
            if len(ready) >= LATE_SCANS:
                self.counts['scans_skipped'] += len(ready) - 1
                del ready[:-1]
            sweep, mount = ready[0]
            while self._waiting[0][0] is not sweep:
                self._waiting.popleft()
                self._left_out += 1
            self._waiting.popleft()
            base = self.track.at(np.array([sweep.stamp_ns]))[0]
            left_out, self._left_out = self._left_out, 0
            is_cut = self._cut_ns is not None and sweep.stamp_ns >= self._cut_ns
            if is_cut:
                self._cut_ns = None
            return PosedScan(scan_of(sweep, self.track, mount), base, mount, left_out, is_cut,
                             self._lasers.are_two)

    def _ready(self) -> list[tuple[Sweep, LaserMount]]:
        """Return the scans that odometry covers; those that it never will are dropped."""
        waiting, track = self._waiting, self.track
        while waiting and self._is_never_covered(waiting[0][0]):
            sweep, _ = waiting.popleft()
            # A process that connects to a running robot gets scans from before the first odometry.
            is_early = not len(track) or sweep.span_ns[0] < track.first_ns
            self.counts['scans_too_early' if is_early else 'scans_without_odometry'] += 1
            self._left_out += 1
        found = []
        for each in waiting:
            if each[0].span_ns[1] > track.last_ns:
                break
            if track.covers(*each[0].span_ns):
                found.append(each)
        return found

    def _is_never_covered(self, sweep: Sweep) -> bool:
        first_ns, last_ns = sweep.span_ns
        track = self.track
        if last_ns <= track.last_ns:
            return not track.covers(first_ns, last_ns)
        return self._last_scan_ns - sweep.stamp_ns > WAIT_NS

    def pose_at(self, topic: str, stamp_ns: int) -> PoseMessage | None:
        """
        Return the newest pose of a topic, moved on by odometry to a time.

        :param stamp_ns: a time that odometry covers.
        :return: None when there was no pose, or odometry does not cover it.
        """
        with self._lock:
            found = self._poses.get(topic)
            if found is None:
                return None
            then_ns, pose = found
            track = self.track
            if not len(track) or not track.first_ns <= then_ns:
                return None
            then, now = track.at(np.array([min(then_ns, track.last_ns),
                                           min(stamp_ns, track.last_ns)]))
            return pose._replace(pose=composed(pose.pose, between(then, now)))

    def raw_odometry(self, base: Floats) -> Floats:
        """Return a pose in the frame of odometry itself."""
        with self._lock:
            return base if self._offset is None else between(self._offset, base)

    def newest(self, topic: str) -> tuple[int, PoseMessage] | None:
        """Return the newest pose of a topic with its stamp."""
        with self._lock:
            return self._poses.get(topic)

    @property
    def newest_ns(self) -> int:
        """Return the stamp of the newest scan; 0 before the first."""
        return self._last_scan_ns

    @property
    def blocking_problem(self) -> str:
        """Return in a few words why nothing can be mapped now; empty without a problem."""
        with self._lock:
            return self.problem or ' and '.join(
                f'no {what}' for what in self._diagnostics.silent_inputs())

    def warning(self, is_connected: bool = True) -> str:
        """
        Return the problems of the inputs; empty without any. Once a second is enough.

        :param is_connected: whether there is a core that could send inputs.
        """
        with self._lock:
            lines = self._diagnostics.warnings(is_connected)
            return '; '.join(filter(None, (self.problem, *lines)))

    def statistics(self) -> Mapping[str, Any]:
        """Return the counters, and the number of waiting scans."""
        with self._lock:
            return {**self.counts, 'scans_waiting': len(self._waiting)}
