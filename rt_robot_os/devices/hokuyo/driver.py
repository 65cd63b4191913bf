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
Hokuyo laser scanners with SCIP 2.0 on USB or a serial line: URG-04LX, UBG, UHG, UTM-30LX.

One ``sensor_msgs/msg/LaserScan`` for each scan, with the number of ranges from the settings. The
device counts its steps counter-clockwise and reports which one is ahead, so the angles are those
of REP 103 with x ahead and z up. REP 117: a distance beyond ``maximum_m``, and the code that the
device sends without an echo (0, of a UTM-30LX 1), are +inf; the other codes below 20 mm mean a
measurement that failed and are NaN (SCIP 2.0, C-42-03320B, tables 3 and 4).

At opening the device is stopped, its parameters are read and must agree with the settings, and it
is commanded to scan. Nothing else is sent.

The stamp is the arrival of the scan less ``latency_s``.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
import operator
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.hokuyo import wire
from rt_robot_os.devices.hokuyo.wire import ScipDecoder
from rt_robot_os.devices.hokuyo.wire import ScipFrame
from rt_robot_os.devices.hokuyo.wire import Steps
from rt_robot_os.devices.serial.device import serial_settings
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.serial.handshake import Handshake
from rt_robot_os.devices.serial.handshake import HandshakeStep

# Smaller distances are codes of errors.
_CODES_MM: Final = 20
# The code without an echo; scanners with this number of steps per turn (UTM-30LX) have another
# one.
_NO_ECHO: Final = 0
_OTHER_STEPS: Final = 1440
_OTHER_NO_ECHO: Final = 1
# Digits of the largest parameter.
_DIGITS: Final = 9
_METRES: Final = 0.001
_REMEDY: Final = ('check its power and its cable; a URG-04LX with SCIP 1.1 must be '
                  "switched to SCIP 2.0 with the maker's tool")
# Parameter of the device, setting of the driver, required relation of the setting to it.
_PARAMETERS: Final = (
    (b'ARES', 'steps_per_turn', operator.eq), (b'AFRT', 'front_step', operator.eq),
    (b'AMIN', 'first_step', operator.ge), (b'AMAX', 'last_step', operator.le))


