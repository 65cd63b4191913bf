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
Commands to simulated devices and their world: lines such as ``imu silent 3``, ``world walk anna``.

They arrive on the standard input of `simulator`, or through a socket in the folder of the devices
that a robot has started.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
import socket
from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.sim.base import Simulated
from rt_robot_os.sim.faults import FAULT_HELP

if TYPE_CHECKING:
    from rt_robot_os.sim.world.world import World

# The first word of a command to the world, and the second one that requests all positions.
WORLD: Final = 'world'
WHERE: Final = 'where'

_NAME: Final = '.orders'
_LONGEST: Final = 4096
_LONGEST_ANSWER: Final = 65536
_PATIENCE_S: Final = 5.0
_DONE: Final = b'ok '


def execute_command(line: str, devices: Mapping[str, Simulated], world: World | None) -> str:
    """
    Execute the command in a line; an empty line is ignored.

    :return: the answer to ``world where``; otherwise empty.
    :raises ConfigError: it cannot be executed.
    """
    words = line.split()
    if not words:
        return ''
    if words[0] == WORLD and WORLD not in devices:
        if world is None:
            raise ConfigError([f'{line!r}: there is no world: configure one, see docs/world.md'])
        if words[1:] == [WHERE]:
            return world.where()
        world.inject(words[1:])
        return ''
    try:
        name, fault, duration = words
        device, duration_s = devices[name], float(duration)
    except (KeyError, ValueError):
        raise ConfigError([
            f'{line!r} is not understood: write DEVICE FAULT SECONDS with one of the devices '
            f'{", ".join(devices)} and one of the faults {FAULT_HELP}'
            + (f', or {WORLD} and an event' if world is not None else '')]) from None
    device.inject(fault, duration_s)
    return ''


class CommandSocket:
    """
    Receives commands on a socket in a folder that only its user can enter, and answers each.

    :param folder: of the devices.
    :param execute: executes a line and returns the answer, or raises ConfigError.
    """

    def __init__(self, folder: Path, execute_command: Callable[[str], str]) -> None:
        self._path = folder / _NAME
        self._execute = execute_command
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            self._path.unlink(missing_ok=True)
            self._socket.bind(str(self._path))
            self._socket.setblocking(False)
        except OSError as error:
            self._socket.close()
            raise DeviceError(f'{self._path} cannot be made: {error.strerror or error}') from error

    def fileno(self) -> int:
        """Return the descriptor that is readable when a command has arrived."""
        return self._socket.fileno()

    def serve(self) -> None:
        """Execute one command and answer it; never blocks."""
        with suppress(OSError):
            line, sender = self._socket.recvfrom(_LONGEST)
            try:
                answer = _DONE + self._execute(line.decode('utf-8', 'replace').strip()).encode()
            except ConfigError as error:
                answer = str(error).encode()
            if sender:
                self._socket.sendto(answer[:_LONGEST_ANSWER], sender)

    def close(self) -> None:
        """Close the socket; may be called twice."""
        self._socket.close()
        self._path.unlink(missing_ok=True)


def send_command(folder: Path, line: str) -> str:
    """
    Send a command to the devices of a folder, and wait until it is executed.

    :return: the answer, if it has one.
    :raises ConfigError: it cannot be executed; the text contains the reason.
    :raises DeviceError: no simulator receives commands there.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as mine:
        mine.settimeout(_PATIENCE_S)
        try:
            mine.bind('')  # Linux assigns a name, for the answer
            mine.sendto(line.encode()[:_LONGEST], str(folder / _NAME))
            answer = mine.recv(_LONGEST_ANSWER)
        except OSError as error:
            raise DeviceError(f'{folder}: no simulated devices receive commands there ({error}): '
                              'is the robot running, and simulated?') from error
    text = answer.decode('utf-8', 'replace')
    if not answer.startswith(_DONE):
        raise ConfigError([text])
    return text[len(_DONE):]
