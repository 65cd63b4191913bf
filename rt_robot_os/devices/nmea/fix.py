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
Position, accuracy and systems from a satellite receiver's sentences.

Rules, in the order in which they were decided:

- Quality 1 and 3 are a fix, 2 and 9 SBAS, 4 and 5 GBAS. Quality 6 (dead reckoning) is not a fix:
  the position is extrapolated, with an unknown error; 7 (typed in) and 8 (simulator) likewise. The
  mode letters of GNS, RMC and GLL have the same meanings and are treated alike. Without a fix
  position and altitude are NaN, even where the receiver repeats its last position.
- With no satellite used there is no fix, whatever the quality: a position is computed from ranges,
  so a receiver that reports 0 repeats or extrapolates one. An empty count is ignored, and so is a
  0 if GSA lists at least three satellites and RMC does not warn.
- A fix of a time for which RMC warned (``V``), or was dead reckoning, typed in or simulated (mode
  ``E``, ``M``, ``S``, ``N``), is not a fix.
- Altitude is above the ellipsoid: height above sea level plus separation. Without the separation
  it is NaN, as the message specifies: sea level is up to 100 m from the ellipsoid.
- Covariance, east, north, up: from GST of the same or the previous epoch (known); else from the
  dilution of precision (of the sentence itself, else of GSA) times ``uere_m`` (approximated), with
  twice the horizontal deviation for up if VDOP is unknown; else unknown. A dilution or deviation
  of 0, or 99 and more, means none.
- Services are the systems whose sentences were seen: by talker, and for the talker GN by the
  satellites in GSA.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date
import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.nmea import sentences
from rt_robot_os.devices.nmea.sentences import GsaSentence
from rt_robot_os.devices.nmea.sentences import GstSentence
from rt_robot_os.devices.nmea.sentences import PositionSentence

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

_STATUS: Final = {
    sentences.AUTONOMOUS: STATUS_FIX, sentences.DIFFERENTIAL: STATUS_SBAS_FIX,
    sentences.PRECISE: STATUS_FIX, sentences.RTK_FIXED: STATUS_GBAS_FIX,
    sentences.RTK_FLOAT: STATUS_GBAS_FIX, sentences.SBAS: STATUS_SBAS_FIX}
_TALKER_SERVICE: Final = {'GP': SERVICE_GPS, 'GL': SERVICE_GLONASS, 'GA': SERVICE_GALILEO,
                          'GB': SERVICE_COMPASS, 'BD': SERVICE_COMPASS}
# NMEA 4.10 system ids in GSA, and the satellite numbers that identify systems of older receivers.
_SYSTEM_SERVICE: Final = {'1': SERVICE_GPS, '2': SERVICE_GLONASS, '3': SERVICE_GALILEO,
                          '4': SERVICE_COMPASS}
_SATELLITE_SERVICE: Final = ((range(1, 33), SERVICE_GPS), (range(65, 97), SERVICE_GLONASS),
                             (range(301, 337), SERVICE_GALILEO),
                             (range(401, 438), SERVICE_COMPASS))
_NO_DILUTION: Final = 99.0
# Some receivers send GSA less often than GGA (a SiRF-II every third second).
_GSA_EPOCHS: Final = 5
# A two-dimensional position needs three satellites.
_FEWEST_SATELLITES: Final = 3
# Limit of talkers and systems of GSA; more are noise.
_MOST_SYSTEMS: Final = 16
_INT32_MAX: Final = 2**31 - 1
_EPOCH: Final = date(1970, 1, 1)
_DAY_S: Final = 86_400


@dataclass(frozen=True)
class GnssFix:
    """
    One position.

    :ivar status: of ``NavSatStatus``.
    :ivar service: bits of ``NavSatStatus``.
    :ivar time_ns: UTC time of day of the receiver, None if unknown.
    :ivar latitude_deg: north positive; NaN without a fix, as longitude and altitude.
    :ivar altitude_m: above the WGS 84 ellipsoid, NaN if unknown.
    :ivar variances_m2: east, north, up.
    :ivar covariance_type: of ``NavSatFix``.
    """

    status: int
    service: int
    time_ns: int | None
    latitude_deg: float = math.nan
    longitude_deg: float = math.nan
    altitude_m: float = math.nan
    variances_m2: tuple[float, float, float] = (0.0, 0.0, 0.0)
    covariance_type: int = COVARIANCE_UNKNOWN

    def withdrawn(self) -> GnssFix:
        """Return the same instant without the fix."""
        return GnssFix(STATUS_NO_FIX, self.service, self.time_ns)


