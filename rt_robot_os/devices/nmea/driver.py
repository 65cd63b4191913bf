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
Satellite receivers with NMEA 0183, which nearly all support.

One ``sensor_msgs/msg/NavSatFix`` per epoch, from GGA, otherwise GNS, RMC or GLL, and one
``sensor_msgs/msg/TimeReference`` per RMC sentence that has date and time and does not warn (status
``A``). ``fix_source.py`` selects the sentence; ``fix.py`` derives position, status, service and
covariance.

A fix is published when its sentence arrives. Receivers that send RMC later may then contradict it
with the status ``V`` for the same time. The first such fix cannot be withdrawn; it is counted, and
from then on this receiver's fixes wait for the RMC of their time (half a second at most).

The stamps are arrivals of sentences. The position is older by the time of computing and sending,
usually 50 to 500 ms; TimeReference contains UTC and stamp of the same epoch.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.nmea.fix import claims_fix
from rt_robot_os.devices.nmea.fix import FixBuilder
from rt_robot_os.devices.nmea.fix import GnssFix
from rt_robot_os.devices.nmea.fix import STATUS_NO_FIX
from rt_robot_os.devices.nmea.fix import utc_of
from rt_robot_os.devices.nmea.fix_source import NmeaFixSource
from rt_robot_os.devices.nmea.sentences import GsaSentence
from rt_robot_os.devices.nmea.sentences import GstSentence
from rt_robot_os.devices.nmea.sentences import parse
from rt_robot_os.devices.nmea.sentences import PositionSentence
from rt_robot_os.devices.nmea.wire import NmeaDecoder
from rt_robot_os.devices.nmea.wire import NmeaFrame
from rt_robot_os.devices.serial.device import serial_settings
from rt_robot_os.devices.serial.device import SerialDevice

_MAX_WAIT_NS: Final = 500 * NS_PER_MS
# Limit of the addresses of unused sentences that are kept, to report them.
_MOST_ADDRESSES: Final = 6


class NmeaGps(SerialDevice[NmeaFrame]):
    """A satellite receiver."""

    SETTINGS = serial_settings(
        baud=9600, frame_id='gps_link', topic='gps/fix', rate_hz=1.0,
    ) + (
        Field('time_topic', str, 'gps/time', 'Topic of the UTC time; empty publishes none.'),
        Field('uere_m', float, 5.0,
              'Error of one satellite range, which is multiplied by the dilution of precision if '
              'the receiver sends no GST. 3 to 6 m is usual for one frequency under open sky; '
              'between houses it is more.', unit='m', minimum=0.001, maximum=1000.0),
    )
    description = 'Satellite receiver with NMEA 0183 output (GPS, GLONASS, Galileo, BeiDou)'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """Store the settings; nothing is opened."""
        super().__init__(name, settings, NmeaDecoder())
        self._builder = FixBuilder(settings['uere_m'])
        self._source = NmeaFixSource()
        self._waiting: tuple[GnssFix, int] | None = None
        self._published: GnssFix | None = None
        self._must_wait = False
        self._contradicted = 0
        self._utc: tuple[str, tuple[int, int]] | None = None
        self._others: set[str] = set()

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications: NavSatFix, and TimeReference unless its topic is empty."""
        settings = self.settings
        depth, rate_hz = settings['depth'], settings['output_rate_hz']
        frame = {'header.frame_id': settings['frame_id']}
        fix = TopicSpec(settings['topic'], 'sensor_msgs/msg/NavSatFix', frame, depth, rate_hz)
        if not settings['time_topic']:
            return (fix,)
        return (fix, TopicSpec(settings['time_topic'], 'sensor_msgs/msg/TimeReference',
                               {**frame, 'source': 'gps'}, depth, rate_hz))

    def restart(self) -> None:
        """Reset the state from before it was reopened."""
        self._builder.restart()
        self._source.restart()
        self._waiting = None
        self._published = None
        self._must_wait = False
        self._utc = None
        self._others.clear()

    def handle(self, frame: NmeaFrame, arrival_ns: int) -> int:
        """Handle one sentence; in the loop."""
        sentence = parse(frame.content)
        if sentence is None:
            self._ignored_frames += 1
            if len(self._others) < _MOST_ADDRESSES:
                self._others.add(frame.address)
            return 0
        self._builder.see_talker(sentence.talker)
        if isinstance(sentence, GstSentence):
            self._builder.see_gst(sentence)
            return 0
        if isinstance(sentence, GsaSentence):
            self._builder.see_gsa(sentence)
            return 0
        samples = self._take_rmc(sentence, arrival_ns) if sentence.kind == 'RMC' else 0
        sentence = self._builder.without_false_count(sentence)
        chosen = self._source.take(sentence, arrival_ns)
        if not chosen and self._source.is_known and sentence.kind != 'RMC':
            self._ignored_frames += 1
        return samples + sum(self._take_position(*each) for each in chosen)

    def idle(self, now_ns: int) -> int:
        """Publish a fix whose RMC is missing, and sentences that were held for a better one."""
        samples = sum(self._take_position(*each) for each in self._source.idle(now_ns))
        if self._waiting is not None and now_ns - self._waiting[1] > _MAX_WAIT_NS:
            samples += self._release()
        return samples

    def unused(self) -> str:
        """Return which sentences arrived."""
        return (f'it sends {", ".join(sorted(self._others)) or "nothing"} but none of GGA, GNS, '
                'RMC and GLL, which contain a position: enable one of them in the receiver; if it '
                'is another device, choose its driver')

    def statistics(self) -> DeviceStatistics:
        """Return the current counters."""
        return self._counters(contradicted=self._contradicted)

    def _take_position(self, sentence: PositionSentence, arrival_ns: int) -> int:
        samples = self._release()
        fix = self._builder.fix(sentence)
        if claims_fix(sentence) and self._builder.is_void(fix.time_ns):
            self._contradicted += 1
        self._waiting = (fix, arrival_ns)
        if self._must_wait and fix.status != STATUS_NO_FIX and sentence.kind != 'RMC':
            return samples
        return samples + self._release()

    def _take_rmc(self, rmc: PositionSentence, arrival_ns: int) -> int:
        valid = self._builder.see_rmc(rmc)
        samples = 0
        if self._waiting is not None and rmc.time_ns == self._waiting[0].time_ns:
            if not valid:
                self._contradicted += 1
                self._waiting = (self._waiting[0].withdrawn(), self._waiting[1])
            samples = self._release()
        elif self._published is not None and self._builder.is_void(self._published.time_ns) \
                and self._published.status != STATUS_NO_FIX:
            self._contradicted += 1
            self._must_wait = True
        if len(self._publishers) > 1 and not rmc.warns:
            samples += self._take_utc(rmc, arrival_ns)
        return samples

    def _take_utc(self, rmc: PositionSentence, arrival_ns: int) -> int:
        """Publish the time, once if two talkers send it."""
        utc = utc_of(rmc)
        if utc is None:
            return 0
        before, self._utc = self._utc, (rmc.talker, utc)
        if before is not None and before[1] == utc and before[0] != rmc.talker:
            return 0
        publisher = self._publishers[1]
        publisher.msg.time_ref.sec, publisher.msg.time_ref.nanosec = utc
        publisher.publish(arrival_ns)
        return 1

    def _release(self) -> int:
        if self._waiting is None:
            return 0
        self._published, arrival_ns = self._waiting
        self._waiting = None
        self._publish_fix(self._published, arrival_ns)
        return 1

    def _publish_fix(self, fix: GnssFix, stamp_ns: int) -> None:
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
