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

"""A simulated notifier: the real delivery log on a disk in memory, and recipients of channels."""

from __future__ import annotations

from collections import Counter
from collections import defaultdict
from collections import deque
from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import replace
from random import Random
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.journal_store import Killed
from rt_robot_os.features.alarms.journal_store import MemoryStore
from rt_robot_os.features.alarms.notifier.delivery_log import DeliveryLog
from rt_robot_os.features.alarms.notifier.delivery_log import DeliveryStatus
from rt_robot_os.features.alarms.notifier.delivery_log import is_doubtful
from rt_robot_os.messages.notification import DeliveryReport
from rt_robot_os.messages.notification import Notification
from rt_robot_os.sim.scenarios.timeline import Action
from rt_robot_os.sim.scenarios.timeline import VirtualTimeline

#: The file of the delivery log.
MEMORY: Final = 'deliveries'
_EXPIRES_NS: Final = 60 * NS_PER_S
_QUEUE: Final = 32
_REPORTS_AGAIN: Final = 32


def _never() -> None:
    """Handle a kill that no scenario injects."""


class Recipient:
    """
    The recipient of a channel, and which notifications were shown.

    :ivar shown: how often each key was shown.
    :ivar twice: notifications that were shown again as if they were new.
    :ivar folded: notifications that were shown again and marked as repeated.
    :ivar down: the channel fails.
    :ivar hangs: the channel delivers, but does not confirm.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.shown: Counter[str] = Counter()
        self.twice = self.folded = 0
        self.down = self.hangs = False

    def show(self, key: str, again: bool) -> bool:
        """Show a notification; return whether it is new."""
        self.shown[key] += 1
        if self.shown[key] == 1:
            return True
        self.folded += again
        self.twice += not again
        return False


class NotifierProcess:
    """
    One run of the notifier, with its real delivery log.

    :param store: its disk.
    :param recipients: by the names of their channels.
    :param report: receives the result of a delivery, for the core.
    :param see: receives what a recipient is shown for the first time.
    :param killed: is called when the process is killed in the middle of a write.
    """

    def __init__(self, timeline: VirtualTimeline, random: Random, store: MemoryStore,
                 recipients: Mapping[str, Recipient], report: Callable[[DeliveryReport], None],
                 see: Callable[[Recipient, Notification], None], killed: Action = _never
                 ) -> None:
        self.ended = False
        self._start_ns = timeline.now_ns
        self._killed = killed
        self._timeline = timeline
        self._random = random
        self._store = store
        self._recipients = recipients
        self._report = report
        self._see = see
        self._log = DeliveryLog()
        data = store.read(MEMORY)
        self._log.restore(data.decode(errors='replace').splitlines())
        if data and not data.endswith(b'\n'):
            self._keep('\n')
        self._queues: defaultdict[str, deque[tuple[Notification, bool, int]]] = (
            defaultdict(deque))
        self._busy: set[str] = set()

    def connect(self, ring: list[tuple[int, str]]) -> None:
        """Connect to a core: report recent results, receive what its ring still holds."""
        for report in self._log.recent(_REPORTS_AGAIN):
            self._report(report)
        for stamp_ns, text in ring:
            self.receive(text, stamp_ns)

    def receive(self, text: str, stamp_ns: int) -> None:
        """Receive a notification."""
        if self.ended:
            return
        found = Notification.from_json(text)
        key, channel = found.key, found.channel
        verdict = self._log.start(key, is_doubtful(found, stamp_ns, self._start_ns))
        known = self._log.report(key)
        if known is not None:
            self._report(known)
        elif verdict is not DeliveryStatus.RUNNING:
            queue = self._queues[channel]
            if len(queue) >= _QUEUE:
                report = DeliveryReport(key, channel, False, 'too many wait')
                self._log.finish(report)
                self._report(report)
                return
            queue.append((found, verdict is DeliveryStatus.AGAIN, stamp_ns))
            self._next(channel)

    def _next(self, channel: str) -> None:
        queue = self._queues[channel]
        if self.ended or channel in self._busy or not queue:
            return
        found, again, stamp_ns = queue.popleft()
        self._busy.add(channel)
        if self._timeline.now_ns - stamp_ns > _EXPIRES_NS:
            self._end(DeliveryReport(found.key, channel, False, 'too old'))
            return
        if self._keep(self._log.start_line(found.key, channel)):
            self._timeline.after(self._ms(1, 400), lambda: self._show(found, again))

    def _show(self, found: Notification, again: bool) -> None:
        if self.ended:
            return
        recipient = self._recipients[found.channel]
        report = DeliveryReport(found.key, recipient.name, not recipient.down,
                                'down' if recipient.down else '')
        if not recipient.down and recipient.show(found.key, again):
            self._see(recipient, found)
        if recipient.hangs and not recipient.down:
            report = replace(report, ok=False, text='no answer')
        self._timeline.after(self._ms(1, 300) + (8 * NS_PER_S if recipient.hangs else 0),
                             lambda: self._end(report))

    def _end(self, report: DeliveryReport) -> None:
        if self.ended:
            return
        if self._keep(self._log.finish(report)):
            self._report(report)
            self._busy.discard(report.channel)
            self._next(report.channel)

    def _keep(self, line: str) -> bool:
        """Write a line whole or not at all, as the real store does; return False when killed."""
        store, size = self._store, len(self._store.read(MEMORY))
        try:
            try:
                store.append(MEMORY, line.encode())
                store.sync(MEMORY)
            except OSError:
                store.truncate(MEMORY, size)
        except Killed:
            self.ended = True
            self._timeline.after(0, self._killed)
        return not self.ended

    def _ms(self, least: float, most: float) -> int:
        return round(self._random.uniform(least, most) * NS_PER_MS)