class Hokuyo(SerialDevice[ScipFrame]):
    """A laser scanner."""

    SETTINGS = serial_settings(
        baud=500000, frame_id='laser_link', topic='scan', rate_hz=10.0,
    ) + (
        Field('first_step', int, 44, 'First step of the scan; the default is a URG-04LX.',
              minimum=0, maximum=9999),
        Field('last_step', int, 725, 'Last step of the scan.', minimum=0, maximum=9999),
        Field('front_step', int, 384, 'Step that points ahead.', minimum=0, maximum=9999),
        Field('steps_per_turn', int, 1024, 'Steps in a whole turn.', minimum=8, maximum=9999),
        Field('minimum_m', float, 0.02, 'Shortest distance that it measures.', 'm', 0.0, 100.0),
        Field('maximum_m', float, 5.6,
              'Longest distance that it measures; beyond it the reading is +inf.',
              'm', 0.001, 250.0),
        Field('no_echo_codes', list, (), 'Codes below 20 mm that mean that nothing is within its '
              'range; empty: 0, with 1440 steps_per_turn (UTM-30LX) 1.', item=int, minimum=0,
              maximum=19),
        Field('latency_s', float, 0.0,
              'Time from the first ray of a scan to its arrival, subtracted from the stamp. A '
              'URG-04LX turns by 240 degrees in 67 ms, and sends them in another 67 ms; measure '
              'yours.', 's', 0.0, 1.0),
        Field('configure', bool, True,
              'Check the device and start its scans at opening. Off: nothing is sent, for a '
              'recording or a device that scans already.'),
    )
    description = 'Hokuyo laser scanner, SCIP 2.0 (URG-04LX, UTM-30LX, ...)'
    IF_SILENT = ('check its power (it needs up to 0.8 A) and its cable; with configure: false it '
                 'must scan already')

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """
        Store the settings; nothing is opened.

        :raises ConfigError: the steps contradict each other.
        """
        super().__init__(name, settings, ScipDecoder())
        first, last = settings['first_step'], settings['last_step']
        if not first < last < first + settings['steps_per_turn']:
            raise ConfigError([f'{name}: first_step {first} and last_step {last}: the last must '
                               'be after the first, by less than steps_per_turn '
                               f'{settings["steps_per_turn"]}'])
        self._count = last - first + 1
        self._angle = 2 * math.pi / settings['steps_per_turn']
        self._angle_minimum = (first - settings['front_step']) * self._angle
        usual = (_OTHER_NO_ECHO if settings['steps_per_turn'] == _OTHER_STEPS else _NO_ECHO,)
        self._no_echo = tuple(settings['no_echo_codes'] or usual)
        self._scan_s = 1 / settings['output_rate_hz']
        self._maximum_mm = round(settings['maximum_m'] / _METRES)
        self._latency_ns = round(settings['latency_s'] * NS_PER_S)
        self._scan = wire.scan_command(first, last)
        self._setup = Handshake(name, (), _REMEDY)
        self._problem = ''
        self._other_counts = 0
        self._other_count = 0

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the publications: LaserScan."""
        s = self.settings
        fixed = {'header.frame_id': s['frame_id'], 'ranges': self._count, 'intensities': 0}
        return (TopicSpec(s['topic'], 'sensor_msgs/msg/LaserScan', fixed, s['depth'],
                          s['output_rate_hz']),)

    def restart(self) -> None:
        """Start the set-up if it is configured."""
        self._problem = ''
        self._setup = Handshake(self.name, [
            HandshakeStep(text[:2].decode(), wire.command(text), int.from_bytes(text[:2], 'big'))
            for text in (wire.QUIT, wire.PARAMETERS, self._scan)
        ] if self.settings['configure'] else [], _REMEDY)

    def is_set_up(self) -> bool:
        """Return whether the device was commanded to scan."""
        return self._setup.done

    def write(self, now_ns: int) -> None:
        """
        Send the next command of the set-up, if due.

        :raises DeviceError: the port is gone, or the device does not answer, or refuses.
        """
        if self._problem:
            raise DeviceError(f'{self.name}: {self._problem}')
        data = self._setup.due(now_ns)
        if data is not None:
            self.send(data)

    def handle(self, frame: ScipFrame, arrival_ns: int) -> int:
        """Handle one answer; in the loop."""
        if frame.distances_mm is not None:
            if not self._setup.done:
                self._ignored_frames += 1
                return 0
            return self._publish(frame.distances_mm, arrival_ns)
        step = self._setup.step
        if step is not None and int.from_bytes(frame.command, 'big') == step.key:
            if frame.status != wire.OK:
                self._problem = (f'it refuses {step.name} with status {frame.status:02d}: check '
                                 'first_step and last_step')
            elif frame.command == wire.PARAMETERS:
                self._check(frame.lines)
            if not self._problem:
                self._setup.acknowledged(arrival_ns)
        else:
            self._ignored_frames += 1
            if self._setup.done and frame.command == b'MD' and frame.status != wire.OK:
                self._problem = (f'it stopped with status {frame.status:02d}: it may be blocked, '
                                 'or defective')
        return 0

    def statistics(self) -> DeviceStatistics:
        """Return the current counters; contradictions are scans of another size."""
        return self._counters(contradicted=self._other_counts)

    def unused(self) -> str:
        """Return that its scans have another size."""
        if not self._other_count:
            return ''
        return (f'its scans have {self._other_count} steps, by the settings {self._count}: set '
                'first_step and last_step to the steps that it is set to send')

    def _check(self, lines: tuple[bytes, ...]) -> None:
        """Compare the parameters of the device with the settings."""
        found = {line[:4]: line[5:].partition(b';')[0].strip() for line in lines}
        wrong = []
        for key, name, fits in _PARAMETERS:
            value = _number(found.get(key, b''))
            if value is not None and not fits(self.settings[name], value):
                wrong.append(f'{name}: {value}')
        if wrong:
            model = found.get(b'MODL', b'').decode('ascii', 'replace') or 'another scanner'
            self._problem = f'the settings do not fit: it is {model}, so set {", ".join(wrong)}'

    def _publish(self, distances_mm: Steps, arrival_ns: int) -> int:
        if distances_mm.size != self._count:
            self._other_counts += 1
            self._other_count = distances_mm.size
            return 0
        publisher = self._publishers[0]
        msg = publisher.msg
        settings = self.settings
        msg.angle_min = self._angle_minimum
        msg.angle_max = self._angle_minimum + (self._count - 1) * self._angle
        msg.angle_increment = self._angle
        msg.time_increment = self._scan_s * self._angle / (2 * math.pi)
        msg.scan_time = self._scan_s
        msg.range_min = settings['minimum_m']
        msg.range_max = settings['maximum_m']
        ranges = msg.ranges
        np.multiply(distances_mm, _METRES, out=ranges, casting='unsafe')
        ranges[distances_mm > self._maximum_mm] = math.inf
        ranges[distances_mm < _CODES_MM] = math.nan
        for code in self._no_echo:
            ranges[distances_mm == code] = math.inf
        publisher.publish(arrival_ns - self._latency_ns)
        return 1


def _number(text: bytes) -> int | None:
    """Parse a parameter; None if it is not a possible number."""
    return int(text) if text.isdigit() and len(text) <= _DIGITS else None
