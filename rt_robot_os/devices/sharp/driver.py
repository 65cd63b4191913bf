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
Sharp infrared range finders (GP2Y0A*), whose voltage an analogue-to-digital converter sends.

The distance is a power of the voltage, ``coefficient_m * volts ** exponent``: fits for the usual
models are built in, but a fit of your own is better, because the devices differ. Each reading of a
channel gives one ``sensor_msgs/msg/Range``, the median of the last few.

The converter (an Arduino, say) sends ``$PADC,channel,millivolts*HH`` with the checksum of NMEA
0183, one sentence for each channel and reading; a sketch is in ``page.md``.

Below its shortest distance the voltage of such a device falls again, as if the target were far
away. The driver cannot distinguish the two: mount the device that far behind the edge of the
robot.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.mounted import mounting_settings
from rt_robot_os.devices.nmea.wire import NmeaDecoder
from rt_robot_os.devices.nmea.wire import NmeaFrame
from rt_robot_os.devices.ranging import INFRARED
from rt_robot_os.devices.ranging import range_settings
from rt_robot_os.devices.ranging import RangeFiller
from rt_robot_os.devices.serial.device import serial_settings
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.sharp.wire import ADC_ADDRESS
from rt_robot_os.devices.sharp.wire import SHARP_FITS
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.motion.mounting import mounting_of

CUSTOM: Final = 'custom'

_SURE: Final = 10
_HIGHEST_MV: Final = 5500
_FIELDS: Final = 3


class Sharp(SerialDevice[NmeaFrame]):
    """Sharp range finders on an analogue-to-digital converter."""

    SETTINGS = serial_settings(
        baud=115200, frame_id='infrared_link', topic='range', rate_hz=25.0,
    ) + range_settings(
        minimum_m=0.1, maximum_m=0.8, field_of_view_rad=0.09, stddev_m=0.01,
    ) + (
        Field('channels', list, (0,),
              'Channels of the converter; with several, the number of each is appended to topic '
              'and frame_id: range_0, infrared_link_0.', item=int, minimum=0, maximum=63),
        *mounting_settings(length=0, more='; with several channels 3 numbers for all, or 3 for '
                                          'each, in their order'),
        Field('model', str, 'gp2y0a21',
              'Model whose fit is used: gp2y0a21 (0.1 to 0.8 m), gp2y0a02 (0.2 to 1.5 m), or '
              'custom.', choices=(*SHARP_FITS, CUSTOM)),
        Field('coefficient_m', float, 0.27728, 'Fit for model custom: distance at 1 V.', 'm',
              0.001, 100.0),
        Field('exponent', float, -1.2045, 'Fit for model custom: power of the voltage.', '',
              -5.0, -0.1),
        Field('lowest_mv', int, 1,
              'A lower voltage means a broken wire or no power, and is not a reading. Best a '
              'little below the voltage without a target; 0: that voltage is zero.',
              'mV', 0, 1000, before=0),
        Field('median', int, 3,
              'Readings of which the median is published; 1 publishes each. The device has a new '
              'reading each 38 ms.', choices=(1, 3, 5, 7, 9)),
    )
    description = 'Sharp GP2Y0A infrared range finders on a serial analogue-to-digital converter'

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: the limits contradict each other, or no channel is named, or one
            twice.
        """
        super().__init__(name, settings, NmeaDecoder())
        channels = list(settings['channels'])
        if not channels or len(set(channels)) != len(channels):
            raise ConfigError([f'{name}: channels {channels}: name each channel once, at least '
                               'one'])
        self._filler = RangeFiller(name, settings, INFRARED)
        self._coefficient_m, self._exponent = SHARP_FITS.get(
            settings['model'], (settings['coefficient_m'], settings['exponent']))
        self._lowest_mv: int = settings['lowest_mv']
        self._places = {channel: place for place, channel in enumerate(channels)}
        self._recent: list[deque[float]] = [deque(maxlen=settings['median']) for _ in channels]
        self._strangers = 0
        self._stranger = ''
        self._wrong = 0

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications: a Range for each channel."""
        s = self.settings
        return tuple(TopicSpec(
            s['topic'] + tail, 'sensor_msgs/msg/Range',
            {'header.frame_id': s['frame_id'] + tail}, s['depth'], s['output_rate_hz'])
            for tail in _tails(s))

    @classmethod
    def mountings(cls, settings: Mapping[str, Any]) -> Mapping[str, Mounting]:
        """
        Return the mounting of the sensor of each channel.

        :raises ConfigError: there are neither three numbers nor three for each channel.
        """
        tails = _tails(settings)
        for key in ('mounting_m', 'mounting_rad'):
            count = len(settings.get(key, ())) or 3
            if count not in (3, 3 * len(tails)):
                raise ConfigError([f'{key} has {count} numbers: give 3 for all channels'
                                   f', or {3 * len(tails)}: 3 for each'])
        return {settings['frame_id'] + tail: mounting_of(settings, place)
                for place, tail in enumerate(tails)}

    def restart(self) -> None:
        """Discard earlier readings."""
        for recent in self._recent:
            recent.clear()
        self._strangers = 0

    def write(self, now_ns: int) -> None:
        """
        Check that it is the configured converter; nothing is sent.

        :raises DeviceError: it is not.
        """
        if self._strangers >= _SURE:
            raise DeviceError(f'{self.name}: it sends {self._stranger}')

    def is_set_up(self) -> bool:
        """Return whether the configured channels arrive."""
        return not self._strangers

    def handle(self, frame: NmeaFrame, arrival_ns: int) -> int:
        """Handle one sentence; in the loop."""
        reading = _reading(frame)
        if reading is None:
            self._unknown(f'{frame.address} sentences and no readings: it is another device, so '
                          'swap the ports or change its type')
            return 0
        channel, millivolts = reading
        place = self._places.get(channel)
        if place is None:
            self._unknown(f'channel {channel} and none of {list(self._places)}: set channels')
            return 0
        self._strangers = 0
        if not self._lowest_mv <= millivolts <= _HIGHEST_MV:
            self._wrong += 1
            return 0
        recent = self._recent[place]
        recent.append(self._distance_m(millivolts))
        publisher = self._publishers[place]
        self._filler.fill(publisher.msg, sorted(recent)[len(recent) // 2])
        publisher.publish(arrival_ns)
        return 1

    def statistics(self) -> DeviceStatistics:
        """Return the current counters; contradictions are impossible voltages."""
        return self._counters(contradicted=self._wrong)

    def _unknown(self, what: str) -> None:
        self._strangers += 1
        self._stranger = what
        self._ignored_frames += 1

    def _distance_m(self, millivolts: int) -> float:
        if not millivolts:
            return math.inf
        distance: float = self._coefficient_m * (millivolts / 1000) ** self._exponent
        return distance


def _tails(settings: Mapping[str, Any]) -> list[str]:
    channels = settings['channels']
    return [f'_{channel}' for channel in channels] if len(channels) > 1 else ['']


def _reading(frame: NmeaFrame) -> tuple[int, int] | None:
    """Return channel and millivolts; None if the sentence is not a reading."""
    if frame.address != ADC_ADDRESS:
        return None
    fields = frame.sentence.partition(b'*')[0].split(b',')
    if len(fields) != _FIELDS or not all(f.isdigit() and len(f) < 6 for f in fields[1:]):
        return None
    return int(fields[1]), int(fields[2])
