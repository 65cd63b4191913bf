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
Pulse oximeters with Nonin's serial data formats 2 and 7.

The device sends its values, the waveform and their quality three times a second. Only valid
values are published: those that the device marks as missing (511 and 127), implausible ones, and
those without a finger or without a pulse are counted and not published. The driver uses the
averages that end immediately with the finger, not those for the display, which stay for ten
seconds.

The stamp is the arrival of the packet; it belongs to the last of the 25 samples of the waveform.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from dataclasses import replace
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.serial.device import serial_settings
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.features.health.oximeter import wire
from rt_robot_os.features.health.oximeter.wire import OximeterPacket
from rt_robot_os.messages.quantities import quantity

FLOAT: Final = 'std_msgs/msg/Float64'
PLETH: Final = 'std_msgs/msg/UInt16MultiArray'
TEXT: Final = 'std_msgs/msg/String'
TEXT_BYTES: Final = 80

MEASURING: Final = 'measuring'
SEARCHING: Final = 'searching'
LOST: Final = 'out of track'
OFF: Final = 'no finger'
UNPLUGGED: Final = 'disconnected'

_SERIAL: Final = {field.name: field for field in serial_settings(
    baud=9600, frame_id='', topic='oximeter', rate_hz=wire.PACKETS_PER_S,
    rates_hz=(wire.PACKETS_PER_S,))}
_SPO2_OF: Final = {'fast': wire.SPO2_FAST, 'beat': wire.SPO2_BEAT}
_AVERAGES: Final = {4: (wire.PULSE_4, wire.SPO2_4), 8: (wire.PULSE_8, wire.SPO2_8)}
# Period of repeating the format command; the device accepts it only soon after connecting.
_COMMAND_NS: Final = NS_PER_S
# A larger gap is a restart of the device, whose counter starts again.
_MOST_LOST: Final = 1000
_WARNINGS: Final = {
    UNPLUGGED: 'the sensor is unplugged or broken',
    OFF: 'no finger in the sensor',
    LOST: 'no pulse detected: warm the finger, keep it still, or use another',
}


