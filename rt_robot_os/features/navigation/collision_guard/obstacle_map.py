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
How fast a robot may drive among the obstacles that its sensors see.

All points are static obstacles; unseen space may contain one. The velocity is scaled as a whole,
so that the arc stays the same. Safe in the real-time loop.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.features.navigation.collision_guard.blind_sectors import BlindSectors
from rt_robot_os.features.navigation.collision_guard.sensors import Bumper
from rt_robot_os.features.navigation.collision_guard.sensors import DistanceSensor
from rt_robot_os.features.navigation.collision_guard.settings import SLOW
from rt_robot_os.motion.run_on import RunOn
from rt_robot_os.motion.zones import Array
from rt_robot_os.motion.zones import braking_share
from rt_robot_os.motion.zones import Footprint
from rt_robot_os.motion.zones import TOUCHING_M

# The last part of the distance to the stop is not driven: it would take forever.
_NEAR_M: Final = 0.01
_NONE: Final[Array] = np.empty(0)
# The share of the clearance that it keeps when it passes something slowly.
_GAP_SHARE: Final = 0.5
#: The end of the cause of a limit that comes from what cannot be seen.
UNSEEN: Final = ': unseen'
_BUMPER: Final = 'bumper'
_CLIFF: Final = 'cliff'
_TOUCHED: Final = {_BUMPER: 'something touches the robot', _CLIFF: 'an edge is ahead'}


@dataclass(frozen=True)
class VelocityVerdict:
    """
    The allowed share of a velocity.

    :ivar share: from 0 to 1.
    :ivar cause: what limits it, the same text while the cause is the same; empty without a limit.
    :ivar reason: the cause with its numbers, for operators.
    """

    share: float
    cause: str = ''
    reason: str = ''


FREE: Final = VelocityVerdict(1.0)


