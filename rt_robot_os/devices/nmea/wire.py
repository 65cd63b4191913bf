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
NMEA 0183 framing: ``$``, at most 200 characters, ``*``, the XOR of what is between, a line end.

The standard ends a line with CR LF and limits it to 82 characters. Some receivers send longer
ones, recordings often have lost their CR, and some programs write CR CR LF: all three are
accepted.

Sentences for simulated receivers and tests are encoded here as well.
"""

from __future__ import annotations

from datetime import datetime
from functools import reduce
import operator
import re
from typing import Final
from typing import NamedTuple

from rt_robot_os.devices.framing import FrameDecoder


# "$X*58\n" is the shortest.
MIN_SENTENCE: Final = 6
MAX_SENTENCE: Final = 200

# A sentence, or its part before the end of the buffer.
SENTENCE: Final = rb'\$(?:[ -#%-)+-~]+(?:\*(?:[0-9A-Fa-f]{2}(?:\r{0,2}(?:\n|\Z))|' \
                  rb'[0-9A-Fa-f]?\Z)|\Z)|\Z)'
_MATCH: Final = re.compile(SENTENCE).match
_LINE_FEED: Final = 10
# Sentences of satellite receivers; other devices, such as VectorNav's, send sentences too.
_OF_RECEIVERS: Final = frozenset(('GGA', 'GNS', 'RMC', 'GLL', 'GSA', 'GSV', 'GST', 'VTG', 'ZDA',
                                  'TXT', 'GBS', 'DTM'))


class NmeaFrame(NamedTuple):
    """
    One sentence with a valid checksum.

    :ivar sentence: its bytes, from ``$`` to the line end.
    :ivar content: the characters between ``$`` and ``*``.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    sentence: bytes
    content: str
    end: int

    @property
    def address(self) -> str:
        """Return the characters before the first comma, such as ``GPGGA``."""
        return self.content.partition(',')[0]


def sentence_end(buffer: bytes, at: int) -> int:
    """
    Return where the sentence that begins at an index ends.

    :return: index just after its line end, one behind the buffer while it may continue, or 0 if
        none begins here. The caller checks the length.
    """
    match = _MATCH(buffer, at)
    if match is None:
        return 0
    end = match.end()
    if buffer[end - 1] == _LINE_FEED:
        return end
    return at + MAX_SENTENCE if len(buffer) - at < MAX_SENTENCE else 0


def checked(sentence: bytes) -> bytes | None:
    """Return the characters between ``$`` and ``*``; None if the checksum is wrong."""
    content, _, checksum = sentence[1:].partition(b'*')
    return content if xor(content) == int(checksum[:2], 16) else None


def xor(content: bytes) -> int:
    """Return the NMEA checksum of the characters between ``$`` and ``*``."""
    return reduce(operator.xor, content, 0)


class NmeaDecoder(FrameDecoder[NmeaFrame]):
    """Find the sentences in a stream of bytes; safe in the loop, keeps less than 200 bytes."""

    STARTS = b'$'
    SHORTEST = MIN_SENTENCE
    LONGEST = MAX_SENTENCE
    PATTERN = SENTENCE

    end = staticmethod(sentence_end)

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> NmeaFrame | None:
        """Decode a sentence with a valid checksum."""
        sentence = buffer[at:end]
        content = checked(sentence)
        if content is None:
            return None
        return NmeaFrame(sentence, content.decode('ascii'), arrived)


# ---- encoding ---------------------------------------------------------------------------------

def sentence(content: str) -> bytes:
    """Encode a sentence from the characters between ``$`` and ``*``."""
    data = content.encode('ascii')
    return b'$%s*%02X\r\n' % (data, xor(data))


