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
The readings of the sensors of a guard, as points in ``base_link``.

REP 117: -inf is nearer than the sensor can measure, so that something touches the robot there;
+inf is nothing within its range; NaN is no reading, and neither is what is below the shortest
distance of a scanner. A message whose limits are not valid is not a reading at all. Everything
here is safe in the real-time loop.
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections.abc import Mapping
import math
from typing import Final

import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.motion.mounting import BASE_FRAME
from rt_robot_os.motion.mounting import in_base
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.zones import Array
from rt_robot_os.motion.zones import Footprint
from rt_robot_os.motion.zones import Mask
from rt_robot_os.topics import Subscription

# A scan with a smaller share of usable rays is no reading: the sensor is covered or broken.
_USABLE: Final = 0.1
# Points along the arc of a range sensor are at most so far apart, in rad.
_RAY_RAD: Final = 0.1
_RAYS_MAXIMUM: Final = 31
# Cosine from which a ray counts as looking backwards: within 25 degrees.
_BACKWARDS: Final = 0.9
#: Number of directions that are distinguished all round.
BEARINGS: Final = 40
# Rays of a scan are at least so far apart, in rad.
_STEP_LEAST: Final = 1e-6
# The plane of a scanner that is steeper has no rays for most places of the floor.
_LEVEL: Final = 0.5
_NONE: Final[Array] = np.empty(0)
_NO_CONTACTS: Final[Array] = np.empty((0, 4))


def sensor_mounting(read: Subscription, mountings: Mapping[str, Mounting], name: str) -> Mounting:
    """
    Return the mounting of the frame of a topic.

    :param name: of the calling module, for errors.
    :raises ConfigError: there is no transform for it.
    """
    frame = str(read.msg.header.frame_id)
    found = in_base(mountings, frame)
    if frame != BASE_FRAME and found.parent == frame:
        known = ', '.join(sorted(mountings)) or 'none'
        raise ConfigError([
            f'{name}: no transform for frame {frame!r} of {read.topic.name}: it must be '
            f'{BASE_FRAME} or the frame_id of a device ({known})'])
    return found


class DistanceSensor(ABC):
    """
    A sensor of distances.

    :param mounting: its pose on the robot.
    :ivar x: of the points that it sees, in m in ``base_link``; as is y.
    :ivar contacts: what touches the robot: of shape (n, 4), see :meth:`Footprint.touched`.
    :ivar driven_m: the distance driven until these points were seen.
    :ivar unusable: messages that were no readings.
    :ivar at_m: its position in ``base_link``.
    :ivar stamp_ns: of its last reading; -1 before the first.
    :ivar looks_back: whether it sees obstacles behind the robot.
    :ivar bearings: tenths of a right angle, counted from straight ahead, that it covers.
    """

    looks_back = False
    bearings: frozenset[int] = frozenset()

    def __init__(self, read: Subscription, mounting: Mounting, footprint: Footprint) -> None:
        self.topic = read.topic.name
        self.x = self.y = _NONE
        self.contacts = _NO_CONTACTS
        self.driven_m = 0.0
        self.unusable = 0
        self._read = read
        self._footprint = footprint
        self.at_m = mounting.position_m
        self._mounting = mounting
        self._seen_ns = -1
        self.stamp_ns = -1

    def update(self, now_ns: int, window_m: float, driven_m: float, speed_m_s: float) -> bool:
        """
        Read the newest message, if it is a new reading.

        :param window_m: points further away from the robot are ignored.
        :param driven_m: by the robot until now.
        :param speed_m_s: of the robot, for the distance driven since the stamp.
        :return: whether there was a new reading.
        """
        read = self._read
        if not read.latest():
            return False
        stamp_ns = min(read.stamp_ns, now_ns)
        # A stamp that stands still has an unknown age.
        if not self._show(window_m) or stamp_ns <= self.stamp_ns:
            self.unusable += 1
            return False
        self._seen_ns = self.stamp_ns = stamp_ns
        self.driven_m = driven_m - speed_m_s * min((now_ns - stamp_ns) / NS_PER_S, 1.0)
        return True

    def times_out_at_ns(self, timeout_ns: int) -> int:
        """Return when it times out; 0 when there was no message."""
        return self._seen_ns + timeout_ns if self._seen_ns >= 0 else 0

    @abstractmethod
    def _show(self, window_m: float) -> bool:
        """Compute the points of the message; return whether it is a reading."""

    def _direction(self, angle: float) -> tuple[float, float]:
        """Return the direction of a ray in the plane of the robot, of length 1."""
        x, y, _ = self._mounting.in_parent((math.cos(angle), math.sin(angle), 0.0))
        x, y = x - self.at_m[0], y - self.at_m[1]
        length = math.hypot(x, y) or 1.0
        return x / length, y / length

    def _note_bearings(self, along: Array, across: Array) -> None:
        """Store the directions of the rays in ``base_link``."""
        self.looks_back = bool((along < -_BACKWARDS).any())
        tenths = np.floor(np.arctan2(across, along) * (BEARINGS / (2 * math.pi)))
        self.bearings = frozenset((tenths.astype(int) % BEARINGS).tolist())

    def _touch(self, angles: list[float]) -> Array:
        x, y, _ = self.at_m
        return np.array([self._footprint.touched(x, y, *self._direction(angle))
                         for angle in angles])


