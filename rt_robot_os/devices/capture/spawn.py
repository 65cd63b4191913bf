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

"""Start a capture process, and end it."""

from __future__ import annotations

from collections.abc import Callable
import os
import socket
import subprocess
from typing import Final

from rt_robot_os.base.programs import ONE_BLAS_THREAD
from rt_robot_os.devices.capture.scene_memory import SceneMemory
from rt_robot_os.linux.process import end_child
from rt_robot_os.linux.process import start_child

# More than all packets that can be in flight.
_BUFFER_BYTES = 1 << 17
_PATIENCE_S = 0.5


#: The default worker; another one inherits its connection in the same way.
CAPTURE: Final = 'rt_robot_os.devices.capture.worker'


def start_worker(connection: socket.socket, scene: SceneMemory | None = None,
                 worker: str = CAPTURE) -> subprocess.Popen[bytes]:
    """
    Start a worker on a connection; the caller may close its own copy of that.

    :param scene: the scene of a simulated camera.
    :param worker: its module.
    :raises OSError: it cannot be started.
    """
    fds = [connection.fileno(), *([] if scene is None else [scene.fd])]
    return start_child(
        worker, os.getpid(), *fds, pass_fds=fds,
        stdout=subprocess.DEVNULL,
        # The worker reports its problems itself; OpenCV would print much more to the terminal.
        env={**os.environ, 'OPENCV_LOG_LEVEL': 'SILENT', **ONE_BLAS_THREAD})


def end_worker(process: subprocess.Popen[bytes]) -> None:
    """End a worker; one that hangs in a library is killed."""
    end_child(process, _PATIENCE_S)


def spawn_worker(worker: str = CAPTURE) -> tuple[socket.socket, Callable[[], None]]:
    """
    Start a worker without a host.

    :param worker: its module.
    :return: the caller's end of the connection, non-blocking, and a function that ends the worker
        after that is closed: the worker has a moment to end by itself.
    :raises OSError: it cannot be started.
    """
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        with theirs:
            process = start_worker(theirs, worker=worker)
    except OSError:
        ours.close()
        raise
    ours.setblocking(False)
    return ours, lambda: _await_end(process)


def _await_end(process: subprocess.Popen[bytes]) -> None:
    try:
        process.wait(_PATIENCE_S)
    except subprocess.TimeoutExpired:
        end_worker(process)
