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
What the sensors of a guard see, as points in ``base_link``.

REP 117: -inf is nearer than the sensor can measure, so that something touches the robot there;
+inf is nothing within its range; NaN is no reading. Everything here is safe in the real-time loop.
"""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from collections.abc import Mapping
import math
from typing import Final

import numpy as np

from rt_robot_os.errors import ConfigError
from rt_robot_os.motion.mounting import BASE_FRAME
from rt_robot_os.motion.mounting import in_base
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.zones import Array
from rt_robot_os.motion.zones import Footprint
from rt_robot_os.motion.zones import Mask
from rt_robot_os.topics import Subscription
from rt_robot_os.units import NS_PER_S

# A scan with a smaller share of usable rays shows nothing: a cover, a broken sensor.
_USABLE: Final = 0.1
# Points along the arc of a range sensor are at most so far apart, in rad.
_RAY_RAD: Final = 0.1
_RAYS_MAXIMUM: Final = 31
# A ray looks back when its direction has this share of straight back: within 25 degrees.
_BACKWARDS: Final = 0.9
_NONE: Final[Array] = np.empty(0)
_NO_CONTACTS: Final[Array] = np.empty((0, 4))


def place_of(read: Subscription, mountings: Mapping[str, Mounting], name: str) -> Mounting:
    """
    Return where on the robot the frame of a topic is.

    :param name: of the module that asks, for errors.
    :raises ConfigError: nobody says where it is.
    """
    frame = str(read.msg.header.frame_id)
    found = in_base(mountings, frame)
    if frame != BASE_FRAME and found.parent == frame:
        known = ', '.join(sorted(mountings)) or 'none'
        raise ConfigError([
            f'{name}: nobody says where {frame!r} is, the frame of {read.topic.name}: it must be '
            f'{BASE_FRAME} or the frame_id of a device ({known})'])
    return found


class Sensor(ABC):
    """
    A sensor of distances.

    :param mounting: where it is on the robot.
    :ivar x: of what it sees, in m in ``base_link``; as is y.
    :ivar contacts: what touches the robot: of shape (n, 4), see :meth:`Footprint.touched`.
    :ivar driven_m: what the robot had driven when it saw that.
    :ivar unusable: messages that showed nothing.
    :ivar looks_back: whether it would see what the robot drives backwards into.
    """

    looks_back = False

    def __init__(self, read: Subscription, mounting: Mounting, footprint: Footprint) -> None:
        self.topic = read.topic.name
        self.x = self.y = _NONE
        self.contacts = _NO_CONTACTS
        self.driven_m = 0.0
        self.unusable = 0
        self._read = read
        self._footprint = footprint
        self._at = mounting.position_m
        self._mounting = mounting
        self._seen_ns = -1
        self._stamp_ns = -1

    def take(self, now_ns: int, window_m: float, driven_m: float, speed_m_s: float) -> bool:
        """
        Take the newest message, if there is a new one that shows something.

        :param window_m: what is further away from the robot does not matter.
        :param driven_m: by the robot until now.
        :param speed_m_s: at which it drives, for what it drove since the stamp.
        :return: whether what is seen is new.
        """
        read = self._read
        if not read.latest():
            return False
        stamp_ns = min(read.stamp_ns, now_ns)
        # One whose clock stands still shows who knows when.
        if not self._show(window_m) or stamp_ns <= self._stamp_ns:
            self.unusable += 1
            return False
        self._seen_ns = self._stamp_ns = stamp_ns
        self.driven_m = driven_m - speed_m_s * min((now_ns - stamp_ns) / NS_PER_S, 1.0)
        return True

    def silent_at_ns(self, timeout_ns: int) -> int:
        """Return when it counts as silent; 0 when it was never heard."""
        return self._seen_ns + timeout_ns if self._seen_ns >= 0 else 0

    @abstractmethod
    def _show(self, window_m: float) -> bool:
        """Make points of the message; return whether it is a reading."""

    def _direction(self, angle: float) -> tuple[float, float]:
        """Return the direction of a ray in the plane of the robot, of length 1."""
        x, y, _ = self._mounting.in_parent((math.cos(angle), math.sin(angle), 0.0))
        x, y = x - self._at[0], y - self._at[1]
        length = math.hypot(x, y) or 1.0
        return x / length, y / length

    def _touch(self, angles: list[float]) -> Array:
        x, y, _ = self._at
        return np.array([self._footprint.touched(x, y, *self._direction(angle))
                         for angle in angles])


class Scanner(Sensor):
    """
    A laser scanner.

    :param minimum_m: what is nearer is the robot itself; 0: the scan says it.
    """

    def __init__(self, read: Subscription, mounting: Mounting, footprint: Footprint,
                 minimum_m: float) -> None:
        super().__init__(read, mounting, footprint)
        self._minimum_m = minimum_m
        self._geometry: tuple[float, float] = math.nan, math.nan
        self._along = self._across = _NONE

    def _show(self, window_m: float) -> bool:
        msg = self._read.msg
        ranges = msg.ranges
        if (msg.angle_min, msg.angle_increment) != self._geometry and not self._measure():
            return False
        low = max(msg.range_min, self._minimum_m)
        with np.errstate(invalid='ignore'):
            usable = ranges >= low
            near = np.flatnonzero(ranges == -math.inf)
            count = np.count_nonzero(usable) + near.size
            if count < max(1.0, _USABLE * ranges.size):
                return False
            high = min(msg.range_max, window_m + math.hypot(*self._at[:2]))
            met = np.flatnonzero(usable & (ranges <= high))
        distances = ranges[met].astype(np.float64)
        self.x = self._at[0] + distances * self._along[met]
        self.y = self._at[1] + distances * self._across[met]
        first, step = self._geometry
        # Many rays are one hand before the lens.
        self.contacts = self._touch([
            first + step * int(i) for i in near[::max(1, near.size // _RAYS_MAXIMUM)]]
        ) if near.size else _NO_CONTACTS
        return True

    def sees_beyond(self, x: Array, y: Array, margin_m: float) -> Mask:
        """
        Return which places, in ``base_link``, the rays of the last scan pass by a margin.

        Not for sensors that hang upside down or lie on their side: these see beyond nothing.
        """
        first, step = self._geometry
        roll, pitch, yaw = self._mounting.rotation_rad
        ranges = self._read.msg.ranges
        if roll or pitch or not step > 0.0:
            return np.zeros(x.shape, bool)
        x, y = x - self._at[0], y - self._at[1]
        angles = np.mod(np.arctan2(y, x) - yaw - first, 2 * math.pi)
        ray = np.rint(angles / step).astype(np.intp)
        inside = ray < ranges.size
        with np.errstate(invalid='ignore'):
            passed = ranges[np.where(inside, ray, 0)] > np.hypot(x, y) + margin_m
        return np.asarray(inside & passed)

    def _measure(self) -> bool:
        """Find the direction of each ray; once, unless the scanner turns out to change."""
        msg = self._read.msg
        first, step = float(msg.angle_min), float(msg.angle_increment)
        if not (math.isfinite(first) and math.isfinite(step)):
            return False
        self._geometry = first, step
        x0, y0, _ = self._at
        ahead = self._mounting.in_parent((1.0, 0.0, 0.0))
        left = self._mounting.in_parent((0.0, 1.0, 0.0))
        angles = first + step * np.arange(msg.ranges.size)
        cosine, sine = np.cos(angles), np.sin(angles)
        self._along = (ahead[0] - x0) * cosine + (left[0] - x0) * sine
        self._across = (ahead[1] - y0) * cosine + (left[1] - y0) * sine
        self.looks_back = bool((self._along < -_BACKWARDS).any())
        return True


class RangeFinder(Sensor):
    """A sensor with one beam: what it sees may be anywhere across the beam, at that distance."""

    _width = math.nan
    _along = _across = _NONE

    def _show(self, window_m: float) -> bool:
        msg = self._read.msg
        distance = float(msg.range)
        if math.isnan(distance):
            return False
        self.x = self.y = _NONE
        self.contacts = _NO_CONTACTS
        if msg.field_of_view != self._width:
            self._measure(msg.field_of_view)
        if distance < msg.min_range:
            self.contacts = self._touch([0.0])
        elif distance <= min(msg.max_range, window_m + math.hypot(*self._at[:2])):
            self.x = self._at[0] + distance * self._along
            self.y = self._at[1] + distance * self._across
        return True

    def _measure(self, width: float) -> None:
        self._width = width
        half = width / 2 if 0.0 <= width <= 2 * math.pi else 0.0
        count = min(_RAYS_MAXIMUM, 1 + 2 * math.ceil(half / _RAY_RAD))
        rays = np.array([self._direction(angle) for angle in np.linspace(-half, half, count)])
        self._along, self._across = rays[:, 0], rays[:, 1]
        self.looks_back = bool((self._along < -_BACKWARDS).any())


class Bumper:
    """
    Switches that something touches, as bits.

    :ivar lifted: whether a wheel hangs in the air.
    :ivar contacts: see :class:`Sensor`.
    """

    topic = ''
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
        self.lifted = False
        self.cliff = False
        self.contacts = _NO_CONTACTS

    def hear(self, bits: int, now_ns: int, hold_ns: int) -> None:
        """Take what the switches say; what is let go counts for a while."""
        for bit in self._until_ns:
            if bits & bit:
                self._until_ns[bit] = math.inf
            elif self.bits & bit:
                self._until_ns[bit] = now_ns + hold_ns
        self.bits = bits

    def look(self, now_ns: int) -> float:
        """
        Find what touches it now.

        :return: when that changes by itself; infinite when it does not.
        """
        held = [bit for bit, until_ns in self._until_ns.items() if now_ns < until_ns]
        self.lifted = self.WHEEL_DROP in held
        self.cliff = self.CLIFF in held
        # Beyond an edge it may not go anywhere ahead.
        touched = tuple(self._points) if self.cliff else [b for b in held if b in self._points]
        self.contacts = np.array([self._points[bit] for bit in touched]) if touched else (
            _NO_CONTACTS)
        return min((t for t in self._until_ns.values() if t > now_ns), default=math.inf)
