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
An extended Kalman filter of a robot in the plane, in closed form and plain floats.

The state is x, y, heading and the error of the measured turn (``drift``): the bias
of a gyroscope in rad/s, or the mismatch of two wheels in rad/m. How much of it a step contains,
its ``lever``, is the time or the distance; at 0 the filter is one of poses only.

Source: Thrun, Burgard, Fox, Probabilistic Robotics, table 3.3, for the filter; Siegwart,
Nourbakhsh, Introduction to Autonomous Mobile Robots, section 5.2.4, for the covariance of
odometry. Everything is safe in the real-time loop.
"""

from __future__ import annotations

import math
from typing import Final

from rt_robot_os.motion.angles import wrapped
from rt_robot_os.motion.differential import moved
from rt_robot_os.motion.differential import Pose
from rt_robot_os.motion.poses import composed

# x-x, x-y, x-heading, y-y, y-heading, heading-heading in m^2, m rad, rad^2.
PoseCovariance = tuple[float, float, float, float, float, float]
State = tuple[float, ...]

# Of chi^2 with 1, 2, 3 degrees of freedom, 99 per cent are below.
GATE_1: Final = 6.635
GATE_2: Final = 9.210
GATE_3: Final = 11.345
# A measurement moves the estimate by at most this many standard deviations of the estimate.
MOVE_SIGMAS: Final = 3.0
# Variance of an unknown heading; with an innovation of zero it has no effect.
UNKNOWN_VARIANCE: Final = 1e6
# The variance of a standing robot grows without limit, and rounding could make one negative.
_VARIANCE_MOST: Final = 1e9
_VARIANCE_LEAST: Final = 1e-14


def _inverse(a: float, b: float, c: float, d: float, e: float, f: float
             ) -> PoseCovariance | None:
    """Return the inverse of the symmetric a b c, b d e, c e f; None when there is none."""
    i00, i01, i02 = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * i00 + b * i01 + c * i02
    if not determinant > 0.0:
        return None
    scale = 1 / determinant
    return (i00 * scale, i01 * scale, i02 * scale, (a * f - c * c) * scale,
            (b * c - a * e) * scale, (a * d - b * b) * scale)


def displaced_covariance(covariance: PoseCovariance, movement: Pose) -> PoseCovariance:
    """Return the covariance of a pose after its frame was moved."""
    xx, xy, xh, yy, yh, hh = covariance
    c, s = math.cos(movement[2]), math.sin(movement[2])
    cc, ss, cs = c * c, s * s, c * s
    return (cc * xx - 2 * cs * xy + ss * yy, cs * (xx - yy) + (cc - ss) * xy, c * xh - s * yh,
            ss * xx + 2 * cs * xy + cc * yy, s * xh + c * yh, hh)


def displaced(state: State, movement: Pose) -> State:
    """Return the state after :meth:`Ekf.displace`."""
    x, y, heading, drift, xx, xy, xh, xd, yy, yh, yd, hh, hd, dd = state
    xx, xy, xh, yy, yh, hh = displaced_covariance((xx, xy, xh, yy, yh, hh), movement)
    c, s = math.cos(movement[2]), math.sin(movement[2])
    return (*composed(movement, (x, y, heading)), drift, xx, xy, xh, c * xd - s * yd, yy, yh,
            s * xd + c * yd, hh, hd, dd)


class Ekf:
    """
    A pose with its covariance, moved by odometry and corrected by measurements.

    :ivar heading: in rad, from -pi to pi.
    :ivar drift: in rad/s or rad/m, depending on ``lever``.
    :ivar nis: normalised innovation squared of the last measurement, accepted or not.
    """

    __slots__ = ('x', 'y', 'heading', 'drift', 'p00', 'p01', 'p02', 'p03', 'p11', 'p12', 'p13',
                 'p22', 'p23', 'p33', 'nis')

    def __init__(self) -> None:
        self.nis = 0.0
        self.drift = self.p33 = 0.0
        self.begin((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))

    def begin(self, pose: Pose, covariance: PoseCovariance) -> None:
        """Set the pose; the drift is unchanged."""
        self.x, self.y = pose[0], pose[1]
        self.heading = wrapped(pose[2])
        self.p00, self.p01, self.p02, self.p11, self.p12, self.p22 = covariance
        self.p03 = self.p13 = self.p23 = 0.0

    def begin_drift(self, value: float, variance: float) -> None:
        """Set the drift, in rad/s or rad/m, uncorrelated with the pose."""
        self.drift, self.p33 = value, variance
        self.p03 = self.p13 = self.p23 = 0.0

    @property
    def pose(self) -> Pose:
        """Return x and y in m and the heading in rad."""
        return self.x, self.y, self.heading

    @property
    def covariance(self) -> PoseCovariance:
        """Return that of the pose."""
        return self.p00, self.p01, self.p02, self.p11, self.p12, self.p22

    def state(self) -> State:
        """Return everything, for :meth:`restore`."""
        return (self.x, self.y, self.heading, self.drift, self.p00, self.p01, self.p02, self.p03,
                self.p11, self.p12, self.p13, self.p22, self.p23, self.p33)

    def restore(self, state: State) -> None:
        """Restore a state that :meth:`state` returned."""
        (self.x, self.y, self.heading, self.drift, self.p00, self.p01, self.p02, self.p03,
         self.p11, self.p12, self.p13, self.p22, self.p23, self.p33) = state

    def displace(self, movement: Pose) -> None:
        """Move the frame in which the pose is: what was at p is at ``composed(movement, p)``."""
        self.restore(displaced(self.state(), movement))

    def predict(self, distance_m: float, turn_rad: float, lever: float, distance_variance: float,
                turn_variance: float, covariance: float = 0.0, drift_variance: float = 0.0
                ) -> None:
        """
        Move along an arc.

        :param turn_rad: as measured, the drift still in it.
        :param lever: how many s or m of drift are in it.
        :param covariance: of distance and turn, in m rad.
        :param drift_variance: what is added to that of the drift.
        """
        turn = turn_rad - self.drift * lever
        x, y, heading = moved((self.x, self.y, self.heading), distance_m, turn)
        dx, dy = x - self.x, y - self.y
        middle = self.heading + turn / 2
        cosine, sine = math.cos(middle), math.sin(middle)
        # A turn moves the end of the arc as if it happened at half the distance.
        tx, ty = -dy / 2, dx / 2
        self.x, self.y, self.heading = x, y, wrapped(heading)
        p02, p03, p12, p13 = self.p02, self.p03, self.p12, self.p13
        p22, p23, p33 = self.p22, self.p23, self.p33
        a, b, e, f = -dy, dx, -lever * tx, -lever * ty
        r02, r03 = p02 + a * p22 + e * p23, p03 + a * p23 + e * p33
        r12, r13 = p12 + b * p22 + f * p23, p13 + b * p23 + f * p33
        r23 = p23 - lever * p33
        r00, r01 = self.p00 + a * p02 + e * p03, self.p01 + a * p12 + e * p13
        r11 = self.p11 + b * p12 + f * p13
        vd, vt, vc = distance_variance, turn_variance, covariance
        self.p00 = min(_VARIANCE_MOST, r00 + a * r02 + e * r03 + cosine * cosine * vd
                       + 2 * cosine * tx * vc + tx * tx * vt)
        self.p01 = r01 + b * r02 + f * r03 + cosine * sine * vd + (
            cosine * ty + sine * tx) * vc + tx * ty * vt
        self.p02 = r02 - lever * r03 + cosine * vc + tx * vt
        self.p11 = min(_VARIANCE_MOST, r11 + b * r12 + f * r13 + sine * sine * vd
                       + 2 * sine * ty * vc + ty * ty * vt)
        self.p12 = r12 - lever * r13 + sine * vc + ty * vt
        self.p22 = min(_VARIANCE_MOST, p22 - lever * (p23 + r23) + vt)
        self.p03, self.p13, self.p23 = r03, r13, r23
        self.p33 = p33 + drift_variance

    def update_pose(self, pose: Pose, covariance: PoseCovariance, gate: float = GATE_3) -> bool:
        """
        Correct the pose by one that was measured.

        :param covariance: of the measurement; the heading may have ``UNKNOWN_VARIANCE``.
        :param gate: largest :attr:`nis`; infinite disables the gate and the limit of the movement
            (``MOVE_SIGMAS``).
        :return: whether it was used.
        """
        p00, p01, p02, p11, p12, p22 = (
            self.p00, self.p01, self.p02, self.p11, self.p12, self.p22)
        inverse = _inverse(p00 + covariance[0], p01 + covariance[1], p02 + covariance[2],
                           p11 + covariance[3], p12 + covariance[4], p22 + covariance[5])
        if inverse is None:
            self.nis = math.inf
            return False
        i00, i01, i02, i11, i12, i22 = inverse
        u, v, w = pose[0] - self.x, pose[1] - self.y, wrapped(pose[2] - self.heading)
        if covariance[5] >= UNKNOWN_VARIANCE:
            w = 0.0
        g, h, k = (i00 * u + i01 * v + i02 * w, i01 * u + i11 * v + i12 * w,
                   i02 * u + i12 * v + i22 * w)
        self.nis = nis = u * g + v * h + w * k
        mx, my, mh = (p00 * g + p01 * h + p02 * k, p01 * g + p11 * h + p12 * k,
                      p02 * g + p12 * h + p22 * k)
        if not nis <= gate or not (
                mx * g + my * h + mh * k <= MOVE_SIGMAS * MOVE_SIGMAS or gate == math.inf):
            return False
        self.x += mx
        self.y += my
        self.heading = wrapped(self.heading + mh)
        self.drift += self.p03 * g + self.p13 * h + self.p23 * k
        self._shrink(i00, i01, i02, i11, i12, i22)
        return True

    def compared(self, pose: Pose, covariance: PoseCovariance) -> float:
        """Return the normalised innovation squared of a measured pose, without a correction."""
        inverse = _inverse(self.p00 + covariance[0], self.p01 + covariance[1],
                           self.p02 + covariance[2], self.p11 + covariance[3],
                           self.p12 + covariance[4], self.p22 + covariance[5])
        if inverse is None:
            return math.inf
        i00, i01, i02, i11, i12, i22 = inverse
        u, v, w = pose[0] - self.x, pose[1] - self.y, wrapped(pose[2] - self.heading)
        if covariance[5] >= UNKNOWN_VARIANCE:
            w = 0.0
        return (u * (i00 * u + 2 * (i01 * v + i02 * w)) + v * (i11 * v + 2 * i12 * w)
                + w * i22 * w)

    def _shrink(self, i00: float, i01: float, i02: float, i11: float, i12: float, i22: float
                ) -> None:
        """Reduce the covariance by a measured pose; i is the inverse of the innovation's."""
        p00, p01, p02, p03 = self.p00, self.p01, self.p02, self.p03
        p11, p12, p13, p22, p23 = self.p11, self.p12, self.p13, self.p22, self.p23
        x0, x1, x2 = (p00 * i00 + p01 * i01 + p02 * i02, p00 * i01 + p01 * i11 + p02 * i12,
                      p00 * i02 + p01 * i12 + p02 * i22)
        y0, y1, y2 = (p01 * i00 + p11 * i01 + p12 * i02, p01 * i01 + p11 * i11 + p12 * i12,
                      p01 * i02 + p11 * i12 + p12 * i22)
        h0, h1, h2 = (p02 * i00 + p12 * i01 + p22 * i02, p02 * i01 + p12 * i11 + p22 * i12,
                      p02 * i02 + p12 * i12 + p22 * i22)
        d0, d1, d2 = (p03 * i00 + p13 * i01 + p23 * i02, p03 * i01 + p13 * i11 + p23 * i12,
                      p03 * i02 + p13 * i12 + p23 * i22)
        least = _VARIANCE_LEAST
        self.p00 = max(least, p00 - (x0 * p00 + x1 * p01 + x2 * p02))
        self.p01 = p01 - (x0 * p01 + x1 * p11 + x2 * p12)
        self.p02 = p02 - (x0 * p02 + x1 * p12 + x2 * p22)
        self.p03 = p03 - (x0 * p03 + x1 * p13 + x2 * p23)
        self.p11 = max(least, p11 - (y0 * p01 + y1 * p11 + y2 * p12))
        self.p12 = p12 - (y0 * p02 + y1 * p12 + y2 * p22)
        self.p13 = p13 - (y0 * p03 + y1 * p13 + y2 * p23)
        self.p22 = max(least, p22 - (h0 * p02 + h1 * p12 + h2 * p22))
        self.p23 = p23 - (h0 * p03 + h1 * p13 + h2 * p23)
        self.p33 = max(0.0, self.p33 - (d0 * p03 + d1 * p13 + d2 * p23))

    def update_heading(self, heading_rad: float, variance: float, gate: float = GATE_1) -> bool:
        """
        Correct by a heading that was measured; arguments as for :meth:`update_pose`.

        :return: whether it was used.
        """
        return self._update_one(wrapped(heading_rad - self.heading), variance, gate, self.p02,
                                self.p12, self.p22, self.p23, self.p22)

    def inflate(self, position_variance: float, heading_variance: float, drift_variance: float
                ) -> None:
        """Add to the variances: m^2 to x and y, rad^2 to the heading, and to the drift."""
        self.p00 = min(_VARIANCE_MOST, self.p00 + position_variance)
        self.p11 = min(_VARIANCE_MOST, self.p11 + position_variance)
        self.p22 = min(_VARIANCE_MOST, self.p22 + heading_variance)
        self.p33 = min(_VARIANCE_MOST, self.p33 + drift_variance)

    def update_drift(self, drift: float, variance: float, gate: float = GATE_1) -> bool:
        """
        Correct by a drift that was measured, such as the rate of a gyroscope at rest.

        :return: whether it was used.
        """
        return self._update_one(drift - self.drift, variance, gate, self.p03, self.p13, self.p23,
                                self.p33, self.p33)

    def _update_one(self, innovation: float, variance: float, gate: float, a: float, b: float,
                    c: float, d: float, own: float) -> bool:
        """Correct by one number; a to d are its covariances with the four of the state."""
        total = own + variance
        if not total > 0.0:
            return False
        scale = innovation / total
        self.nis = nis = innovation * scale
        # It moves its own number by own/total of the innovation: sigmas, squared, are nis * that.
        if not nis <= gate or not (nis * own <= total * MOVE_SIGMAS * MOVE_SIGMAS
                                   or gate == math.inf):
            return False
        self.x += a * scale
        self.y += b * scale
        self.heading = wrapped(self.heading + c * scale)
        self.drift += d * scale
        p, q, r, s = a / total, b / total, c / total, d / total
        least = _VARIANCE_LEAST
        self.p00 = max(least, self.p00 - p * a)
        self.p01 -= p * b
        self.p02 -= p * c
        self.p03 -= p * d
        self.p11 = max(least, self.p11 - q * b)
        self.p12 -= q * c
        self.p13 -= q * d
        self.p22 = max(least, self.p22 - r * c)
        self.p23 -= r * d
        self.p33 = max(0.0, self.p33 - s * d)
        return True
