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
The host of the capture processes: it starts one for each connection to its socket.

The core cannot start a process while it runs: that is a native call of up to a millisecond, and
the child would start with the core's priority and on its CPU. So this small process is started
before the core enters real-time mode. A worker ends with its connection, or with this process.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
import select
import socket
import subprocess
import sys
import time
from typing import Final

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.programs import ended_by_signals
from rt_robot_os.base.programs import warn
from rt_robot_os.devices.capture.scene_memory import SceneMemory
from rt_robot_os.devices.capture.spawn import CAPTURE
from rt_robot_os.devices.capture.spawn import end_worker
from rt_robot_os.devices.capture.spawn import start_worker
from rt_robot_os.linux.process import run_child

WORKERS_MAXIMUM: Final = 32
_WAIT_MS: Final = 500
_FAILED_PAUSE_S: Final = 0.2


class CaptureHost:
    """
    A listening socket and the workers that were started for its connections.

    :param path: of the socket.
    :param scene: the scene of a simulated camera.
    :param worker: the module of the workers.
    :ivar workers: the running workers.
    """

    def __init__(self, path: Path, scene: SceneMemory | None = None,
                 worker: str = CAPTURE) -> None:
        self.path = path
        self._worker = worker
        self.scene = scene
        self.workers: list[subprocess.Popen[bytes]] = []
        self._listener: socket.socket | None = None
        self._inode = -1

    def fileno(self) -> int:
        """Return the descriptor that is readable when a client connects; -1 while it is closed."""
        return -1 if self._listener is None else self._listener.fileno()

    def open(self) -> None:  # noqa: A003
        """
        Listen; may be called twice.

        :raises DeviceError: the socket cannot be made.
        """
        if self._listener is not None:
            return
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        # Bound under another name first, so that a client that sees the path can connect.
        made = self.path.with_name(f'.{self.path.name}')
        try:
            self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            made.unlink(missing_ok=True)
            listener.bind(str(made))
            made.chmod(0o600)
            listener.listen(WORKERS_MAXIMUM)
            listener.setblocking(False)
            self._inode = made.stat().st_ino
            made.replace(self.path)
        except OSError as error:
            listener.close()
            raise DeviceError(f'{self.path} cannot be made ({error}): set RT_ROBOT_OS_RUNTIME_DIR '
                              'to a folder of your own with a short path') from error
        self._listener = listener

    def serve(self) -> None:
        """Start workers for new connections and reap those that ended; does not block long."""
        self.workers = [worker for worker in self.workers if worker.poll() is None]
        while self._listener is not None:
            try:
                connection, _ = self._listener.accept()
                with connection:
                    if len(self.workers) < WORKERS_MAXIMUM:
                        self.workers.append(start_worker(connection, self.scene, self._worker))
            except BlockingIOError:
                return
            except OSError as error:  # no descriptors or no memory: the device tries again
                warn(self._worker, f'cannot be started: {error.strerror or error}')
                # The connection may still be pending: not again immediately.
                time.sleep(_FAILED_PAUSE_S)
                return

    def close(self) -> None:
        """Stop listening and end all workers; may be called twice."""
        if self._listener is not None:
            # A core that replaces a killed one may have its own host at this path by now. While
            # this socket listens its inode number is unique.
            with suppress(OSError):
                if self.path.stat().st_ino == self._inode:
                    self.path.unlink()
            self._listener.close()
            self._listener = None
        for worker in self.workers:
            worker.terminate()
        for worker in self.workers:
            end_worker(worker)
        self.workers = []


def main(arguments: Sequence[str]) -> int:
    """Serve until SIGTERM or the end of the parent; arguments: path of the socket, worker."""
    host = CaptureHost(Path(arguments[0]), worker=arguments[1])
    ended: list[int] = []
    try:
        with ended_by_signals(ended.append):
            host.open()
            poll = select.poll()
            poll.register(host.fileno(), select.POLLIN)
            while not ended:
                poll.poll(_WAIT_MS)
                host.serve()
    except (DeviceError, OSError) as error:
        print(f'{arguments[1]}: {error}', file=sys.stderr)
        return 1
    finally:
        host.close()
    return 0


if __name__ == '__main__':
    sys.exit(run_child(main))
