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

"""A check of a pulse oximeter: the pulse rate of its waveform against the rate it reports."""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.pulse_check.pulse_meter import PulseMeasurement
from rt_robot_os.features.health.pulse_check.pulse_meter import PulseMeter
from rt_robot_os.features.health.pulse_check.pulse_meter import WINDOW_S
from rt_robot_os.modules.base import Module
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_FLOAT: Final = 'std_msgs/msg/Float64'
_TEXT_BYTES: Final = 120
# Largest age of the device's rate in a comparison.
_FRESH_NS: Final = 5 * NS_PER_S
# A longer gap restarts the measurement: the wave before it is outside the window.
_KEPT_NS: Final = round(WINDOW_S * NS_PER_S)

AGREES: Final = 'agrees'
SUSPECT: Final = 'suspect'
UNKNOWN: Final = 'unknown'


class PulseCheck(Module):
    """
    Measure the pulse in a waveform, and report when the device differs for long.

    A difference lowers the quality of a measurement; it is not an alarm. After each third packet,
    a second of the wave, the last ten seconds are evaluated. All times are stamps of samples.
    """

    pleth = Input('oximeter/pleth', message='std_msgs/msg/UInt16MultiArray', wake=3)
    device = Input('oximeter/pulse_per_min', message=_FLOAT)
    pulse = Output('oximeter/wave_pulse_per_min', _FLOAT)
    verdict = Output('oximeter/pulse_check', 'std_msgs/msg/String', tail=_TEXT_BYTES)

    SETTINGS = (
        Field('sample_rate_hz', float, 75.0, 'Sampling rate of the waveform.', 'Hz', 25.0,
              1000.0),
        Field('difference_per_min', float, 10.0, 'Largest difference of the two rates that counts '
              'as agreement; a tenth of the rate always does.', '1/min', 1.0, 200.0, live=True),
        Field('for_s', float, 10.0, 'Time for which they must differ, or the wave be unreliable, '
              'before that is reported.', 's', 0.0, 600.0, live=True),
    )

    def configure(self) -> None:
        """Create the pulse meter."""
        self._rate_hz: float = self.settings['sample_rate_hz']
        self._meter = PulseMeter(self._rate_hz)
        # Stamp of the newest packet.
        self._last_ns = 0
        # Since when the pulse is unknown, and since when the rates differ; 0: not.
        self._unknown_ns = self._differ_ns = 0
        self._verdict = UNKNOWN
        self._counts = {'looks': 0, 'believed': 0, 'differed': 0, 'gaps': 0}
        self._reason = ''

    def step(self) -> None:
        """Process new packets of the wave, and evaluate it."""
        stamp_ns = 0
        while self.pleth.take():
            stamp_ns = self.pleth.stamp_ns
            self._add(stamp_ns)
        self.device.latest()
        if not stamp_ns:
            return
        measurement = self._meter.measure()
        self._counts['looks'] += 1
        if not measurement.doubt:
            self._counts['believed'] += 1
            self.pulse.msg.data = measurement.rate_per_min
            self.pulse.publish(stamp_ns)
        self.verdict.msg.data = self._judge(measurement, stamp_ns)[:_TEXT_BYTES]
        self.verdict.publish(stamp_ns)

    def statistics(self) -> Mapping[str, Any]:
        """Return how often the wave was evaluated, reliable, and different from the device."""
        return {**self._counts, 'verdict': self._verdict,
                'warning': self._reason if self._verdict == SUSPECT else ''}

    def _add(self, stamp_ns: int) -> None:
        samples = self.pleth.msg.data
        length_ns = round(len(samples) * NS_PER_S / self._rate_hz)
        # Up to half a packet is jitter of the line; more is a gap.
        missing_ns = stamp_ns - self._last_ns - length_ns
        if self._last_ns and abs(missing_ns) > length_ns // 2:
            self._counts['gaps'] += 1
            if 0 < missing_ns <= _KEPT_NS:
                # With the wave before the gap a pause of the pulse can be measured.
                self._meter.add([math.nan] * round(missing_ns * self._rate_hz / NS_PER_S))
            else:
                self._meter.restart()
        self._last_ns = stamp_ns
        self._meter.add(samples)

    def _judge(self, measurement: PulseMeasurement, stamp_ns: int) -> str:
        for_ns = round(self.settings['for_s'] * NS_PER_S)
        device_per_min = self._device_rate(stamp_ns)
        if measurement.doubt or math.isnan(device_per_min):
            self._unknown_ns = self._unknown_ns or stamp_ns
            if stamp_ns - self._unknown_ns >= for_ns:
                self._verdict, self._differ_ns = UNKNOWN, 0
                self._reason = measurement.doubt or 'the device reports no pulse'
            return f'{self._verdict}: {self._reason}' if self._reason else self._verdict
        self._unknown_ns = 0
        apart = abs(measurement.rate_per_min - device_per_min)
        if apart <= max(self.settings['difference_per_min'], device_per_min / 10.0):
            self._verdict, self._differ_ns, self._reason = AGREES, 0, ''
            return AGREES
        self._counts['differed'] += 1
        self._differ_ns = self._differ_ns or stamp_ns
        if stamp_ns - self._differ_ns >= for_ns:
            self._verdict = SUSPECT
            self._reason = (f'the device reports {device_per_min:.0f}/min and its wave shows '
                            f'{measurement.rate_per_min:.0f}/min')
        return f'{self._verdict}: {self._reason}' if self._reason else self._verdict

    def _device_rate(self, stamp_ns: int) -> float:
        """Return the device's rate; NaN when it is old, or there is none."""
        if self.device.seq < 0 or stamp_ns - self.device.stamp_ns > _FRESH_NS:
            return math.nan
        return float(self.device.msg.data)
