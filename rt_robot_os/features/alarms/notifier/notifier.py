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
The notifier: it passes notifications from the core to the channels, and reports back.

A key is delivered once. A delivery is on the disk before its report is sent. After a new
connection all recent reports are sent again; the core ignores those that it has.
"""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
import queue
import threading
import time
from typing import Any
from typing import Final

from rt_robot_os.base.errors import LinkError
from rt_robot_os.features.alarms.notifier.delivery_log import DeliveryLog
from rt_robot_os.features.alarms.notifier.delivery_log import DeliveryStatus
from rt_robot_os.features.alarms.notifier.delivery_log import is_doubtful
from rt_robot_os.features.alarms.notifier.delivery_log_file import DeliveryLogFile
from rt_robot_os.features.alarms.notifier.sender import ChannelSender
from rt_robot_os.features.alarms.notifier.settings import NotifierSettings
from rt_robot_os.link.client import LinkClient
from rt_robot_os.link.reconnecting_client import ReconnectingClient
from rt_robot_os.messages.cdr import string_in
from rt_robot_os.messages.cdr import string_message
from rt_robot_os.messages.notification import DeliveryReport
from rt_robot_os.messages.notification import Notification
from rt_robot_os.messages.notification import REPORT_CHARACTERS

NOTIFY: Final = 'alarms/notify'
REPORT: Final = 'alarms/report'
HEARTBEAT: Final = 'notifier/heartbeat'
#: Reports that are sent again to a core after a new connection.
REPORTS_AGAIN: Final = 32
_PUMP_S: Final = 0.05
_END_S: Final = 3.0


class Notifier:
    """
    Delivers the notifications of one robot.

    :param path: of the core's socket.
    :param memory: the file of the delivery log.
    :param tell: receives a line of text about each problem.
    :raises StartError: the file cannot be used.
    """

    def __init__(self, settings: NotifierSettings, path: Path, memory: Path,
                 tell: Callable[[str], None]) -> None:
        self._settings = settings
        self._tell = tell
        self._store = DeliveryLogFile(memory)
        self._log = DeliveryLog()
        self._log.restore(self._store.read())
        self._lock = threading.Lock()
        # A thread that waits for the disk delays only threads that store lines, too.
        self._disk = threading.Lock()
        self._shrink()
        self._reports: queue.SimpleQueue[DeliveryReport] = queue.SimpleQueue()
        self._unsent: list[DeliveryReport] = []
        self._channels: dict[str, int] = {}
        self._counters = {'taken': 0, 'again': 0, 'duplicates': 0, 'malformed': 0, 'missed': 0,
                          'unknown_channel': 0}
        self._beat_s = 0.0
        self._start_ns = time.monotonic_ns()
        self.senders = {each.name: ChannelSender(each, self._begin, self._end, settings.expires_s)
                        for each in settings.channels}
        self.link = ReconnectingClient(path, 'notifier', self._connect, tell)

    def run(self, stopping: Callable[[], bool]) -> None:
        """Deliver until stopped; then running deliveries have three seconds to end."""
        try:
            while not stopping():
                self.link.pump(_PUMP_S)
                self._report()
                self._beat()
        finally:
            deadline = time.monotonic() + _END_S
            for sender in self.senders.values():
                sender.stop(max(0.0, deadline - time.monotonic()))
            self._report()
            self.link.close()
            with self._disk:
                self._store.close()

    # ---- from the core -----------------------------------------------------------------------

    def _connect(self, client: LinkClient) -> None:
        """
        Set up a new connection: notifications so far, and reports that may have been lost.

        :raises LinkError: this robot has no alarms.
        """
        missing = [topic for topic in (NOTIFY, REPORT) if topic not in client.topics]
        if missing:
            raise LinkError(f'this robot has no topic {missing[0]}: it has no module alarms, or '
                            'does not list that topic (docs/notifier.md)')
        self._channels = {topic: client.advertise(topic) for topic in (REPORT, HEARTBEAT)
                          if topic in client.topics}
        with self._lock:
            again = self._log.recent(REPORTS_AGAIN)
        known = {each.key for each in again}
        self._unsent = [*again, *(each for each in self._unsent if each.key not in known)]
        self._beat_s = 0.0
        client.sample_handlers[client.topics[NOTIFY].channel] = self._take
        client.mirror(NOTIFY, oldest=True, patient=True)

    def _take(self, stamp_ns: int, missed: int, cdr: memoryview) -> None:
        self._counters['missed'] = missed
        try:
            notification = Notification.from_json(string_in(cdr))
        except ValueError as error:
            self._counters['malformed'] += 1
            self._tell(f'{NOTIFY}: {error}')
            return
        self._counters['taken'] += 1
        with self._lock:
            verdict = self._log.start(notification.key, is_doubtful(
                notification, stamp_ns, self._start_ns))
            known = self._log.report(notification.key)
        if known is not None:
            self._counters['duplicates'] += 1
            self._reports.put(known)
        elif verdict is DeliveryStatus.RUNNING:
            self._counters['duplicates'] += 1
        else:
            self._counters['again'] += verdict is DeliveryStatus.AGAIN
            self._hand_over(notification, verdict is DeliveryStatus.AGAIN, stamp_ns)

    def _hand_over(self, notification: Notification, again: bool, stamp_ns: int) -> None:
        sender = self.senders.get(notification.channel)
        if sender is None:
            self._counters['unknown_channel'] += 1
            there = ', '.join(self.senders) or 'none'
            self._refuse(notification, f'the notifier has no such channel; it has {there}')
        elif not sender.send(notification, again, stamp_ns):
            self._refuse(notification, 'too many notifications wait for this channel')

    def _refuse(self, notification: Notification, why: str) -> None:
        self._tell(f'{notification.key}: {why}')
        report = DeliveryReport(
            notification.key, notification.channel, False, why[:REPORT_CHARACTERS])
        with self._lock:
            self._log.finish(report)  # not stored: nothing was delivered
        self._reports.put(report)

    # ---- by the senders ----------------------------------------------------------------------

    def _begin(self, notification: Notification) -> None:
        """Store that the delivery starts."""
        line = self._log.start_line(notification.key, notification.channel)
        with self._disk:
            self._store.keep(line)

    def _end(self, report: DeliveryReport) -> None:
        with self._lock:
            line = self._log.finish(report)
        with self._disk:
            self._store.keep(line)
            self._shrink()
        self._reports.put(report)

    def _shrink(self) -> None:
        if self._store.is_long(len(self._log)):
            with self._lock:
                lines = self._log.lines()
            self._store.rewrite(lines)

    # ---- to the core -------------------------------------------------------------------------

    def _report(self) -> None:
        """Publish delivery reports; those that cannot be published wait."""
        while True:
            try:
                report = self._reports.get_nowait()
            except queue.Empty:
                break
            self._unsent.append(report)
            if not report.ok:
                self._tell(f'{report.channel}: {report.key} failed: {report.text}')
        client = self.link.client
        while self._unsent and client is not None:
            try:
                client.publish(self._channels[REPORT], string_message(self._unsent[0].to_json()))
            except LinkError:
                return  # it is sent again with the next connection, or a moment later
            self._unsent.pop(0)

    def _beat(self) -> None:
        now_s = time.monotonic()
        client = self.link.client
        if client is None or HEARTBEAT not in self._channels or now_s < self._beat_s:
            return
        self._beat_s = now_s + self._settings.heartbeat_s
        try:
            client.publish(self._channels[HEARTBEAT],
                           string_message(json.dumps(self.statistics())[:_BEAT_LETTERS]))
        except LinkError:
            return  # the next heartbeat has the same content

    def statistics(self) -> dict[str, Any]:
        """Return the counters of all channels, and what is wrong."""
        return {'channels': {name: each.statistics() for name, each in self.senders.items()},
                **self._counters, 'unsent': len(self._unsent), 'remembered': len(self._log),
                'unkept': self._store.failed, 'problem': self._store.problem}


_BEAT_LETTERS: Final = 4000
