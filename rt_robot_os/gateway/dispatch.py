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
Selects the next records to send, adapted to the network.

The most important are sent first, and of them the oldest.

This module has no threads and no network: it returns texts, receives answers, and gets the time as
an argument.
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field
from typing import Final

from rt_robot_os.gateway.memory_fallback import MemoryFallback
from rt_robot_os.gateway.outbox import Outbox
from rt_robot_os.gateway.outbox import OutboxPosition
from rt_robot_os.gateway.outbox import OutboxRow
from rt_robot_os.gateway.outbox import START
from rt_robot_os.messages.uplink.importance import Importance
from rt_robot_os.messages.uplink.messages import MESSAGE_BYTES
from rt_robot_os.messages.uplink.records import RecordBatch

#: Most batches in flight, and one more for urgent records.
WINDOW: Final = 2
URGENT: Final = (Importance.ALARM, Importance.EVENT)
#: Rows of a batch; more while the server is fast, fewer while it is slow.
ROWS_FIRST: Final = 64
ROWS_LEAST: Final = 16
ROWS_MOST: Final = 8000
BATCH_BYTES: Final = MESSAGE_BYTES * 3 // 4
QUICK_S: Final = 0.15
SLOW_S: Final = 0.4
#: If fewer rows take more than this part of the time, the number of rows is not the cause.
GAIN: Final = 0.7
HOLD: Final = 16
#: Timeout after which a batch is sent again; it doubles each time.
ANSWER_S: Final = 10.0
ANSWER_MOST_S: Final = 120.0
#: Pause after a refusal.
RETRY_S: Final = 0.5
RETRY_MOST_S: Final = 30.0
#: Refusals of a record, while others are stored, after which it is quarantined.
STRIKES: Final = 3
DOUBTFUL_MOST: Final = 64
_FACTOR: Final = 2
#: A batch has one record only while records are tested one by one.
_ONE: Final = 1


@dataclass
class SentBatch:
    """Records in flight."""

    number: int
    importance: Importance
    rows: list[OutboxRow]
    sent_s: float
    from_doubtful: bool = False


@dataclass
class Doubt:
    """A record that was refused in a batch of its own."""

    row: OutboxRow
    why: str
    strikes: int = 0
    #: Other records were accepted since its last refusal.
    others: bool = False


