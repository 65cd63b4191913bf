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
What a satellite receiver's sentences say about position, accuracy and systems.

Rules, in the order in which they were decided:

- Quality 1 and 3 are a fix, 2 and 9 SBAS, 4 and 5 GBAS. Quality 6 (dead reckoning) is no fix: the
  position is extrapolated, with an error that nobody reports; 7 (typed in) and 8 (simulator)
  likewise. Without a fix position and altitude are NaN, even where the receiver repeats its last
  position.
- A fix of a time for which RMC said ``V`` (warning) is no fix.
- Altitude is above the ellipsoid: height above sea level plus separation. Without the separation
  it is NaN, as the message asks: sea level is up to 100 m away from the ellipsoid.
- Covariance, east, north, up: from GST of the same or the previous epoch (known); else from the
  dilution of precision times ``uere_m`` (approximated), with twice the horizontal deviation for up
  when VDOP is not known; else unknown. A dilution or deviation of 0, or 99 and more, is
  what receivers send for none.
- Services are the systems whose sentences were seen: by talker, and for the talker GN by the
  satellites in GSA.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
from datetime import datetime
from datetime import time
from datetime import timezone
import math
from typing import Any
from typing import Final

# sensor_msgs/msg/NavSatStatus and NavSatFix; the real-time core does not import ROS.
STATUS_NO_FIX: Final = -1
STATUS_FIX: Final = 0
STATUS_SBAS_FIX: Final = 1
STATUS_GBAS_FIX: Final = 2
COVARIANCE_UNKNOWN: Final = 0
COVARIANCE_APPROXIMATED: Final = 1
COVARIANCE_DIAGONAL_KNOWN: Final = 2
SERVICE_GPS: Final = 1
SERVICE_GLONASS: Final = 2
SERVICE_COMPASS: Final = 4
SERVICE_GALILEO: Final = 8

_STATUS: Final = {1: STATUS_FIX, 2: STATUS_SBAS_FIX, 3: STATUS_FIX, 4: STATUS_GBAS_FIX,
                  5: STATUS_GBAS_FIX, 9: STATUS_SBAS_FIX}
_TALKER_SERVICE: Final = {'GP': SERVICE_GPS, 'GL': SERVICE_GLONASS, 'GA': SERVICE_GALILEO,
                          'GB': SERVICE_COMPASS, 'BD': SERVICE_COMPASS}
# NMEA 4.10 system ids in GSA, and the satellite numbers by which older receivers tell them.
_SYSTEM_SERVICE: Final = {'1': SERVICE_GPS, '2': SERVICE_GLONASS, '3': SERVICE_GALILEO,
                          '4': SERVICE_COMPASS}
_SATELLITE_SERVICE: Final = ((range(1, 33), SERVICE_GPS), (range(65, 97), SERVICE_GLONASS),
                             (range(301, 337), SERVICE_GALILEO),
                             (range(401, 438), SERVICE_COMPASS))
_NO_DILUTION: Final = 99.0
# GSA comes less often than GGA from some receivers (every third second from a SiRF-II).
_VDOP_EPOCHS: Final = 5
_INT32_MAX: Final = 2**31 - 1


@dataclass(frozen=True)
class Fix:
    """
    One position.

    :ivar status: of ``NavSatStatus``.
    :ivar service: bits of ``NavSatStatus``.
    :ivar time: UTC time of day that the receiver gave, None if it gave none.
    :ivar latitude_deg: north positive; NaN without a fix, as longitude and altitude.
    :ivar altitude_m: above the WGS 84 ellipsoid, NaN when not known.
    :ivar variances_m2: east, north, up.
    :ivar covariance_type: of ``NavSatFix``.
    """

    status: int
    service: int
    time: time | None
    latitude_deg: float = math.nan
    longitude_deg: float = math.nan
    altitude_m: float = math.nan
    variances_m2: tuple[float, float, float] = (0.0, 0.0, 0.0)
    covariance_type: int = COVARIANCE_UNKNOWN

    def withdrawn(self) -> Fix:
        """Give the same instant without the fix."""
        return Fix(STATUS_NO_FIX, self.service, self.time)


