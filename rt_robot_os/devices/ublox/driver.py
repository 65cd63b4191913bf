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
u-blox satellite receivers with UBX output, from the NAV-PVT message.

One message contains the whole epoch, so position, velocity and time belong together and nothing
waits: ``sensor_msgs/msg/NavSatFix``, velocity as ``geometry_msgs/msg/TwistWithCovarianceStamped``
(x east, y north, z up) and ``sensor_msgs/msg/TimeReference``. NMEA sentences on the same line are
counted but not used.

Rules: without ``gnssFixOK``, with dead reckoning alone, or with a position flagged as invalid,
there is no fix and the position is NaN. The altitude of a two-dimensional fix is NaN. Carrier
phase solutions are GBAS, other corrections SBAS. Accuracies are the receiver's own estimates, one
standard deviation. NAV-PVT does not contain the systems in use: set ``services``.

With ``high_precision`` the position of a fix is that of NAV-HPPOSLLH of the same epoch (iTOW), and
its quality that of NAV-PVT; a fix whose NAV-HPPOSLLH does not arrive within half a period is
published with the position of NAV-PVT. RTCM 3 corrections are forwarded to the receiver.

The stamp is the arrival of NAV-PVT. The position is older by the time of computing and sending;
TimeReference contains UTC and stamp of the same epoch.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from datetime import datetime
from datetime import timezone
import math
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import period_from_rate
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.device import SamplePublisher
from rt_robot_os.devices.device import Value
from rt_robot_os.devices.nmea.fix import COVARIANCE_DIAGONAL_KNOWN
from rt_robot_os.devices.nmea.fix import COVARIANCE_UNKNOWN
from rt_robot_os.devices.nmea.fix import SERVICE_COMPASS
from rt_robot_os.devices.nmea.fix import SERVICE_GALILEO
from rt_robot_os.devices.nmea.fix import SERVICE_GLONASS
from rt_robot_os.devices.nmea.fix import SERVICE_GPS
from rt_robot_os.devices.nmea.fix import STATUS_FIX
from rt_robot_os.devices.nmea.fix import STATUS_GBAS_FIX
from rt_robot_os.devices.nmea.fix import STATUS_NO_FIX
from rt_robot_os.devices.nmea.fix import STATUS_SBAS_FIX
from rt_robot_os.devices.nmea.wire import gga
from rt_robot_os.devices.serial.device import serial_settings
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.ublox import wire
from rt_robot_os.devices.ublox.corrections import RtcmCorrections
from rt_robot_os.devices.ublox.setup import UbloxSetup
from rt_robot_os.devices.ublox.wire import HighPrecision
from rt_robot_os.devices.ublox.wire import NavPvt
from rt_robot_os.devices.ublox.wire import UbxDecoder
from rt_robot_os.devices.ublox.wire import UbxFrame

_SERVICES: Final = {'gps': SERVICE_GPS, 'glonass': SERVICE_GLONASS, 'galileo': SERVICE_GALILEO,
                    'beidou': SERVICE_COMPASS}
_DEGREES: Final = 1e-7
_METRES: Final = 1e-3
# The receiver's value for an unknown accuracy.
_NO_ACCURACY_MM: Final = 10_000_000
_INT32_MAX: Final = 2**31 - 1
_ANGULAR: Final = (21, 28, 35)


