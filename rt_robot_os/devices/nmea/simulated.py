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


"""A simulated satellite receiver, on the robot or moving on a circle."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from datetime import timedelta
from datetime import timezone
import math
from typing import Any
from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.schema import Field
from rt_robot_os.devices.nmea import wire
from rt_robot_os.devices.witmotion import wire as witmotion
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice

if TYPE_CHECKING:
    from rt_robot_os.sim.world.world import World

# A fixed day, so that equal settings give equal bytes.
START: Final = datetime(2026, 1, 1, 12, 0, 0, tzinfo=timezone.utc)
SEPARATION_M: Final = 47.0
ALTITUDE_M: Final = 34.0
DEVIATIONS_M: Final = (0.8, 0.7, 1.5)

_SATELLITES: Final = (2, 5, 7, 13, 15, 18, 20, 30)
_PDOP, _HDOP, _VDOP = 1.7, 0.9, 1.4
_SEMI_MAJOR_M: Final = 6378137.0
_ECCENTRICITY_2: Final = 0.00669437999014
# Correlation time of the error.
_ERROR_S: Final = 40.0


class SimulatedNmea(SimulatedDevice):
    """A receiver that sends some sentences for each epoch."""

    SETTINGS = common_settings(1.0, 50.0) + (
        Field('latitude_deg', float, 52.5163, 'Centre of the circle, without a world.',
              unit='degrees', minimum=-89.0, maximum=89.0),
        Field('longitude_deg', float, 13.3777, 'Centre of the circle, without a world.',
              unit='degrees', minimum=-180.0, maximum=180.0),
        Field('radius_m', float, 20.0, 'Radius of the circle, without a world.',
              unit='m', minimum=0.01, maximum=10_000.0),
        Field('speed_m_s', float, 1.0, 'Speed along the circle, without a world; 0 stands '
              'still.', unit='m/s', minimum=0.0, maximum=100.0),
        Field('sentences', list, ('GGA', 'GSA', 'RMC', 'GST'), 'NMEA sentences of each epoch, in '
              'this order.', choices=('GGA', 'GNS', 'RMC', 'GLL', 'GSA', 'GST')),
        Field('noise', float, 1.0,
              'Error of its position in a world, as a multiple of the reported deviations; it '
              'changes slowly.', minimum=0.0, maximum=1000.0),
    )
    BAUD = 9600
    # In standard deviations; drawn again after a long time, and at first.
    _wandered: Sequence[float] = (0.0, 0.0, 0.0)
    _erred_s = -math.inf

    def sample(self, time_s: float) -> bytes:
        """Return the sentences of one epoch."""
        settings = self.settings
        time = START + timedelta(seconds=round(time_s, 2))
        latitude_deg, longitude_deg, course_deg = self.position(time_s)
        speed_m_s, altitude_m = self.speed_and_altitude()
        place: Any = (time, latitude_deg, longitude_deg)
        height: dict[str, Any] = {'satellites': len(_SATELLITES), 'hdop': _HDOP,
                                  'altitude_m': altitude_m, 'separation_m': SEPARATION_M}
        north_m, east_m, up_m = DEVIATIONS_M
        made = {
            'GGA': lambda: wire.gga(*place, **height),
            'GNS': lambda: wire.gns(*place, **height),
            'RMC': lambda: wire.rmc(*place, speed_m_s=speed_m_s,
                                    course_deg=course_deg),
            'GLL': lambda: wire.gll(*place),
            'GSA': lambda: wire.gsa(_SATELLITES, _PDOP, _HDOP, _VDOP),
            'GST': lambda: wire.gst(time, 1.0, north_m, east_m, up_m),
        }
        return b''.join(made[kind]() for kind in settings['sentences'])

    def foreign(self) -> bytes:
        """Return bytes of an inertial measurement unit."""
        return witmotion.acceleration_frame(0.0, 0.0, 9.8)

    def position(self, time_s: float) -> tuple[float, float, float]:
        """Return latitude, longitude and course (clockwise from north), all in degrees."""
        if self.world is not None:
            self._err(time_s)
            return self._position_on_robot(self.world)
        settings = self.settings
        radius_m = settings['radius_m']
        angle = settings['speed_m_s'] / radius_m * time_s
        course_deg = math.degrees(math.atan2(-math.sin(angle), math.cos(angle))) % 360
        return (*_moved(settings['latitude_deg'], settings['longitude_deg'],
                        radius_m * math.cos(angle), radius_m * math.sin(angle)), course_deg)

    def speed_and_altitude(self) -> tuple[float, float]:
        """Return its speed in m/s and its height in m."""
        if self.world is None:
            return self.settings['speed_m_s'], ALTITUDE_M
        return (abs(self.world.base.velocity[0]),
                self.world.settings.altitude_m + self.mounting.position_m[2] + self._error_m()[2])

    def deviations_m(self) -> tuple[float, float, float]:
        """Return the standard deviations of its error: north, east, up."""
        return DEVIATIONS_M

    def _error_m(self) -> tuple[float, float, float]:
        north, east, up = (self.settings['noise'] * deviation * wandered for deviation, wandered
                           in zip(self.deviations_m(), self._wandered))
        return north, east, up

    def _err(self, time_s: float) -> None:
        """Advance the error, a Gauss-Markov process of first order."""
        if time_s == self._erred_s:
            return
        kept = math.exp(-max(time_s - self._erred_s, 0.0) / _ERROR_S)
        self._erred_s = time_s
        new = math.sqrt(1.0 - kept * kept)
        self._wandered = [kept * old + self.random.gauss(0.0, new) for old in self._wandered]

    def _position_on_robot(self, world: World) -> tuple[float, float, float]:
        x, y, _ = world.pose_of(self.mounting)
        s = world.settings
        cosine, sine = math.cos(s.east_rad), math.sin(s.east_rad)
        ahead = world.base.pose[2] + (math.pi if world.base.velocity[0] < 0.0 else 0.0)
        course_deg = math.degrees(math.pi / 2 - (ahead - s.east_rad)) % 360
        north_m, east_m, _ = self._error_m()
        return (*_moved(s.latitude_deg, s.longitude_deg, cosine * x + sine * y + east_m,
                        cosine * y - sine * x + north_m), course_deg)


def _moved(latitude_deg: float, longitude_deg: float, east_m: float, north_m: float
           ) -> tuple[float, float]:
    """Return latitude and longitude of a position at a small offset from another."""
    latitude = math.radians(latitude_deg)
    flat = 1 - _ECCENTRICITY_2 * math.sin(latitude) ** 2
    meridian_m = _SEMI_MAJOR_M * (1 - _ECCENTRICITY_2) / flat ** 1.5
    parallel_m = _SEMI_MAJOR_M / math.sqrt(flat) * math.cos(latitude)
    return (latitude_deg + math.degrees(north_m / meridian_m),
            longitude_deg + math.degrees(east_m / parallel_m))
