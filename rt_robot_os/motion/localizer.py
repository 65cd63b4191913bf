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
The pose of a robot on its map: a filter, and its recovery when measurements contradict it.

Inconsistent measurements are rejected (Mahalanobis distance, 99 per cent of chi^2). When all are
inconsistent but agree with each other, the robot has been carried away: a second filter starts
with the first of them, follows the odometry and is corrected by the rest; when it has been right
for some time, it replaces the first. An unknown initial pose is found the same way. Everything is
safe in the real-time loop.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.ekf import Ekf
from rt_robot_os.motion.ekf import GATE_2
from rt_robot_os.motion.ekf import GATE_3
from rt_robot_os.motion.ekf import PoseCovariance
from rt_robot_os.motion.ekf import UNKNOWN_VARIANCE
from rt_robot_os.motion.fix_statistics import FixStatistics
from rt_robot_os.motion.gate_monitor import GateMonitor
from rt_robot_os.motion.pose_history import OdometryStep
from rt_robot_os.motion.pose_history import PoseFix
from rt_robot_os.motion.pose_history import PoseHistory
from rt_robot_os.motion.poses import composed
from rt_robot_os.motion.poses import transform

# Measurements that wait for the odometry of their moment.
_WAITING_MOST: Final = 16
_LATE_NS: Final = NS_PER_S // 10
_SOURCES_MOST: Final = 3
# How long a source outranks those behind it after a measurement.
_RANK_NS: Final = NS_PER_S
# Movements of the map that are stored, to be applied to late measurements.
_MOVEMENTS_MOST: Final = 16
# Length of the moving mean of the innovations, about.
_NIS_COUNT: Final = 100


@dataclass(frozen=True)
class LocalizerTuning:
    """
    The parameters.

    :ivar history_s: how late a measurement may be.
    :ivar kidnapped_s: how long measurements must contradict until they replace the pose; 0: never.
    :ivar kidnapped_fixes: how many of them there must be.
    :ivar start_fixes: how many consistent ones set the first pose.
    :ivar scale: relative standard deviation of the distance of the wheels. The error is the same
        from metre to metre, and so adds up from one measurement to the next.
    """

    history_s: float = 2.0
    kidnapped_s: float = 2.0
    kidnapped_fixes: int = 4
    start_fixes: int = 3
    scale: float = 0.01


@dataclass
class FixCounters:
    """
    Counters of measured poses.

    :ivar accepted: used.
    :ivar rejected: too far from the estimate.
    :ivar too_late: older than the history.
    :ivar overflow: dropped: too many waited for odometry, or belonged to one step of it.
    :ivar recovered: times that the robot had been carried away, and was found.
    :ivar corrected: times that the map was moved, and the estimate with it.
    """

    accepted: int = 0
    rejected: int = 0
    too_late: int = 0
    overflow: int = 0
    recovered: int = 0
    corrected: int = 0


class _PoseCandidate:
    """Another pose of the robot, by measurements of a source."""

    __slots__ = ('state', 'votes', 'since_ns', 'last_ns', 'source')

    def __init__(self, state: Ekf, fix: PoseFix) -> None:
        self.state = state
        self.votes = 1
        self.since_ns = self.last_ns = fix.stamp_ns
        self.source = fix.source


