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

"""The energy consumption of a mote, and the state of its battery."""

from __future__ import annotations

from typing import Final
from typing import NamedTuple

from rt_robot_os.features.wsn.radio.cc2420 import transmit_current_ma
from rt_robot_os.features.wsn.simulator.air import Radio

_NS_PER_HOUR: Final = 3_600_000_000_000


class PowerModel(NamedTuple):
    """
    The current of a mote in mA; the defaults are those of a Tmote Sky that always listens.

    :ivar listening_ma: radio and processor while it listens.
    :ivar sending_processor_ma: the processor while the radio sends.
    :ivar sleeping_ma: of a sleeping mote, also between two checks of the channel.
    :ivar capacity_mah: of a new battery.
    :ivar acceleration: factor by which a battery discharges faster, for short runs.
    :ivar listening_share: share of the time in which the radio listens; 1: always. Below 1 it
        is low-power listening: the radio sleeps and checks the channel periodically.
    :ivar wake_interval_s: with low-power listening, the time between two checks. A sender
        repeats each frame until the receiver is awake: half of this time on average.
    """

    listening_ma: float = 21.8
    sending_processor_ma: float = 2.1
    sleeping_ma: float = 0.0051
    capacity_mah: float = 2500.0
    acceleration: float = 1.0
    listening_share: float = 1.0
    wake_interval_s: float = 0.5


# Two alkaline cells: the part of the charge that is used, and the voltage then.
_DISCHARGE: Final = (
    (0.0, 3.2), (0.05, 2.95), (0.15, 2.8), (0.5, 2.6), (0.8, 2.4), (0.93, 2.2), (1.0, 1.8))
#: Below this voltage the radio is not reliable.
UNSTABLE_V: Final = 2.1
_FULL_SCALE_V: Final = 3.0
_ADC_VALUES: Final = 4096


class Battery:
    """
    The battery of a mote.

    :ivar model: the power model of the mote.
    :ivar used_mah: used charge at the last call of :meth:`account`.
    """

    __slots__ = ('model', 'used_mah', '_is_on', '_counted_ns', '_air_ns', '_frames', '_received')

    def __init__(self, model: PowerModel, used_mah: float = 0.0) -> None:
        """
        Create the battery of a mote that is off.

        :param used_mah: charge already used.
        """
        self.model = model
        self.used_mah = used_mah
        self._is_on = False
        self._counted_ns = 0
        self._air_ns = 0
        self._frames = 0
        self._received = 0

    @property
    def is_empty(self) -> bool:
        """Return whether it was empty at the last call of :meth:`account`."""
        return self.used_mah >= self.model.capacity_mah

    def switch_on(self, now_ns: int) -> None:
        """Start counting; a mote that is off uses no charge."""
        self._is_on = True
        self._counted_ns = now_ns

    def switch_off(self, now_ns: int, radio: Radio) -> None:
        """Count the charge up to now, then stop counting."""
        self.account(now_ns, radio)
        self._is_on = False

    def account(self, now_ns: int, radio: Radio) -> float:
        """Count the charge used up to now; return the remaining charge in mAh."""
        model = self.model
        if self._is_on:
            time_ns = now_ns - self._counted_ns
            air_ns = radio.air_ns - self._air_ns
            frames = radio.sent_frames - self._frames
            received = radio.received_frames - self._received
            self._air_ns, self._frames = radio.air_ns, radio.sent_frames
            self._received = radio.received_frames
            self._counted_ns = now_ns
            sending_ma = transmit_current_ma(radio.power_dbm) + model.sending_processor_ma
            share = model.listening_share
            if share < 1:
                # Of the repeated frames the receiver hears one and a half on average.
                air_ns += int(frames * model.wake_interval_s * 0.5e9)
                awake_ns = share * time_ns + received * 3_000_000
            else:
                awake_ns = float(time_ns)
            air_ns = min(air_ns, time_ns)
            awake_ns = min(awake_ns, float(time_ns - air_ns))
            asleep_ns = time_ns - air_ns - awake_ns
            charge = (sending_ma * air_ns + model.listening_ma * awake_ns
                      + model.sleeping_ma * asleep_ns)
            self.used_mah += model.acceleration * charge / _NS_PER_HOUR
        return max(0.0, model.capacity_mah - self.used_mah)

    @property
    def voltage_v(self) -> float:
        """Return the voltage at the last call of :meth:`account`."""
        used = min(self.used_mah / self.model.capacity_mah, 1.0)
        (before, high) = _DISCHARGE[0]
        for after, low in _DISCHARGE[1:]:
            if used <= after:
                return high + (low - high) * (used - before) / (after - before)
            before, high = after, low
        return high

    @property
    def raw_voltage(self) -> int:
        """Return it as the mote's ADC reads it: 12 bits of half of it, reference 1.5 V."""
        return min(int(self.voltage_v / _FULL_SCALE_V * _ADC_VALUES), _ADC_VALUES - 1)
