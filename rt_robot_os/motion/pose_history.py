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
The last two seconds of a filter, so that late measurements are applied at their time.

The filter is restored to the step during which the measurement was made, corrected there, and
advanced again through all later steps and measurements. Everything is bounded and safe in
the real-time loop: a measurement that is late by n steps costs n predictions.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.ekf import displaced
from rt_robot_os.motion.ekf import displaced_covariance
from rt_robot_os.motion.ekf import Ekf
from rt_robot_os.motion.ekf import GATE_1
from rt_robot_os.motion.ekf import GATE_2
from rt_robot_os.motion.ekf import GATE_3
from rt_robot_os.motion.ekf import PoseCovariance
from rt_robot_os.motion.ekf import State
from rt_robot_os.motion.ekf import UNKNOWN_VARIANCE
from rt_robot_os.motion.poses import composed

# At 200 Hz these are 2.5 s.
_STEPS_MOST: Final = 512
# Each of them is recomputed with the step.
_FIXES_MOST: Final = 16


@dataclass
class PoseFix:
    """
    A measured pose on the map.

    :ivar stamp_ns: when it was measured.
    :ivar covariance: of it; a heading that is not known has ``UNKNOWN_VARIANCE``.
    :ivar source: number of its source, the highest rank first.
    :ivar inflation: factor of the covariance in the estimate, not in the comparison: correlated
        errors are not averaged away.
    :ivar judged: it has been compared with the estimate once.
    :ivar accepted: it was used, when it was last compared.
    :ivar nis: normalised innovation squared, of the first comparison.
    :ivar innovation: measured minus estimated pose, of the first comparison.
    """

    stamp_ns: int
    pose: Pose
    covariance: PoseCovariance
    source: int = 0
    inflation: float = 1.0
    judged: bool = False
    accepted: bool = False
    nis: float = math.nan
    innovation: Pose = (0.0, 0.0, 0.0)

    def displace(self, movement: Pose) -> None:
        """Move the frame that it was measured in."""
        self.pose = composed(movement, self.pose)
        self.covariance = displaced_covariance(self.covariance, movement)

    @property
    def dimensions(self) -> int:
        """Return how many numbers were measured."""
        return 2 if self.covariance[5] >= UNKNOWN_VARIANCE else 3


# Result for a heading or a drift: whether it was used, and its innovation.
Judgement = tuple[bool, float]


@dataclass
class OdometryStep:
    """
    The motion from one sample of odometry to the next.

    :ivar stamp_ns: of its end.
    :ivar distance_m: along the arc.
    :ivar turn_rad: as measured, drift included.
    :ivar lever: how many s or m of drift are in the turn; see :class:`Ekf`.
    :ivar distance_variance: in m^2.
    :ivar turn_variance: in rad^2.
    :ivar covariance: of both, in m rad.
    :ivar drift_variance: by which that of the drift grows.
    :ivar heading_rad: measured at its end, on the map; NaN without.
    :ivar heading_variance: of that.
    :ivar drift: measured in it, as of a gyroscope at rest; NaN without.
    :ivar drift_measured_variance: of that.
    :ivar heading_judgement: result of the last comparison of the heading.
    :ivar drift_judgement: the same of the drift.
    :ivar believed_heading: accept the heading without a gate, and add this to the variance of the
        position, in m^2; None: the gate is used.
    :ivar believes_drift: accept the drift without a gate.
    """

    stamp_ns: int
    distance_m: float = 0.0
    turn_rad: float = 0.0
    lever: float = 0.0
    distance_variance: float = 0.0
    turn_variance: float = 0.0
    covariance: float = 0.0
    drift_variance: float = 0.0
    heading_rad: float = math.nan
    heading_variance: float = 0.0
    drift: float = math.nan
    drift_measured_variance: float = 0.0

    def __post_init__(self) -> None:
        self.fixes: list[PoseFix] = []
        self.after: State = ()
        self.blind_m = 0.0
        self.heading_judgement: Judgement = (True, 0.0)
        self.drift_judgement: Judgement = (True, 0.0)
        self.believed_heading: float | None = None
        self.believes_drift = False

    def predict(self, state: Ekf, part: float = 1.0, further_variance: float = 0.0) -> None:
        """
        Move a filter along a part of the step.

        :param further_variance: of the distance of that part, in m^2.
        """
        if part == 1.0:
            state.predict(self.distance_m, self.turn_rad, self.lever,
                          self.distance_variance + further_variance, self.turn_variance,
                          self.covariance, self.drift_variance)
        else:
            state.predict(self.distance_m * part, self.turn_rad * part, self.lever * part,
                          self.distance_variance * part + further_variance,
                          self.turn_variance * part, self.covariance * part,
                          self.drift_variance * part)