class FixBuilder:
    """Collect the data of the sentences of an epoch; safe in the loop, keeps the last of each."""

    def __init__(self, uere_m: float) -> None:
        """
        Start without data.

        :param uere_m: error of one range, which is multiplied by the dilutions of precision.
        """
        self._uere_m = uere_m
        self.restart()

    def restart(self) -> None:
        """Reset everything: the stream restarts."""
        self._service = 0
        self._gst: GstSentence | None = None
        self._previous_ns: int | None = None
        self._gsa: GsaSentence | None = None
        self._gsa_epochs = 0
        self._epoch = 0
        self._used: dict[tuple[str, str], tuple[int, int]] = {}
        self._void_ns: int | None = None
        self._rmc_is_valid = False

    def see_talker(self, talker: str) -> None:
        """Add the talker (the first two characters) of a used address."""
        self._service |= _TALKER_SERVICE.get(talker, 0)

    def see_gst(self, gst: GstSentence) -> None:
        """Add the standard deviations."""
        self._gst = gst

    def see_gsa(self, gsa: GsaSentence) -> None:
        """Add the dilutions, and the systems in use."""
        self._gsa = gsa
        self._gsa_epochs = 0
        self._count_used(gsa)
        if gsa.talker != 'GN':
            return
        system = _SYSTEM_SERVICE.get(gsa.system)
        if system is not None:
            self._service |= system if gsa.satellites else 0
            return
        for numbers_of, service in _SATELLITE_SERVICE:
            if any(n in numbers_of for n in gsa.satellites):
                self._service |= service

    def see_rmc(self, rmc: PositionSentence) -> bool:
        """
        Check whether the receiver withdraws its position.

        :return: True if it does not.
        """
        valid = rmc.quality in _STATUS
        self._void_ns = None if valid else rmc.time_ns
        self._rmc_is_valid = valid
        return valid

    def without_false_count(self, sentence: PositionSentence) -> PositionSentence:
        """Return a sentence without its count of 0 satellites if GSA and RMC contradict it."""
        if sentence.satellites != 0 or not self._rmc_is_valid:
            return sentence
        oldest = self._epoch - _GSA_EPOCHS
        used = sum(count for count, epoch in self._used.values() if epoch >= oldest)
        return sentence._replace(satellites=None) if used >= _FEWEST_SATELLITES else sentence

    def _count_used(self, gsa: GsaSentence) -> None:
        """Count the satellites of all systems; an epoch may contain one GSA for each."""
        key = gsa.talker, gsa.system
        before, epoch = self._used.get(key, (0, -1))
        if key in self._used or len(self._used) < _MOST_SYSTEMS:
            count = len(gsa.satellites) + (before if epoch == self._epoch else 0)
            self._used[key] = count, self._epoch

    def fix(self, sentence: PositionSentence) -> GnssFix:
        """Return the position of a sentence."""
        moment = sentence.time_ns
        fix = GnssFix(STATUS_NO_FIX, self._service, moment)
        if claims_fix(sentence) and sentence.position_deg and not self.is_void(moment):
            variances, kind = self._covariance(sentence, moment)
            fix = GnssFix(_STATUS[sentence.quality], self._service, moment, *sentence.position_deg,
                          _altitude(sentence), variances, kind)
        self._previous_ns = moment
        self._gsa_epochs += 1
        self._epoch += 1
        return fix

    def is_void(self, time_ns: int | None) -> bool:
        """Return whether the last RMC withdraws the position of this time of day."""
        return time_ns is not None and time_ns == self._void_ns

    def _covariance(
        self, sentence: PositionSentence, time_ns: int | None,
    ) -> tuple[tuple[float, float, float], int]:
        gst = self._gst
        if gst and gst.time_ns is not None and gst.time_ns in (time_ns, self._previous_ns):
            north, east = _deviation(gst.north_m), _deviation(gst.east_m)
            if north is not None and east is not None:
                up = _deviation(gst.up_m) or 2 * max(east, north)
                return (east * east, north * north, up * up), COVARIANCE_DIAGONAL_KNOWN
        gsa = self._gsa if self._gsa_epochs <= _GSA_EPOCHS else None
        hdop = _dilution(sentence.hdop) or (_dilution(gsa.hdop) if gsa else None)
        if hdop is None:
            return (0.0, 0.0, 0.0), COVARIANCE_UNKNOWN
        vdop = _dilution(gsa.vdop) if gsa else None
        horizontal = (hdop * self._uere_m) ** 2
        vertical = ((vdop or 2 * hdop) * self._uere_m) ** 2
        return (horizontal, horizontal, vertical), COVARIANCE_APPROXIMATED


def is_quality_of_fix(quality: int) -> bool:
    """Return whether a quality is that of a position computed from ranges."""
    return quality in _STATUS


def claims_fix(sentence: PositionSentence) -> bool:
    """Return whether the quality is that of a fix, and the count of satellites is not 0."""
    return sentence.quality in _STATUS and sentence.satellites != 0


def utc_of(rmc: PositionSentence) -> tuple[int, int] | None:
    """
    Return date and time of an RMC sentence.

    :return: seconds since 1970 and nanoseconds; None if absent or beyond ``builtin_interfaces``.
    """
    if rmc.day is None or rmc.time_ns is None:
        return None
    seconds, nanoseconds = divmod(rmc.time_ns, NS_PER_S)
    stamp = (rmc.day - _EPOCH).days * _DAY_S + seconds
    return (stamp, nanoseconds) if 0 <= stamp <= _INT32_MAX else None


def _dilution(value: float | None) -> float | None:
    return value if value is not None and 0 < value < _NO_DILUTION else None


def _deviation(value: float | None) -> float | None:
    return value if value is not None and 0 < value < _INT32_MAX else None


def _altitude(sentence: PositionSentence) -> float:
    if sentence.height_m is None or sentence.separation_m is None:
        return math.nan
    return sentence.height_m + sentence.separation_m