class Localizer:
    """
    Estimate the pose on the map; call :meth:`move` and :meth:`add_fix` as data come.

    :ivar state: the filter; invalid before :attr:`located`.
    :ivar located: the pose is known.
    :ivar accepted_ns: moment of the newest measurement that was used; 0 without.
    :ivar fix_ns: moment of the newest measurement, used or not; 0 without.
    :ivar nis: mean normalised innovation squared of the last 100 measurements that were used, for
        each number that was measured: about 1 when the covariances are right; 0 before.
    :ivar late: measurements that arrived more than 0.1 s after the odometry of their time.
    :ivar latest_ns: largest delay of a measurement that could still be used.
    :ivar records: statistics of each source, by its number.
    :ivar headings: gate of the headings of an inertial sensor.
    :ivar drifts: gate of the drifts that were measured at rest.
    :ivar jump: movement of the pose by the last recovery, or correction of the map, in m and rad.
    """

    def __init__(self, tuning: LocalizerTuning = LocalizerTuning()) -> None:
        self.counters = FixCounters()
        self.state = Ekf()
        self.located = False
        self.accepted_ns = self.fix_ns = 0
        self.nis = 0.0
        self.jump = (0.0, 0.0)
        self.late = self.latest_ns = 0
        self.records = tuple(FixStatistics() for _ in range(_SOURCES_MOST))
        self.headings = GateMonitor(tuning.kidnapped_s, tuning.kidnapped_fixes)
        self.drifts = GateMonitor(tuning.kidnapped_s, tuning.kidnapped_fixes)
        self._heading_fix_ns = 0
        self._tuning = tuning
        self._history = PoseHistory(self.state, tuning.history_s, tuning.scale)
        self._waiting: list[PoseFix] = []
        self._candidate: _PoseCandidate | None = None
        self._movements: deque[tuple[int, Pose]] = deque(maxlen=_MOVEMENTS_MOST)

    @property
    def stamp_ns(self) -> int:
        """Return the moment of the estimate: that of the last step; 0 before."""
        return self._history.stamp_ns

    @property
    def replayed(self) -> int:
        """Return how many steps were recomputed for late measurements."""
        return self._history.replayed

    @property
    def waiting(self) -> int:
        """Return how many measurements wait for the odometry of their moment."""
        return len(self._waiting)

    @property
    def waiting_ns(self) -> int:
        """Return the newest moment of those; 0 when there are none."""
        return max((fix.stamp_ns for fix in self._waiting), default=0)

    def begin(self, pose: Pose, covariance: PoseCovariance) -> None:
        """Set the pose at the time of the last step."""
        self.state.begin(pose, covariance)
        self.located = True
        self._candidate = None
        if self.stamp_ns:
            self._history.begin(self.stamp_ns)

    def restart(self, stamp_ns: int) -> None:
        """Continue after a pause, or on another clock: the history is discarded."""
        self._waiting.clear()
        self._movements.clear()
        self._candidate = None
        self._history.begin(stamp_ns)
        self.accepted_ns = self.fix_ns = 0
        self._heading_fix_ns = 0
        self.headings.restart()
        self.drifts.restart()
        for record in self.records:
            record.restart()

    def move(self, step: OdometryStep) -> bool:
        """
        Move on.

        :param step: since the last one; of the first only the moment counts.
        :return: False when it is not newer than the last, and is dropped.
        """
        history = self._history
        if not history.stamp_ns:
            history.begin(step.stamp_ns)
            self._apply_due(step.stamp_ns)
            return True
        if step.stamp_ns <= history.stamp_ns:
            return False
        if self._candidate is not None:
            step.predict(self._candidate.state)
        history.append(step)
        if self.located:
            self._evaluate_step(step)
        self._apply_due(step.stamp_ns)
        return True

    def displace(self, stamp_ns: int, movement: Pose) -> bool:
        """
        Apply a movement of the map, exactly: consistent measurements stay consistent.

        The estimate is moved, with its history, and waiting and late measurements. Its covariance
        is rotated, and does not grow.

        :param stamp_ns: measurements from then on refer to the moved map.
        :param movement: what was at p is at ``composed(movement, p)``.
        :return: False when it is older than the history, and nothing was moved: later measurements
            have been compared with the estimate for too long.
        """
        history = self._history
        if stamp_ns < history.oldest_ns:
            return False
        x, y, _ = self.state.pose
        self._movements.append((stamp_ns, movement))
        history.displace(movement, stamp_ns)
        for fix in self._waiting:
            if fix.stamp_ns < stamp_ns:
                fix.displace(movement)
        candidate = self._candidate
        if candidate is not None and candidate.since_ns < stamp_ns:
            candidate.state.displace(movement)
        self.counters.corrected += 1
        if self.located:
            there = composed(movement, (x, y, 0.0))
            self.jump = math.hypot(there[0] - x, there[1] - y), abs(there[2])
        return True

    def add_fix(self, fix: PoseFix) -> None:
        """
        Add a measured pose, in any order; :attr:`PoseFix.judged` tells whether it was compared.

        One that is newer than the last step waits for the next.
        """
        for moved_ns, movement in self._movements:
            if fix.stamp_ns < moved_ns:
                fix.displace(movement)
        self._place(fix)

    def _place(self, fix: PoseFix) -> None:
        history = self._history
        if not history.stamp_ns or fix.stamp_ns > history.stamp_ns:
            self._waiting.append(fix)
            if len(self._waiting) > _WAITING_MOST:
                del self._waiting[0]
                self.counters.overflow += 1
            return
        if fix.stamp_ns < history.oldest_ns:
            self.counters.too_late += 1
            return
        behind_ns = history.stamp_ns - fix.stamp_ns
        self.latest_ns = max(self.latest_ns, behind_ns)
        if behind_ns > _LATE_NS:
            self.late += 1
        if self.located and not history.insert(fix):
            self.counters.overflow += 1
            return
        self._evaluate(fix)

    def _apply_due(self, stamp_ns: int) -> None:
        """Apply the measurements that waited for the odometry of their time."""
        if self._waiting:
            due = [fix for fix in self._waiting if fix.stamp_ns <= stamp_ns]
            self._waiting = [fix for fix in self._waiting if fix.stamp_ns > stamp_ns]
            due.sort(key=lambda fix: fix.stamp_ns)
            for fix in due:
                self._place(fix)

    def transform(self, odometry: Pose) -> Pose:
        """Return ``map`` -> ``odom``, for the pose of odometry at the moment of the last step."""
        return transform(self.state.pose, odometry)

    def _evaluate_step(self, step: OdometryStep) -> None:
        """Record heading and drift of a step; accept those that are refused for long."""
        headings, drifts, again = self.headings, self.drifts, False
        if step.heading_rad == step.heading_rad:
            stays = headings.add(step.stamp_ns, *step.heading_judgement, step.heading_variance,
                                 step.distance_m)
            # Measured poses that confirm the estimate outrank a magnetometer.
            if stays and step.stamp_ns - self._heading_fix_ns >= (
                    self._tuning.kidnapped_s * NS_PER_S):
                # Position error by driving with the wrong heading.
                off_m = headings.way_m * 2.0 * math.sin(abs(step.heading_judgement[1]) / 2.0)
                step.believed_heading = off_m * off_m
                headings.reopen()
                again = True
        if step.drift == step.drift and drifts.add(
                step.stamp_ns, *step.drift_judgement, step.drift_measured_variance):
            step.believes_drift = again = True
            drifts.reopen()
        if again:
            self._history.judge_again()

    # ---- recovery ----------------------------------------------------------------------------

    def _evaluate(self, fix: PoseFix) -> None:
        """Evaluate the result of the comparison of a measurement."""
        self.fix_ns = max(self.fix_ns, fix.stamp_ns)
        if self.located and fix.judged and fix.source < len(self.records):
            self.records[fix.source].add(fix)
        if not self.located:
            self._test_candidate(fix)
        elif fix.accepted:
            self._accept(fix)
        elif fix.judged:
            self.counters.rejected += 1
            if self._tuning.kidnapped_s:
                self._test_candidate(fix)

    def _accept(self, fix: PoseFix) -> None:
        self.counters.accepted += 1
        self.accepted_ns = max(self.accepted_ns, fix.stamp_ns)
        if fix.dimensions == 3:
            self._heading_fix_ns = max(self._heading_fix_ns, fix.stamp_ns)
        count = min(_NIS_COUNT, self.counters.accepted)
        self.nis += (fix.nis / fix.dimensions - self.nis) / count
        candidate = self._candidate
        if candidate is not None:
            candidate.votes -= 1
            if candidate.votes <= 0:
                self._candidate = None

    def _test_candidate(self, fix: PoseFix) -> None:
        """Compare a measurement with the candidate pose."""
        there = self._history.carried(fix)
        candidate = self._candidate
        if candidate is not None:
            gate = GATE_3 if fix.dimensions == 3 else GATE_2
            if candidate.state.update_pose(there.pose, there.covariance, gate):
                candidate.votes += 1
                candidate.last_ns = fix.stamp_ns
                self._adopt_candidate(candidate, fix.stamp_ns)
                return
            if not self._outranks(candidate, fix):
                candidate.votes -= 1
            if fix.source < candidate.source:
                candidate.votes = 0
        # A position alone cannot start a candidate.
        if (candidate is None or candidate.votes <= 0) and fix.dimensions == 3:
            self._candidate = candidate = _PoseCandidate(there, fix)
            self._adopt_candidate(candidate, fix.stamp_ns)

    def _outranks(self, candidate: _PoseCandidate, fix: PoseFix) -> bool:
        """
        Return whether a candidate is recent and of a source that outranks the contradicting one.

        Where two sources have different frames, one of them must determine the pose.
        """
        return (candidate.source < fix.source
                and fix.stamp_ns - candidate.last_ns < _RANK_NS)

    def _adopt_candidate(self, candidate: _PoseCandidate, stamp_ns: int) -> None:
        """Adopt the candidate when it has been right for long enough."""
        tuning = self._tuning
        if self.located:
            wait_ns = tuning.kidnapped_s * NS_PER_S
            if (candidate.votes < tuning.kidnapped_fixes or stamp_ns - candidate.since_ns < wait_ns
                    or stamp_ns - self.accepted_ns < wait_ns):
                return
            self.counters.recovered += 1
            x, y, heading = self.state.pose
            self.jump = (math.hypot(candidate.state.x - x, candidate.state.y - y),
                         abs(math.remainder(candidate.state.heading - heading, math.tau)))
        elif candidate.votes < tuning.start_fixes:
            return
        self.accepted_ns = stamp_ns
        self.begin(candidate.state.pose, candidate.state.covariance)


