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
Parse the sentences of a satellite receiver: GGA, GNS, RMC, GLL, GSA and GST.

Unknown fields are empty, and an invalid number counts as empty: only plain decimal digits are a
number (not ``nan``, ``inf``, ``1_0``, ``1e9``). A sentence without its fields, or with an invalid
quality, is rejected.

The four that contain a position state its origin in four ways. The result always has the quality
of GGA; the mode letters of the others (NMEA 2.3 and later) are translated to it.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from datetime import date
import re
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S

# Quality of a GGA sentence.
NO_FIX: Final = 0
AUTONOMOUS: Final = 1
DIFFERENTIAL: Final = 2
PRECISE: Final = 3
RTK_FIXED: Final = 4
RTK_FLOAT: Final = 5
DEAD_RECKONING: Final = 6
TYPED_IN: Final = 7
SIMULATED: Final = 8
# Some receivers: corrections of a satellite-based system.
SBAS: Final = 9

# The mode letters of the other sentences, the best first.
_QUALITY_OF_MODE: Final = {
    'R': RTK_FIXED, 'F': RTK_FLOAT, 'P': PRECISE, 'D': DIFFERENTIAL, 'A': AUTONOMOUS,
    'E': DEAD_RECKONING, 'M': TYPED_IN, 'S': SIMULATED, 'N': NO_FIX}

# Bounded, so that parsing a number is fast and cannot overflow.
_NUMBER: Final = re.compile(r'[+-]?(?:\d{1,12}(?:\.\d{0,12})?|\.\d{1,12})', re.ASCII).fullmatch
_INTEGER: Final = re.compile(r'[+-]?\d{1,6}', re.ASCII).fullmatch
_CLOCK: Final = re.compile(r'(\d\d)(\d\d)(\d\d)(?:\.(\d{0,12}))?', re.ASCII).fullmatch
_DATE: Final = re.compile(r'(\d\d)(\d\d)(\d\d)', re.ASCII).fullmatch
# Degrees, then two digits of minutes and their fraction; leading zeros may be missing.
_ANGLE: Final = re.compile(r'(\d{1,3})(\d\d(?:\.\d{0,12})?)', re.ASCII).fullmatch
# Some receivers round 59.99999 minutes to 60.
_MOST_MINUTES: Final = 60.0
# Two-digit years from here on are in the last century: GPS began in 1980.
_CENTURY: Final = 80
_SATELLITES: Final = 12


class PositionSentence(NamedTuple):
    """
    A sentence with a position; None for empty fields.

    :ivar kind: ``GGA``, ``GNS``, ``RMC`` or ``GLL``.
    :ivar talker: the two characters before that.
    :ivar time_ns: UTC time of day, which identifies the epoch.
    :ivar position_deg: latitude and longitude, north and east positive.
    :ivar quality: as in GGA, whatever the kind.
    :ivar satellites: number used.
    :ivar hdop: horizontal dilution of precision.
    :ivar height_m: above mean sea level.
    :ivar separation_m: of the geoid from the ellipsoid.
    :ivar warns: the status of an RMC or GLL is not ``A``.
    :ivar day: of an RMC.
    """

    kind: str
    talker: str
    time_ns: int | None
    position_deg: tuple[float, float] | None
    quality: int
    satellites: int | None = None
    hdop: float | None = None
    height_m: float | None = None
    separation_m: float | None = None
    warns: bool = False
    day: date | None = None


class GsaSentence(NamedTuple):
    """
    The satellites that are used; None for what is empty.

    :ivar system: NMEA 4.10 number of the system, empty before.
    """

    talker: str
    satellites: tuple[int, ...]
    hdop: float | None
    vdop: float | None
    system: str


class GstSentence(NamedTuple):
    """Standard deviations of the position; None for what is empty."""

    talker: str
    time_ns: int | None
    north_m: float | None
    east_m: float | None
    up_m: float | None


Sentence = PositionSentence | GsaSentence | GstSentence
_Fields = Sequence[str]


def parse(content: str) -> Sentence | None:
    """
    Read a sentence; safe in the loop, never raises.

    :param content: what stands between ``$`` and ``*``.
    :return: None when it is of another kind, of one maker alone, or too short.
    """
    fields = content.split(',')
    address = fields[0]
    reader = _READERS.get(address[2:])
    # An address that begins with P is proprietary.
    if reader is None or len(address) != 5 or address[0] == 'P':
        return None
    shortest, read = reader
    return read(address[:2], fields) if len(fields) >= shortest else None


