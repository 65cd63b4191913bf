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
The bridge to a real I2C bus: a separate process that blocks on the bus, so that the core need not.

It is the program ``i2c_bridge``, started with the core and, if it has ended, again when a device
is opened. It ends with this process, because its standard input is a pipe from here.
"""

from __future__ import annotations

import os
from pathlib import Path
import select
import shutil
import socket
import subprocess
import tempfile
from typing import Final

from rt_robot_os.linux.process import end_child
from rt_robot_os.linux.process import start_child
from rt_robot_os.linux.process import START_PATIENCE_S

_BACKLOG: Final = 128
_STOP_S: Final = 2.0


class I2cBridge:
    """
    The bridge of one bus.

    :ivar path: of the bus.
    :ivar socket_path: its socket, in a folder that only this user can enter; new with each start.
    """

    def __init__(self, path: str) -> None:
        """Store the path; nothing is started."""
        self.path = path
        self.socket_path = Path()
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, *, wait: bool = False) -> None:
        """
        Start it unless it runs; without ``wait`` this takes a native call of about 1 ms.

        :param wait: block until it serves; not for the loop.
        :raises OSError: it cannot be started.
        """
        if self._process is not None and self._process.poll() is None:
            return
        self._let_go()
        self._clean_up()
        self.socket_path = Path(tempfile.mkdtemp(prefix='rt_robot_os-i2c-')) / 'bus'
        # Made here, so that devices can connect and send requests before it serves.
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
            listener.bind(str(self.socket_path))
            listener.listen(_BACKLOG)
            self._process = start_child(
                'rt_robot_os.devices.i2c.program', self.path, '--socket', self.socket_path,
                '--listener', listener.fileno(), '--with-parent', os.getpid(),
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, pass_fds=[listener.fileno()])
        output = self._process.stdout
        if wait and output is not None:
            select.select([output], [], [], START_PATIENCE_S)

    def stop(self) -> None:
        """End it; may be called twice."""
        process = self._process
        self._let_go()
        if process is not None:
            end_child(process, _STOP_S)
        self._clean_up()

    def _clean_up(self) -> None:
        """Remove the socket of a killed bridge; one that ends by itself does so."""
        if self.socket_path != Path():
            shutil.rmtree(self.socket_path.parent, ignore_errors=True)
        self.socket_path = Path()

    def _let_go(self) -> None:
        process, self._process = self._process, None
        if process is not None and process.stdin is not None and process.stdout is not None:
            process.stdin.close()
            process.stdout.close()
