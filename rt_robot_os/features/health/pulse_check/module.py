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

"""A second opinion on a pulse oximeter: the pulse as its waveform shows it, beside its own."""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any
from typing import Final

from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.health.pulse_check.pulse_meter import Pulse
from rt_robot_os.features.health.pulse_check.pulse_meter import PulseMeter
from rt_robot_os.features.health.pulse_check.pulse_meter import WINDOW_S
from rt_robot_os.modules.base import Module
from rt_robot_os.topics.ports import Input
from rt_robot_os.topics.ports import Output

_FLOAT: Final = 'std_msgs/msg/Float64'
_TEXT_BYTES: Final = 120
# The device's own rate is not older than this when it is compared.
_FRESH_NS: Final = 5 * NS_PER_S
# A longer gap is a new beginning: the wave before it has left the window.
_KEPT_NS: Final = round(WINDOW_S * NS_PER_S)

AGREES: Final = 'agrees'
SUSPECT: Final = 'suspect'
UNKNOWN: Final = 'unknown'


class PulseCheck(Module):
    """
    Find the pulse in a waveform, and say where the device differs for long.

    A difference lowers the quality of a measurement; it is no alarm. Each third packet, a second
    of the wave, is followed by a look at the last ten; all times are those of the samples.
    """

    pleth = Input('oximeter/pleth', message='std_msgs/msg/UInt16MultiArray', wake=3)
    device = Input('oximeter/pulse_per_min', message=_FLOAT)
    pulse = Output('oximeter/wave_pulse_per_min', _FLOAT)
    verdict = Output('oximeter/pulse_check', 'std_msgs/msg/String', tail=_TEXT_BYTES)

    SETTINGS = (
        Field('sample_rate_hz', float, 75.0, 'Samples a second of the waveform.', 'Hz', 25.0,
              1000.0),
        Field('difference_per_min', float, 10.0, 'The two differ when they are farther apart, and '
              'by more than a tenth.', '1/min', 1.0, 200.0, live=True),
        Field('for_s', float, 10.0, 'Time for which they have to differ, or the wave to say '
              'nothing, before that is told.', 's', 0.0, 600.0, live=True),
    )

    def configure(self) -> None:
        """Make the meter."""
        self._rate_hz: float = self.settings['sample_rate_hz']
        self._meter = PulseMeter(self._rate_hz)
        # What the next sample would be stamped if none is missing.
        self._last_ns = 0
        # Since when it is not known, and since when they differ; 0: it is, they do not.
        self._unknown_ns = self._differ_ns = 0
        self._told = UNKNOWN
        self._counts = {'looks': 0, 'believed': 0, 'differed': 0, 'gaps': 0}
        self._why = ''

    def step(self) -> None:
        """Take what came of the wave, and look at it."""
        stamp_ns = 0
        while self.pleth.take():
            stamp_ns = self.pleth.stamp_ns
            self._add(stamp_ns)
        self.device.latest()
        if not stamp_ns:
            return
        found = self._meter.look()
        self._counts['looks'] += 1
        if not found.doubt:
            self._counts['believed'] += 1
            self.pulse.msg.data = found.rate_per_min
            self.pulse.publish(stamp_ns)
        self.verdict.msg.data = self._judge(found, stamp_ns)[:_TEXT_BYTES]
        self.verdict.publish(stamp_ns)

    def statistics(self) -> Mapping[str, Any]:
        """Return how often the wave was looked at, believed, and another than the device."""
        return {**self._counts, 'verdict': self._told,
                'warning': self._why if self._told == SUSPECT else ''}

    def _add(self, stamp_ns: int) -> None:
        samples = self.pleth.msg.data
        length_ns = round(len(samples) * NS_PER_S / self._rate_hz)
        # Half a packet aside is jitter of the line; more is a wave that does not go on.
        missing_ns = stamp_ns - self._last_ns - length_ns
        if self._last_ns and abs(missing_ns) > length_ns // 2:
            self._counts['gaps'] += 1
            if 0 < missing_ns <= _KEPT_NS:
                # The wave before it still tells when the pulse has stopped.
                self._meter.add([math.nan] * round(missing_ns * self._rate_hz / NS_PER_S))
            else:
                self._meter.restart()
        self._last_ns = stamp_ns
        self._meter.add(samples)

    def _judge(self, found: Pulse, stamp_ns: int) -> str:
        for_ns = round(self.settings['for_s'] * NS_PER_S)
        told = self._of_device(stamp_ns)
        if found.doubt or math.isnan(told):
            self._unknown_ns = self._unknown_ns or stamp_ns
            if stamp_ns - self._unknown_ns >= for_ns:
                self._told, self._differ_ns = UNKNOWN, 0
                self._why = found.doubt or 'the device tells no pulse'
            return f'{self._told}: {self._why}' if self._why else self._told
        self._unknown_ns = 0
        apart = abs(found.rate_per_min - told)
        if apart <= max(self.settings['difference_per_min'], told / 10.0):
            self._told, self._differ_ns, self._why = AGREES, 0, ''
            return AGREES
        self._counts['differed'] += 1
        self._differ_ns = self._differ_ns or stamp_ns
        if stamp_ns - self._differ_ns >= for_ns:
            self._told = SUSPECT
            self._why = (f'the device says {told:.0f}/min and its wave shows '
                         f'{found.rate_per_min:.0f}/min')
        return f'{self._told}: {self._why}' if self._why else self._told

    def _of_device(self, stamp_ns: int) -> float:
        """Return the device's own rate; NaN when it is old, or there is none."""
        if self.device.seq < 0 or stamp_ns - self.device.stamp_ns > _FRESH_NS:
            return math.nan
        return float(self.device.msg.data)
