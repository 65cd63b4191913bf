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


"""A simulated u-blox receiver that moves like the NMEA receiver."""

from __future__ import annotations

from datetime import timedelta
import math

from rt_robot_os.base.schema import Field
from rt_robot_os.devices.nmea.simulated import DEVIATIONS_M
from rt_robot_os.devices.nmea.simulated import SEPARATION_M
from rt_robot_os.devices.nmea.simulated import SimulatedNmea
from rt_robot_os.devices.nmea.simulated import START
from rt_robot_os.devices.ublox import wire
from rt_robot_os.devices.ublox.rtcm import RtcmDecoder
from rt_robot_os.devices.ublox.wire import CFG
from rt_robot_os.devices.ublox.wire import HPPOSLLH
from rt_robot_os.devices.ublox.wire import NAV
from rt_robot_os.devices.ublox.wire import UbxDecoder

_SATELLITES = 14
_CARRIER_FIXED = 0x82
# An RTK solution remains for a while without corrections.
_CORRECTED_S = 10.0
_FIXED_DEVIATIONS_M = (0.012, 0.010, 0.020)


class SimulatedUblox(SimulatedNmea):
    """
    A receiver that sends NAV-PVT; set up by CFG-VALSET, or by CFG-MSG and CFG-RATE.

    In generation 9 it is an RTK receiver: it has NAV-HPPOSLLH, and a fixed carrier phase solution
    while corrections arrive.

    :ivar corrections: number of RTCM 3 messages received.
    """

    SETTINGS = SimulatedNmea.SETTINGS + (
        Field('first_fix_s', float, 0.0, 'Time to the first fix.', unit='s', minimum=0.0,
              maximum=1e6),
        Field('mixed', bool, False,
              'It also sends NMEA sentences, like a receiver with factory settings.'),
        Field('generation', int, 9,
              'Up to 8 it does not support CFG-VALSET, 10 supports nothing else; 9 supports both '
              'and is an RTK receiver.', choices=(8, 9, 10)),
        Field('refuses', bool, False, 'It refuses all commands.'),
    )
    BAUD = 38400

    def prepare(self) -> None:
        """Start in the state after power-on."""
        self._decoder = UbxDecoder()
        self._rtcm = RtcmDecoder()
        self.corrections = 0
        self._corrected_until_s = 0.0
        self._time_s = 0.0
        self._precise = False
        self._keys = _known_keys(self.settings['generation'])

    def sample(self, time_s: float) -> bytes:
        """Return one epoch."""
        self._time_s = time_s
        fixed = time_s >= self.settings['first_fix_s']
        latitude_deg, longitude_deg, course_deg = self.position(time_s)
        speed, altitude_m = self.speed_and_altitude()
        course = math.radians(course_deg)
        north_m, east_m, up_m = DEVIATIONS_M
        time = START + timedelta(seconds=round(time_s, 3))
        flags = _CARRIER_FIXED if time_s < self._corrected_until_s else 0
        data = wire.make_nav_pvt(
            time, latitude_deg, longitude_deg,
            altitude_m + SEPARATION_M, separation_m=SEPARATION_M, fix_type=3 if fixed else 0,
            flags=flags | fixed, satellites=_SATELLITES if fixed else 0,
            horizontal_m=math.hypot(north_m, east_m), vertical_m=up_m,
            velocity_m_s=(speed * math.sin(course), speed * math.cos(course), 0.0))
        if self._precise:
            data += wire.make_nav_hpposllh(
                time, latitude_deg, longitude_deg, altitude_m + SEPARATION_M,
                separation_m=SEPARATION_M, invalid=not fixed)
        return super().sample(time_s) + data if self.settings['mixed'] else data

    def deviations_m(self) -> tuple[float, float, float]:
        """Return the standard deviations of its error: north, east, up; small with corrections."""
        fixed = self._time_s < self._corrected_until_s
        return _FIXED_DEVIATIONS_M if fixed else super().deviations_m()

    def handle_command(self, data: bytes) -> None:
        """Execute commands and acknowledge them; count corrections."""
        corrections = len(self._rtcm.feed(data))
        if corrections and wire.PORTS[0].rtcm_in in self._keys:
            self.corrections += corrections
            self._corrected_until_s = self._time_s + _CORRECTED_S
        for frame in self._decoder.feed(data):
            if frame.kind == CFG:
                done = not self.settings['refuses'] and self._do(frame.identifier, frame.payload)
                self.reply(wire.acknowledge(CFG, frame.identifier, done=done))

    def _do(self, identifier: int, payload: bytes) -> bool:
        generation = self.settings['generation']
        if identifier == wire.CFG_VALSET and generation > 8:
            values = wire.parse_valset(payload)
            if not values or not self._keys.issuperset(values):
                return False
            self._precise = self._precise or any(
                values.get(port.nav_hpposllh) for port in wire.PORTS)
            if wire.RATE_MEAS in values:
                self.set_rate(1000 / max(values[wire.RATE_MEAS], 20))
            return True
        if identifier == wire.CFG_RATE and generation < 10 and len(payload) == 6:
            self.set_rate(1000 / max(int.from_bytes(payload[:2], 'little'), 20))
            return True
        if identifier == wire.CFG_MSG and generation < 10:
            self._precise = self._precise or payload == bytes((NAV, HPPOSLLH, 1))
            return True
        return False


def _known_keys(generation: int) -> frozenset[int]:
    """Return the keys of a receiver; one of generation 10 has one port and accepts no RTCM."""
    keys = {wire.RATE_MEAS, wire.RATE_NAV}
    for port in wire.PORTS[:1] if generation > 9 else wire.PORTS:
        keys |= {port.ubx_out, port.nav_pvt}
        if generation == 9:
            keys |= {port.rtcm_in, port.nav_hpposllh}
    return frozenset(keys)