class ObstacleMap:
    """
    All obstacles that the sensors see, and the velocity that they allow.

    :param sights: the blind sectors of its scanners.
    :param settings: of the guard; a live one may change.
    :param run_on: how far the robot moves on when its computer stops sending commands.
    """

    def __init__(self, footprint: Footprint, sensors: Sequence[DistanceSensor],
                 sights: Sequence[BlindSectors],
                 bumper: Bumper | None, settings: Mapping[str, Any],
                 run_on: RunOn = RunOn()) -> None:
        self._run_on = run_on
        self._footprint = footprint
        self._sensors = sensors
        self._sights = sights
        self._bumper = bumper
        self._settings = settings
        self._x = self._y = self._driven = _NONE
        self._contacts = np.empty((0, 4))
        self._owners: list[str] = []
        self._owner = np.empty(0, int)
        self._contact_owners: list[str] = []
        self._clearance_m = self._gap_m = 0.0
        self.is_close = False
        self._stands = False

    def window_m(self) -> float:
        """Return the distance from ``base_link`` beyond which obstacles have no effect."""
        s = self._settings
        speed = max(s['linear_max_m_s'], s['backward_max_m_s'],
                    s['angular_max_rad_s'] * self._footprint.reach_m)
        braking = speed * s['reaction_s'] + max(
            speed * speed / (2 * s['deceleration_m_s2']), self._run_on.way_m(speed))
        return float(self._footprint.reach_m + s['clearance_m'] + s['stop_m'] + s['hysteresis_m']
                     + s['slow_m'] + braking)

    def unseen_m_s(self) -> float:
        """Return the speed of blind motion at which it runs on by stop_m at most."""
        return self._run_on.speed_m_s(self._settings['stop_m'], self._settings['reaction_s'])

    def rebuild(self) -> None:
        """Combine the points of all sensors; call it after a new reading."""
        sensors = self._sensors
        x = np.concatenate([_NONE, *(each.x for each in sensors)])
        y = np.concatenate([_NONE, *(each.y for each in sensors)])
        sizes = [each.x.size for each in sensors]
        owner = np.repeat(np.arange(len(sensors)), sizes)
        driven = np.repeat([each.driven_m for each in sensors], sizes)
        self._owners = [each.topic for each in sensors]
        contacts = [each.contacts for each in sensors]
        self._contact_owners = [each.topic for each in sensors for _ in each.contacts]
        if self._bumper is not None:
            contacts.append(self._bumper.contacts)
            cause = _CLIFF if self._bumper.cliff else _BUMPER
            self._contact_owners += [cause] * len(self._bumper.contacts)
        room = self._footprint.room(x, y)
        touching = room < TOUCHING_M
        if touching.any():
            tx, ty = x[touching], y[touching]
            contacts.append(np.stack((tx, ty, *self._footprint.normals(tx, ty)), axis=1))
            self._contact_owners += [self._owners[i] for i in owner[touching]]
            clear = ~touching
            x, y, room = x[clear], y[clear], room[clear]
            owner, driven = owner[clear], driven[clear]
        self._contacts = np.concatenate(contacts) if contacts else np.empty((0, 4))
        self._x, self._y, self._owner, self._driven = x, y, owner, driven
        nearest_m = float(room.min(initial=math.inf)) - 1e-4
        wanted_m: float = self._settings['clearance_m']
        # An obstacle that is too near must not block it forever: it may move slowly, not nearer.
        self.is_close = nearest_m < wanted_m or len(self._contacts) > 0
        self._clearance_m = min(wanted_m, max(0.0, nearest_m))
        self._gap_m = min(_GAP_SHARE * wanted_m, self._clearance_m)

    def judge(self, v: float, w: float, driven_m: float) -> VelocityVerdict:
        """
        Return the allowed share of a velocity.

        :param v: ahead in m/s.
        :param w: to the left in rad/s.
        :param driven_m: by the fastest point of the robot until now.
        """
        seen = self._judge_seen(v, w, driven_m)
        if seen.share == 0.0:
            return seen
        return min((seen, *(self._judge_unseen(sight, v, w, driven_m) for sight in self._sights
                            if sight.x.size)), key=lambda verdict: verdict.share)

    def _judge_unseen(self, sight: BlindSectors, v: float, w: float, driven_m: float
                      ) -> VelocityVerdict:
        """Return the share at which the robot stops before the unseen space of a scanner."""
        shape, s = self._footprint, self._settings
        speed = shape.speed(v, w)
        if speed == 0.0:
            return FREE
        times = shape.times(sight.x, sight.y, v, w, 0.0)
        times = times - (driven_m - sight.driven_m) / (abs(v) + abs(w) * shape.reach_m)
        first = int(times.argmin())
        room_m = float(times[first]) * speed - s['stop_m']
        share = min(self._braking(room_m, v, w, speed), self._running_on(
            room_m + s['stop_m'], speed)) if room_m > _NEAR_M else 0.0
        # As without any sensor: it can always retreat, but slowly.
        least_m_s = s['backward_max_m_s'] if v <= 0.0 else 0.0
        if s['unseen'] == SLOW:
            least_m_s = max(least_m_s, s['slow_m_s'])
        least_m_s = min(least_m_s, self.unseen_m_s())
        share = max(share, min(1.0, least_m_s / speed))
        if share == 1.0:
            return FREE
        low, high = map(math.degrees, sight.sector(first))
        return VelocityVerdict(
            share, sight.topic + UNSEEN,
            f'{sight.topic}: no valid readings from {low:.0f} to {high:.0f} degrees')

    def _judge_seen(self, v: float, w: float, driven_m: float) -> VelocityVerdict:
        """Return the share that the visible obstacles allow."""
        shape, s = self._footprint, self._settings
        speed = shape.speed(v, w)
        if speed == 0.0:
            self._stands = False
            return FREE
        blocked = self._pushed(v, w)
        if blocked:
            self._stands = True
            what = _TOUCHED.get(blocked, 'something touches the robot, or is too near to measure')
            return VelocityVerdict(0.0, f'{blocked}: touched', f'{blocked}: {what}')
        slow = min(1.0, s['slow_m_s'] / speed) if self.is_close else 1.0
        cause = 'close' if slow < 1.0 else ''
        if not self._x.size:
            self._stands = False
            return VelocityVerdict(slow, cause, cause)
        first, way_m = self._way(v, w, speed, driven_m, self._clearance_m)
        if way_m < max(s['slow_m'], s['stop_m'] + s['hysteresis_m']):
            slow, cause = min(slow, s['slow_m_s'] / speed), 'slow zone'
            # Slowly, it may pass obstacles that are nearer on its sides, such as door posts.
            first, way_m = self._way(v, w, speed, driven_m, self._gap_m)
        room_m = way_m - s['stop_m']
        if room_m <= (max(s['hysteresis_m'], _NEAR_M) if self._stands else _NEAR_M):
            self._stands = True
            return self._stop(first)
        self._stands = False
        share, run_on = self._braking(room_m, v, w, speed), self._running_on(way_m, speed)
        if run_on < min(share, slow):
            return VelocityVerdict(
                run_on, 'run-on', f'{way_m:.2f} m are free, and without this computer '
                f'the motors go on for {self._run_on.total_s:.1f} s')
        if share < slow:
            return VelocityVerdict(share, 'braking', f'{way_m:.2f} m are free')
        return VelocityVerdict(slow, cause, cause)

    def _braking(self, room_m: float, v: float, w: float, speed: float) -> float:
        """Return the share of a velocity from which it still stops within a distance."""
        s = self._settings
        stopping_s = max(abs(v) / s['deceleration_m_s2'], abs(w) / s['deceleration_rad_s2'])
        return braking_share(room_m / speed, stopping_s, s['reaction_s'])

    def _running_on(self, way_m: float, speed: float) -> float:
        """
        Return the share of a velocity from which it stops within a distance without this computer.

        It may then stop nearer than stop_m, if it touches nothing.
        """
        return min(1.0, self._run_on.speed_m_s(way_m, self._settings['reaction_s']) / speed)

    def _way(self, v: float, w: float, speed: float, driven_m: float, clearance_m: float
             ) -> tuple[int, float]:
        """
        Find the first collision.

        :return: index of the obstacle, and the distance of the fastest point until then.
        """
        shape = self._footprint
        times = shape.times(self._x, self._y, v, w, clearance_m)
        # The distance driven since a reading is how much nearer its points are at most.
        times = times - (driven_m - self._driven) / (abs(v) + abs(w) * shape.reach_m)
        first = int(times.argmin())
        return first, float(times[first]) * speed

    def _pushed(self, v: float, w: float) -> str:
        """Return the sensor of an obstacle that would be pushed; empty without one."""
        if not len(self._contacts):
            return ''
        x, y, nx, ny = self._contacts.T
        pushed = self._footprint.approached(x, y, nx, ny, v, w)
        return self._contact_owners[int(pushed.argmax())] if pushed.any() else ''

    def _stop(self, first: int) -> VelocityVerdict:
        topic = self._owners[int(self._owner[first])]
        x, y = float(self._x[first]), float(self._y[first])
        room_m = float(self._footprint.room(self._x[first:first + 1], self._y[first:first + 1])[0])
        return VelocityVerdict(
            0.0, f'{topic}: obstacle',
            f'{topic}: obstacle {max(0.0, room_m):.2f} m before the robot, at '
            f'{round(math.degrees(math.atan2(y, x)))} degrees')
