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

One message holds the whole of an epoch, so position, velocity and time belong together and nothing
waits for anything: ``sensor_msgs/msg/NavSatFix``, velocity as
``geometry_msgs/msg/TwistWithCovarianceStamped`` (x east, y north, z up) and
``sensor_msgs/msg/TimeReference``. NMEA sentences on the same line are counted and not used.

Rules: without ``gnssFixOK``, with dead reckoning alone, or where the message calls the position
invalid, there is no fix and the position is NaN. Of a two-dimensional fix the altitude is NaN.
Carrier phase solutions are GBAS, other corrections SBAS. Accuracies are the receiver's own
estimates, one standard deviation. NAV-PVT does not say which systems were used: ``services`` does.

The stamp is the arrival of the message. The position is older by what the receiver computed and
sent before; TimeReference tells UTC and stamp of the same epoch.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from datetime import timezone
import math
from typing import Any
from typing import Final

from rt_robot_os.drivers.decoders import ubx as wire
from rt_robot_os.drivers.decoders.ubx import NavPvt
from rt_robot_os.drivers.decoders.ubx import UbxDecoder
from rt_robot_os.drivers.decoders.ubx import UbxFrame
from rt_robot_os.drivers.device import Publication
from rt_robot_os.drivers.encoders import ubx as encode
from rt_robot_os.drivers.handshake import Handshake
from rt_robot_os.drivers.handshake import Step
from rt_robot_os.drivers.nmea_fix import COVARIANCE_DIAGONAL_KNOWN
from rt_robot_os.drivers.nmea_fix import COVARIANCE_UNKNOWN
from rt_robot_os.drivers.nmea_fix import SERVICE_COMPASS
from rt_robot_os.drivers.nmea_fix import SERVICE_GALILEO
from rt_robot_os.drivers.nmea_fix import SERVICE_GLONASS
from rt_robot_os.drivers.nmea_fix import SERVICE_GPS
from rt_robot_os.drivers.nmea_fix import STATUS_FIX
from rt_robot_os.drivers.nmea_fix import STATUS_GBAS_FIX
from rt_robot_os.drivers.nmea_fix import STATUS_NO_FIX
from rt_robot_os.drivers.nmea_fix import STATUS_SBAS_FIX
from rt_robot_os.drivers.serial_device import serial_settings
from rt_robot_os.drivers.serial_device import SerialDevice
from rt_robot_os.errors import DeviceError
from rt_robot_os.schema import Field
from rt_robot_os.units import NS_PER_S

_SERVICES: Final = {'gps': SERVICE_GPS, 'glonass': SERVICE_GLONASS, 'galileo': SERVICE_GALILEO,
                    'beidou': SERVICE_COMPASS}
_DEGREES: Final = 1e-7
_METRES: Final = 1e-3
# What the receiver says when it knows no accuracy.
_NO_ACCURACY_MM: Final = 10_000_000
_INT32_MAX: Final = 2**31 - 1
_REMEDY: Final = ('check the wire to its receive pin, or set configure: false and set it up with '
                  "the maker's u-center")
_ANGULAR: Final = (21, 28, 35)


class Ublox(SerialDevice[UbxFrame]):
    """A u-blox receiver."""

    SETTINGS = serial_settings(
        baud=38400, frame_id='gps_link', topic='gps/fix', rate_hz=1.0,
    ) + (
        Field('velocity_topic', str, 'gps/velocity',
              'Topic of the velocity, east, north, up; empty publishes none.'),
        Field('time_topic', str, 'gps/time', 'Topic of the UTC time; empty publishes none.'),
        Field('services', list, (), 'Satellite systems that the receiver was set up to use; its '
              'message does not say. Empty: not known.', choices=tuple(_SERVICES)),
        Field('configure', bool, False,
              'Ask for NAV-PVT and the output rate at opening (CFG-MSG, CFG-RATE; not saved in '
              'the receiver). Receivers up to generation 9 know them; set up later ones with '
              'u-center.'),
    )
    description = 'u-blox satellite receiver, UBX NAV-PVT: position, velocity, time'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """Keep the settings; nothing is opened."""
        super().__init__(name, settings, UbxDecoder())
        self._service = sum(_SERVICES[each] for each in set(settings['services']))
        self._velocity_at = 1 if settings['velocity_topic'] else 0
        self._time_at = 1 + self._velocity_at if settings['time_topic'] else 0
        self._setup = Handshake(name, (), _REMEDY)
        self._problem = ''
        self._sentences = False

    def publications(self) -> tuple[Publication, ...]:
        """Say what is published: NavSatFix, and velocity and time with a topic."""
        settings = self.settings
        depth, rate_hz = settings['depth'], settings['output_rate_hz']
        frame = {'header.frame_id': settings['frame_id']}
        found = [Publication(settings['topic'], 'sensor_msgs/msg/NavSatFix', frame, depth,
                             rate_hz)]
        if settings['velocity_topic']:
            found.append(Publication(
                settings['velocity_topic'], 'geometry_msgs/msg/TwistWithCovarianceStamped', frame,
                depth, rate_hz))
        if settings['time_topic']:
            found.append(Publication(settings['time_topic'], 'sensor_msgs/msg/TimeReference',
                                     {**frame, 'source': 'gps'}, depth, rate_hz))
        return tuple(found)

    def restart(self) -> None:
        """Begin the set-up if it is wanted."""
        self._problem = ''
        self._setup = Handshake(self.name, (
            Step('CFG-MSG', encode.enable_nav_pvt(), encode.CFG_MSG),
            Step('CFG-RATE', encode.set_rate(self.settings['output_rate_hz']), encode.CFG_RATE),
        ) if self.settings['configure'] else (), _REMEDY)

    def is_set_up(self) -> bool:
        """Say whether the set-up is done."""
        return self._setup.done

    def write(self, now_ns: int) -> None:
        """
        Send the command of the set-up that is due, if any.

        :raises DeviceError: the port is gone, or the device does not answer or refuses.
        """
        if self._problem:
            raise DeviceError(f'{self.name}: {self._problem}')
        data = self._setup.due(now_ns)
        if data is not None:
            self.send(data)

    def handle(self, frame: UbxFrame, arrival_ns: int) -> int:
        """Use one message; in the loop."""
        if frame.kind == wire.NAV and frame.identifier == wire.PVT:
            pvt = wire.nav_pvt(frame.payload)
            if pvt is not None:
                return self._publish(pvt, arrival_ns)
        step = self._setup.step
        if step is not None and frame.kind == wire.ACK \
                and frame.payload == bytes((wire.CFG, step.key)):
            if frame.identifier == encode.ACK_NAK:
                self._problem = (
                    f'it refuses {step.name}: lower output_rate_hz, or set it up with u-center '
                    'and set configure: false (receivers from generation 10 on do not know this '
                    'command)')
            else:
                self._setup.acknowledged(arrival_ns)
        else:
            self._ignored_frames += 1
            self._sentences = frame.kind == wire.NMEA
        return 0

    def unused(self) -> str:
        """Say what it sends instead of NAV-PVT."""
        what = 'NMEA sentences' if self._sentences else 'other UBX messages'
        return (f'it sends {what} and no NAV-PVT: set configure: true, let it send NAV-PVT with '
                'u-center, or choose type: nmea')

    def _publish(self, pvt: NavPvt, arrival_ns: int) -> int:
        publisher = self._publishers[0]
        self._fill_fix(publisher.msg, pvt)
        publisher.publish(arrival_ns)
        samples = 1
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
    """Give seconds since 1970 and nanoseconds; None when not valid, or no such moment."""
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
