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
The file of a journal: opened, appended to, synced, and rewritten now and then.

There are two generations. A new file is written whole, synced, and only then takes the name of the
one in use, which becomes the older one. So one of them is whole at each moment, whatever is cut.
The file is also rewritten each time it is opened, which leaves behind what a crash has left.

Room on the disk is reserved for what will be added and for the next file, so that a full disk does
not stop the journal soon; :meth:`JournalFile.keep_room` returns how much is left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field
from typing import Final
from typing import NamedTuple

from rt_robot_os.features.alarms.journal_lines import decode
from rt_robot_os.features.alarms.journal_lines import encode_header
from rt_robot_os.features.alarms.journal_lines import encode_record
from rt_robot_os.features.alarms.journal_lines import JournalContents
from rt_robot_os.features.alarms.journal_lines import JournalHeader
from rt_robot_os.features.alarms.journal_lines import newest
from rt_robot_os.features.alarms.journal_lines import retained
from rt_robot_os.features.alarms.journal_lines import StoredRecord
from rt_robot_os.features.alarms.journal_store import JournalStore
from rt_robot_os.messages.fields import compact

#: Names of the file in use, the one before it, and the one that is being written.
NAME: Final = 'alarms.journal'
OLDER: Final = 'alarms.journal.1'
NEW: Final = 'alarms.journal.new'
# How often within one limit a rewrite is tried again, while the disk refuses it.
_TRIES: Final = 16


@dataclass
class JournalHistory:
    """
    What a journal holds.

    :ivar records: all that could be read, in order.
    :ivar torn_bytes: cut off at the end of the file in use.
    :ivar damaged: stretches that could not be read.
    :ivar generation: of the file in use.
    """

    records: list[StoredRecord] = field(default_factory=list)
    torn_bytes: int = 0
    damaged: int = 0
    generation: int = 0

    def living(self) -> list[StoredRecord]:
        """Return the newest record of each open alarm, and the last record."""
        last = max((each.seq for each in self.records), default=0)
        return sorted(each for each in newest(self.records).values()
                      if each.is_needed or each.seq == last)


