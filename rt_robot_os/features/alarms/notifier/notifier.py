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
The notifier: notifications from the core to the couriers, and what became of them back.

A key is delivered once. What was delivered is on the disk before the core is told; after the core
or the notifier was away all recent reports are told again, which the core takes as one.
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
#: Reports that are told again to a core that comes (back).
REPORTS_AGAIN: Final = 32
_PUMP_S: Final = 0.05
_END_S: Final = 3.0


class Notifier:
    """
    Carry notifications of one robot.

    :param path: of the core's socket.
    :param memory: the file that remembers what was delivered.
    :param tell: takes a line of text about what goes wrong.
    :raises StartError: the memory cannot be used.
    """

    def __init__(self, settings: NotifierSettings, path: Path, memory: Path,
                 tell: Callable[[str], None]) -> None:
        self._settings = settings
        self._tell = tell
        self._store = DeliveryLogFile(memory)
        self._ledger = DeliveryLog()
        self._ledger.restore(self._store.read())
        self._lock = threading.Lock()
        # Who waits for the disk holds up only who has something to keep as well.
        self._disk = threading.Lock()
        self._shrink()
        self._reports: queue.SimpleQueue[DeliveryReport] = queue.SimpleQueue()
        self._unsent: list[DeliveryReport] = []
        self._channels: dict[str, int] = {}
        self._counters = {'taken': 0, 'again': 0, 'duplicates': 0, 'malformed': 0, 'missed': 0,
                          'unknown_channel': 0}
        self._beat_s = 0.0
        self._start_ns = time.monotonic_ns()
        self.couriers = {each.name: ChannelSender(each, self._begin, self._end, settings.expires_s)
                         for each in settings.channels}
        self.link = ReconnectingClient(path, 'notifier', self._connect, tell)

    def run(self, stopping: Callable[[], bool]) -> None:
        """Carry until somebody stops it; then what runs has three seconds to end."""
        try:
            while not stopping():
                self.link.pump(_PUMP_S)
                self._report()
                self._beat()
        finally:
            deadline = time.monotonic() + _END_S
            for courier in self.couriers.values():
                courier.stop(max(0.0, deadline - time.monotonic()))
            self._report()
            self.link.close()
            with self._disk:
                self._store.close()

    # ---- from the core -----------------------------------------------------------------------

    def _connect(self, client: LinkClient) -> None:
        """
        Take a new connection: what its core told already, and what it may not have heard.

        :raises LinkError: this robot has no alarms.
        """
        missing = [topic for topic in (NOTIFY, REPORT) if topic not in client.topics]
        if missing:
            raise LinkError(f'this robot has no topic {missing[0]}: it keeps no alarms, or '
                            'does not list that topic (docs/notifier.md)')
        self._channels = {topic: client.advertise(topic) for topic in (REPORT, HEARTBEAT)
                          if topic in client.topics}
        with self._lock:
            again = self._ledger.recent(REPORTS_AGAIN)
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
            verdict = self._ledger.take(notification.key, is_doubtful(
                notification, stamp_ns, self._start_ns))
            known = self._ledger.report(notification.key)
        if known is not None:
            self._counters['duplicates'] += 1
            self._reports.put(known)
        elif verdict is DeliveryStatus.RUNNING:
            self._counters['duplicates'] += 1
        else:
            self._counters['again'] += verdict is DeliveryStatus.AGAIN
            self._hand_over(notification, verdict is DeliveryStatus.AGAIN, stamp_ns)

    def _hand_over(self, notification: Notification, again: bool, stamp_ns: int) -> None:
        courier = self.couriers.get(notification.channel)
        if courier is None:
            self._counters['unknown_channel'] += 1
            there = ', '.join(self.couriers) or 'none'
            self._refuse(notification, f'the notifier has no such channel; it has {there}')
        elif not courier.send(notification, again, stamp_ns):
            self._refuse(notification, 'too many notifications wait for this channel')

    def _refuse(self, notification: Notification, why: str) -> None:
        self._tell(f'{notification.key}: {why}')
        report = DeliveryReport(notification.key, notification.channel, False, why[:REPORT_CHARACTERS])
        with self._lock:
            self._ledger.end(report)  # not worth the disk: it was not told
        self._reports.put(report)

    # ---- by the couriers ---------------------------------------------------------------------

    def _begin(self, notification: Notification) -> None:
        """Have it on the disk that somebody may know from now on."""
        line = self._ledger.begun(notification.key, notification.channel)
        with self._disk:
            self._store.keep(line)

    def _end(self, report: DeliveryReport) -> None:
        with self._lock:
            line = self._ledger.end(report)
        with self._disk:
            self._store.keep(line)
            self._shrink()
        self._reports.put(report)

    def _shrink(self) -> None:
        if self._store.is_long(len(self._ledger)):
            with self._lock:
                lines = self._ledger.lines()
            self._store.write_anew(lines)

    # ---- to the core -------------------------------------------------------------------------

    def _report(self) -> None:
        """Publish what became of notifications; what cannot be is kept for later."""
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
                return  # it is told again with the next connection, or a moment later
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
            return  # the next one says as much

    def statistics(self) -> dict[str, Any]:
        """Return the counters of all channels, and what is wrong."""
        return {'channels': {name: each.statistics() for name, each in self.couriers.items()},
                **self._counters, 'unsent': len(self._unsent), 'remembered': len(self._ledger),
                'unkept': self._store.failed, 'problem': self._store.problem}


_BEAT_LETTERS: Final = 4000
