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


"""A simulated u-blox receiver that goes round in a circle, as the NMEA receiver does."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import timedelta
import math
from typing import Any

from rt_robot_os.drivers.decoders.ubx import CFG
from rt_robot_os.drivers.decoders.ubx import UbxDecoder
from rt_robot_os.drivers.encoders import ubx as encode
from rt_robot_os.schema import Field
from rt_robot_os.sim.nmea import ALTITUDE_M
from rt_robot_os.sim.nmea import DEVIATIONS_M
from rt_robot_os.sim.nmea import SEPARATION_M
from rt_robot_os.sim.nmea import SimulatedNmea
from rt_robot_os.sim.nmea import START
from rt_robot_os.sim.pty_port import PtyPort

_SATELLITES = 14


class SimulatedUblox(SimulatedNmea):
    """A receiver that sends NAV-PVT; it obeys CFG-MSG and CFG-RATE."""

    SETTINGS = SimulatedNmea.SETTINGS + (
        Field('first_fix_s', float, 0.0, 'Time to the first fix.', unit='s', minimum=0.0,
              maximum=1e6),
        Field('mixed', bool, False, 'NMEA sentences come between, as from a receiver as '
              'delivered.'),
        Field('refuses', bool, False, 'Refuses commands, as a receiver of generation 10.'),
    )
    BAUD = 38400

    def __init__(
        self, name: str, settings: Mapping[str, Any], port: PtyPort, baud: int | None = None,
    ) -> None:
        """
        Check the settings; nothing is plugged in yet.

        :raises ConfigError: a setting is wrong.
        """
        super().__init__(name, settings, port, baud)
        self._decoder = UbxDecoder()

    def sample(self, time_s: float) -> bytes:
        """Give one epoch."""
        fixed = time_s >= self.settings['first_fix_s']
        latitude_deg, longitude_deg, course_deg = self.position(time_s)
        speed = self.settings['speed_m_s']
        course = math.radians(course_deg)
        north_m, east_m, up_m = DEVIATIONS_M
        data = encode.nav_pvt(
            START + timedelta(seconds=round(time_s, 3)), latitude_deg, longitude_deg,
            ALTITUDE_M + SEPARATION_M, separation_m=SEPARATION_M, fix_type=3 if fixed else 0,
            flags=int(fixed), satellites=_SATELLITES if fixed else 0,
            horizontal_m=math.hypot(north_m, east_m), vertical_m=up_m,
            velocity_m_s=(speed * math.sin(course), speed * math.cos(course), 0.0))
        return super().sample(time_s) + data if self.settings['mixed'] else data

    def obey(self, data: bytes) -> None:
        """Take commands and acknowledge them."""
        for frame in self._decoder.feed(data):
            if frame.kind != CFG:
                continue
            known = frame.identifier in (encode.CFG_MSG, encode.CFG_RATE)
            done = known and not self.settings['refuses']
            if done and frame.identifier == encode.CFG_RATE and len(frame.payload) == 6:
                self.set_rate(1000 / max(int.from_bytes(frame.payload[:2], 'little'), 20))
            self.reply(encode.acknowledge(CFG, frame.identifier, done=done))
