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

"""The service that starts the host of the capture processes (cameras, microphones)."""

from __future__ import annotations

import os
from pathlib import Path
import time
from typing import ClassVar

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.capture.spawn import CAPTURE
from rt_robot_os.devices.service import Service
from rt_robot_os.linux.process import start_child
from rt_robot_os.linux.process import START_PATIENCE_S
from rt_robot_os.linux.supervised_child import SupervisedChild

_STOP_TIMEOUT_S = 3.0


class CaptureService(Service):
    """
    The child process that starts capture processes; it ends with this process.

    :cvar WORKER: the module of the started processes.
    :cvar FOR: their purpose, for messages.
    """

    WORKER: ClassVar[str] = CAPTURE
    FOR: ClassVar[str] = 'cameras and microphones'

    def __init__(self) -> None:
        self._child: SupervisedChild | None = None

    def start(self, path: Path) -> Path:
        """
        Start it, and wait until it listens.

        :param path: of its socket.
        :return: the path.
        :raises DeviceError: it ended or hangs.
        """
        path.unlink(missing_ok=True)  # an old socket of a killed core
        self._child = SupervisedChild(f'the process that starts {self.FOR}', lambda: start_child(
            'rt_robot_os.devices.capture.host', os.getpid(), path, self.WORKER))
        process = self._child.start()
        deadline = time.monotonic() + START_PATIENCE_S
        while not path.exists():
            if process.poll() is not None or time.monotonic() > deadline:
                self.stop()
                raise DeviceError(f'the process that starts {self.FOR} did not start; see the '
                                  'message above')
            time.sleep(0.01)
        return path

    def check(self) -> str:
        """Restart it if it has ended; its devices connect to it when they are reopened."""
        return '' if self._child is None else self._child.check()

    def stop(self) -> None:
        """End it, and with it all captures; may be called twice."""
        if self._child is not None:
            self._child.stop(_STOP_TIMEOUT_S)
            self._child = None
