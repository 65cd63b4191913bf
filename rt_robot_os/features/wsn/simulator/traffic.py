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


"""The packets of a node's application, byte for byte: of Surge, of the paper, of TinyOS 2."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
import math
from struct import Struct
from types import MappingProxyType
from typing import Final
from typing import Protocol

from rt_robot_os.features.wsn.packets.oscilloscope import Oscilloscope
from rt_robot_os.features.wsn.packets.paper import DataMsg
from rt_robot_os.features.wsn.packets.paper import Kind
from rt_robot_os.features.wsn.packets.surge import SurgeMsg
from rt_robot_os.features.wsn.routing.protocol import Router
from rt_robot_os.features.wsn.simulator.energy import Battery

_NOBODY: Final = 0xFFFF
_READINGS: Final = Struct('>5H')
_FULL_BATTERY: Final = 4095
_DAY_PACKETS: Final = 3000.0


class Source(Protocol):
    """The interface of a mote to its application."""

    address: int
    router: Router
    battery: Battery | None
    boots: int


#: Creates the bytes of a packet from the mote and the packet's number.
Build = Callable[[Source, int], bytes]

#: The kind of a quantity in a packet of the paper, and the mean of its raw value.
KINDS: Final[Mapping[str, tuple[Kind, int, int]]] = MappingProxyType({
    'temperature': (Kind.TEMPERATURE, 6100, 120), 'humidity': (Kind.HUMIDITY, 1250, 80),
    'light': (Kind.LIGHT, 300, 150), 'battery': (Kind.BATTERY, 0, 0),
    'pulse_per_min': (Kind.PULSE, 72, 9), 'respiration_per_min': (Kind.RESPIRATION, 15, 2),
    'spo2_percent': (Kind.SPO2, 97, 1), 'body_temperature': (Kind.BODY_TEMPERATURE, 30_980, 20),
    'acceleration_g': (Kind.ACCELERATION, 1000, 25), 'alarm': (Kind.ALARM, 0, 0),
    'smoke': (Kind.SMOKE, 0, 0), 'water': (Kind.WATER, 0, 0),
    'systolic_mmhg': (Kind.SYSTOLIC, 126, 9), 'diastolic_mmhg': (Kind.DIASTOLIC, 78, 6),
    'oxygen_l_per_min': (Kind.OXYGEN, 0, 0), 'consciousness': (Kind.CONSCIOUSNESS, 0, 0),
    'presence': (Kind.PRESENCE, 0, 0), 'nearest_node': (Kind.NEAREST_NODE, 0, 0)})


class _Count:
    """Counts the packets of a mote since its boot; the network's count continues."""

    __slots__ = ('_boots', '_first')

    def __init__(self) -> None:
        self._boots = -1
        self._first = 0

    def since_boot(self, mote: Source, number: int) -> int:
        if mote.boots != self._boots:
            self._boots, self._first = mote.boots, number
        return number - self._first


def _swing(address: int, number: int, least: int, most: int) -> int:
    """Return a value that varies slowly and periodically, with another phase for each node."""
    part = math.sin(math.tau * (number / _DAY_PACKETS + address * 0.381966))
    return round(least + (most - least) * (0.5 + 0.5 * part))


def _voltage(mote: Source) -> int:
    return _FULL_BATTERY if mote.battery is None else mote.battery.raw_voltage


def _parent(mote: Source) -> int:
    parent = mote.router.parent
    return _NOBODY if parent is None else parent


def surge() -> Build:
    """Create the application of SurgeTelos: one reading of the ADC a packet."""
    count = _Count()

    def build(mote: Source, number: int) -> bytes:
        made = count.since_boot(mote, number)
        return SurgeMsg(0, _swing(mote.address, made, 500, 3000), _parent(mote), made).pack()

    return build


def data(quantities: tuple[str, ...]) -> Build:
    """
    Create the application of the paper: one quantity a packet, one after the other.

    :param quantities: of the node; those without a kind in the paper are left out.
    """
    count = _Count()
    kinds = [KINDS[name] for name in quantities if name in KINDS] or [KINDS['temperature']]

    def build(mote: Source, number: int) -> bytes:
        made = count.since_boot(mote, number)
        kind, middle, swing = kinds[made % len(kinds)]
        voltage = _voltage(mote)
        reading = voltage if kind is Kind.BATTERY else _swing(
            mote.address, made, middle - swing, middle + swing)
        return DataMsg(0, reading, _parent(mote), made, kind, voltage).pack()

    return build


def oscilloscope(period_ns: int) -> Build:
    """
    Create the application MultihopOscilloscope: five readings a packet.

    :param period_ns: between packets; the interval between readings is a fifth of it.
    """
    count = _Count()
    interval = max(1, min(0xFFFF, round(period_ns * 1024 / 5e9)))

    def build(mote: Source, number: int) -> bytes:
        made = count.since_boot(mote, number)
        readings = [_swing(mote.address, 5 * made + each, 0, 100) for each in range(5)]
        return Oscilloscope(0, interval, mote.address, made & 0xFFFF,
                            _READINGS.pack(*readings)).pack()

    return build


def application(payload: str, quantities: tuple[str, ...], period_ns: int) -> Build:
    """
    Create the application of one node.

    :param payload: one of ``scenario.PAYLOADS``.
    """
    if payload == 'surge':
        return surge()
    return data(quantities) if payload == 'data' else oscilloscope(period_ns)
