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
The recorder: a client of the link that writes the samples that it receives.

It has two threads: one receives in batches, so that the sockets stay empty; the other compresses
and writes, so that a slow disk uses memory, up to a limit, but loses no samples.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Collection
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
import queue
import struct
import threading
import time
from typing import Any
from typing import Final

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.errors import RecordingError
from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.base.safe_text import safe_text
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.core.tap_format import is_tap
from rt_robot_os.core.tap_format import SCHEDULE_TOPIC
from rt_robot_os.link import LinkClient
from rt_robot_os.link.log_message import log_message
from rt_robot_os.link.log_message import nearest_severity
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import VERSION
from rt_robot_os.recording.bag import Bag
from rt_robot_os.recording.bag import LOG_CHANNEL
from rt_robot_os.recording.bag import Packet
from rt_robot_os.recording.graph import read_graph
from rt_robot_os.recording.selection import Selection
from rt_robot_os.recording.selection import Wanted
from rt_robot_os.recording.session import RecordingSession

# Packets of this interval are read together, with one wake-up. A socket of the default size holds
# three times as many at 10 000 per second, and the rings of the topics more.
_BATCH_S: Final = 0.01
_POLL_S: Final = 0.1
_RETRY_S: Final = 0.2
_QUEUE_BYTES: Final = 64 << 20
_BEAT_NS: Final = NS_PER_S // 2
# The delay of a sample: the gather interval of the link, and the interval of the recorder.
_ON_ITS_WAY_NS: Final = NS_PER_S // 20
# The core publishes the schedule of its tasks ten times a second, at the lowest priority.
_SCHEDULE_NS_MOST: Final = 2 * NS_PER_S
_FILLED: Final = 0.9


@dataclass(frozen=True)
class RecorderStatus:
    """The state of a recording, once a second."""

    elapsed_ns: int
    messages: int
    size: int
    lost: dict[str, int]
    connected: bool


