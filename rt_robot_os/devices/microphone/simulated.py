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

"""A simulated microphone."""

from __future__ import annotations

from collections.abc import Mapping
import math
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.devices.capture.scene_memory import SceneMemory
from rt_robot_os.devices.capture.simulated import SimulatedCapture
from rt_robot_os.sim.base import NOWHERE
from rt_robot_os.sim.base import Site

_LISTEN_NS: Final = 50 * NS_PER_MS
# Levels of a quiet room, of a voice 1 m away, and the attenuation of a wall.
_ROOM_DB: Final = -60.0
_VOICE_DB: Final = -20.0
_WALL_DB: Final = 15.0
_NEAREST_M: Final = 0.3


class SimulatedMicrophone(SimulatedCapture):
    """A microphone that records speaking people of the world, or a tone of 440 Hz at -12 dB."""

    def __init__(self, name: str, settings: Mapping[str, Any], path: Path,
                 site: Site = NOWHERE) -> None:
        """
        Store the settings; nothing is plugged in.

        :raises ConfigError: a setting is wrong.
        """
        super().__init__(name, settings, path, site)
        self._listen_ns = 0
        if self.world is not None:
            self.port.scene = SceneMemory.create()

    def pump(self, now_ns: int) -> None:
        """
        Pass the level to its process, and start the process.

        :raises DeviceError: the port cannot be made again after a fault.
        """
        if self.world is not None and self.port.scene is not None and now_ns >= self._listen_ns:
            self.world.advance(now_ns)
            self.port.scene.write({'level_db': self.level_db()})
            self._listen_ns = now_ns + _LISTEN_NS
        super().pump(now_ns)

    def next_event_ns(self) -> int:
        """Return when ``pump`` has to be called next."""
        next_ns = super().next_event_ns()
        return next_ns if self.world is None else min(next_ns, self._listen_ns)

    def close(self) -> None:
        """Unplug the device; may be called twice."""
        super().close()
        if self.port.scene is not None:
            self.port.scene.close()
            self.port.scene = None

    def level_db(self) -> float:
        """Return the level at the microphone, in dB below full scale."""
        power: float = 10 ** (_ROOM_DB / 10)
        if self.world is None:
            return _ROOM_DB
        x, y, _ = self.world.pose_of(self.site.mounting())
        for person in self.world.people:
            if person.speaks:
                away_m = max(math.hypot(person.x - x, person.y - y), _NEAREST_M)
                level_db = _VOICE_DB - 20.0 * math.log10(away_m)
                if not self.world.in_sight(person.x, person.y, x, y):
                    level_db -= _WALL_DB
                power += 10 ** (level_db / 10)
        return 10.0 * math.log10(power)
