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
The hardware of an attacked robot: simulated devices and their world, in a process of their own.

Devices that a core starts end with it. These go on when the core is killed or stopped, as real
ones do, and write down what truly happened. It is started by :mod:`robot`, with its settings as
JSON on standard input::

    hardware.py FOLDER

``FOLDER/NAME`` is the port of each device. ``FOLDER/track`` has a line for each 10 ms, oldest
first, with the fields of :class:`robot.Truth`.
"""

from __future__ import annotations

import json
from pathlib import Path
import signal
import sys
import time

from rt_robot_os.core.simulator_process import device_server
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.sim.base import RobotSite
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world_settings import WorldSettings

TRACK = 'track'
_EVERY_NS = 10_000_000


def main(folder: Path) -> None:
    """Be the hardware until SIGTERM."""
    given = json.load(sys.stdin)
    world = World(WorldSettings(**given['world']))
    mountings = {frame: Mounting(tuple(each['position_m']), tuple(each['rotation_rad']),
                                 each['parent']) for frame, each in given['mountings'].items()}
    server = device_server(given['devices'], RobotSite(folder, world, mountings))
    base, due_ns = world.base, 0
    with (folder / TRACK).open('w', buffering=1) as track:
        def record() -> bool:
            nonlocal due_ns
            now_ns = time.monotonic_ns()
            if now_ns >= due_ns:
                due_ns = now_ns + _EVERY_NS
                world.advance(now_ns)
                numbers = (*base.pose, *base.velocity, base.impact_m_s)
                track.write(f'{now_ns} {" ".join(f"{each:.5f}" for each in numbers)} '
                            f'{base.contacts}\n')
            return False

        signal.signal(signal.SIGTERM, lambda *_: server.stop())
        server.run(until=record)


if __name__ == '__main__':
    main(Path(sys.argv[1]))
