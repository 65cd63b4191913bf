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

"""The child process with a robot's simulated devices; it reads settings from standard input."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
import json
import os
from pathlib import Path
import select
import sys
from typing import Any
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.programs import ended_by_signals
from rt_robot_os.devices.simulators import SIMULATORS
from rt_robot_os.linux.process import run_child
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.sim.base import RobotSite
from rt_robot_os.sim.commands import CommandSocket
from rt_robot_os.sim.commands import execute_command
from rt_robot_os.sim.server import SimServer
from rt_robot_os.sim.world_settings import WorldSettings

if TYPE_CHECKING:
    from rt_robot_os.sim.world.world import World


def build(devices: dict[str, Any], folder: Path, world: dict[str, Any] | None = None,
          mountings: dict[str, dict[str, Any]] | None = None) -> SimServer:
    """
    Make the simulated devices, with their ports as ``folder/name``, and the world they sense.

    :param world: its settings; None for devices without a world.
    :param mountings: the mountings of the frames of all devices, by name.
    :raises RtRobotError: a setting is wrong, or a port cannot be created.
    """
    there = None if world is None else _world(world)
    return device_server(devices, RobotSite(
        folder, there, {frame: Mounting(tuple(each['position_m']), tuple(each['rotation_rad']),
                                        each['parent'])
                        for frame, each in (mountings or {}).items()}))


def device_server(devices: dict[str, Any], place: RobotSite) -> SimServer:
    """
    Make the simulated devices of a place, plugged in, with a socket for commands to them.

    :param devices: by name: ``type``, settings of the simulated device (``sim``) and of the device
        itself (``device``).
    :raises RtRobotError: a setting is wrong, or a port cannot be created.
    """
    made = {name: SIMULATORS.load(d['type']).made_for(name, d['sim'], place, d['device'])
            for name, d in devices.items()}
    for device in made.values():
        device.port.plug()
    server = SimServer(tuple(made.values()), report=tell)
    try:
        server.watch(CommandSocket(place.folder,
                                   lambda line: execute_command(line, made, place.world)))
    except DeviceError as error:
        tell(f'they accept no commands: {error}')
    return server


def _world(settings: dict[str, Any]) -> World:
    # Late: it needs NumPy, and most simulated devices do not.
    from rt_robot_os.sim.world.world import World
    return World(WorldSettings(**settings))


def tell(text: str) -> None:
    """Write a line to standard error, unless that would block: the devices do not wait."""
    writable = select.poll()
    writable.register(2, select.POLLOUT)
    with suppress(OSError):
        if any(events & select.POLLOUT for _, events in writable.poll(0)):
            os.write(2, f'simulator: {text}\n'.encode(errors='backslashreplace'))


def main(arguments: Sequence[str]) -> int:
    """Run until SIGTERM or the end of the parent; the argument is the folder of the devices."""
    text = sys.stdin.read()
    if not text:
        return 0  # no device is simulated
    folder = Path(arguments[0])
    folder.mkdir(mode=0o700, exist_ok=True)
    try:
        given = json.loads(text)
        server = build(given['devices'], folder, given['world'], given['mountings'])
        with ended_by_signals(lambda _: server.stop()):
            server.run()
    except RtRobotError as error:
        tell(str(error))
        return 1
    finally:
        with suppress(OSError):  # it contains other files
            folder.rmdir()
    return 0


if __name__ == '__main__':
    sys.exit(run_child(main))