class Scanner(DistanceSensor):
    """
    A laser scanner.

    :param minimum_m: nearer points are the robot itself; 0: range_min of the scan.
    :ivar blind: which rays of the last scan have no valid reading.
    :ivar geometry: angle of the first ray and of a step, in rad, of the last scan.
    :ivar directions: x and y of each ray in ``base_link``.
    """

    def __init__(self, read: Subscription, mounting: Mounting, footprint: Footprint,
                 minimum_m: float) -> None:
        super().__init__(read, mounting, footprint)
        self._minimum_m = minimum_m
        self.blind: Mask = np.empty(0, bool)
        self.geometry: tuple[float, float] = math.nan, math.nan
        self.directions = _NONE, _NONE

    @property
    def ranges(self) -> Array:
        """Return the ranges of the last message, in m."""
        ranges: Array = self._read.msg.ranges
        return ranges

    @property
    def to_scanner(self) -> Array | None:
        """Return the matrix from ``base_link`` to the scan plane; None when that is steep."""
        x0, y0, _ = self.at_m
        ahead = self._mounting.in_parent((1.0, 0.0, 0.0))
        left = self._mounting.in_parent((0.0, 1.0, 0.0))
        (a, b), (c, d) = (ahead[0] - x0, left[0] - x0), (ahead[1] - y0, left[1] - y0)
        determinant = a * d - b * c
        if abs(determinant) < _LEVEL:
            return None
        return np.array(((d, -b), (-c, a))) / determinant

    def _show(self, window_m: float) -> bool:
        msg = self._read.msg
        ranges = msg.ranges
        low, most = max(msg.range_min, self._minimum_m), msg.range_max
        if not 0.0 <= msg.range_min <= low < most:
            return False
        if ((msg.angle_min, msg.angle_increment) != self.geometry
                or ranges.size != self.directions[0].size) and not self._measure():
            return False
        with np.errstate(invalid='ignore'):
            usable = (ranges >= low) & (ranges > 0.0)
            near = np.flatnonzero(ranges == -math.inf)
            count = np.count_nonzero(usable) + near.size
            if count < max(1.0, _USABLE * ranges.size):
                return False
            high = min(most, window_m + math.hypot(*self.at_m[:2]))
            met = np.flatnonzero(usable & (ranges <= high))
        distances = ranges[met].astype(np.float64)
        along, across = self.directions
        self.x = self.at_m[0] + distances * along[met]
        self.y = self.at_m[1] + distances * across[met]
        self.blind = ~usable
        self.blind[near] = False
        first, step = self.geometry
        # Many such rays are one hand in front of the lens.
        self.contacts = self._touch([
            first + step * int(i) for i in near[::max(1, near.size // _RAYS_MAXIMUM)]]
        ) if near.size else _NO_CONTACTS
        return True

    def sees_beyond(self, x: Array, y: Array, margin_m: float) -> Mask:
        """
        Return which places, in ``base_link``, the rays of the last scan pass by a margin.

        Sensors that are mounted upside down or on their side return nothing.
        """
        first, step = self.geometry
        roll, pitch, yaw = self._mounting.rotation_rad
        ranges = self._read.msg.ranges
        if roll or pitch or not step > 0.0:
            return np.zeros(x.shape, bool)
        x, y = x - self.at_m[0], y - self.at_m[1]
        angles = np.mod(np.arctan2(y, x) - yaw - first, 2 * math.pi)
        ray = np.rint(angles / step).astype(np.intp)
        inside = ray < ranges.size
        with np.errstate(invalid='ignore'):
            passed = ranges[np.where(inside, ray, 0)] > np.hypot(x, y) + margin_m
        return np.asarray(inside & passed)

    def _measure(self) -> bool:
        """Compute the direction of each ray; again only when the scan geometry changes."""
        msg = self._read.msg
        first, step = float(msg.angle_min), float(msg.angle_increment)
        if not (math.isfinite(first) and _STEP_LEAST <= abs(step) < math.pi):
            return False
        self.geometry = first, step
        x0, y0, _ = self.at_m
        ahead = self._mounting.in_parent((1.0, 0.0, 0.0))
        left = self._mounting.in_parent((0.0, 1.0, 0.0))
        angles = first + step * np.arange(msg.ranges.size)
        cosine, sine = np.cos(angles), np.sin(angles)
        along = (ahead[0] - x0) * cosine + (left[0] - x0) * sine
        across = (ahead[1] - y0) * cosine + (left[1] - y0) * sine
        self.directions = along, across
        self._note_bearings(along, across)
        return True


class RangeFinder(DistanceSensor):
    """A sensor with one beam: what it sees may be anywhere across the beam, at that distance."""

    _width = math.nan
    _along = _across = _NONE

    def _show(self, window_m: float) -> bool:
        msg = self._read.msg
        distance = float(msg.range)
        if math.isnan(distance) or not 0.0 <= msg.min_range <= msg.max_range > 0.0:
            return False
        self.x = self.y = _NONE
        self.contacts = _NO_CONTACTS
        if msg.field_of_view != self._width:
            self._measure(msg.field_of_view)
        if distance < msg.min_range:
            self.contacts = self._touch([0.0])
        elif distance <= min(msg.max_range, window_m + math.hypot(*self.at_m[:2])):
            self.x = self.at_m[0] + distance * self._along
            self.y = self.at_m[1] + distance * self._across
        return True

    def _measure(self, width: float) -> None:
        self._width = width
        half = width / 2 if 0.0 <= width <= 2 * math.pi else 0.0
        count = min(_RAYS_MAXIMUM, 1 + 2 * math.ceil(half / _RAY_RAD))
        rays = np.array([self._direction(angle) for angle in np.linspace(-half, half, count)])
        self._along, self._across = rays[:, 0], rays[:, 1]
        self._note_bearings(self._along, self._across)


class Bumper:
    """
    Contact, cliff and wheel-drop switches, as bits.

    :ivar lifted: whether a wheel is off the ground.
    :ivar contacts: see :class:`DistanceSensor`.
    """

    RIGHT: Final = 1
    CENTRE: Final = 2
    LEFT: Final = 4
    CLIFF: Final = 8
    WHEEL_DROP: Final = 16
    _ANGLES: Final = {RIGHT: -math.pi / 4, CENTRE: 0.0, LEFT: math.pi / 4}

    def __init__(self, footprint: Footprint) -> None:
        self._points = {bit: footprint.touched(0.0, 0.0, math.cos(angle), math.sin(angle))
                        for bit, angle in self._ANGLES.items()}
        self._until_ns = dict.fromkeys((*self._ANGLES, self.CLIFF, self.WHEEL_DROP), 0.0)
        self.bits = 0
        self._heard_ns = -1
        self.lifted = False
        self.cliff = False
        self.contacts = _NO_CONTACTS

    def update(self, bits: int, now_ns: int, hold_ns: int) -> None:
        """Process the state of the switches; a released one counts for a while longer."""
        self._heard_ns = now_ns
        for bit in self._until_ns:
            if bits & bit:
                self._until_ns[bit] = math.inf
            elif self.bits & bit:
                self._until_ns[bit] = now_ns + hold_ns
        self.bits = bits

    def times_out_at_ns(self, timeout_ns: int) -> int:
        """Return when it times out; 0 when there was no message."""
        return self._heard_ns + timeout_ns if self._heard_ns >= 0 else 0

    def evaluate(self, now_ns: int) -> float:
        """
        Compute the present contacts.

        :return: when they change without a message; infinite if they do not.
        """
        held = [bit for bit, until_ns in self._until_ns.items() if now_ns < until_ns]
        self.lifted = self.WHEEL_DROP in held
        self.cliff = self.CLIFF in held
        # At an edge it must not move forward in any direction.
        touched = tuple(self._points) if self.cliff else [b for b in held if b in self._points]
        self.contacts = np.array([self._points[bit] for bit in touched]) if touched else (
            _NO_CONTACTS)
        return min((t for t in self._until_ns.values() if t > now_ns), default=math.inf)