def disk_bytes(limit_bytes: int) -> int:
    """Return about how much of its disk a journal takes, with its reserve."""
    return 3 * (limit_bytes + limit_bytes // 2)


class DiskReserve(NamedTuple):
    """
    Room that is reserved on the disk for records.

    :ivar kept_bytes: reserved behind what is written.
    :ivar problem: why there is less than there should be; None when there is all of it.
    """

    kept_bytes: int = 0
    problem: OSError | None = None


def read_journal(store: JournalStore) -> JournalHistory:
    """
    Read a journal, even while another process writes it.

    :raises OSError: it cannot be read.
    """
    return _found(decode(store.read(NAME)), lambda: decode(store.read(OLDER)))


def _found(used: JournalContents, older: Callable[[], JournalContents]) -> JournalHistory:
    found = JournalHistory(used.records, used.torn_bytes, used.damaged,
                           used.beginning.generation if used.beginning else 0)
    if used.whole:
        return found
    before = older()
    found.records = sorted({each.seq: each for each in (*before.records, *used.records)}.values())
    found.damaged += before.damaged
    if before.beginning is not None:
        found.generation = max(found.generation, before.beginning.generation)
    return found


class JournalFile:
    """
    The journal of one robot; no other process may write it.

    :param store: where its files are.
    :param limit_bytes: a file of that length is rewritten.
    :param now_ns: the time of day, in ns since 1970.
    :ivar seq: of the last record that is stored.
    :ivar begun: the number of the file that was begun with :meth:`open`, which no file had before;
        0 when none could be begun.
    :ivar put_off: how often no new file could be written, and the one in use was kept.
    """

    def __init__(self, store: JournalStore, limit_bytes: int, now_ns: Callable[[], int]) -> None:
        self.seq = self.begun = self.put_off = 0
        self._store = store
        self._limit_bytes = limit_bytes
        self._now_ns = now_ns
        self._generation = 0
        self._size = 0
        # From which length on it is rewritten, and how long it may become meanwhile.
        self._anew_at = limit_bytes
        self._most_bytes = 0
        self._dirty = False

    def open(self) -> JournalHistory:  # noqa: A003
        """
        Read the journal, and begin a new file with the records that are retained.

        On a full disk, on which no new file can be written, the present one stays in use.

        :raises OSError: it can neither be rewritten nor used.
        """
        used = decode(self._store.read(NAME))
        found = _found(used, lambda: decode(self._store.read(OLDER)))
        self.seq = max((each.seq for each in found.records), default=0)
        self._generation = found.generation
        try:
            self._put_in_use(self._write_new(found.records))
            self.begun = self._generation
        except OSError:
            if not used.whole:
                raise
            self._use_on(used)
        self.keep_room()
        return found

    def append(self, text: str, seq: int) -> None:
        """
        Append a record, unless it is there; it is safe after :meth:`commit`.

        :param text: of the record, JSON.
        :raises OSError: it cannot be written; nothing is left of it.
        """
        if seq <= self.seq:
            return
        line = encode_record(text, self._now_ns())
        if self._size + len(line) > self._anew_at:
            self.commit()
            self._shorten(len(line))
        try:
            self._store.append(NAME, line)
        except OSError:
            self._store.truncate(NAME, self._size)
            raise
        self._size += len(line)
        self.seq = seq
        self._dirty = True

    def commit(self) -> int:
        """
        Wait until all records are safe.

        :return: the number of the last one.
        :raises OSError: what is safe is not known; open the journal again.
        """
        if self._dirty:
            self._store.sync(NAME)
            self._dirty = False
        return self.seq

    def keep_room(self) -> DiskReserve:
        """Reserve room for what will be added and for the next file, as far as there is any."""
        problem = None
        for name in (NAME, NEW):
            try:
                if self._store.kept(name) < self._most_bytes:
                    self._store.keep(name, self._most_bytes)
            except OSError as error:
                problem = problem or error
        return DiskReserve(max(0, self._store.kept(NAME) - self._size), problem)

    def _shorten(self, more_bytes: int) -> None:
        """Rewrite the file; while that is not possible it stays in use, but not for ever."""
        try:
            data = self._write_new(decode(self._store.read(NAME)).records)
        except OSError:
            if self._size + more_bytes > self._most_bytes:
                raise
            self.put_off += 1
            self._anew_at = self._size + self._limit_bytes // _TRIES
            return
        self._put_in_use(data)
        self.keep_room()

    def _write_new(self, records: list[StoredRecord]) -> bytes:
        """Write the retained records to a file that is not in use yet."""
        kept = retained(records, self._limit_bytes // 2)
        beginning = encode_header(JournalHeader(self._generation + 1, len(kept)))
        data = b''.join([beginning, *(
            encode_record(compact(each.record), each.at_ns) for each in kept)])
        try:
            self._store.write(NEW, data)
        except OSError:
            self._store.remove(NEW)
            raise
        return data

    def _put_in_use(self, data: bytes) -> None:
        store = self._store
        if store.read(NAME):
            store.rename(NAME, OLDER)
        store.rename(NEW, NAME)
        store.sync_folder()
        self._generation += 1
        self._size = len(data)
        # Open alarms may take more than half of the limit: no rewrite with each record then.
        self._limit_to(2 * len(data))
        self._dirty = False

    def _use_on(self, used: JournalContents) -> None:
        if used.torn_bytes:
            # To cut them off would give back the room that is reserved behind them.
            self._store.blank(NAME, used.end)
        self._size = used.end + used.torn_bytes
        if not used.ended:
            self._store.append(NAME, b'\n')
            self._size += 1
        self._limit_to(self._size)

    def _limit_to(self, least_bytes: int) -> None:
        self._anew_at = max(self._limit_bytes, least_bytes)
        self._most_bytes = self._anew_at + self._limit_bytes // 2
