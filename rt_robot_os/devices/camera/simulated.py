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

"""A simulated camera."""

from __future__ import annotations

from collections.abc import Mapping
import math
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.devices.capture.scene_memory import SceneMemory
from rt_robot_os.devices.capture.simulated import SimulatedCapture
from rt_robot_os.motion.quaternion import rotate
from rt_robot_os.motion.quaternion import Vector
from rt_robot_os.sim.base import NOWHERE
from rt_robot_os.sim.base import Site

_LOOK_NS: Final = 20 * NS_PER_MS


class SimulatedCamera(SimulatedCapture):
    """A camera that shows the world from its mounting, or without a world a moving pattern."""

    def __init__(self, name: str, settings: Mapping[str, Any], path: Path,
                 site: Site = NOWHERE) -> None:
        """
        Store the settings; nothing is plugged in.

        :raises ConfigError: a setting is wrong.
        """
        super().__init__(name, settings, path, site)
        self._look_ns = 0
        if self.world is not None:
            self.port.scene = SceneMemory.create()

    def pump(self, now_ns: int) -> None:
        """
        Pass the scene to its process, and start the process.

        :raises DeviceError: the port cannot be made again after a fault.
        """
        if self.world is not None and self.port.scene is not None and now_ns >= self._look_ns:
            self.world.advance(now_ns)
            self.port.scene.write(self.scene())
            self._look_ns = now_ns + _LOOK_NS
        super().pump(now_ns)

    def next_event_ns(self) -> int:
        """Return when ``pump`` has to be called next."""
        next_ns = super().next_event_ns()
        return next_ns if self.world is None else min(next_ns, self._look_ns)

    def close(self) -> None:
        """Unplug the device; may be called twice."""
        super().close()
        if self.port.scene is not None:
            self.port.scene.close()
            self.port.scene = None

    def scene(self) -> Mapping[str, Any]:
        """Return the scene for a ``RoomView``."""
        world = self.world
        if world is None:
            return {}
        mounting = self.site.mounting()
        x, y, _ = world.pose_of(mounting)
        ahead, left, up = rotate(mounting.quaternion(), self._axis())
        yaw = world.base.pose[2] + math.atan2(left, ahead)
        return {'map': str(world.map_path or ''),
                'camera': (x, y, mounting.position_m[2], yaw,
                           -math.asin(max(-1.0, min(1.0, up)))),
                'ceiling': world.settings.ceiling_m, 'lux': world.light_lux(x, y),
                'people': [(person.x, person.y, *person.figure()) for person in world.people]}

    def _axis(self) -> Vector:
        """Return its optical axis, in the axes of the mounted frame."""
        device = self.site.device
        housing = device.get('body_frame_id', 'camera_link')
        optical = not housing or housing == device.get('frame_id')
        return (0.0, 0.0, 1.0) if optical else (1.0, 0.0, 0.0)
