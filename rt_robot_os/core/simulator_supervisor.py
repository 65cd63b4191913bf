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
Supervise the process of the simulated devices: start it, and restart it when it was killed.

The core cannot do that itself: starting a process takes milliseconds in which no task runs. So
this process is started before the core becomes real-time, and starts the other one for it. It
writes its reports to standard output, one line each, where the core reads them.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from contextlib import suppress
import os
import signal
import subprocess
import sys
import time

from rt_robot_os.base.programs import ended_by_signals
from rt_robot_os.linux.process import run_child
from rt_robot_os.linux.process import start_child
from rt_robot_os.linux.process import write_stdin
from rt_robot_os.linux.supervised_child import describe_exit
from rt_robot_os.linux.supervised_child import LONG_LIFE_S
from rt_robot_os.linux.supervised_child import PAUSE_FIRST_S
from rt_robot_os.linux.supervised_child import PAUSE_MAXIMUM_S

RESTARTED = 'started again'
_STOP_TIMEOUT_S = 2.0


def _report(text: str) -> None:
    with suppress(OSError):  # the core has ended, or does not read
        os.write(1, f'{text}\n'.encode())


class SimulatorSupervisor:
    """
    Run a program, and restart it when it ends, until :meth:`stop`.

    :param start: starts the program.
    """

    def __init__(self, start: Callable[[], subprocess.Popen[bytes]]) -> None:
        self.stopping = False
        self.restarts = 0
        self._start = start
        self._process: subprocess.Popen[bytes] | None = None

    def run(self) -> int:
        """
        Keep the program running.

        :return: its exit code if its first start fails; otherwise 0.
        """
        pause_s = PAUSE_FIRST_S
        while not self.stopping:
            started_s = time.monotonic()
            try:
                code = self._once()
            except OSError as error:  # no memory, no file descriptors: this may be temporary
                _report(f'the simulated devices cannot be started: {error.strerror or error}')
                code = -1
            if self._is_stopping():
                break
            if code > 0 and not self.restarts:
                return code
            if time.monotonic() - started_s > LONG_LIFE_S:
                pause_s = PAUSE_FIRST_S
            time.sleep(pause_s)
            pause_s = min(2 * pause_s, PAUSE_MAXIMUM_S)
            self.restarts += 1
            _report(f'the process of the simulated devices {describe_exit(code)}; {RESTARTED}')
        return 0

    def _is_stopping(self) -> bool:
        return self.stopping  # a signal sets it at any time

    def _once(self) -> int:
        self._process = self._start()
        if self._is_stopping():  # since the start
            self.stop()
        return self._process.wait()

    def stop(self) -> None:
        """End the program, by force if it does not respond; safe in a signal handler."""
        self.stopping = True
        process = self._process
        if process is not None and process.returncode is None:
            with suppress(ProcessLookupError):
                os.kill(process.pid, signal.SIGTERM)
            signal.setitimer(signal.ITIMER_REAL, _STOP_TIMEOUT_S)

    def kill(self) -> None:
        """End the program by force; safe in a signal handler."""
        process = self._process
        if process is not None and process.returncode is None:
            with suppress(ProcessLookupError):
                os.kill(process.pid, signal.SIGKILL)


def main(arguments: Sequence[str]) -> int:
    """Run until SIGTERM or the end of the parent; the argument is the folder of the devices."""
    def load() -> subprocess.Popen[bytes]:
        return start_child(
            'rt_robot_os.core.simulator_process', os.getpid(), *arguments, stdin=subprocess.PIPE,
            stdout=2)  # not the standard output of this process, which the core reads

    def start() -> subprocess.Popen[bytes]:
        process = loaded.pop() if loaded else load()
        write_stdin(process, settings)
        return process

    loaded = []
    with suppress(OSError):  # tried again, and reported, when the settings are read
        loaded.append(load())  # its imports take time, while this process waits for settings
    settings = sys.stdin.buffer.read()
    if not settings:  # the core has ended, or has no simulated devices
        return start().wait() if loaded else 0
    supervisor = SimulatorSupervisor(start)
    signal.signal(signal.SIGALRM, lambda *_: supervisor.kill())
    with ended_by_signals(lambda _: supervisor.stop()):
        return supervisor.run()


if __name__ == '__main__':
    sys.exit(run_child(main))
