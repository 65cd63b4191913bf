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
The file of a journal: opened, appended to, synced, and now and then written anew.

There are two generations. A new file is written whole, synced, and only then takes the name of the
one in use, which becomes the older one. So at each moment one of them is whole, whatever is cut.
It is written anew each time it is opened, too: what a crash has left behind it stays behind.

DiskReserve is kept on the disk for what will be added and for the next file, so that a disk that becomes
full does not stop it soon; :meth:`JournalFile.keep_room` says how much is left.
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
# So often it is tried to write the file anew within one limit, while the disk does not let it.
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
        """Return what a desk needs to go on: of each open alarm the newest, and the last one."""
        last = max((each.seq for each in self.records), default=0)
        return sorted(each for each in newest(self.records).values()
                      if each.lives or each.seq == last)


def disk_bytes(limit_bytes: int) -> int:
    """Return what a journal takes of its disk with all that it keeps free, about."""
    return 3 * (limit_bytes + limit_bytes // 2)


class DiskReserve(NamedTuple):
    """
    What is kept on the disk for records.

    :ivar kept_bytes: behind what is written.
    :ivar problem: why there is less than there should be; None when there is all of it.
    """

    kept_bytes: int = 0
    problem: OSError | None = None


def read_journal(store: JournalStore) -> JournalHistory:
    """
    Read a journal, also while another process writes it.

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
    The journal of one robot; nobody else may write it.

    :param store: where its files are.
    :param limit_bytes: when it has become that long it is written anew.
    :param now_ns: the time of day, in ns since 1970.
    :ivar seq: of the last record that is kept.
    :ivar begun: the number of the file that was begun with :meth:`open`, which no file had before;
        0 when none could be begun.
    :ivar put_off: how often no new file could be written, and the one in use was used on.
    """

    def __init__(self, store: JournalStore, limit_bytes: int, now_ns: Callable[[], int]) -> None:
        self.seq = self.begun = self.put_off = 0
        self._store = store
        self._limit_bytes = limit_bytes
        self._now_ns = now_ns
        self._generation = 0
        self._size = 0
        # From when on it is tried to write it anew, and how long it may become meanwhile.
        self._anew_at = limit_bytes
        self._most_bytes = 0
        self._dirty = False

    def open(self) -> JournalHistory:  # noqa: A003
        """
        Read what is there, and begin a new file with what is worth keeping.

        On a full disk, on which no new file can be written, the one that is there is used on.

        :raises OSError: it can neither be written anew nor used on.
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
        Add a record, unless it is there; it is safe with :meth:`commit`.

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
        :raises OSError: nobody knows what is safe; open it anew.
        """
        if self._dirty:
            self._store.sync(NAME)
            self._dirty = False
        return self.seq

    def keep_room(self) -> DiskReserve:
        """Keep room for what will be added and for the next file, as far as there is any."""
        problem = None
        for name in (NAME, NEW):
            try:
                if self._store.kept(name) < self._most_bytes:
                    self._store.keep(name, self._most_bytes)
            except OSError as error:
                problem = problem or error
        return DiskReserve(max(0, self._store.kept(NAME) - self._size), problem)

    def _shorten(self, more_bytes: int) -> None:
        """Write it anew; while that cannot be it is used on, but not for ever."""
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
        """Write what is worth keeping to a file that is not in use yet."""
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
        # What lives may be more than half of the limit: not anew with each record then.
        self._limit_to(2 * len(data))
        self._dirty = False

    def _use_on(self, used: JournalContents) -> None:
        if used.torn_bytes:
            # To cut them off would give back the room that is kept behind them.
            self._store.blank(NAME, used.end)
        self._size = used.end + used.torn_bytes
        if not used.ended:
            self._store.append(NAME, b'\n')
            self._size += 1
        self._limit_to(self._size)

    def _limit_to(self, least_bytes: int) -> None:
        self._anew_at = max(self._limit_bytes, least_bytes)
        self._most_bytes = self._anew_at + self._limit_bytes // 2
