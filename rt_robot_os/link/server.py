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
The core's side of the link.

Two tasks share the work. ``link/commands`` has a priority of the user's choice: it is released by
arriving packets and publishes samples of clients immediately. ``link/service`` has a low priority:
it answers requests and sends mirrored topics; it is released by their publications, immediately
after a pause, otherwise once per interval. With the same low priority ``link/accept`` accepts
clients, and ``link/beat`` runs 50 times a second for heartbeats and leftover work. ``link/life``,
above all others, writes the liveness page.
"""

from __future__ import annotations

import functools
import os
from pathlib import Path
import socket
import struct

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.reports import LogEntry
from rt_robot_os.base.reports import Reports
from rt_robot_os.base.reports import Severity
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.base.units import NS_PER_US
from rt_robot_os.kernel import Kernel
from rt_robot_os.link.entry_times import EntryTimes
from rt_robot_os.link.gather import Gather
from rt_robot_os.link.liveness import LivenessPage
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import PACKET_BYTES_MAXIMUM
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.rate_limits import ClientQuotas
from rt_robot_os.link.rate_limits import LogRateLimiter
from rt_robot_os.link.requests import Requests
from rt_robot_os.link.session import ClientSession
from rt_robot_os.link.session import ClientStatistics
from rt_robot_os.link.topic_requests import TopicRequests
from rt_robot_os.link.uploads import UploadScheduler
from rt_robot_os.topics import Bus

CLIENTS_MAXIMUM = 16
BEAT_RATE_HZ = 50.0
BEATS_PER_HEARTBEAT = 10
SEND_BUFFER_BYTES = 1 << 20
LIVENESS_TASK = 'link/life'
LIVENESS_PRIORITY = 99
SERVICE_PRIORITY, COMMAND_PRIORITY = 2, 50
# The longest execution time of one of its jobs, for `plan`.
LIVENESS_EXECUTION_NS = 20 * NS_PER_US
LIVENESS_RATE_HZ = 10.0
# How long the link may be starved before the page names the task that runs instead.
_STARVED_NS = 500 * NS_PER_MS
HELLO_NS = 5 * NS_PER_S
_ACCEPTED_AT_ONCE = 4
_FIRST_QUOTA = 16


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        status = path.lstat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


class LinkServer:
    """
    Serve clients on a Unix socket; the constructor adds the tasks to the kernel.

    :param path: of the socket; the leftover of a core that died is replaced.
    :param requests: the table of requests; the link adds those about topics.
    :param service_priority: of mirroring; below all important tasks.
    :param command_priority: of samples that clients publish.
    :param gather_ns: samples that are published within this time are sent together.
    :param liveness_fd: of a liveness page that another process has created; -1 for none.
    """

    def __init__(self, kernel: Kernel, bus: Bus, path: Path, requests: Requests,
                 reports: Reports, *, service_priority: int = SERVICE_PRIORITY,
                 command_priority: int = COMMAND_PRIORITY, gather_ns: int = 0,
                 liveness_fd: int = -1) -> None:
        self.path = path
        self.accepted = self.refused = 0
        self._kernel = kernel
        self._bus = bus
        self._requests = requests
        self._reports = reports
        self._sessions: tuple[ClientSession, ...] = ()
        self._listener: socket.socket | None = None
        self._beats = 0
        self._served_ns = 0
        self._page = LivenessPage(liveness_fd)
        self._parent = os.getppid()
        self._quotas = ClientQuotas()
        self._uploads = UploadScheduler()
        self._entries = EntryTimes(kernel.clock)
        self._log_limit = LogRateLimiter(functools.partial(self._log, Severity.WARN))
        self._identity: tuple[int, int] | None = None
        self._buffer = bytearray(PACKET_BYTES_MAXIMUM)
        self._commands = kernel.add_task('link/commands', self._receive, priority=command_priority)
        self._service = kernel.add_task('link/service', self._serve, priority=service_priority)
        self._gather = Gather(kernel, self._service, gather_ns)
        TopicRequests(kernel, bus, self._service, self._gather, self._page,
                      lambda: self._sessions).serve(requests)
        self._accepting = kernel.add_task('link/accept', self._accept, priority=service_priority)
        self._listening = kernel.timer(self._commands)
        kernel.add_task('link/beat', self._beat, priority=service_priority, rate_hz=BEAT_RATE_HZ)
        self._liveness = kernel.add_task(LIVENESS_TASK, self._live, priority=LIVENESS_PRIORITY,
                                         rate_hz=LIVENESS_RATE_HZ)

    # ---- opening and closing -----------------------------------------------------------------

    def open(self) -> None:  # noqa: A003
        """
        Listen, with the socket for this user alone.

        :raises LinkError: another core serves this path, or the folder cannot be written.
        """
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            self._clear_leftover()
            mask = os.umask(0o177)
            try:
                listener.bind(str(self.path))
            finally:
                os.umask(mask)
            listener.listen(CLIENTS_MAXIMUM)
            listener.setblocking(False)
            self._identity = _identity(self.path)
        except OSError as error:
            listener.close()
            if isinstance(error, LinkError):
                raise
            raise LinkError(f'socket {self.path}: {error.strerror or error}; is the folder '
                            'writable and the path below 108 characters?') from error
        self._listener = listener
        self._kernel.add_interrupt(listener.fileno(), self._accepting)

    def close(self) -> None:
        """
        Disconnect all clients and remove the socket; may be called twice.

        Clients get the last reports, as far as these fit their sockets.
        """
        self._report()
        for session in self._sessions:
            session.send_samples(self._kernel.now_ns())
            self._kernel.remove_interrupt(session.connection.fileno())
            session.close()
        self._sessions = ()
        if self._listener is not None:
            self._kernel.remove_interrupt(self._listener.fileno())
            self._listener.close()
            self._listener = None
            if _identity(self.path) == self._identity:  # not the socket of a later core
                self.path.unlink(missing_ok=True)
        self._page.close()

    def _clear_leftover(self) -> None:
        if not self.path.is_socket():
            if self.path.exists():
                raise LinkError(f'{self.path} exists and is not a socket; choose another path')
            return
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as probe:
            probe.setblocking(False)  # the listen queue of a stopped core may be full
            try:
                probe.connect(str(self.path))
            except ConnectionRefusedError:
                self.path.unlink(missing_ok=True)
                return
            except BlockingIOError:
                pass
        raise LinkError(f'socket {self.path}: another core serves it; stop that core, or give '
                        'this robot another node name (--ros-args -r __node:=other)')

    # ---- tasks -------------------------------------------------------------------------------

    def _receive(self) -> None:
        now_ns = self._kernel.now_ns()
        self._entries.update(now_ns)
        for session in self._quotas.renew(self._sessions, now_ns):
            if not session.gone:
                self._kernel.add_interrupt(session.connection.fileno(), self._commands)
        work = pause = False
        for session in self._sessions:
            if session.paused:
                continue
            session.receive(now_ns)
            if self._quotas.pause_if_exhausted(session, now_ns):
                self._kernel.remove_interrupt(session.connection.fileno())
                pause = True
            work = work or bool(session.gone or session.requests or session.uploads.waiting)
        if pause and self._kernel.running:
            self._listening.start_at(self._quotas.end_ns)
        if work:
            self._kernel.release(self._service)

    def _serve(self) -> None:
        now_ns = self._kernel.now_ns()
        self._gather.begin()
        some = more = False
        for session in self._sessions:
            # One request of each client per round: a client with many requests delays only itself.
            if session.requests and not session.gone:
                try:
                    self._requests.answer(session, session.requests.popleft())
                except Exception as error:
                    # The answer may run code of a module: an error affects only this client.
                    session.gone = f'refused: a request raised {type(error).__name__}: {error}'
                more = more or bool(session.requests)
            some |= session.send_samples(now_ns)
            if session.gone:
                self._remove(session)
        more = self._uploads.publish_next(self._sessions, now_ns) or more
        if some:
            self._gather.note_sent(now_ns)
        if more:
            self._kernel.release(self._service)

    def _live(self) -> None:
        now_ns = self._kernel.now_ns()
        self._served_ns = self._served_ns or now_ns
        starved = now_ns - self._served_ns > _STARVED_NS
        self._page.write(now_ns, self._served_ns, self._running_task() if starved else '')

    def _running_task(self) -> str:
        """Return the name of the task that the liveness task has preempted."""
        busy = [task for task in self._kernel.tasks if task.busy and task is not self._liveness]
        if not busy:
            return ''
        task = max(busy, key=lambda task: task.priority)
        occupied_by = self._requests.occupied_by if task is self._service else ''
        return occupied_by or task.name

    def _beat(self) -> None:
        self._beats += 1
        now_ns = self._served_ns = self._kernel.now_ns()
        if self._beats % BEATS_PER_HEARTBEAT == 0:
            beat = header(PacketKind.BEAT, stamp_ns=now_ns)
            for session in self._sessions:
                session.post(beat)
                if not session.greeted and now_ns - session.since_ns > HELLO_NS:
                    session.gone = session.gone or (
                        f'refused: it sent no hello within {HELLO_NS // NS_PER_S} s')
        self._log_limit.refill(now_ns)
        self._report()
        if any(session.paused for session in self._sessions) and now_ns >= self._quotas.end_ns:
            self._kernel.release(self._commands)  # the timer does not outlast a run of the kernel
        for session in self._sessions:
            session.flush()
        self._serve()

    def _accept(self) -> None:
        for _ in range(_ACCEPTED_AT_ONCE):
            if self._listener is None:
                return
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            self._admit(connection)
        self._kernel.release(self._accepting)  # other tasks run before the next connections

    def _admit(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        credentials = connection.getsockopt(
            socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize('3i'))
        pid, user, _ = struct.unpack('3i', credentials)
        if user not in (os.getuid(), 0) or not self._has_place(pid):
            self.refused += 1
            connection.close()
            self._note(Severity.WARN, f'client {pid} refused: user {user}, '
                       f'{len(self._sessions)} of {CLIENTS_MAXIMUM} clients connected')
            return
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        now_ns = self._kernel.now_ns()
        session = ClientSession(connection, self._bus, pid, now_ns, self._buffer, self._entries)
        session.quota = _FIRST_QUOTA
        self._sessions = (*self._sessions, session)
        self.accepted += 1
        self._kernel.add_interrupt(connection.fileno(), self._commands)
        self._kernel.release(self._commands)  # it may have sent packets already

    def _has_place(self, pid: int) -> bool:
        """
        Return whether there is a place for a client.

        One place is reserved for the parent process; a client without hello is removed if needed.
        """
        kept = any(session.pid == self._parent for session in self._sessions)
        if len(self._sessions) - kept < CLIENTS_MAXIMUM or (pid == self._parent and not kept):
            return True
        for session in self._sessions:
            if not session.greeted and not session.requests and not session.gone:
                session.gone = 'refused: it sent no hello, and another client needs its place'
                self._remove(session)
                return True
        return False

    def _remove(self, session: ClientSession) -> None:
        refused = session.gone.startswith('refused')
        while session.uploads.waiting and not refused:
            session.publish_upload()  # sent before it left
        self.refused += refused
        self._note(Severity.WARN if refused else Severity.INFO,
                   f'client {session.name} (pid {session.pid}) left: {session.gone}')
        self._sessions = tuple(s for s in self._sessions if s is not session)
        self._kernel.remove_interrupt(session.connection.fileno())
        session.close()

    # ---- reports and statistics --------------------------------------------------------------

    def facts(self) -> dict[str, int]:
        """Return the numbers of accepted and refused clients."""
        return {'accepted': self.accepted, 'refused': self.refused}

    def statistics(self) -> tuple[ClientStatistics, ...]:
        """Return the statistics of all clients."""
        now_ns = self._kernel.now_ns()
        return tuple(session.statistics(now_ns) for session in self._sessions)

    def _note(self, severity: Severity, text: str) -> None:
        """Log a line about a client; a flood of lines is summarised."""
        if self._log_limit.allow(self._kernel.now_ns()):
            self._log(severity, text)

    def _log(self, severity: Severity, text: str) -> None:
        self._reports.note(LogEntry(self._kernel.now_ns(), severity, 'link', text))

    def _report(self) -> None:
        for session in self._sessions:
            session.report_place, dropped, reports = self._reports.since(session.report_place)
            for report in reports:
                session.post(encode_json(PacketKind.REPORT, {
                    'at_ns': report.at_ns, 'severity': int(report.severity),
                    'source': report.source, 'text': report.text[:4000], 'dropped': dropped}))
                dropped = 0  # reported once, with the first report