class PoseHistory:
    """
    Steps and measurements in the order in which they happened.

    :param state: the filter that they act on.
    :param seconds: how late measurements may be.
    :param scale: relative standard deviation of the distance; the error is the same from step to
        step, so it adds up from one accepted measurement to the next.
    :ivar replayed: steps that were computed again.
    """

    def __init__(self, state: Ekf, seconds: float, scale: float) -> None:
        self.replayed = 0
        self._scale = scale * scale
        self._blind_m = 0.0
        self._state = state
        self._length_ns = round(seconds * NS_PER_S)
        self._steps: deque[OdometryStep] = deque()

    @property
    def stamp_ns(self) -> int:
        """Return the time of the filter; 0 before the first step."""
        return self._steps[-1].stamp_ns if self._steps else 0

    @property
    def oldest_ns(self) -> int:
        """Return the time of the oldest state; older measurements cannot be used."""
        return self._steps[0].stamp_ns if self._steps else 0

    def begin(self, stamp_ns: int) -> None:
        """Discard the history: the state of the filter is that of this time."""
        self._steps.clear()
        self._blind_m = 0.0
        step = OdometryStep(stamp_ns)
        step.after = self._state.state()
        self._steps.append(step)

    def append(self, step: OdometryStep) -> None:
        """Move the filter along the next step; its fixes lie within."""
        steps = self._steps
        self._advance(step, steps[-1].stamp_ns)
        steps.append(step)
        oldest_ns = step.stamp_ns - self._length_ns
        while len(steps) > 1 and (steps[1].stamp_ns <= oldest_ns or len(steps) > _STEPS_MOST):
            steps.popleft()

    def judge_again(self) -> None:
        """Recompute the last step, after its heading or drift was accepted."""
        if len(self._steps) > 1:
            self._replay(-1)

    def insert(self, fix: PoseFix) -> bool:
        """
        Apply a measurement at its time in the past.

        :return: False when it is too old, or its step has too many.
        """
        steps = self._steps
        if not steps or not steps[0].stamp_ns <= fix.stamp_ns <= steps[-1].stamp_ns:
            return False
        index = self._step_of(fix.stamp_ns)
        if index == -len(steps):
            # At the time of the oldest state there is no earlier state to restore.
            step = steps[0]
            self._go_back_to(step)
            self._correct(fix)
            step.after, step.blind_m = self._state.state(), self._blind_m
            index += 1
        else:
            step = steps[index]
            if len(step.fixes) >= _FIXES_MOST:
                return False
            step.fixes.append(fix)
            if len(step.fixes) > 1:
                step.fixes.sort(key=_stamp)
        self._replay(index)
        return True

    def _replay(self, index: int) -> None:
        """Advance the filter again through the steps from one on, counted from the end."""
        steps = self._steps
        if index:
            self._go_back_to(steps[index - 1])
        for again in range(index, 0):
            self._advance(steps[again], steps[again - 1].stamp_ns)
        self.replayed -= index

    def displace(self, movement: Pose, stamp_ns: int) -> None:
        """
        Move the frame of the map: the estimate, its history, and measurements in the old frame.

        :param movement: what was at p is at ``composed(movement, p)``.
        :param stamp_ns: measurements from then on are in the new frame already.
        """
        state, steps = self._state, self._steps
        state.displace(movement)
        again = 0
        for index, step in enumerate(steps):
            step.after = displaced(step.after, movement)
            for fix in step.fixes:
                if fix.stamp_ns < stamp_ns:
                    fix.displace(movement)
                elif index:
                    again = again or index - len(steps)
        if again:  # they were compared in the wrong frame
            self._replay(again)

    def carried(self, fix: PoseFix) -> Ekf:
        """Return the present pose that follows from a past measurement alone."""
        there = Ekf()
        there.begin(fix.pose, fix.covariance)
        there.drift = self._state.drift
        steps = self._steps
        if not steps or fix.stamp_ns < steps[0].stamp_ns or fix.stamp_ns > steps[-1].stamp_ns:
            return there
        index = self._step_of(fix.stamp_ns)
        stamp_ns = steps[index].stamp_ns
        if fix.stamp_ns < stamp_ns:
            before_ns = steps[index - 1].stamp_ns
            steps[index].predict(there, (stamp_ns - fix.stamp_ns) / (stamp_ns - before_ns))
        for again in range(index + 1, 0):
            steps[again].predict(there)
        return there

    def _step_of(self, stamp_ns: int) -> int:
        """Return the step that contains a time, counted from the end: -1 is the last."""
        steps, index = self._steps, -1
        first = -len(steps)
        while index > first and steps[index - 1].stamp_ns >= stamp_ns:
            index -= 1
        return index

    def _go_back_to(self, step: OdometryStep) -> None:
        self._state.restore(step.after)
        self._blind_m = step.blind_m

    def _correct(self, fix: PoseFix) -> None:
        state = self._state
        before = state.p00 + state.p11
        correct(state, fix)
        # The measured share of the distance is the reduction of the variance.
        if before:
            self._blind_m *= (state.p00 + state.p11) / before

    def _predict(self, step: OdometryStep, part: float) -> None:
        length = abs(step.distance_m) * part
        # The growth of (scale * distance)^2.
        step.predict(self._state, part, self._scale * length * (2 * self._blind_m + length))
        self._blind_m += length

    def _advance(self, step: OdometryStep, before_ns: int) -> None:
        state = self._state
        if step.fixes:
            done, span_ns = 0.0, step.stamp_ns - before_ns
            for fix in step.fixes:
                reached = (fix.stamp_ns - before_ns) / span_ns
                if reached > done:
                    self._predict(step, reached - done)
                    done = reached
                self._correct(fix)
            if done < 1.0:
                self._predict(step, 1.0 - done)
        else:
            self._predict(step, 1.0)
        if step.heading_rad == step.heading_rad:
            off, gate = wrapped(step.heading_rad - state.heading), GATE_1
            if step.believed_heading is not None:
                state.inflate(step.believed_heading, off * off, 0.0)
                gate = math.inf
            step.heading_judgement = state.update_heading(
                step.heading_rad, step.heading_variance, gate), off
        if step.drift == step.drift:
            off, gate = step.drift - state.drift, GATE_1
            if step.believes_drift:
                state.inflate(0.0, 0.0, off * off)
                gate = math.inf
            step.drift_judgement = state.update_drift(
                step.drift, step.drift_measured_variance, gate), off
        step.after, step.blind_m = state.state(), self._blind_m


def correct(state: Ekf, fix: PoseFix) -> None:
    """Compare a filter with a measurement, and correct it if the two agree."""
    gate = GATE_3 if fix.dimensions == 3 else GATE_2
    x, y, heading = state.pose
    if fix.inflation > 1.0:
        nis = state.compared(fix.pose, fix.covariance)
        fix.accepted = nis <= gate and state.update_pose(
            fix.pose, inflated(fix.covariance, fix.inflation), gate)
        state.nis = nis
    else:
        fix.accepted = state.update_pose(fix.pose, fix.covariance, gate)
    if not fix.judged:
        fix.judged, fix.nis = True, state.nis
        turn = wrapped(fix.pose[2] - heading) if fix.dimensions == 3 else 0.0
        fix.innovation = fix.pose[0] - x, fix.pose[1] - y, turn


def inflated(covariance: PoseCovariance, factor: float) -> PoseCovariance:
    """Return a covariance times a factor; a heading that is not known stays so."""
    xx, xy, xh, yy, yh, hh = (each * factor for each in covariance)
    return xx, xy, xh, yy, yh, max(hh, covariance[5])


def _stamp(fix: PoseFix) -> int:
    return fix.stamp_ns
