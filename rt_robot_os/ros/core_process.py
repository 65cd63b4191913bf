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

"""Start, watch and end the core as a child process."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from fcntl import F_SETPIPE_SZ
from fcntl import fcntl
import os
from pathlib import Path
import select
import signal
import subprocess

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.programs import ONE_BLAS_THREAD
from rt_robot_os.link.liveness import LivenessPage
from rt_robot_os.link.liveness import LivenessReader
from rt_robot_os.link.robots import remove_leftovers
from rt_robot_os.linux.process import end_child
from rt_robot_os.linux.process import start_child
from rt_robot_os.linux.process import write_stdin

CONFIGURATION_EXIT_CODE = 2
FORCED_EXIT_CODE = 3
_STOP_TIMEOUT_S = 3.0
# Of the standard input of a core: the settings of a large robot fit, so that no process waits.
_PIPE_BYTES = 1 << 19
_MS_PER_S = 1000


class CoreProcess:
    """
    A core as a child process, restarted with a back-off when it ends.

    It ends with its parent (PR_SET_PDEATHSIG), and for Linux that is the *thread* that starts it:
    call :meth:`start` and :meth:`load` from a thread that outlives the core.

    :param settings_json: for the standard input of the core.
    :param socket_path: where the core listens.
    :ivar starts: number of starts.
    """

    def __init__(self, settings_json: str, socket_path: Path, arguments: Sequence[str] = ()
                 ) -> None:
        self.starts = 0
        self.exit_code: int | None = None
        self._settings = settings_json.encode()
        self._path = socket_path
        self._arguments = list(arguments)
        self._process: subprocess.Popen[bytes] | None = None
        self._waits = False  # for its settings
        self._prepares = False
        self._liveness: LivenessReader | None = None
        self._ready_fd = -1

    def set_settings(self, settings_json: str, loaded_json: str = '') -> None:
        """
        Change the settings for the next start.

        :param loaded_json: the settings before any change.
        """
        self._settings = f'{settings_json}\n{loaded_json}'.encode()

    @property
    def pid(self) -> int:
        """Return the process id; 0 when it does not run."""
        return self._process.pid if self._process is not None else 0

    def load(self) -> None:
        """
        Start the interpreter, which imports what every core needs and waits for :meth:`start`.

        Until then it opens nothing, and ends silently when it is stopped or this process ends.
        Meanwhile the settings can be checked.

        :raises OSError: it cannot be started.
        """
        ready, signal_fd = os.pipe()
        page = LivenessPage()
        self._forget()
        try:
            self._process = start_child(
                'rt_robot_os.core.program', '--socket', self._path, '--settings', '-', '--parent',
                os.getpid(), '--ahead', '--life', page.fd, '--ready', signal_fd,
                *self._arguments, stdin=subprocess.PIPE, env={**os.environ, **ONE_BLAS_THREAD},
                pass_fds=(signal_fd, page.fd) if page.fd >= 0 else (signal_fd,))
            self._waits, self._prepares = True, False
            self._ready_fd, ready = ready, -1
            with suppress(OSError, LinkError):  # without it only the start time-out applies
                self._liveness = LivenessReader(os.dup(page.fd))
        finally:
            page.close()
            for fd in {signal_fd, ready} - {-1}:
                os.close(fd)

    def prepare(self, settings_json: str) -> None:
        """
        Let a loaded core import what the settings name, before it is started.

        :param settings_json: may differ from the settings of the start.
        """
        if self._waits and self._process is not None and self._process.stdin is not None:
            self._prepares = True
            with suppress(OSError):  # beyond the user's limit for pipes: writing may block then
                fcntl(self._process.stdin, F_SETPIPE_SZ, _PIPE_BYTES)
            with suppress(OSError):  # if it has ended, the start notices it
                self._process.stdin.write(settings_json.encode() + b'\n')
                self._process.stdin.flush()

    def start(self) -> None:
        """
        Start the core; it is ready when its socket answers.

        :raises OSError: the interpreter cannot be started.
        """
        self.starts += 1
        waited, self._waits = self._waits, False
        if not (waited and self.alive()):
            self.load()
        self.exit_code, self._waits = None, False
        if self._process is not None:
            write_stdin(self._process, (b'' if self._prepares else b'\n') + self._settings)

    def wait_until_ready(self, timeout_s: float) -> bool:
        """
        Wait until its socket may answer, or it has ended.

        :return: False if it was ready before: there is nothing to wait for.
        """
        if self._ready_fd < 0:
            return False
        ready = select.poll()
        ready.register(self._ready_fd, select.POLLIN)
        if ready.poll(timeout_s * _MS_PER_S):
            self._close_ready()
        return True

    def _close_stdin(self) -> None:
        """Close the standard input of a core that waits for its settings."""
        if self._process is not None and self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()

    def _close_ready(self) -> None:
        fd, self._ready_fd = self._ready_fd, -1
        if fd >= 0:
            os.close(fd)

    def _forget(self) -> None:
        """Release the resources of the previous core."""
        self._close_ready()
        liveness = self.take_liveness()
        if liveness is not None:
            liveness.close()

    def take_liveness(self) -> LivenessReader | None:
        """Return, once, the liveness counter of the last started core; None without one."""
        liveness, self._liveness = self._liveness, None
        return liveness

    def alive(self) -> bool:
        """Return whether it was started and runs; :attr:`exit_code` has its exit code."""
        if self._process is None or self._waits:
            return False
        code = self._process.poll()
        if code is None:
            return True
        self.exit_code = code
        self._close_stdin()
        self._process = None
        self._close_ready()
        with suppress(OSError, RtRobotError):  # no descriptors, for example: left to the next core
            remove_leftovers(self._path)
        return False

    def ended_within(self, timeout_s: float) -> bool:
        """Wait for it to end by itself; return whether it did."""
        if self._process is not None:
            try:
                self._process.wait(timeout_s)
            except subprocess.TimeoutExpired:
                return False
        return not self.alive()

    def kill(self) -> None:
        """End a core that hangs."""
        self._end(signal.SIGKILL)

    def stop(self) -> None:
        """End the core in order, by force if it does not respond; may be called twice."""
        self._end(signal.SIGTERM)

    def _end(self, signo: int) -> None:
        self._waits = False
        if self._process is not None:
            self._close_stdin()
            end_child(self._process, _STOP_TIMEOUT_S, signo)
        self.alive()