class Recorder:
    """
    Record a robot until stopped.

    :param path: of the core's socket.
    :param log: called with lines for the user.
    :param show: called once a second with the status.
    :ivar stopping: set it to end the recording.
    """

    def __init__(self, path: Path, bag: Bag, wanted: Wanted, log: Callable[[str], None],
                 show: Callable[[RecorderStatus], None]) -> None:
        self.stopping = False
        self._asked_ns = time.monotonic_ns()
        self._path = path
        self._robot = path.stem
        self._bag = bag
        self._wanted = wanted
        self._log = log
        self._show = show
        self._sessions = 0
        self._batch: list[Packet] = []
        self._queue: queue.SimpleQueue[
            RecordingSession | list[Packet] | None] = queue.SimpleQueue()
        self._queued = self._written = self._dropped = 0
        self._error: Exception | None = None
        self._begin_ns = self._shown_ns = 0
        self._schedule = -1
        self._schedule_ns = 0
        self._logger: Callable[[str], str] = str
        self._reports = 0

    # ---- receiving ---------------------------------------------------------------------------

    def run(self) -> None:
        """
        Record until stopped, or for the duration.

        :raises RecordingError: writing failed; the written part is closed.
        """
        writer = threading.Thread(target=self._write, name='writer')
        writer.start()
        try:
            waiting = False
            while not self._over():
                try:
                    client = LinkClient(self._path, 'record')
                except LinkError as error:
                    if not waiting:
                        self._log(f'waiting for a core: {error}' if not self._sessions else
                                  'the core has ended; waiting for a new one')
                    waiting = True
                    time.sleep(_RETRY_S)
                    self._report(False)
                    continue
                waiting = False
                with client:
                    self._record(client)
        finally:
            self._queue.put(None)
            writer.join()
        self._report(False, last=True)
        if self._error is not None:
            what = (self._error.strerror if isinstance(self._error, OSError)
                    and self._error.strerror else str(self._error))
            raise RecordingError(f'recording stopped: {what}; {self._bag.rescue()}')

    def _over(self) -> bool:
        wanted_ns = self._wanted.duration_ns
        return self.stopping or self._error is not None or (
            wanted_ns > 0 and self._begin_ns > 0
            and time.monotonic_ns() - self._begin_ns >= wanted_ns + _ON_ITS_WAY_NS)

    def _record(self, client: LinkClient) -> None:
        """Record one core until it ends."""
        try:
            session = self._session(client)
            client.on_data = self._take
            self._queue.put(session)
            self._mirror(client, session)
            beat_ns = 0
            while not self._over():
                client.pump(_POLL_S)
                self._queue_batch()
                now_ns = time.monotonic_ns()
                if now_ns - beat_ns > _BEAT_NS:
                    beat_ns = now_ns
                    client.beat()
                self._report(True)
                time.sleep(_BATCH_S)
            self._await_schedule(client)
            client.pump(0.0)
        except LinkError as error:
            if not self.stopping:
                self._log(f'{error}; the samples so far are kept')
        finally:
            self._queue_batch()

    def _await_schedule(self, client: LinkClient) -> None:
        """Receive the schedule up to now, so that a replay covers the whole recording."""
        now_ns = time.monotonic_ns()
        while (self._error is None and self._schedule >= 0 and self._schedule_ns < now_ns
               and time.monotonic_ns() < now_ns + _SCHEDULE_NS_MOST):
            client.pump(_POLL_S)
            self._queue_batch()

    def _mirror(self, client: LinkClient, session: RecordingSession) -> None:
        """Request the topics; older samples in the rings only if they are useful."""
        from_start = not session.begin_ns or (
            session.tapped and bool(session.taps) and _is_all_there(client, session.taps))
        latched = {info.name for info, shown in session.shown.items()
                   if any(each.latched for each in shown)}
        names = dict.fromkeys(info.name for info in (*session.shown, *session.kept))
        # The schedule comes last: its samples are then before it in the file.
        for name in sorted(names, key=lambda name: name == SCHEDULE_TOPIC):
            client.mirror(name, oldest=from_start, initial=name in latched, patient=True)

    def _session(self, client: LinkClient) -> RecordingSession:
        settings = ''.join(str(part['text']) for part in client.request_all('settings'))
        was_tapped = any(map(is_tap, client.topics))
        taps = client.tap() if self._wanted.replay else ()
        self._schedule = client.topics[SCHEDULE_TOPIC].channel if SCHEDULE_TOPIC in taps else -1
        graph, problem = read_graph(settings, self._robot, self._wanted.core_names)
        chosen = Selection(client.topics, taps, self._wanted, graph)
        if chosen.missing and not self._sessions:
            raise UnknownTopicError(chosen.missing)
        for line in filter(None, (problem, chosen.missing, *chosen.unknown_types)):
            self._log(line)
        start_ns, now_ns = int(client.core['start_ns']), time.monotonic_ns()
        cold = start_ns >= self._asked_ns
        self._begin_ns = self._begin_ns or (start_ns if cold else now_ns)
        session = RecordingSession(
            self._sessions, int(client.core['pid']), start_ns, was_tapped,
            tuple(client.core['tasks']), tuple(client.topics), chosen.shown, chosen.kept, taps,
            settings, self._robot, 0 if cold else now_ns,
            self._wanted.duration_ns and self._begin_ns + self._wanted.duration_ns,
            chosen.frames, chosen.logs)
        self._sessions += 1
        if session.logs:
            self._logger, self._reports = graph.logger, 0
            client.on_report = self._take_report
        count = len(chosen.names)
        topics = '1 topic' if count == 1 else f'{count} topics'
        self._log(f'connected to the core (pid {session.pid}): recording {topics} '
                  f'to {self._bag.folder}')
        return session

    def _take(self, head: Header, cdr: memoryview) -> None:
        self._batch.append((head, bytearray(cdr)))
        if head.channel == self._schedule:
            self._schedule_ns = head.stamp_ns

    def _take_report(self, report: Mapping[str, Any]) -> None:
        """Receive a report of the core; a malformed one is dropped."""
        with suppress(KeyError, TypeError, ValueError, struct.error):
            self._reports += int(report.get('dropped') or 0)
            message = log_message(
                0, nearest_severity(int(report['severity'])),
                self._logger(safe_line(str(report['source']))), safe_text(str(report['text'])))
            head = Header(PacketKind.REPORT, VERSION, LOG_CHANNEL, 0, int(report['at_ns']),
                          self._reports)
            self._reports += 1
            self._batch.append((head, bytearray(message)))

    def _queue_batch(self) -> None:
        batch, self._batch = self._batch, []
        if not batch:
            return
        size = sum(len(cdr) for _, cdr in batch)
        if self._queued + size - self._written > _QUEUE_BYTES:
            self._dropped += len(batch)  # the gaps in their numbers count them by topic
            return
        self._queued += size
        self._queue.put(batch)

    def _report(self, connected: bool, last: bool = False) -> None:
        now_ns = time.monotonic_ns()
        if self._begin_ns and (last or now_ns - self._shown_ns >= NS_PER_S):
            self._shown_ns = now_ns
            self._show(RecorderStatus(now_ns - self._begin_ns, self._bag.messages, self._bag.size,
                                      self._bag.lost, connected))

    # ---- writing -----------------------------------------------------------------------------

    def _write(self) -> None:
        try:
            while True:
                try:
                    item = self._queue.get(timeout=_POLL_S)
                except queue.Empty:
                    item = []
                if item is None:
                    self._bag.end()
                    return
                if isinstance(item, RecordingSession):
                    self._bag.begin(item)
                else:
                    self._bag.write(item)
                    self._written += sum(len(cdr) for _, cdr in item)
                self._bag.tick(time.monotonic_ns())
        except Exception as error:
            self._error = error


class UnknownTopicError(RecordingError):
    """A requested topic does not exist in the core."""


def _is_all_there(client: LinkClient, taps: Collection[str]) -> bool:
    """Whether the rings of the taps still have all samples, with space for the next."""
    return all(topic['published'] < _FILLED * topic['depth']
               for topic in client.statistics().topics if topic['name'] in taps)
