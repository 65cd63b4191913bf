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

"""Run the simulated devices of a robot in a process of their own, as real devices are."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
import json
import os
from pathlib import Path
import subprocess
import time
from typing import Any

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.reports import Severity
from rt_robot_os.core.part import Host
from rt_robot_os.core.simulator_supervisor import RESTARTED
from rt_robot_os.linux.process import start_child
from rt_robot_os.linux.process import START_PATIENCE_S
from rt_robot_os.linux.process import write_stdin
from rt_robot_os.linux.supervised_child import SupervisedChild
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import SIM_PORT

_STOP_TIMEOUT_S = 3.0
_NEWS_BYTES = 4096


class Simulators:
    """
    The child process with the simulated devices; it ends with this process.

    Another child keeps it running, see :mod:`rt_robot_os.core.simulator_supervisor`.

    :ivar restarts: how often it was started again.
    """

    def __init__(self) -> None:
        self.restarts = 0
        self._loaded: subprocess.Popen[bytes] | None = None
        self._keeper: SupervisedChild | None = None
        self._folder = Path()
        self._ports: tuple[Path, ...] = ()
        self._news = b''

    @staticmethod
    def wanted(settings: RobotSettings) -> bool:
        """Return whether a robot has simulated devices."""
        return any(device.port == SIM_PORT for device in settings.devices)

    def load(self, folder: Path) -> None:
        """
        Start the interpreters of the processes, which open nothing before :meth:`start`.

        :param folder: as for :meth:`start`.
        :raises OSError: they cannot be started.
        """
        self._loaded = _loaded_keeper(folder)

    def start(self, settings: RobotSettings, folder: Path) -> dict[str, str]:
        """
        Start what the settings ask for; :meth:`wait` until the ports are there.

        :param folder: where the ports get their stable paths; the caller holds the robot's name,
            so what lies there was left behind.
        :return: the path of the port of each simulated device, by device.
        :raises OSError: it cannot be started.
        """
        devices = {d.name: {'type': d.type, 'device': dict(d.settings), 'sim': dict(d.sim or {})}
                   for d in settings.devices if d.port == SIM_PORT}
        given = {'devices': devices,
                 'world': asdict(settings.world) if settings.world.map else None,
                 'mountings': {frame: asdict(each) for frame, each in settings.mountings.items()}}
        clear(folder)
        if not devices:
            self._end_loaded()
            return {}
        self._folder = folder
        given_json = json.dumps(given, default=_plain).encode()
        self._keeper = SupervisedChild('what keeps the simulated devices running', lambda: (
            self._started_keeper(folder, given_json)))
        self._keeper.start()
        self._ports = tuple(folder / name for name in devices)
        return {path.name: str(path) for path in self._ports}

    def wait(self) -> None:
        """
        Wait until the ports of all simulated devices are there.

        :raises DeviceError: the simulator ended or hangs.
        """
        process = self._keeper.process if self._keeper is not None else None
        deadline = time.monotonic() + START_PATIENCE_S
        while process is not None and not all(path.exists() for path in self._ports):
            if process.poll() is not None or time.monotonic() > deadline:
                self.stop()
                raise DeviceError('the simulated devices did not start; see the message above')
            time.sleep(0.01)

    def attach(self, host: Host) -> None:
        """Have a core look after them, and count them."""
        def look() -> None:
            for text in self.news():
                host.note(Severity.WARN, 'simulator', text)

        host.watch.add(look)
        host.statistics.add_facts(lambda: {'simulators_restarted': self.restarts})

    def news(self) -> list[str]:
        """
        Return what is new of the simulated devices; never waits.

        Two system calls: for the lowest task, a few times a second.
        """
        keeper = self._keeper
        if keeper is None or keeper.process is None:
            return []
        output = keeper.process.stdout
        if output is not None and not output.closed:
            with suppress(OSError):  # nothing new
                self._news += os.read(output.fileno(), _NEWS_BYTES)
        *lines, self._news = self._news[-_NEWS_BYTES:].split(b'\n')
        told = [line.decode(errors='replace') for line in lines]
        self.restarts += sum(RESTARTED in line for line in told)
        restarts = keeper.restarts
        told += filter(None, (keeper.check(),))
        self.restarts += keeper.restarts - restarts
        if keeper.restarts > restarts and output is not None:
            output.close()
        return told

    def _started_keeper(self, folder: Path, given: bytes) -> subprocess.Popen[bytes]:
        process, self._loaded = self._loaded or _loaded_keeper(folder), None
        write_stdin(process, given)
        return process

    def _end_loaded(self) -> None:
        """End what was loaded and is not needed: it ends by itself when it is given nothing."""
        if self._loaded is not None:
            write_stdin(self._loaded, b'')
            self._loaded = None

    def stop(self) -> None:
        """End the simulator; may be called twice."""
        self._end_loaded()
        keeper, self._keeper = self._keeper, None
        if keeper is None:
            return
        if keeper.process is not None and keeper.process.stdout is not None:
            keeper.process.stdout.close()
        keeper.stop(_STOP_TIMEOUT_S)
        clear(self._folder)  # it may have been killed


def _loaded_keeper(folder: Path) -> subprocess.Popen[bytes]:
    process = start_child('rt_robot_os.core.simulator_supervisor', os.getpid(), folder,
                          stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    if process.stdout is not None:
        os.set_blocking(process.stdout.fileno(), False)
    return process


def device_folder(path: Path) -> Path:
    """
    Return the folder of a robot's simulated devices.

    :param path: of the core's socket; it lies beside that.
    """
    return path.with_suffix('') if path.suffix else path.with_suffix('.devices')


def clear(folder: Path) -> None:
    """Remove the links and sockets of simulated devices that are no more, and their folder."""
    if folder.is_symlink() or not folder.is_dir():
        return
    for path in folder.iterdir():
        if path.is_symlink() or path.is_socket():
            path.unlink(missing_ok=True)
    with suppress(OSError):  # it holds something of somebody else
        folder.rmdir()


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f'{value!r} cannot be handed to the simulator')