class Ublox(SerialDevice[UbxFrame]):
    """A u-blox receiver."""

    SETTINGS = serial_settings(
        baud=38400, frame_id='gps_link', topic='gps/fix', rate_hz=1.0,
    ) + (
        Field('velocity_topic', str, 'gps/velocity',
              'Topic of the velocity, east, north, up; empty publishes none.'),
        Field('time_topic', str, 'gps/time', 'Topic of the UTC time; empty publishes none.'),
        Field('services', list, (),
              'Satellite systems that the receiver is set to use; its message does not contain '
              'them. Empty: unknown.', choices=tuple(_SERVICES)),
        Field('configure', bool, False,
              'Set NAV-PVT and the output rate at opening, with CFG-VALSET, or with CFG-MSG and '
              'CFG-RATE if the receiver is older than generation 9; not saved in the receiver.'),
        Field('high_precision', bool, False,
              'Use the position of NAV-HPPOSLLH, with 1e-9 degrees and 0.1 mm, which RTK '
              'receivers send.'),
        Field('corrections', str, '',
              'Source of RTCM 3 corrections: a port in the same form as that of the device, or '
              'ntrip://user:password@host:2101/MOUNT; empty for none.'),
        Field('corrections_baud', int, 115200, 'Speed of the serial line of the corrections.',
              unit='bit/s', minimum=0, maximum=4_000_000),
    )
    description = 'u-blox satellite receiver, UBX NAV-PVT: position, velocity, time'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """Store the settings; nothing is opened."""
        super().__init__(name, settings, UbxDecoder())
        self._service = sum(_SERVICES[each] for each in set(settings['services']))
        self._velocity_at = 1 if settings['velocity_topic'] else 0
        self._time_at = 1 + self._velocity_at if settings['time_topic'] else 0
        self._sentences = False
        self._setup: UbloxSetup | None = None
        self._high_precision: bool = settings['high_precision']
        self._half_period_ns = period_from_rate(settings['output_rate_hz']) // 2
        # The epoch whose fix waits for its NAV-HPPOSLLH, and a NAV-HPPOSLLH that arrived first.
        self._waiting: NavPvt | None = None
        self._waiting_ns = 0
        self._ahead: HighPrecision | None = None
        self._without_high_precision = 0
        self._latest: NavPvt | None = None
        self._corrections: RtcmCorrections | None = None
        if settings['corrections']:
            self._corrections = RtcmCorrections(
                name, settings['corrections'], settings['corrections_baud'], self.log,
                self._gga)

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications: NavSatFix, and velocity and time with a topic."""
        settings = self.settings
        depth, rate_hz = settings['depth'], settings['output_rate_hz']
        frame = {'header.frame_id': settings['frame_id']}
        found = [TopicSpec(settings['topic'], 'sensor_msgs/msg/NavSatFix', frame, depth,
                           rate_hz)]
        if settings['velocity_topic']:
            found.append(TopicSpec(
                settings['velocity_topic'], 'geometry_msgs/msg/TwistWithCovarianceStamped', frame,
                depth, rate_hz))
        if settings['time_topic']:
            found.append(TopicSpec(settings['time_topic'], 'sensor_msgs/msg/TimeReference',
                                   {**frame, 'source': 'gps'}, depth, rate_hz))
        return tuple(found)

    def bind(self, publishers: Sequence[SamplePublisher]) -> None:
        """
        Bind the publishers, and look up the hosts of the ports.

        :raises TopicError: their number is not that of the publications.
        """
        super().bind(publishers)
        if self._corrections is not None and self.is_live:
            self._corrections.prepare()

    def restart(self) -> None:
        """Start the set-up if it is configured."""
        self._waiting = self._ahead = None
        settings = self.settings
        self._setup = UbloxSetup(
            self.name, settings['output_rate_hz'], high_precision=self._high_precision,
            corrections=self._corrections is not None) if settings['configure'] else None

    def is_set_up(self) -> bool:
        """Return whether the set-up is done."""
        return self._setup is None or self._setup.done

    def close(self) -> None:
        """Close the ports; may be called twice and does not raise."""
        super().close()
        if self._corrections is not None:
            self._corrections.close()

    def write(self, now_ns: int) -> None:
        """
        Send the next command of the set-up if due, or corrections that have arrived.

        :raises DeviceError: the port is gone, or the device does not answer or refuses.
        """
        if self._setup is not None and not self._setup.done:
            data = self._setup.due(now_ns)
            if data is not None:
                self.send(data)
        elif self._corrections is not None:
            message = self._corrections.take()
            while message:
                self.send(message)
                message = self._corrections.take()

    def maintain(self, now_ns: int) -> None:
        """Read the corrections; at low priority."""
        if self._corrections is not None and self.is_live:
            self._corrections.maintain(now_ns)

    def handle(self, frame: UbxFrame, arrival_ns: int) -> int:
        """Handle one message; in the loop."""
        if frame.kind == wire.NAV:
            if frame.identifier == wire.PVT:
                pvt = wire.nav_pvt(frame.payload)
                if pvt is not None:
                    return self._begin_epoch(pvt, arrival_ns)
            elif frame.identifier == wire.HPPOSLLH and self._high_precision:
                precise = wire.high_precision(frame.payload)
                if precise is not None:
                    return self._complete_epoch(precise)
        if self._setup is None or not self._setup.handle(frame):
            self._ignored_frames += 1
            self._sentences = frame.kind == wire.NMEA
        return 0

    def unused(self) -> str:
        """Return that it sends something else than NAV-PVT."""
        what = 'NMEA sentences' if self._sentences else 'other UBX messages'
        return (f'it sends {what} and no NAV-PVT: set configure: true, enable NAV-PVT with '
                'u-center, or choose type: nmea')

    def idle(self, now_ns: int) -> int:
        """Publish a fix whose NAV-HPPOSLLH has not arrived; in the loop."""
        if self._waiting is not None and now_ns - self._waiting_ns > self._half_period_ns:
            return self._publish_coarse()
        return 0

    def statistics(self) -> DeviceStatistics:
        """Return the current counters."""
        more: dict[str, Value] = {}
        if self._high_precision:
            more['fixes_without_high_precision'] = self._without_high_precision
        if self._corrections is not None:
            more.update(self._corrections.report(self.clock_ns()))
        return self._counters(more=more)

    def _begin_epoch(self, pvt: NavPvt, arrival_ns: int) -> int:
        self._latest = pvt
        samples = self._publish_coarse() if self._waiting is not None else 0
        ahead, self._ahead = self._ahead, None
        if not self._high_precision or not pvt.has_fix:
            samples += self._publish_fix(pvt, None, arrival_ns)
        elif ahead is not None and ahead.tow_ms == pvt.tow_ms:
            samples += self._publish_fix(pvt, ahead, arrival_ns)
        else:
            self._waiting, self._waiting_ns = pvt, arrival_ns
        return samples + self._publish_rest(pvt, arrival_ns)

    def _complete_epoch(self, precise: HighPrecision) -> int:
        pvt = self._waiting
        if pvt is None or pvt.tow_ms != precise.tow_ms:
            self._ahead = precise
            return 0
        self._waiting = None
        return self._publish_fix(pvt, precise, self._waiting_ns)

    def _gga(self) -> bytes:
        """Return the position for a caster; not in the loop."""
        pvt = self._latest
        utc = _utc(pvt) if pvt is not None and pvt.has_fix else None
        if pvt is None or utc is None:
            return b''
        return gga(datetime.fromtimestamp(utc[0], timezone.utc), pvt.latitude * _DEGREES,
                   pvt.longitude * _DEGREES, satellites=min(pvt.satellites, 99),
                   altitude_m=pvt.sea_height_mm * _METRES,
                   separation_m=(pvt.height_mm - pvt.sea_height_mm) * _METRES)

    def _publish_coarse(self) -> int:
        pvt, self._waiting = self._waiting, None
        if pvt is None:
            return 0
        self._without_high_precision += 1
        self.log.warn('no NAV-HPPOSLLH arrived for a fix: set configure: true, or enable it with '
                      'u-center', throttle_s=60.0)
        return self._publish_fix(pvt, None, self._waiting_ns)

    def _publish_fix(self, pvt: NavPvt, precise: HighPrecision | None, arrival_ns: int) -> int:
        publisher = self._publishers[0]
        self._fill_fix(publisher.msg, pvt)
        if precise is not None and precise.valid and pvt.has_fix:
            _refine(publisher.msg, precise, pvt.fix_type != wire.FIX_2D)
        publisher.publish(arrival_ns)
        return 1

    def _publish_rest(self, pvt: NavPvt, arrival_ns: int) -> int:
        samples = 0
        if self._velocity_at and pvt.has_fix:
            publisher = self._publishers[self._velocity_at]
            _fill_velocity(publisher.msg.twist, pvt)
            publisher.publish(arrival_ns)
            samples += 1
        utc = _utc(pvt) if self._time_at else None
        if utc is not None:
            publisher = self._publishers[self._time_at]
            publisher.msg.time_ref.sec, publisher.msg.time_ref.nanosec = utc
            publisher.publish(arrival_ns)
            samples += 1
        return samples

    def _fill_fix(self, msg: Any, pvt: NavPvt) -> None:
        msg.status.service = self._service
        covariance = msg.position_covariance
        covariance[:] = 0.0
        latitude, longitude = pvt.latitude * _DEGREES, pvt.longitude * _DEGREES
        if not pvt.has_fix or abs(latitude) > 90 or abs(longitude) > 180:
            msg.status.status = STATUS_NO_FIX
            msg.latitude = msg.longitude = msg.altitude = math.nan
            msg.position_covariance_type = COVARIANCE_UNKNOWN
            return
        msg.status.status = _status(pvt)
        msg.latitude = latitude
        msg.longitude = longitude
        msg.altitude = math.nan if pvt.fix_type == wire.FIX_2D else pvt.height_mm * _METRES
        if 0 < pvt.horizontal_accuracy_mm < _NO_ACCURACY_MM:
            horizontal = (pvt.horizontal_accuracy_mm * _METRES) ** 2
            covariance[0] = covariance[4] = horizontal
            covariance[8] = (pvt.vertical_accuracy_mm * _METRES) ** 2
            msg.position_covariance_type = COVARIANCE_DIAGONAL_KNOWN
        else:
            msg.position_covariance_type = COVARIANCE_UNKNOWN


def _refine(msg: Any, precise: HighPrecision, has_altitude: bool) -> None:
    """Replace the position of NAV-PVT by that of NAV-HPPOSLLH, if it is valid."""
    latitude, longitude = precise.latitude * 1e-9, precise.longitude * 1e-9
    if abs(latitude) > 90 or abs(longitude) > 180:
        return
    msg.latitude, msg.longitude = latitude, longitude
    if has_altitude:
        msg.altitude = precise.height * 1e-4
    if 0 < precise.horizontal_accuracy < 10 * _NO_ACCURACY_MM:
        covariance = msg.position_covariance
        covariance[0] = covariance[4] = (precise.horizontal_accuracy * 1e-4) ** 2
        covariance[8] = (precise.vertical_accuracy * 1e-4) ** 2
        msg.position_covariance_type = COVARIANCE_DIAGONAL_KNOWN


def _status(pvt: NavPvt) -> int:
    if pvt.carrier:
        return STATUS_GBAS_FIX
    return STATUS_SBAS_FIX if pvt.is_differential else STATUS_FIX


def _fill_velocity(twist: Any, pvt: NavPvt) -> None:
    twist.twist.linear = (pvt.east_mm_s * _METRES, pvt.north_mm_s * _METRES,
                          -pvt.down_mm_s * _METRES)
    twist.twist.angular = (0.0, 0.0, 0.0)
    covariance = twist.covariance
    covariance[:] = 0.0
    covariance[0] = covariance[7] = covariance[14] = (pvt.speed_accuracy_mm_s * _METRES) ** 2
    for index in _ANGULAR:
        covariance[index] = -1.0


def _utc(pvt: NavPvt) -> tuple[int, int] | None:
    """Return seconds since 1970 and nanoseconds; None if not valid or not a possible time."""
    if not pvt.has_date:
        return None
    try:
        # A leap second, 60, is the next second here, as in POSIX.
        stamp = datetime(pvt.year, pvt.month, pvt.day, pvt.hour, pvt.minute,
                         min(pvt.second, 59), tzinfo=timezone.utc).timestamp()
    except (ValueError, OverflowError):
        return None
    seconds, nanoseconds = divmod(
        (int(stamp) + (pvt.second > 59)) * NS_PER_S + pvt.nano, NS_PER_S)
    return (seconds, nanoseconds) if 0 <= seconds <= _INT32_MAX else None
