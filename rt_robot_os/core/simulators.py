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

"""Run the simulated devices of a robot in a separate process, as real devices are."""

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
_REPORT_BYTES = 4096


class Simulators:
    """
    The child process with the simulated devices; it ends with this process.

    Another child supervises it, see :mod:`rt_robot_os.core.simulator_supervisor`.

    :ivar restarts: the number of restarts.
    """

    def __init__(self) -> None:
        self.restarts = 0
        self._loaded: subprocess.Popen[bytes] | None = None
        self._supervisor: SupervisedChild | None = None
        self._folder = Path()
        self._ports: tuple[Path, ...] = ()
        self._unread = b''

    @staticmethod
    def wanted(settings: RobotSettings) -> bool:
        """Return whether a robot has simulated devices."""
        return any(device.port == SIM_PORT for device in settings.devices)

    def load(self, folder: Path) -> None:
        """
        Start the interpreters of both processes, which open nothing before :meth:`start`.

        :param folder: as for :meth:`start`.
        :raises OSError: they cannot be started.
        """
        self._loaded = _loaded_supervisor(folder)

    def start(self, settings: RobotSettings, folder: Path) -> dict[str, str]:
        """
        Start the simulated devices of the settings; :meth:`wait` until their ports exist.

        :param folder: for the stable paths of the ports; the caller holds the robot's lock, so
            any content was left behind.
        :return: the path of the port of each simulated device, by device.
        :raises OSError: the process cannot be started.
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
        self._supervisor = SupervisedChild('the supervisor of the simulated devices', lambda: (
            self._started_supervisor(folder, given_json)))
        self._supervisor.start()
        self._ports = tuple(folder / name for name in devices)
        return {path.name: str(path) for path in self._ports}

    def wait(self) -> None:
        """
        Wait until the ports of all simulated devices exist.

        :raises DeviceError: the simulator ended or hangs.
        """
        process = self._supervisor.process if self._supervisor is not None else None
        deadline = time.monotonic() + START_PATIENCE_S
        while process is not None and not all(path.exists() for path in self._ports):
            if process.poll() is not None or time.monotonic() > deadline:
                self.stop()
                raise DeviceError('the simulated devices did not start; see the message above')
            time.sleep(0.01)

    def attach(self, host: Host) -> None:
        """Let a core log the reports about the devices, and count restarts."""
        def poll() -> None:
            for text in self.reports():
                host.note(Severity.WARN, 'simulator', text)

        host.watch.add(poll)
        host.statistics.add_facts(lambda: {'simulators_restarted': self.restarts})

    def reports(self) -> list[str]:
        """
        Return new reports about the simulated devices; never waits.

        Two system calls: for the lowest task, a few times a second.
        """
        supervisor = self._supervisor
        if supervisor is None or supervisor.process is None:
            return []
        output = supervisor.process.stdout
        if output is not None and not output.closed:
            with suppress(OSError):  # nothing to read
                self._unread += os.read(output.fileno(), _REPORT_BYTES)
        *lines, self._unread = self._unread[-_REPORT_BYTES:].split(b'\n')
        reports = [line.decode(errors='replace') for line in lines]
        self.restarts += sum(RESTARTED in line for line in reports)
        restarts = supervisor.restarts
        reports += filter(None, (supervisor.check(),))
        self.restarts += supervisor.restarts - restarts
        if supervisor.restarts > restarts and output is not None:
            output.close()
        return reports

    def _started_supervisor(self, folder: Path, given: bytes) -> subprocess.Popen[bytes]:
        process, self._loaded = self._loaded or _loaded_supervisor(folder), None
        write_stdin(process, given)
        return process

    def _end_loaded(self) -> None:
        """End the loaded process if it is not needed: without settings it ends by itself."""
        if self._loaded is not None:
            write_stdin(self._loaded, b'')
            self._loaded = None

    def stop(self) -> None:
        """End the simulator; may be called twice."""
        self._end_loaded()
        supervisor, self._supervisor = self._supervisor, None
        if supervisor is None:
            return
        if supervisor.process is not None and supervisor.process.stdout is not None:
            supervisor.process.stdout.close()
        supervisor.stop(_STOP_TIMEOUT_S)
        clear(self._folder)  # the process may have been killed


def _loaded_supervisor(folder: Path) -> subprocess.Popen[bytes]:
    process = start_child('rt_robot_os.core.simulator_supervisor', os.getpid(), folder,
                          stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    if process.stdout is not None:
        os.set_blocking(process.stdout.fileno(), False)
    return process


def device_folder(path: Path) -> Path:
    """
    Return the folder of a robot's simulated devices.

    :param path: of the core's socket; the folder is next to it.
    """
    return path.with_suffix('') if path.suffix else path.with_suffix('.devices')


def clear(folder: Path) -> None:
    """Remove the links and sockets of former simulated devices, and their folder."""
    if folder.is_symlink() or not folder.is_dir():
        return
    for path in folder.iterdir():
        if path.is_symlink() or path.is_socket():
            path.unlink(missing_ok=True)
    with suppress(OSError):  # it contains other files
        folder.rmdir()


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f'{value!r} cannot be sent to the simulator')