class FixBuilder:
    """
    Collect what the sentences of an epoch say; safe in the loop, keeps the last of each.

    It takes parsed sentences (of pynmeagps), whose values are numbers, times, or '' if absent; a
    missing attribute counts as absent, and so does a number that is not finite.
    """

    def __init__(self, uere_m: float) -> None:
        """
        Start with nothing known.

        :param uere_m: error of one range, which the dilutions of precision multiply.
        """
        self._uere_m = uere_m
        self.restart()

    def restart(self) -> None:
        """Forget everything: the stream starts anew."""
        self._service = 0
        self._deviations_m: tuple[float, float, float | None] | None = None
        self._deviations_time: time | None = None
        self._previous_time: time | None = None
        self._vdop: float | None = None
        self._vdop_epochs = 0
        self._void_time: time | None = None

    def see_talker(self, talker: str) -> None:
        """Take the first two letters of an address that is used."""
        self._service |= _TALKER_SERVICE.get(talker, 0)

    def see_gst(self, gst: Any) -> None:
        """Take the standard deviations."""
        north, east = _deviation(gst, 'stdLat'), _deviation(gst, 'stdLong')
        if north is None or east is None:
            self._deviations_m = None
        else:
            self._deviations_m = (east, north, _deviation(gst, 'stdAlt'))
        self._deviations_time = time_of(gst)

    def see_gsa(self, gsa: Any, talker: str) -> None:
        """Take the vertical dilution, and which systems are used."""
        self._vdop = _dilution(gsa, 'VDOP')
        self._vdop_epochs = 0
        if talker != 'GN':
            return
        numbers = [getattr(gsa, f'svid_{i:02d}', '') for i in range(1, 13)]
        used = [n for n in numbers if isinstance(n, int)]
        system = _SYSTEM_SERVICE.get(getattr(gsa, 'systemId', ''))
        if system is not None:
            self._service |= system if used else 0
            return
        for numbers_of, service in _SATELLITE_SERVICE:
            if any(n in numbers_of for n in used):
                self._service |= service

    def see_rmc(self, rmc: Any) -> bool:
        """
        Take whether the receiver warns.

        :return: True when it does not.
        """
        valid: bool = getattr(rmc, 'status', '') == 'A'
        self._void_time = None if valid else time_of(rmc)
        return valid

    def fix(self, gga: Any) -> Fix:
        """Give the position of a GGA sentence."""
        moment = time_of(gga)
        status = _STATUS.get(getattr(gga, 'quality', 0), STATUS_NO_FIX)
        position = _position(gga)
        fix = Fix(STATUS_NO_FIX, self._service, moment)
        if status != STATUS_NO_FIX and position is not None and not self.is_void(moment):
            variances, kind = self._covariance(gga, moment)
            fix = Fix(status, self._service, moment, *position, _altitude(gga), variances, kind)
        self._previous_time = moment
        self._vdop_epochs += 1
        return fix

    def is_void(self, moment: time | None) -> bool:
        """Say whether the last RMC warns about this time of day."""
        return moment is not None and moment == self._void_time

    def _covariance(
        self, gga: Any, moment: time | None,
    ) -> tuple[tuple[float, float, float], int]:
        if self._deviations_m is not None and self._deviations_time is not None \
                and self._deviations_time in (moment, self._previous_time):
            east, north, up = self._deviations_m
            if up is None:
                up = 2 * max(east, north)
            return (east * east, north * north, up * up), COVARIANCE_DIAGONAL_KNOWN
        hdop = _dilution(gga, 'HDOP')
        if hdop is None:
            return (0.0, 0.0, 0.0), COVARIANCE_UNKNOWN
        vdop = self._vdop if self._vdop_epochs <= _VDOP_EPOCHS else None
        horizontal = (hdop * self._uere_m) ** 2
        vertical = ((2 * hdop if vdop is None else vdop) * self._uere_m) ** 2
        return (horizontal, horizontal, vertical), COVARIANCE_APPROXIMATED


def claims_fix(gga: Any) -> bool:
    """Say whether the quality is one of a fix."""
    return getattr(gga, 'quality', 0) in _STATUS


def time_of(message: Any) -> time | None:
    """Give the UTC time of day of a sentence, None if it has none."""
    value = getattr(message, 'time', None)
    return value if isinstance(value, time) else None


def utc_of(rmc: Any) -> tuple[int, int] | None:
    """
    Give date and time of an RMC sentence.

    :return: seconds since 1970 and nanoseconds; None if absent or beyond ``builtin_interfaces``.
    """
    day, moment = getattr(rmc, 'date', None), time_of(rmc)
    if not isinstance(day, date) or moment is None:
        return None
    stamp = datetime.combine(day, moment.replace(microsecond=0), timezone.utc).timestamp()
    if not 0 <= stamp <= _INT32_MAX:
        return None
    return int(stamp), moment.microsecond * 1000


def _number(message: Any, name: str) -> float | None:
    value = getattr(message, name, None)
    if isinstance(value, (int, float)) and math.isfinite(value):
        return value
    return None


def _dilution(message: Any, name: str) -> float | None:
    value = _number(message, name)
    return value if value is not None and 0 < value < _NO_DILUTION else None


def _deviation(message: Any, name: str) -> float | None:
    value = _number(message, name)
    return value if value is not None and 0 < value < _INT32_MAX else None


def _position(gga: Any) -> tuple[float, float] | None:
    latitude, longitude = _number(gga, 'lat'), _number(gga, 'lon')
    if latitude is None or longitude is None:
        return None
    # pynmeagps gives the unsigned number when the letter is missing or unknown.
    if getattr(gga, 'NS', '') not in ('N', 'S') or getattr(gga, 'EW', '') not in ('E', 'W'):
        return None
    if abs(latitude) > 90 or abs(longitude) > 180:
        return None
    return latitude, longitude


def _altitude(gga: Any) -> float:
    height, separation = _number(gga, 'alt'), _number(gga, 'sep')
    if height is None or separation is None:
        return math.nan
    if getattr(gga, 'altUnit', '') != 'M' or getattr(gga, 'sepUnit', '') != 'M':
        return math.nan
    return height + separation