def fix_covariance(covariance: PoseCovariance, least_m: float, least_rad: float
                   ) -> PoseCovariance | None:
    """
    Return the covariance of a measured pose with a lower bound.

    :param least_m: smallest standard deviation of x and y; replaces zeros, too.
    :param least_rad: the same of the heading.
    :return: None when it is invalid: not finite, or negative; a heading with -1 is unknown.
    """
    xx, xy, xh, yy, yh, hh = covariance
    if not (all(map(math.isfinite, covariance)) and xx >= 0.0 and yy >= 0.0
            and xx < UNKNOWN_VARIANCE and yy < UNKNOWN_VARIANCE):
        return None
    if hh == -1.0 or hh >= UNKNOWN_VARIANCE:
        xh, yh, hh = 0.0, 0.0, UNKNOWN_VARIANCE
    elif hh < 0.0:
        return None
    xx, yy = max(xx, least_m * least_m), max(yy, least_m * least_m)
    hh = max(hh, least_rad * least_rad)
    # A correlation is at most 1; rounding may exceed that.
    if (xy * xy > xx * yy or xh * xh > xx * hh or yh * yh > yy * hh
            or xx * (yy * hh - yh * yh) - xy * (xy * hh - yh * xh) + xh * (xy * yh - yy * xh) < 0):
        return xx, 0.0, 0.0, yy, 0.0, hh
    return xx, xy, xh, yy, yh, hh