def _gga(talker: str, fields: _Fields) -> PositionSentence | None:
    quality = _integer(fields[6]) if fields[6] else NO_FIX
    if quality is None:
        return None
    return PositionSentence(
        'GGA', talker, _time_ns(fields[1]), _position(fields[2:6]), quality,
        _integer(_field(fields, 7)), _number(_field(fields, 8)), _metres(fields, 9),
        _metres(fields, 11))


def _gns(talker: str, fields: _Fields) -> PositionSentence | None:
    # One letter for each system; the best one determines the quality.
    modes = fields[6]
    quality = next((q for letter, q in _QUALITY_OF_MODE.items() if letter in modes), NO_FIX)
    return PositionSentence(
        'GNS', talker, _time_ns(fields[1]), _position(fields[2:6]), quality,
        _integer(_field(fields, 7)), _number(_field(fields, 8)), _number(_field(fields, 9)),
        _number(_field(fields, 10)))


def _rmc(talker: str, fields: _Fields) -> PositionSentence | None:
    warns = fields[2] != 'A'
    return PositionSentence(
        'RMC', talker, _time_ns(fields[1]), _position(fields[3:7]),
        _quality(warns, _field(fields, 12)), warns=warns, day=_day(_field(fields, 9)))


def _gll(talker: str, fields: _Fields) -> PositionSentence | None:
    # Before NMEA 2.0 it had neither time nor status.
    warns = _field(fields, 6, 'A') != 'A'
    return PositionSentence(
        'GLL', talker, _time_ns(_field(fields, 5)), _position(fields[1:5]),
        _quality(warns, _field(fields, 7)), warns=warns)


def _gsa(talker: str, fields: _Fields) -> GsaSentence | None:
    used = map(_integer, fields[3:3 + _SATELLITES])
    return GsaSentence(talker, tuple(n for n in used if n is not None), _number(fields[16]),
                       _number(fields[17]), _field(fields, 18))


def _gst(talker: str, fields: _Fields) -> GstSentence | None:
    return GstSentence(talker, _time_ns(fields[1]), _number(fields[6]), _number(fields[7]),
                       _number(_field(fields, 8)))


# Kind -> number of its fields, including the address, and its parser.
_READERS: Final[dict[str, tuple[int, Callable[[str, _Fields], Sentence | None]]]] = {
    'GGA': (7, _gga), 'GNS': (7, _gns), 'RMC': (7, _rmc), 'GLL': (5, _gll), 'GSA': (18, _gsa),
    'GST': (8, _gst)}


def _field(fields: _Fields, index: int, absent: str = '') -> str:
    return fields[index] if index < len(fields) else absent


def _quality(warns: bool, mode: str) -> int:
    """Return the quality of a sentence with a status; before NMEA 2.3 it has no mode."""
    if warns:
        return NO_FIX
    return _QUALITY_OF_MODE.get(mode, AUTONOMOUS)


def _number(text: str) -> float | None:
    return float(text) if _NUMBER(text) else None


def _integer(text: str) -> int | None:
    return int(text) if _INTEGER(text) else None


def _metres(fields: _Fields, index: int) -> float | None:
    """Parse a length, followed by its unit; only metres are valid."""
    return _number(_field(fields, index)) if _field(fields, index + 1) == 'M' else None


def _position(fields: _Fields) -> tuple[float, float] | None:
    """Parse latitude, N or S, longitude, E or W."""
    latitude = _degrees(fields[0], fields[1], 'NS', 90.0)
    longitude = _degrees(fields[2], fields[3], 'EW', 180.0)
    return None if latitude is None or longitude is None else (latitude, longitude)


def _degrees(text: str, letter: str, letters: str, limit: float) -> float | None:
    match = _ANGLE(text)
    if match is None or len(letter) != 1 or letter not in letters:
        return None
    minutes = float(match[2])
    degrees = int(match[1]) + minutes / 60
    if minutes > _MOST_MINUTES or degrees > limit:
        return None
    return degrees if letter == letters[0] else -degrees


def _time_ns(text: str) -> int | None:
    """Parse ``hhmmss.s``; a leap second, 60, is not a time of day."""
    match = _CLOCK(text)
    if match is None:
        return None
    hours, minutes, seconds = int(match[1]), int(match[2]), int(match[3])
    if hours > 23 or minutes > 59 or seconds > 59:
        return None
    fraction = int(((match[4] or '') + '0' * 9)[:9])
    return ((hours * 60 + minutes) * 60 + seconds) * NS_PER_S + fraction


def _day(text: str) -> date | None:
    match = _DATE(text)
    if match is None:
        return None
    year = int(match[3])
    try:
        return date(year + (1900 if year >= _CENTURY else 2000), int(match[2]), int(match[1]))
    except ValueError:
        return None