@dataclass
class Dispatch:
    """
    The records in flight to the server; :meth:`reset` at each connection.

    :ivar stored: records that the server has stored.
    :ivar again: records that were sent again because no answer came.
    :ivar refusals: batches that the server refused.
    :ivar rows_now: present number of rows of a batch.
    """

    outbox: Outbox
    spare: MemoryFallback
    stored: int = 0
    again: int = 0
    refusals: int = 0
    rows_now: int = ROWS_FIRST
    _number: int = 0
    _batches: dict[int, SentBatch] = field(default_factory=dict)
    _places: dict[Importance, OutboxPosition] = field(default_factory=dict)
    _doubts: dict[tuple[int, int, int], Doubt] = field(default_factory=dict)
    _not_before_s: float = 0.0
    _retry_s: float = RETRY_S
    _answer_s: float = ANSWER_S
    _changed: int = 0
    _slow_s: float = 0.0
    _hold: int = 0

    def reset(self) -> None:
        """Treat all records in flight as not sent."""
        self._batches.clear()
        self._places.clear()
        self._not_before_s = 0.0

    @property
    def protected(self) -> dict[Importance, OutboxPosition]:
        """Return the last rows in flight, by importance."""
        return dict(self._places)

    # ---- out ---------------------------------------------------------------------------------

    def next_batch(self, now_s: float) -> tuple[Importance, str] | None:
        """
        Make the next message.

        :param now_s: on CLOCK_MONOTONIC, here and below.
        :return: its importance and its text; None when nothing may be sent now.
        """
        if now_s < self._not_before_s:
            return None
        self._give_up(now_s)
        for importance in Importance:
            if not self._may_go(importance):
                continue
            rows = self._rows(importance)
            if rows:
                return importance, self._send(importance, rows, now_s)
        return self._next_doubtful(now_s)

    def _may_go(self, importance: Importance) -> bool:
        if len(self._batches) < WINDOW and (self.rows_now > _ONE or not self._batches):
            return True
        return importance in URGENT and self.rows_now > _ONE and not any(
            each.importance in URGENT for each in self._batches.values())

    def _rows(self, importance: Importance) -> list[OutboxRow]:
        place = self._places.get(importance, START)
        while True:
            rows = self.outbox.after(importance, place, self.rows_now, BATCH_BYTES)
            if not rows:
                rows = self.spare.after(importance, place, self.rows_now, BATCH_BYTES)
            good = [row for row in rows if row[:3] not in self._doubts]
            if good or not rows:
                return good
            place = self._places[importance] = rows[-1][1:3]

    def _send(self, importance: Importance, rows: list[OutboxRow], now_s: float,
              from_doubtful: bool = False) -> str:
        self._number += 1
        self._batches[self._number] = SentBatch(self._number, importance, rows, now_s,
                                                from_doubtful)
        if not from_doubtful:
            self._places[importance] = rows[-1].boot, rows[-1].seq
        lost = {str(each.value): count for each, count in self.outbox.lost.items() if count}
        batch = RecordBatch(self._number, (), self.outbox.boots[rows[0].boot], lost)
        return batch.with_records(row.text for row in rows)

    def _next_doubtful(self, now_s: float) -> tuple[Importance, str] | None:
        """Retry a refused record if others were accepted since."""
        if self._batches:
            return None
        for doubt in self._doubts.values():
            if doubt.others:
                importance = Importance(doubt.row.importance)
                return importance, self._send(importance, [doubt.row], now_s, True)
        return None

    def _give_up(self, now_s: float) -> None:
        """Send batches without an answer again."""
        if any(now_s - each.sent_s > self._answer_s for each in self._batches.values()):
            self.again += sum(len(each.rows) for each in self._batches.values())
            self._answer_s = min(ANSWER_MOST_S, _FACTOR * self._answer_s)
            self.reset()

    # ---- in ----------------------------------------------------------------------------------

    def take_stored(self, number: int, now_s: float) -> None:
        """
        Process the acknowledgement of a batch.

        :raises sqlite3.Error: it cannot be removed from the outbox, and will be sent again.
        """
        batch = self._batches.pop(number, None)
        if batch is None:
            return  # it was sent again since
        self._adapt(batch, now_s - batch.sent_s)
        self._answer_s, self._retry_s = ANSWER_S, RETRY_S
        self.stored += len(batch.rows)
        for row in batch.rows:
            self._doubts.pop(row[:3], None)
        for doubt in self._doubts.values():
            doubt.others = True
        self.spare.done(batch.rows)
        self.outbox.done(batch.rows)

    def _adapt(self, batch: SentBatch, elapsed_s: float) -> None:
        """Adapt the number of rows of a batch: many on a fast network, few on a slow one."""
        if batch.number <= self._changed and self.rows_now > _ONE:
            return  # of the size before
        rows = self.rows_now
        if elapsed_s < QUICK_S or rows == _ONE:
            rows, self._slow_s = min(ROWS_MOST, _FACTOR * rows), 0.0
        elif elapsed_s < SLOW_S:
            self._slow_s = 0.0
        elif self._hold:
            self._hold -= 1
        elif self._slow_s and elapsed_s > GAIN * self._slow_s:
            # The server is slow, which costs the same for few rows.
            rows, self._slow_s, self._hold = _FACTOR * rows, 0.0, HOLD
        else:
            rows, self._slow_s = max(ROWS_LEAST, rows // _FACTOR), elapsed_s
        if rows != self.rows_now:
            self.rows_now, self._changed = rows, self._number

    def take_refused(self, number: int, why: str, retry_s: float, now_s: float
                     ) -> OutboxRow | None:
        """
        Process the refusal of a batch: it is halved until records are sent one by one.

        :return: a record that was quarantined now.
        :raises sqlite3.Error: the quarantine cannot be stored.
        """
        batch = self._batches.pop(number, None)
        if batch is None:
            return None
        self.refusals += 1
        self.reset()
        self._not_before_s = now_s + min(RETRY_MOST_S, max(0.0, retry_s) or self._retry_s)
        if len(batch.rows) > 1:
            self.rows_now = max(_ONE, min(self.rows_now, len(batch.rows)) // _FACTOR)
            return None
        return self._doubt(batch.rows[0], why)

    def _doubt(self, row: OutboxRow, why: str) -> OutboxRow | None:
        self.rows_now = _ONE
        known = self._doubts.get(row[:3])
        if known is None:
            if len(self._doubts) >= DOUBTFUL_MOST:
                # After so many refusals in a row the cause is the server, not the records.
                self._doubts.clear()
                self._retry_s = min(RETRY_MOST_S, _FACTOR * self._retry_s)
                self._not_before_s += self._retry_s
            self._doubts[row[:3]] = Doubt(row, why)
            return None
        if known.others:
            known.strikes += 1
            known.others = False
        if known.strikes < STRIKES - 1:
            return None
        del self._doubts[row[:3]]
        self.outbox.quarantine(row, why)
        self.spare.done([row])
        return row