def gga(
    time: datetime, latitude_deg: float, longitude_deg: float, *, quality: int = 1,
    satellites: int = 8, hdop: float = 0.9, altitude_m: float = 0.0, separation_m: float = 0.0,
) -> bytes:
    """
    Encode a position sentence.

    :param altitude_m: above mean sea level.
    :param separation_m: of the geoid above the ellipsoid.
    """
    return sentence(
        f'GPGGA,{_time(time)},{_position(latitude_deg, longitude_deg)},{quality},'
        f'{satellites:02d},{hdop:.1f},{altitude_m:.2f},M,{separation_m:.1f},M,,')


def rmc(
    time: datetime, latitude_deg: float, longitude_deg: float, *, valid: bool = True,
    speed_m_s: float = 0.0, course_deg: float = 0.0,
) -> bytes:
    """Encode a sentence of time, date, speed and course (clockwise from north)."""
    knots = speed_m_s * 3600 / 1852
    return sentence(
        f'GPRMC,{_time(time)},{"A" if valid else "V"},{_position(latitude_deg, longitude_deg)},'
        f'{knots:.2f},{course_deg % 360:.1f},{time:%d%m%y},,,{"A" if valid else "N"}')


def gns(
    time: datetime, latitude_deg: float, longitude_deg: float, *, mode: str = 'AA',
    satellites: int = 8, hdop: float = 0.9, altitude_m: float = 0.0, separation_m: float = 0.0,
) -> bytes:
    """
    Encode a position sentence of several systems.

    :param mode: a letter for each system, such as ``A`` (alone), ``D`` (corrected), ``N`` (none).
    """
    return sentence(
        f'GNGNS,{_time(time)},{_position(latitude_deg, longitude_deg)},{mode},{satellites:02d},'
        f'{hdop:.1f},{altitude_m:.2f},{separation_m:.1f},,')


def gll(time: datetime, latitude_deg: float, longitude_deg: float, *, valid: bool = True) -> bytes:
    """Encode a sentence with only position and time."""
    status = 'A,A' if valid else 'V,N'
    return sentence(f'GPGLL,{_position(latitude_deg, longitude_deg)},{_time(time)},{status}')


def gsa(satellites: tuple[int, ...], pdop: float, hdop: float, vdop: float) -> bytes:
    """Encode the sentence of the satellites used, at most twelve, in a three-dimensional fix."""
    used = [f'{number:02d}' for number in satellites[:12]]
    used += [''] * (12 - len(used))
    return sentence(f'GPGSA,A,3,{",".join(used)},{pdop:.1f},{hdop:.1f},{vdop:.1f}')


def gst(time: datetime, rms_m: float, north_m: float, east_m: float, up_m: float) -> bytes:
    """Encode the sentence of the standard deviations of the position, without error ellipse."""
    return sentence(f'GPGST,{_time(time)},{rms_m:.1f},,,,{north_m:.2f},{east_m:.2f},{up_m:.2f}')


def _time(time: datetime) -> str:
    return f'{time:%H%M%S}.{time.microsecond // 10_000:02d}'


def _position(latitude_deg: float, longitude_deg: float) -> str:
    latitude, longitude = _degrees_minutes(latitude_deg, 2), _degrees_minutes(longitude_deg, 3)
    north = 'S' if latitude_deg < 0 else 'N'
    east = 'W' if longitude_deg < 0 else 'E'
    return f'{latitude},{north},{longitude},{east}'


def _degrees_minutes(degrees: float, digits: int) -> str:
    # Rounded as a whole, so that 59.999999 minutes become the next degree.
    whole, minutes = divmod(round(abs(degrees) * 60 * 10**5), 60 * 10**5)
    return f'{whole:0{digits}d}{minutes / 10**5:08.5f}'


def is_sentences(data: bytes) -> bool:
    """Return whether some bytes contain a sentence."""
    return bool(NmeaDecoder().feed(data))


def is_of_receiver(data: bytes) -> bool:
    """Return whether some bytes contain a sentence of a satellite receiver."""
    return any(frame.address[2:] in _OF_RECEIVERS for frame in NmeaDecoder().feed(data))
