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
Satellite receivers that speak NMEA 0183, as nearly all do.

One ``sensor_msgs/msg/NavSatFix`` per GGA sentence and one ``sensor_msgs/msg/TimeReference`` per
RMC sentence that has date and time and does not warn (status ``A``). How position, status, service
and covariance come about is in ``nmea_fix.py``.

A fix is published when its GGA arrives. Receivers that send RMC later may then contradict it with
the status ``V`` for the same time. The first such fix cannot be taken back; it is counted, and
from then on this receiver's fixes wait for the RMC of their time (half a second at most).

The stamps are arrivals of sentences. The position is older by what the receiver computed and sent
before it, usually 50 to 500 ms; TimeReference tells UTC and stamp of the same epoch.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from pynmeagps import NMEAReader  # type: ignore[import-untyped]

from rt_robot_os.drivers.decoders.nmea import NmeaDecoder
from rt_robot_os.drivers.decoders.nmea import NmeaFrame
from rt_robot_os.drivers.device import DeviceStatistics
from rt_robot_os.drivers.device import Publication
from rt_robot_os.drivers.nmea_fix import claims_fix
from rt_robot_os.drivers.nmea_fix import Fix
from rt_robot_os.drivers.nmea_fix import FixBuilder
from rt_robot_os.drivers.nmea_fix import STATUS_NO_FIX
from rt_robot_os.drivers.nmea_fix import time_of
from rt_robot_os.drivers.nmea_fix import utc_of
from rt_robot_os.drivers.serial_device import serial_settings
from rt_robot_os.drivers.serial_device import SerialDevice
from rt_robot_os.schema import Field
from rt_robot_os.units import NS_PER_MS

_PARSED: Final = frozenset(('GGA', 'GSA', 'GST', 'RMC'))
_MAX_WAIT_NS: Final = 500 * NS_PER_MS
_ANY_RMC: Final = b'$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A\r\n'


class NmeaGps(SerialDevice[NmeaFrame]):
    """A satellite receiver."""

    SETTINGS = serial_settings(
        baud=9600, frame_id='gps_link', topic='gps/fix', rate_hz=1.0,
    ) + (
        Field('time_topic', str, 'gps/time', 'Topic of the UTC time; empty publishes none.'),
        Field('uere_m', float, 5.0,
              'Error of one satellite range, times the dilution of precision where the receiver '
              'sends no GST. 3 to 6 m is usual for one frequency under open sky; between houses '
              'it is more.', unit='m', minimum=0.001, maximum=1000.0),
    )
    description = 'Satellite receiver with NMEA 0183 output (GPS, GLONASS, Galileo, BeiDou)'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """Keep the settings; nothing is opened."""
        super().__init__(name, settings, NmeaDecoder())
        self._builder = FixBuilder(settings['uere_m'])
        self._waiting: tuple[Fix, int] | None = None
        self._published: Fix | None = None
        self._must_wait = False
        self._contradicted = 0
        # The first parse imports modules (strptime does), which must not happen in the loop.
        _parse(_ANY_RMC)

    def publications(self) -> tuple[Publication, ...]:
        """Say what is published: NavSatFix, and TimeReference unless its topic is empty."""
        settings = self.settings
        depth, rate_hz = settings['depth'], settings['output_rate_hz']
        frame = {'header.frame_id': settings['frame_id']}
        fix = Publication(settings['topic'], 'sensor_msgs/msg/NavSatFix', frame, depth, rate_hz)
        if not settings['time_topic']:
            return (fix,)
        return (fix, Publication(settings['time_topic'], 'sensor_msgs/msg/TimeReference',
                                 {**frame, 'source': 'gps'}, depth, rate_hz))

    def restart(self) -> None:
        """Forget what the receiver said before it was opened again."""
        self._builder.restart()
        self._waiting = None
        self._published = None
        self._must_wait = False

    def handle(self, frame: NmeaFrame, arrival_ns: int) -> int:
        """Use one sentence; in the loop."""
        kind, talker = frame.address[2:], frame.address[:2]
        # An address that begins with P is a maker's own.
        used = kind in _PARSED and talker[0] != 'P'
        message = _parse(frame.sentence) if used else None
        if message is None:
            self._ignored_frames += 1
            return 0
        self._builder.see_talker(talker)
        if kind == 'GGA':
            return self._take_gga(message, arrival_ns)
        if kind == 'RMC':
            return self._take_rmc(message, arrival_ns)
        if kind == 'GST':
            self._builder.see_gst(message)
        else:
            self._builder.see_gsa(message, talker)
        return 0

    def idle(self, now_ns: int) -> int:
        """Publish a fix whose RMC does not come."""
        if self._waiting is not None and now_ns - self._waiting[1] > _MAX_WAIT_NS:
            return self._release()
        return 0

    def statistics(self) -> DeviceStatistics:
        """Give the counters as they are now."""
        return self._counters(contradicted=self._contradicted)

    def _take_gga(self, gga: Any, arrival_ns: int) -> int:
        samples = self._release()
        fix = self._builder.fix(gga)
        if claims_fix(gga) and self._builder.is_void(fix.time):
            self._contradicted += 1
        self._waiting = (fix, arrival_ns)
        if self._must_wait and fix.status != STATUS_NO_FIX:
            return samples
        return samples + self._release()

    def _take_rmc(self, rmc: Any, arrival_ns: int) -> int:
        valid = self._builder.see_rmc(rmc)
        samples = 0
        moment = time_of(rmc)
        if self._waiting is not None and moment == self._waiting[0].time:
            if not valid:
                self._contradicted += 1
                self._waiting = (self._waiting[0].withdrawn(), self._waiting[1])
            samples = self._release()
        elif self._published is not None and self._builder.is_void(self._published.time) \
                and self._published.status != STATUS_NO_FIX:
            self._contradicted += 1
            self._must_wait = True
        utc = utc_of(rmc) if valid and len(self._publishers) > 1 else None
        if utc is not None:
            self._publish_time(*utc, arrival_ns)
            samples += 1
        return samples

    def _release(self) -> int:
        if self._waiting is None:
            return 0
        self._published, arrival_ns = self._waiting
        self._waiting = None
        self._publish_fix(self._published, arrival_ns)
        return 1

    def _publish_fix(self, fix: Fix, stamp_ns: int) -> None:
        publisher = self._publishers[0]
        msg = publisher.msg
        msg.status.status = fix.status
        msg.status.service = fix.service
        msg.latitude = fix.latitude_deg
        msg.longitude = fix.longitude_deg
        msg.altitude = fix.altitude_m
        covariance = msg.position_covariance
        covariance[:] = 0.0
        covariance[0], covariance[4], covariance[8] = fix.variances_m2
        msg.position_covariance_type = fix.covariance_type
        publisher.publish(stamp_ns)

    def _publish_time(self, seconds: int, nanoseconds: int, stamp_ns: int) -> None:
        publisher = self._publishers[1]
        publisher.msg.time_ref.sec = seconds
        publisher.msg.time_ref.nanosec = nanoseconds
        publisher.publish(stamp_ns)


def _parse(sentence: bytes) -> Any:
    """Parse a sentence whose checksum is good; None when its content makes no sense."""
    try:
        return NMEAReader.parse(sentence)
    except Exception:  # noqa: B902 - whatever it raises, bytes from outside must not stop the loop
        return None
