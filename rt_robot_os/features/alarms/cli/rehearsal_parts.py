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
The simulated parts of a rehearsal of alarms: time, disk, notifier and people.

The journal and the delivery log are the real ones, over files in memory that can be cut at any
byte. A process that is killed loses its pending work.
"""

from __future__ import annotations

from collections import Counter
from collections import deque
from collections.abc import Callable
from dataclasses import replace
import heapq
import itertools
import json
from random import Random
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.alarms.journal_file import JournalFile
from rt_robot_os.features.alarms.journal_store import Killed
from rt_robot_os.features.alarms.journal_store import MemoryStore
from rt_robot_os.features.alarms.notifier.delivery_log import DeliveryLog
from rt_robot_os.features.alarms.notifier.delivery_log import DeliveryStatus
from rt_robot_os.features.alarms.notifier.delivery_log import is_doubtful
from rt_robot_os.messages.notification import DeliveryReport
from rt_robot_os.messages.notification import Notification

Action = Callable[[], None]
# Short, so that it is rewritten often.
_LIMIT_BYTES: Final = 40_000
_RETRY_S: Final = (1.0, 5.0)
_EXPIRES_NS: Final = 60 * NS_PER_S
_QUEUE: Final = 32
_REPORTS_AGAIN: Final = 32
MEMORY: Final = 'deliveries'


class RehearsalClock:
    """Virtual time: scheduled calls run in order, each at its own time."""

    def __init__(self) -> None:
        self.now_ns = 0
        self._due: list[tuple[int, int, Action]] = []
        self._count = itertools.count()

    def after(self, delay_ns: int, action: Action) -> None:
        """Schedule a call."""
        heapq.heappush(self._due, (self.now_ns + max(0, delay_ns), next(self._count), action))

    def step(self) -> bool:
        """Run the next call; False when there is none."""
        if not self._due:
            return False
        self.now_ns, _, action = heapq.heappop(self._due)
        action()
        return True


class JournalProcess:
    """
    The process that writes the journal of one run of a core.

    :param store: the disk.
    :param tell: receives its replies to the core.
    :param killed: called when it is killed in the middle of a write.
    """

    def __init__(self, timeline: RehearsalClock, random: Random, store: MemoryStore,
                 tell: Callable[[dict[str, Any]], None], killed: Action) -> None:
        self.ended = False
        self._timeline = timeline
        self._random = random
        self._store = store
        self._tell = tell
        self._killed = killed
        self._file: JournalFile | None = None
        self._deferred: list[str] = []
        self._low = False
        timeline.after(self._ms(2, 30), self._open)

    def _ms(self, least: float, most: float) -> int:
        return round(self._random.uniform(least, most) * NS_PER_MS)

    def keep(self, text: str) -> None:
        """Store a record; those before it has opened are requested again then."""
        if self._file is None:
            return
        if not self._deferred:
            self._timeline.after(self._ms(0.2, 3), self._write)
        self._deferred.append(text)

    def _open(self) -> None:
        if self.ended:
            return
        now_ns = self._timeline.now_ns
        try:
            file = JournalFile(self._store, _LIMIT_BYTES, lambda: self._timeline.now_ns)
            found = file.open()
        except OSError as error:
            self._fail(str(error.strerror))
            return
        except Killed:
            self._killed()
            return
        self._file = file
        for each in found.living():
            self._tell({'record': each.record, 'age_ns': max(0, now_ns - each.at_ns)})
        self._tell({'restored': len(found.living())})

    def _write(self) -> None:
        if self.ended or self._file is None:
            return
        waiting, self._deferred = self._deferred, []
        try:
            for text in waiting:
                self._file.append(text, int(json.loads(text)['seq']))
            stored = self._file.commit()
            low = self._file.keep_room().problem
        except OSError as error:
            self._fail(str(error.strerror))
            return
        except Killed:
            self._killed()
            return
        self._timeline.after(self._ms(0.5, 15), lambda: self._say({'stored': stored}))
        if self._low != (low is not None):
            self._low = not self._low
            self._say({'low': str(low.strerror) if low else ''})

    def _say(self, said: dict[str, Any]) -> None:
        if not self.ended:
            self._tell(said)

    def _fail(self, why: str) -> None:
        """Report a fault, and try again with another process."""
        self._file, self._deferred = None, []
        self._timeline.after(round(self._random.uniform(*_RETRY_S) * NS_PER_S), self._open)
        self._tell({'fault': why})


class Responder:
    """
    A person at the end of a channel, and the notifications that they were shown.

    :ivar shown: how often each key reached them.
    :ivar twice: of them, those that came again without saying so.
    :ivar folded: those that came again and said so.
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
    One run of the notifier, with the real delivery log.

    :param store: its disk.
    :param report: receives the delivery reports for the core.
    :param see: receives what a person is shown.
    :param killed: called when something kills it in the middle of a write.
    """

    def __init__(self, timeline: RehearsalClock, random: Random, store: MemoryStore,
                 people: dict[str, Responder], report: Callable[[DeliveryReport], None],
                 see: Callable[[Responder, Notification], None], killed: Action) -> None:
        self.ended = False
        self._start_ns = timeline.now_ns
        self._killed = killed
        self._timeline = timeline
        self._random = random
        self._store = store
        self._people = people
        self._tell = report
        self._see = see
        self._log = DeliveryLog()
        data = store.read(MEMORY)
        self._log.restore(data.decode(errors='replace').splitlines())
        if data and not data.endswith(b'\n'):
            self._keep('\n')
        self._queues: dict[str, deque[tuple[Notification, bool, int]]] = {
            name: deque() for name in people}
        self._busy: set[str] = set()

    def connect(self, ring: list[tuple[int, str]]) -> None:
        """Connect to a core, with the samples that its ring still holds."""
        for report in self._log.recent(_REPORTS_AGAIN):
            self._tell(report)
        for stamp_ns, text in ring:
            self.take(text, stamp_ns)

    def take(self, text: str, stamp_ns: int) -> None:
        """Handle a notification."""
        if self.ended:
            return
        found = Notification.from_json(text)
        key, channel = found.key, found.channel
        verdict = self._log.start(key, is_doubtful(found, stamp_ns, self._start_ns))
        known = self._log.report(key)
        if known is not None:
            self._tell(known)
        elif verdict is not DeliveryStatus.RUNNING:
            queue = self._queues[channel]
            if len(queue) >= _QUEUE:
                report = DeliveryReport(key, channel, False, 'too many wait')
                self._log.finish(report)
                self._tell(report)
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
        person = self._people[found.channel]
        report = DeliveryReport(found.key, person.name, not person.down,
                                'down' if person.down else '')
        if not person.down and person.show(found.key, again):
            self._see(person, found)
        if person.hangs and not person.down:
            report = replace(report, ok=False, text='no answer')
        self._timeline.after(self._ms(1, 300) + (8 * NS_PER_S if person.hangs else 0),
                             lambda: self._end(report))

    def _end(self, report: DeliveryReport) -> None:
        if self.ended:
            return
        if self._keep(self._log.finish(report)):
            self._tell(report)
            self._busy.discard(report.channel)
            self._next(report.channel)

    def _keep(self, line: str) -> bool:
        """Write a line as the real file does, whole or not at all; False when that kills it."""
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
