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


"""Save the core's black box: after a fault, on a signal, when the kernel fails."""

from __future__ import annotations

from datetime import datetime
import itertools
import json
import marshal
import os
import socket
import subprocess

from rt_robot_os.base.reports import LogEntry
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.core.dumps.dump_parts import live_parts
from rt_robot_os.core.dumps.folder import default_folder
from rt_robot_os.core.dumps.folder import expanded
from rt_robot_os.core.part import Host
from rt_robot_os.kernel import Kernel
from rt_robot_os.link.requests import reason_argument
from rt_robot_os.linux.process import start_child

INTERVAL_NS = 60 * NS_PER_S
_SEND_BUFFER_BYTES = 1 << 20
_PATIENCE_S = 2.0
_END_PATIENCE_S = 5.0
_ANSWER_BYTES_MAXIMUM = 1 << 16


class BlackBoxWriter:
    """
    The child process that writes dumps; see :mod:`rt_robot_os.core.dumps.writer_process`.

    It is started with the core: starting a process from one under SCHED_FIFO takes a millisecond,
    which must not happen at the time of a fault.

    :param folder: for the dumps; empty for ROS's folder of logs.
    :raises OSError: it cannot be started.
    """

    def __init__(self, robot: str, folder: str = '') -> None:
        self.socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
            # It outlives this process: a dump that was received is written in any case.
            self._process = start_child(
                'rt_robot_os.core.dumps.writer_process', theirs.fileno(),
                expanded(folder) if folder else default_folder(), robot,
                pass_fds=[theirs.fileno()], stdout=subprocess.DEVNULL)

    def close(self) -> None:
        """Wait until it has written what it received; may be called twice."""
        self.socket.close()
        try:
            self._process.wait(_END_PATIENCE_S)
        except subprocess.TimeoutExpired:
            pass  # a slow disk: the process ends by itself after writing


class BlackBoxSaver:
    """
    Decide when the black box is saved, and hand it to the writer.

    :meth:`watch` runs in the lowest task, so all other tasks preempt it.

    :param writer: None saves nothing.
    :param interval_ns: minimum time between two dumps after faults; requested dumps are always
        saved.
    """

    def __init__(self, kernel: Kernel, reports: Reports, robot: str,
                 writer: BlackBoxWriter | None, interval_ns: int = INTERVAL_NS) -> None:
        self.saved = self.lost = self.held_back = 0
        self._kernel = kernel
        self._reports = reports
        self._robot = robot
        self._writer = writer
        self._interval_ns = interval_ns
        self._asked = ''
        self._fault = ''
        self._next_ns = 0
        self._waiting = 0
        self._numbers = itertools.count()

    def attach(self, host: Host) -> None:
        """Save it on request, and send it to clients."""
        host.watch.add(self.watch)
        host.statistics.add_facts(lambda: {'black_box': self.statistics()})
        host.requests.add_long('black_box', lambda session, arguments: live_parts(
            self._kernel, reason_argument(session, arguments), self.facts()))

    def ask(self, reason: str) -> None:
        """Request a dump, saved at the next poll; safe in a signal handler and in the loop."""
        self._asked = reason

    def fault(self, reason: str) -> None:
        """Note a fault, saved at the next poll unless one was saved recently; safe in the loop."""
        if not self._fault:
            self._fault = reason

    def watch(self) -> None:
        """Save what was requested, and report the result."""
        reason, self._asked = self._asked, ''
        fault, self._fault = self._fault, ''
        if fault:
            now_ns = self._kernel.now_ns()
            if reason or now_ns >= self._next_ns:
                self._next_ns = now_ns + self._interval_ns
                reason = f'{fault} ({reason})' if reason else fault
            else:
                self.held_back += 1
        if reason:
            self.save(reason)
        if self._waiting:
            self._read_answers(0.0)

    def save(self, reason: str) -> None:
        """
        Send a dump to the writer: 10 ms of computing, so only at the lowest priority.

        After a fatal fault the priority does not matter.
        """
        if self._writer is None:
            return
        number = next(self._numbers)
        if self.held_back:
            reason = f'{reason} ({self.held_back} x faults before it, not saved)'
            self.held_back = 0
        connection = self._writer.socket
        try:
            connection.settimeout(_PATIENCE_S)
            for part in live_parts(self._kernel, reason, self.facts()):
                connection.send(marshal.dumps((number, part)))
            self._waiting += 1
        except (OSError, ValueError) as error:  # ValueError: a string that cannot be encoded
            self.lost += 1
            self._note(Severity.ERROR, 'not saved: its writer does not receive it '
                       f'({error}); see its message above')

    def statistics(self) -> dict[str, int]:
        """Return the numbers of saved dumps, lost dumps, and faults without a dump."""
        return {'saved': self.saved, 'lost': self.lost, 'held_back': self.held_back}

    def facts(self) -> dict[str, str | int]:
        """Return what the kernel does not know: the robot, the process, the time of day."""
        return {'robot': self._robot, 'pid': os.getpid(),
                'at': datetime.now().astimezone().isoformat(timespec='milliseconds')}

    def _read_answers(self, patience_s: float) -> None:
        writer = self._writer
        while writer is not None and self._waiting:
            try:
                writer.socket.settimeout(patience_s)
                packet = writer.socket.recv(_ANSWER_BYTES_MAXIMUM)
            except (BlockingIOError, TimeoutError):
                return
            except OSError:
                packet = b''
            if not packet:
                self.lost += self._waiting
                self._waiting = 0
                self._note(Severity.ERROR, 'not saved: its writer has ended')
                return
            self._waiting -= 1
            answer = json.loads(packet)
            if answer['error']:
                self.lost += 1
            else:
                self.saved += 1
            self._note(Severity.ERROR if answer['error'] else Severity.WARN, answer['text'])

    def close(self) -> None:
        """Save a pending fault, and wait for the writer; may be called twice."""
        if self._writer is None:
            return
        self.watch()
        self._read_answers(_END_PATIENCE_S)
        self._writer.close()
        self._writer = None

    def _note(self, severity: Severity, text: str) -> None:
        self._reports.note(LogEntry(self._kernel.now_ns(), severity, 'black box', text))
