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
Writes records to the disk and passes them to the sender, in a separate thread: a disk may be slow.

Urgent records are written immediately, the rest together a moment later. With a full or broken
disk records are held in memory, sent from there, and written when the disk works again.
"""

from __future__ import annotations

from collections.abc import Callable
import queue
import sqlite3
import threading
import time
from typing import Any
from typing import Final

from rt_robot_os.gateway.dispatch import Dispatch
from rt_robot_os.gateway.dispatch import URGENT
from rt_robot_os.gateway.memory_fallback import MemoryFallback
from rt_robot_os.gateway.outbox import Mark
from rt_robot_os.gateway.outbox import Outbox
from rt_robot_os.gateway.outbox import OutboxRow
from rt_robot_os.gateway.part import GatewayContext
from rt_robot_os.gateway.part import Part
from rt_robot_os.gateway.part import Record
from rt_robot_os.messages.uplink.importance import Importance
from rt_robot_os.messages.uplink.messages import MESSAGE_BYTES
from rt_robot_os.messages.uplink.messages import UplinkMessage
from rt_robot_os.messages.uplink.records import BatchRefused
from rt_robot_os.messages.uplink.records import BatchStored
from rt_robot_os.messages.uplink.records import UplinkRecord

FILE: Final = 'outbox.sqlite3'
#: Longest record; a longer one is replaced by a note about it.
RECORD_BYTES: Final = MESSAGE_BYTES // 4
#: Most records that wait for the thread.
QUEUE: Final = 20_000
_GATHER_S: Final = 0.5
_GATHER_MOST: Final = 1000
_LOOK_S: Final = 0.25
_AGAIN_S: Final = 1.0
_OLD_S: Final = 60.0
_BYTES_PER_MB: Final = 1_000_000
_S_PER_DAY: Final = 86400.0


class RecordQueue(Part):
    """
    Store records until the server has them.

    :param boot: id of this start.
    :param clock_s: CLOCK_MONOTONIC, in s.
    :ivar kept: records so far.
    :ivar problem: the problem of the disk; empty without one.
    :ivar flooded: records dropped because the queue to the disk was full.
    :raises StartError: the folder cannot be used.
    """

    receives = (BatchStored, BatchRefused)

    def __init__(self, context: GatewayContext, boot: str,
                 clock_s: Callable[[], float] = time.monotonic) -> None:
        super().__init__(context)
        settings = context.settings
        self.outbox = Outbox(context.folder / FILE, boot,
                             round(settings.outbox_mb * _BYTES_PER_MB),
                             settings.outbox_days * _S_PER_DAY)
        self.spare = MemoryFallback()
        self.dispatch = Dispatch(self.outbox, self.spare)
        self.kept = self.flooded = self.too_long = 0
        self.problem = ''
        self._clock_s = clock_s
        self._queue: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._ready: list[tuple[Importance, int, str]] = []
        self._lock = threading.Lock()
        self._connection = 0
        self._sending = 0
        self._seq = 0
        self._base_s = self.outbox.lived_s - clock_s()
        self._gathered: list[OutboxRow] = []
        self._marks: dict[str, Mark] = {}
        self._since_s = self._tried_s = 0.0
        self._old_s = clock_s()
        self._thread: threading.Thread | None = None
        if self.outbox.damaged is not None:
            context.tell(f'{self.outbox.path} could not be read and is now {self.outbox.damaged}: '
                         'its records are not sent')

    # ---- any thread --------------------------------------------------------------------------

    def keep(self, record: Record, mark: Mark | None = None) -> None:
        """
        Keep a record.

        :param mark: how far its topic is recorded with it; both are written together.
        """
        if self._queue.qsize() >= QUEUE and record.importance not in URGENT:
            self.flooded += 1
            return
        self._queue.put((record, mark))

    def next_text(self) -> str | None:
        """Return the next batch, for the sender."""
        with self._lock:
            while self._ready:
                _, connection, text = self._ready.pop(0)
                if connection == self._connection:
                    return text
        return None

    def met_server(self) -> None:
        """Send from the beginning: batches in flight may be lost."""
        self._connection += 1
        self._queue.put(('met', self._connection))

    def lost_server(self) -> None:
        """Stop sending."""
        self._connection += 1
        self._queue.put(('lost', self._connection))

    def receive(self, message: UplinkMessage) -> None:
        """Receive the result of a batch."""
        if not isinstance(message, (BatchStored, BatchRefused)):
            return
        if not isinstance(message.batch, int):
            raise ValueError(f'batch {message.batch[:20]!r} is not a number of this gateway')
        if isinstance(message, BatchStored):
            self._queue.put(('stored', message.batch, self._connection))
        else:
            self._queue.put(('refused', message.batch, self._connection, message.retry_s,
                             message.text))

    def statistics(self) -> dict[str, Any]:
        """Return its counters."""
        box, dispatch = self.outbox, self.dispatch
        return {'kept': self.kept, 'waiting': sum(box.rows.values()) + len(self.spare),
                'waiting_mb': round(sum(box.nbytes.values()) / _BYTES_PER_MB, 3),
                'waiting_by_class': {each.name.lower(): n for each, n in box.rows.items() if n},
                'gave_way': {each.name.lower(): n for each, n in box.lost.items() if n},
                'stored': dispatch.stored, 'sent_again': dispatch.again,
                'refusals': dispatch.refusals, 'set_aside': box.refused,
                'unkept': len(self.spare), 'flooded': self.flooded, 'too_long': self.too_long,
                'disk_problem': self.problem}

    def marks(self) -> dict[str, Mark]:
        """Return how far topics were recorded; before :meth:`start`."""
        return self.outbox.marks()

    def start(self) -> None:
        """Begin."""
        self._thread = threading.Thread(target=self._run, name='records', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Write the queued records, and end."""
        if self._thread is not None:
            self._queue.put(None)
            self._thread.join()
            self._thread = None
        self.outbox.close()

    # ---- its thread --------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            try:
                item = self._queue.get(timeout=_LOOK_S)
            except queue.Empty:
                self.step(())
                continue
            items = [item]
            while len(items) < _GATHER_MOST and not self._queue.empty():
                items.append(self._queue.get())
            self.step([each for each in items if each is not None])
            if None in items:
                self._write()
                return

    def step(self, items: Any) -> None:
        """Process arrived records, write due ones, and prepare the next batch."""
        now_s = self._clock_s()
        self.outbox.lived_s = round(self._base_s + now_s)
        for item in items:
            if isinstance(item[0], Record):
                self._gather(item[0], item[1], now_s)
            else:
                self._take(item, now_s)
        if self._gathered and (
                len(self._gathered) >= _GATHER_MOST or now_s - self._since_s >= _GATHER_S
                or any(row.importance in URGENT for row in self._gathered)):
            self._write()
        self._tidy(now_s)
        self._prepare(now_s)

    def _gather(self, record: Record, mark: Mark | None, now_s: float) -> None:
        self._seq += 1
        text = record_text(self._seq, record)
        if text is None:
            self.too_long += 1
            text = record_text(self._seq, Record(record.importance, 'log', {
                'text': f'a record of type {record.type[:40]} was too long or no JSON'},
                record.utc_ns)) or ''
        if not self._gathered:
            self._since_s = now_s
        self._gathered.append(OutboxRow(record.importance, self.outbox.boot, self._seq,
                                        self.outbox.lived_s, text))
        if mark is not None:
            self._marks[mark.topic] = mark
        self.kept += 1

    def _take(self, item: tuple[Any, ...], now_s: float) -> None:
        what = item[0]
        if what in ('met', 'lost'):
            self.dispatch.reset()
            self._sending = item[1] if what == 'met' else 0
            return
        if item[2] != self._sending:
            return  # about an earlier connection
        try:
            if what == 'stored':
                self.dispatch.take_stored(item[1], now_s)
                return
            _, number, _, retry_s, why = item
            row = self.dispatch.take_refused(number, why, retry_s, now_s)
            if row is not None:
                self.context.tell(f'the server always refuses record {row.seq}: {why}; it is set '
                                  f'aside in {self.outbox.path}')
        except sqlite3.Error as error:
            self._note(error)

    def _write(self) -> None:
        rows, marks = self._gathered, list(self._marks.values())
        self._gathered, self._marks = [], {}
        try:
            if len(self.spare):
                raise sqlite3.OperationalError(self.problem or 'the disk did not work before')
            self.outbox.add(rows, marks)
            self.problem = ''
        except sqlite3.Error as error:
            self._note(error)
            for row in self.spare.add(rows, marks):
                self.outbox.lost[Importance(row.importance)] += 1

    def _tidy(self, now_s: float) -> None:
        """Evict rows beyond the limit, free disk space, and write rows that failed before."""
        try:
            if len(self.spare) and now_s - self._tried_s >= _AGAIN_S:
                self._tried_s = now_s
                self._write_spare()
            while self.outbox.over() and self.outbox.evict(self.dispatch.protected):
                pass
            if now_s - self._old_s >= _OLD_S:
                self._old_s = now_s
                while self.outbox.expire(self.dispatch.protected):
                    pass
                self.outbox.shrink()
        except sqlite3.Error as error:
            self._note(error)

    def _write_spare(self) -> None:
        rows = self.spare.rows()
        try:
            self.outbox.add(rows, list(self.spare.marks.values()))
        except sqlite3.Error:
            # Free pages in the file need no further disk space.
            least = max(rows[0].importance + 1, Importance.MEDIA)
            if not self.outbox.evict(self.dispatch.protected, least):
                raise
            self.outbox.add(rows, list(self.spare.marks.values()))
        self.spare.clear()
        self.problem = ''
        self.context.tell(f'{self.outbox.path} can be written again')

    def _note(self, error: sqlite3.Error) -> None:
        text = str(error)
        if not self.problem:
            self.context.tell(f'{self.outbox.path} cannot be written ({text}): make room on the '
                              'disk; meanwhile records are only in memory')
        self.problem = text

    def _prepare(self, now_s: float) -> None:
        if not self._sending:
            return
        try:
            while (made := self.dispatch.next_batch(now_s)) is not None:
                importance, text = made
                with self._lock:  # there are three at most
                    at = sum(each[0] <= importance for each in self._ready)
                    self._ready.insert(at, (importance, self._sending, text))
                self.context.server.wake()
        except sqlite3.Error as error:
            self._note(error)


def record_text(seq: int, record: Record) -> str | None:
    """Serialise a record for sending; None when it is too long or not valid as JSON."""
    try:
        text = UplinkRecord(seq, record.importance, record.type, record.utc_ns,
                            record.content).to_json()
        return text if len(text.encode()) <= RECORD_BYTES else None
    except (TypeError, ValueError, RecursionError):
        return None
