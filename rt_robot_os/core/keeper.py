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
Keep the simulated devices running: start their process, and start it again when it was killed.

The core cannot do that itself: starting a process takes milliseconds in which no task runs. So
this one is started before the core turns real-time, and starts the others for it. What it has to
tell goes to its standard output, one line each, where the core reads it.
"""

from __future__ import annotations

from contextlib import suppress
import os
import signal
import subprocess
import sys
import time
from types import FrameType

from rt_robot_os.linux.process import die_with_parent

RESTARTED = 'started again'
_PAUSE_FIRST_S = 0.2
_PAUSE_MAXIMUM_S = 5.0
_LONG_LIFE_S = 10.0
_STOP_TIMEOUT_S = 2.0


def _tell(text: str) -> None:
    with suppress(OSError):  # the core is gone, or does not read
        os.write(1, f'{text}\n'.encode())


def _ended(code: int) -> str:
    if code >= 0:
        return f'ended with code {code}'
    with suppress(ValueError):
        return f'was ended by {signal.Signals(-code).name}'
    return f'was ended by signal {-code}'


class Keeper:
    """
    Run a program again and again until told to stop.

    :param command: of the program.
    :param given: what it gets on its standard input.
    """

    def __init__(self, command: list[str], given: bytes) -> None:
        self.stopping = False
        self.restarts = 0
        self._command = command
        self._given = given
        self._process: subprocess.Popen[bytes] | None = None

    def run(self) -> int:
        """
        Keep it running.

        :return: its exit code when it refuses what it is given, at its first start; else 0.
        """
        pause_s = _PAUSE_FIRST_S
        while not self.stopping:
            started_s = time.monotonic()
            try:
                code = self._once()
            except OSError as error:  # no memory, no descriptors: they may come back
                _tell(f'the simulated devices cannot be started: {error.strerror or error}')
                code = -1
            if self._is_stopping():
                break
            if code > 0 and not self.restarts:
                return code
            if time.monotonic() - started_s > _LONG_LIFE_S:
                pause_s = _PAUSE_FIRST_S
            time.sleep(pause_s)
            pause_s = min(2 * pause_s, _PAUSE_MAXIMUM_S)
            self.restarts += 1
            _tell(f'the process of the simulated devices {_ended(code)}; {RESTARTED}')
        return 0

    def _is_stopping(self) -> bool:
        return self.stopping  # a signal sets it at any time

    def _once(self) -> int:
        # Not this one's standard output: that is for the core.
        self._process = subprocess.Popen(self._command, stdin=subprocess.PIPE, stdout=2)
        pipe = self._process.stdin
        if pipe is not None:
            with suppress(BrokenPipeError):  # it ended already: its code says how
                pipe.write(self._given)
                pipe.close()
        return self._process.wait()

    def stop(self) -> None:
        """End the program, by force when it does not listen; safe in a signal handler."""
        self.stopping = True
        process = self._process
        if process is not None and process.returncode is None:
            with suppress(ProcessLookupError):
                os.kill(process.pid, signal.SIGTERM)
            signal.setitimer(signal.ITIMER_REAL, _STOP_TIMEOUT_S)

    def kill(self) -> None:
        """End it by force; safe in a signal handler."""
        process = self._process
        if process is not None and process.returncode is None:
            with suppress(ProcessLookupError):
                os.kill(process.pid, signal.SIGKILL)


def main() -> int:
    """Run until SIGTERM or the end of the parent, whose number is the first argument."""
    parent, folder = int(sys.argv[1]), sys.argv[2]
    if not die_with_parent(parent):
        return 0
    keeper = Keeper([sys.executable, '-m', 'rt_robot_os.core.simulator_process',
                     str(os.getpid()), folder], sys.stdin.buffer.read())

    def stop(signum: int, frame: FrameType | None) -> None:
        keeper.stop()

    def kill(signum: int, frame: FrameType | None) -> None:
        keeper.kill()

    # A Ctrl-C in the terminal is for the parent, which ends this process in order.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGALRM, kill)
    for signo in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(signo, stop)
    return keeper.run()


if __name__ == '__main__':
    sys.exit(main())