class Oximeter(SerialDevice[OximeterPacket]):
    """A pulse oximeter."""

    SETTINGS = (
        _SERIAL['port'], _SERIAL['baud'],
        replace(_SERIAL['topic'], description='Prefix of the names of the topics: '
                'oximeter/pulse_per_min.'),
        _SERIAL['depth'], _SERIAL['output_rate_hz'],
        Field('data_format', int, 7, 'What the device sends: 7 has the waveform in 16 bits, 2 in '
              '8 bits.', choices=tuple(wire.DECODERS)),
        Field('configure', bool, False, 'Send the command for data_format at opening; needed for '
              'an Onyx II 9560, which otherwise sends single measurements.'),
        Field('average_beats', int, 4, 'Number of beats over which pulse rate and saturation are '
              'averaged.', choices=tuple(_AVERAGES)),
        Field('spo2', str, 'average', 'Which saturation: average (over average_beats), fast (over '
              '4 beats, with less delay) or beat (of each one).',
              choices=('average', *_SPO2_OF)),
    )
    description = "pulse oximeter with Nonin's data format 2 or 7 (OEM III, Onyx II, WristOx2)"
    IF_SILENT = ('check that it is switched on (most switch on with a finger in them), the '
                 'Bluetooth connection (rfcomm), and its batteries')
    IF_GARBAGE = ('check the baud rate (9600 of OEM III and Xpod), and data_format; a model that '
                  'sends single measurements (13) or one a second (8) needs configure: true')

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """Store the settings; nothing is opened."""
        super().__init__(name, settings, wire.DECODERS[settings['data_format']]())
        self._pulse_at, average = _AVERAGES[settings['average_beats']]
        self._spo2_at = _SPO2_OF.get(settings['spo2'], average)
        self._pulse_limits = quantity('pulse_per_min')
        self._spo2_limits = quantity('spo2_percent')
        self._counts = dict.fromkeys((
            'artefacts', 'poor_pulses', 'marginal_pulses', 'good_pulses', 'packets_disconnected',
            'packets_without_finger', 'packets_out_of_track', 'pulse_missing', 'spo2_missing'), 0)
        self._firmware = 0
        self._lost = self._contradicted = 0
        self.restart()

    def publications(self) -> tuple[TopicSpec, ...]:
        """Return the topics: pulse rate, saturation, waveform and status."""
        s = self.settings
        topic, depth, rate_hz = s['topic'], s['depth'], s['output_rate_hz']
        return (
            TopicSpec(f'{topic}/pulse_per_min', FLOAT, {}, depth, rate_hz),
            TopicSpec(f'{topic}/spo2_percent', FLOAT, {}, depth, rate_hz),
            TopicSpec(f'{topic}/pleth', PLETH, {
                'layout.dim': [{'label': 'samples', 'size': wire.FRAMES, 'stride': wire.FRAMES}],
                'data': wire.FRAMES}, depth, rate_hz),
            TopicSpec(f'{topic}/status', TEXT, {}, depth, rate_hz, TEXT_BYTES),
        )

    def restart(self) -> None:
        """Reset the state, as the device is opened again."""
        self._state = SEARCHING
        self._perfusion = ''
        self._battery_low = False
        self._timer = -1
        self._before = 0
        self._received = False
        self._command_ns = 0

    def write(self, now_ns: int) -> None:
        """
        Send the format command until packets arrive.

        :raises DeviceError: the device is disconnected.
        """
        if self.settings['configure'] and not self._received and now_ns >= self._command_ns:
            self._command_ns = now_ns + _COMMAND_NS
            self.send(wire.format_command(self.settings['data_format']))

    def handle(self, frame: OximeterPacket, arrival_ns: int) -> int:
        """Process one packet; in the real-time loop."""
        self._received = True
        self._count_lost(frame.timer())
        self._firmware = frame.float_byte(wire.FIRMWARE)
        self._battery_low = bool(frame.float_byte(wire.STATUS_2) & wire.BATTERY_LOW)
        self._state = self._evaluate_status(frame.statuses)
        published = 2
        pulse, spo2 = frame.pulse(self._pulse_at), frame.float_byte(self._spo2_at)
        if self._state in (MEASURING, SEARCHING):
            self._state = SEARCHING if pulse == wire.NO_PULSE else MEASURING
            published += self._number(0, pulse, wire.NO_PULSE, arrival_ns)
            published += self._number(1, spo2, wire.NO_SPO2, arrival_ns)
        pleth, status = self._publishers[2:]
        pleth.fill(memoryview(array('H', frame.pleth())))
        pleth.publish(arrival_ns)
        status.msg.data = self._status_text()
        status.publish(arrival_ns)
        return published

    def statistics(self) -> DeviceStatistics:
        """Return the counters; contradictions are implausible values."""
        warning = _WARNINGS.get(self._state, 'its batteries are low' if self._battery_low else '')
        return self._counters(
            lost_samples=self._lost, contradicted=self._contradicted,
            more={'state': self._state, **self._counts, 'firmware': self._firmware,
                  'warning': warning})

    def _number(self, index: int, value: int, missing: int, arrival_ns: int) -> int:
        limits = self._spo2_limits if index else self._pulse_limits
        if value == missing:
            self._counts['spo2_missing' if index else 'pulse_missing'] += 1
            return 0
        if not limits.plausible(value):
            self._contradicted += 1
            return 0
        publisher = self._publishers[index]
        publisher.msg.data = float(value)
        publisher.publish(arrival_ns)
        return 1

    def _evaluate_status(self, statuses: bytes) -> str:
        """Return the state that a packet shows, and count the pulses that start in it."""
        counts, before, seen = self._counts, self._before, 0
        for status in statuses:
            seen |= status
            if status & wire.PERFUSION and not before & wire.PERFUSION:
                self._perfusion = wire.PERFUSIONS[status & wire.PERFUSION]
                counts[f'{self._perfusion}_pulses'] += 1
            if status & ~before & wire.ARTEFACT:
                counts['artefacts'] += 1
            before = status
        self._before = before
        if seen & wire.DISCONNECTED:
            counts['packets_disconnected'] += 1
            state = UNPLUGGED
        elif seen & wire.NO_FINGER:
            counts['packets_without_finger'] += 1
            state = OFF
        elif seen & wire.OUT_OF_TRACK:
            counts['packets_out_of_track'] += 1
            state = LOST
        else:
            return MEASURING
        self._perfusion = ''
        return state

    def _count_lost(self, timer: int) -> None:
        before, self._timer = self._timer, timer
        lost = (timer - before - 1) % wire.TIMER_TURN
        if before >= 0 and lost <= _MOST_LOST:
            self._lost += lost

    def _status_text(self) -> str:
        parts = [self._state]
        if self._perfusion:
            parts.append(f'perfusion {self._perfusion}')
        if self._before & wire.ARTEFACT:
            parts.append('artefact')
        if self._battery_low:
            parts.append('battery low')
        return ', '.join(parts)
