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
A simulated Hokuyo laser scanner on the robot, or turning in a room with a pillar.

On a moving robot each ray is cast from the position of the laser at its time, as its mirror turns.
"""

from __future__ import annotations

import math
from typing import Final
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rt_robot_os.base.schema import Field
from rt_robot_os.devices.hokuyo import wire
from rt_robot_os.sim import world
from rt_robot_os.sim.device import common_settings
from rt_robot_os.sim.device import SimulatedDevice

if TYPE_CHECKING:
    from rt_robot_os.sim.world.world import World

# First, last and front step, steps per turn, longest distance in mm, turns per minute.
PRODUCTS: Final = {'URG-04LX': (44, 725, 384, 1024, 5600, 600),
                   'UTM-30LX': (0, 1080, 540, 1440, 30000, 2400)}
# The code that it sends without an echo, instead of a distance in mm.
_NO_ECHO: Final = {'URG-04LX': 0, 'UTM-30LX': 1}
ROOM_M: Final = (6.0, 4.0)
PILLAR_M: Final = (1.5, 0.5, 0.2)

_NOISE_M: Final = 0.01
_MINIMUM_MM: Final = 20
_MAX_PENDING: Final = 256
_BAD_COMMAND: Final = 4
_SCAN_COMMAND: Final = 15
#: Rays that are cast from one position while the robot moves: they take 6 ms.
_SECTOR: Final = 64
_S_PER_MIN: Final = 60.0

Ranges = npt.NDArray[np.float64]


class SimulatedHokuyo(SimulatedDevice):
    """A scanner; it executes MD, QT and PP."""

    SETTINGS = common_settings(10.0, 40.0) + (
        Field('product', str, 'URG-04LX', 'Its model.', choices=tuple(PRODUCTS)),
        Field('turn_rad_s', float, 0.2, 'How fast it turns in the room, without a world.', 'rad/s',
              -10.0, 10.0),
        world.NOISE_SETTING,
        Field('scanning', bool, False, 'It scans from the start, without a command.'),
    )
    BAUD = 500000

    def prepare(self) -> None:
        """Start in the state after power-on."""
        (self._first, self._last, self._front, self._turn, self._maximum_mm,
         self._rpm) = PRODUCTS[self.settings['product']]
        self._noise = np.random.default_rng(self.settings['seed'])
        self._scan = wire.scan_command(self._first, self._last) if (
            self.settings['scanning']) else b''
        self._received = b''

    def sample(self, time_s: float) -> bytes:
        """Return one scan; nothing before the command to scan."""
        if not self._scan:
            return b''
        first, last = int(self._scan[2:6]), int(self._scan[6:10])
        steps = np.arange(first, last + 1, dtype=np.float64) - self._front
        ranges = self._ranges(steps * (2 * math.pi / self._turn), time_s)
        ranges += self._noise.normal(0.0, _NOISE_M * self.settings['noise'], ranges.size)
        millimetres = np.where(ranges * 1000 >= self._maximum_mm + 0.5,
                               _NO_ECHO[self.settings['product']],
                               np.round(ranges * 1000)).astype(int)
        return wire.scan(self._scan, round(time_s * 1000), millimetres.tolist())

    def _ranges(self, angles: Ranges, time_s: float) -> Ranges:
        world = self.world
        if world is None:
            return room(angles + self.settings['turn_rad_s'] * time_s)
        ahead, turning = world.base.velocity
        if not ahead and not turning:
            return self._cast(world, angles, 0.0)
        # The last ray is measured now, the others before it.
        ages_s = (angles[-1] - angles) / math.tau * (_S_PER_MIN / self._rpm)
        return np.concatenate([
            self._cast(world, angles[start:start + _SECTOR],
                       float(ages_s[start:start + _SECTOR].mean()))
            for start in range(0, len(angles), _SECTOR)])

    def _cast(self, world: World, angles: Ranges, age_s: float) -> Ranges:
        """Return the distances that were measured some time ago."""
        x, y, yaw = world.pose_of(self.mounting, age_s)
        upside_down = abs(self.mounting.rotation_rad[0]) > math.pi / 2
        return world.cast(x, y, yaw - angles if upside_down else yaw + angles,
                          self._maximum_mm / 1000, self.mounting.position_m[2])

    def handle_command(self, data: bytes) -> None:
        """Answer each command."""
        *lines, rest = (self._received + data).split(b'\n')
        self._received = rest[-_MAX_PENDING:]
        for line in lines:
            self._handle_one(line)

    def _handle_one(self, line: bytes) -> None:
        if line == wire.QUIT:
            self._scan = b''
            self.reply(wire.answer(line))
        elif line == wire.PARAMETERS:
            self.reply(wire.parameters(
                first_step=self._first, last_step=self._last, steps_per_turn=self._turn,
                front_step=self._front, minimum_mm=_MINIMUM_MM, maximum_mm=self._maximum_mm,
                rpm=self._rpm, model=f'{self.settings["product"]}(simulated)'))
        elif line[:2] == b'MD' and len(line) == _SCAN_COMMAND and line[2:].isdigit():
            good = self._first <= int(line[2:6]) < int(line[6:10]) <= self._last
            self.reply(wire.answer(line, 0 if good else _BAD_COMMAND))
            if good:
                self._scan = line
        elif line:
            self.reply(wire.answer(line[:2], _BAD_COMMAND))


def room(angles: Ranges) -> Ranges:
    """
    Return the distances in m to the walls, or to the pillar in front of them.

    :param angles: in rad, 0 along the longer side of the room.
    """
    along, across = np.cos(angles), np.sin(angles)
    with np.errstate(divide='ignore'):
        walls = np.minimum(ROOM_M[0] / 2 / np.abs(along), ROOM_M[1] / 2 / np.abs(across))
    x, y, radius = PILLAR_M
    ahead = x * along + y * across
    beside = radius ** 2 - (x * across - y * along) ** 2
    hit = (beside > 0) & (ahead > 0)
    found: Ranges = np.where(hit, ahead - np.sqrt(np.where(hit, beside, 0.0)), walls)
    return found
