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
A simulated pulse oximeter: worn by a person of the world, or playing recordings of a monitor.

Its values come from the first of these sources that applies: an injected fault, the wearer
(``on``), a recording of numbers (``numerics``) and of a waveform (``wave``), its settings.
"""

from __future__ import annotations

import math
from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.features.health.oximeter import wire
from rt_robot_os.features.health.oximeter.simulated_recordings import Numerics
from rt_robot_os.features.health.oximeter.simulated_recordings import Wave
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice
from rt_robot_os.sim.faults import OXIMETER_FAULTS

if TYPE_CHECKING:
    from rt_robot_os.sim.world.people import SimulatedPerson

_MIDDLE: Final = 32768
_SWING: Final = 9000.0
_NOISE: Final = 40.0
# Time for which the display holds its values after the finger is removed.
_SHOWN_S: Final = 10.0
# Duration of artefacts after which the device is out of track.
_TRACK_S: Final = 5.0
# Pulse and dicrotic wave: phase, width and height.
_PULSE_SHAPE: Final = ((0.2, 0.09, 1.0), (0.52, 0.13, 0.35))


class SimulatedOximeter(SimulatedDevice):
    """A pulse oximeter; it executes the command for a data format."""

    SETTINGS = (
        *common_settings(wire.PACKETS_PER_S, wire.PACKETS_PER_S, OXIMETER_FAULTS),
        Field('on', str, '', 'The wearer, one of the people of the world.'),
        Field('pulse_per_min', float, 68.0, 'Pulse of the wearer; 0: the device is not worn.',
              '1/min', 0.0, 320.0),
        Field('spo2_percent', float, 97.0, 'Saturation of the wearer.', '%', 0.0, 100.0),
        Field('numerics', str, '', 'Recorded numbers of a monitor to play: CSV with the columns '
              'minute, PULSE (or HR) and SpO2; 0 is a sensor that is off.', is_file=True),
        Field('wave', str, '', 'Recorded waveform to play: header of a WFDB record with a signal '
              'PLETH; without numerics the pulse is that of the wave.', is_file=True),
        Field('faster', float, 1.0, 'Speed factor of playing the numbers.', '', 1.0, 1000.0),
    )
    BAUD = 9600
    KNOWN_FAULTS = OXIMETER_FAULTS

    def prepare(self) -> None:
        """
        Read the recordings.

        :raises ConfigError: one cannot be read, or the wearer does not exist.
        """
        s = self.settings
        try:
            self._numerics = Numerics.load(s['numerics']) if s['numerics'] else None
            self._wave = Wave.load(s['wave'], wire.FRAMES_PER_S) if s['wave'] else None
        except ConfigError as error:
            raise ConfigError([f'{self.name}: {each}' for each in error.problems]) from error
        self._person = self._wearer(s['on'])
        self._format: int = self.device.get('data_format', 7)
        self._number = 0
        self._phase = 0.0
        self._pulse_frames = 0
        self._shown = (wire.NO_PULSE, wire.NO_SPO2)
        self._shown_s = self._steady_s = -math.inf
        self._status = 0
        self._rate_hz = 0.0

    def sample(self, time_s: float) -> bytes:
        """Return one packet, of the last third of a second."""
        floats = self._floats(time_s)
        frames = [self._next(time_s + (number - wire.FRAMES) / wire.FRAMES_PER_S)
                  for number in range(wire.FRAMES)]
        return wire.packet(self._format, [status for _, status in frames],
                           [level for level, _ in frames], floats)

    def handle_command(self, data: bytes) -> None:
        """Execute the command for a data format."""
        for known in wire.DECODERS:
            if wire.format_command(known) in data:
                self._format = known
                self.reply(wire.ACCEPTED)

    def _wearer(self, name: str) -> SimulatedPerson | None:
        if not name or self.world is None:
            return None
        people = self.world.people_model
        found = people.find(name)
        if found is None:
            raise ConfigError([f'{self.name}: on: {name}: {people.problem(name)}'])
        return found

    def _signs(self, time_s: float) -> tuple[float, float]:
        """Return pulse and saturation; 0 means no value."""
        if self._person is not None:
            vitals, at_s = self._person.vitals, self._person.time_s
            return vitals.value('pulse_per_min', at_s), vitals.value('spo2_percent', at_s)
        if self._numerics is not None:
            return self._numerics.at(time_s * self.settings['faster'])
        pulse = self.settings['pulse_per_min']
        if self._wave is not None:
            pulse = self._wave.pulse_per_min(time_s)
        return pulse, self.settings['spo2_percent']

    def _floats(self, time_s: float) -> bytes:
        """Return the multiplexed bytes; set status and rate of the frames."""
        pulse, spo2 = self._signs(time_s)
        disturbed = self.has_fault('artefact')
        if not disturbed:
            self._steady_s = time_s
        off = self.has_fault('off') or self.has_fault('disconnect') or (
            pulse <= 0.0 and spo2 <= 0.0)
        lost = time_s - self._steady_s > _TRACK_S
        self._status = (
            (wire.DISCONNECTED if self.has_fault('disconnect') else 0)
            | (wire.NO_FINGER if off else 0) | (wire.OUT_OF_TRACK if lost else 0))
        pulse_now = wire.NO_PULSE if off or lost or pulse <= 0.0 else min(round(pulse), 321)
        spo2_now = wire.NO_SPO2 if off or lost or spo2 <= 0.0 else min(round(spo2), 100)
        if pulse_now != wire.NO_PULSE:
            self._shown, self._shown_s = (pulse_now, spo2_now), time_s
        elif time_s - self._shown_s > _SHOWN_S:
            self._shown = (wire.NO_PULSE, wire.NO_SPO2)
        self._rate_hz = 0.0 if off else pulse / 60.0
        self._number += 1
        return wire.float_bytes(
            pulse_now, spo2_now, timer=self._number % wire.TIMER_TURN,
            status_2=wire.BATTERY_LOW if self.has_fault('battery') else 0, displayed=self._shown)

    def _next(self, time_s: float) -> tuple[int, int]:
        """Return the next sample of the wave, and its status."""
        status = self._status
        if status & wire.NO_FINGER:
            return _MIDDLE, status
        if self.has_fault('artefact'):
            status |= wire.ARTEFACT
        if self._wave is not None:
            sample, beat = self._wave.at(time_s)
        else:
            sample, beat = self._synthetic()
        if beat:
            self._pulse_frames = wire.PULSE_FRAMES
        if self._pulse_frames:
            self._pulse_frames -= 1
            status |= wire.POOR if status & wire.ARTEFACT else wire.GOOD
        swing = _SWING * (8.0 * self.random.random() if status & wire.ARTEFACT else 1.0)
        level = _MIDDLE + swing * (sample - 0.5) + self.random.gauss(0.0, _NOISE)
        return min(max(round(level), 0), 0xFFFF), status

    def _synthetic(self) -> tuple[float, bool]:
        """Return the next sample of a synthetic wave, 0 to 1, and whether a beat starts."""
        phase = self._phase + self._rate_hz / wire.FRAMES_PER_S
        beat = phase >= 1.0
        self._phase = phase = phase % 1.0
        return sum(height * math.exp(-((phase - at) / width) ** 2)
                   for at, width, height in _PULSE_SHAPE), beat
