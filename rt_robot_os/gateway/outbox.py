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
The queue to the server on the disk: rows in SQLite, ordered by importance and age.

A row is stored before it is sent, and deleted when the server has it on its own disk, so it
survives a killed process and a power failure. Its key, the start of the gateway and a number, is
never reused, and the server stores each key once. The time of day is not trusted: age is counted
in seconds of running gateways.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from contextlib import contextmanager
from contextlib import suppress
import os
from pathlib import Path
import sqlite3
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import StartError
from rt_robot_os.messages.uplink.importance import Importance

#: Overhead of a row in addition to its text, in bytes.
ROW_BYTES: Final = 64
#: Rows that are evicted together.
CHUNK: Final = 256
#: Most refused records that are stored for diagnosis.
REFUSED_MOST: Final = 1000
#: These never expire: they are evicted only for lack of space.
LASTING: Final = (Importance.ALARM, Importance.EVENT)

_SCHEMA: Final = """
CREATE TABLE IF NOT EXISTS boot(id INTEGER PRIMARY KEY, uuid TEXT NOT NULL UNIQUE);
CREATE TABLE IF NOT EXISTS record(
  importance INTEGER NOT NULL, boot INTEGER NOT NULL, seq INTEGER NOT NULL,
  lived_s INTEGER NOT NULL, text TEXT NOT NULL, PRIMARY KEY(importance, boot, seq)) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS refused(
  boot INTEGER NOT NULL, seq INTEGER NOT NULL, why TEXT NOT NULL, text TEXT NOT NULL,
  PRIMARY KEY(boot, seq));
CREATE TABLE IF NOT EXISTS seen(
  topic TEXT PRIMARY KEY, run TEXT NOT NULL, seq INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS fact(name TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;
"""
_PRAGMAS: Final = ('page_size = 4096', 'auto_vacuum = INCREMENTAL', 'journal_mode = WAL',
                   'synchronous = FULL', 'journal_size_limit = 4194304', 'cache_size = -4000',
                   'temp_store = MEMORY')
_LOST: Final = 'lost_'
_ROWS: Final = 'rows_'
_BYTES: Final = 'bytes_'


class Mark(NamedTuple):
    """
    How far a topic has been recorded.

    :ivar run: id of the core's run; see :attr:`~.robot_link.RobotLink.run_id`.
    :ivar seq: number of the last sample in the topic.
    """

    topic: str
    run: str
    seq: int


class OutboxRow(NamedTuple):
    """
    A record that waits.

    :ivar boot: number of the start of the gateway that made it, in this file.
    :ivar text: JSON of the whole record, as sent.
    """

    importance: int
    boot: int
    seq: int
    lived_s: int
    text: str

    @property
    def nbytes(self) -> int:
        """Return the bytes that count for the limit."""
        return len(self.text.encode()) + ROW_BYTES


OutboxPosition = tuple[int, int]
START: Final[OutboxPosition] = (-1, -1)


class Outbox:
    """
    The queue in a file; for one thread.

    :param boot: UUID of this start.
    :param most_bytes: limit of all rows together.
    :param most_s: after this time a record expires, unless it is lasting.
    :ivar boot: number of this start in the file.
    :ivar rows: number of waiting rows, by importance.
    :ivar nbytes: their size, by importance.
    :ivar lost: rows that were evicted or have expired so far, by importance.
    :ivar lived_s: seconds that gateways with this file have run.
    :ivar damaged: new path of a file that could not be read; None if there was none.
    :raises StartError: the folder cannot be used.
    """

    def __init__(self, path: Path, boot: str, most_bytes: int, most_s: float) -> None:
        self.path = path
        self.rows = {each: 0 for each in Importance}
        self.nbytes = {each: 0 for each in Importance}
        self.lost: dict[Importance, int] = {each: 0 for each in Importance}
        self.damaged: Path | None = None
        self._most_bytes = most_bytes
        self._most_s = most_s
        try:
            self._db = self._open(boot)
        except sqlite3.DatabaseError as error:
            if isinstance(error, sqlite3.OperationalError) and not _is_damage(error):
                raise StartError(f'{path} cannot be used: {error}; set folder under /**/gateway '
                                 'to a writable one') from error
            self._put_aside()
            self._db = self._open(boot)

    def _open(self, boot: str) -> sqlite3.Connection:
        old = os.umask(0o077)
        try:
            db = sqlite3.connect(self.path, isolation_level=None, check_same_thread=False,
                                 timeout=5.0)
            try:
                for each in _PRAGMAS:
                    db.execute(f'PRAGMA {each}')
                db.executescript(_SCHEMA)
                self._load(db, boot)
            except sqlite3.Error:
                db.close()
                raise
        finally:
            os.umask(old)
        return db

    def _load(self, db: sqlite3.Connection, boot: str) -> None:
        db.execute('DELETE FROM boot WHERE id NOT IN (SELECT boot FROM record) '
                   'AND id NOT IN (SELECT boot FROM refused) '
                   'AND id < (SELECT max(id) FROM boot)')
        db.execute('INSERT OR IGNORE INTO boot(uuid) VALUES (?)', (boot,))
        self.boots: dict[int, str] = dict(db.execute('SELECT id, uuid FROM boot'))
        self.boot = next(number for number, uuid in self.boots.items() if uuid == boot)
        facts: dict[str, int] = dict(db.execute('SELECT name, value FROM fact'))
        for each in Importance:  # counted with each change, since counting all rows is slow
            self.rows[each] = facts.get(f'{_ROWS}{each.value}', 0)
            self.nbytes[each] = facts.get(f'{_BYTES}{each.value}', 0)
        self.lived_s = facts.get('lived_s', 0)
        self.lost = {each: facts.get(f'{_LOST}{each.value}', 0) for each in Importance}
        self.refused = facts.get('refused', 0)

    def _put_aside(self) -> None:
        """Move an unreadable file aside for diagnosis, replacing an earlier one."""
        self.damaged = self.path.with_name(self.path.name + '.damaged')
        for end in ('', '-wal', '-shm'):
            with suppress(OSError):
                os.replace(f'{self.path}{end}', f'{self.damaged}{end}')

    def close(self) -> None:
        """Close the file; may be called twice."""
        self._db.close()

    # ---- in ----------------------------------------------------------------------------------

    def marks(self) -> dict[str, Mark]:
        """Return how far each topic has been recorded."""
        return {topic: Mark(topic, run, seq)
                for topic, run, seq in self._db.execute('SELECT topic, run, seq FROM seen')}

    def add(self, rows: Sequence[OutboxRow], marks: Iterable[Mark] = ()) -> None:
        """
        Write rows, all or none; they are on the disk when this returns.

        :raises sqlite3.Error: none is written: the disk is full or broken.
        """
        with self._transaction('FULL'):
            self._db.executemany('INSERT OR IGNORE INTO record VALUES (?, ?, ?, ?, ?)', rows)
            self._db.executemany('INSERT OR REPLACE INTO seen VALUES (?, ?, ?)', marks)
            self._note({'lived_s': self.lived_s, **{
                f'{_LOST}{each.value}': n for each, n in self.lost.items() if n}})
            self._count(rows, 1)

    def over(self) -> bool:
        """Return whether the limit is exceeded."""
        return sum(self.nbytes.values()) > self._most_bytes

    def evict(self, protected: Mapping[Importance, OutboxPosition], least: int = 0) -> int:
        """
        Delete and count some of the oldest rows with the least importance.

        :param protected: by importance, the last rows in flight: up to these none is deleted.
        :param least: rows more important than this number are not deleted.
        :return: how many went.
        :raises sqlite3.Error: the disk is full, or broken.
        """
        for importance in sorted(Importance, reverse=True):
            if importance < least:
                break
            rows = self._after(importance, protected.get(importance, START), CHUNK)
            if rows:
                self._lose(importance, rows)
                return len(rows)
        return 0

    def expire(self, protected: Mapping[Importance, OutboxPosition]) -> int:
        """
        Delete and count expired rows.

        :return: how many went.
        :raises sqlite3.Error: the disk is full, or broken.
        """
        count = 0
        for importance in sorted(set(Importance) - set(LASTING), reverse=True):
            rows = [row for row in self._after(importance, protected.get(importance, START), CHUNK)
                    if self.lived_s - row.lived_s > self._most_s]
            if rows:
                self._lose(importance, rows)
                count += len(rows)
        return count

    def _lose(self, importance: Importance, rows: Sequence[OutboxRow]) -> None:
        lost = self.lost[importance] + len(rows)
        with self._transaction('NORMAL'):
            self._count(self._delete(rows), -1)
            self._note({f'{_LOST}{importance.value}': lost})
        self.lost[importance] = lost

    # ---- out ---------------------------------------------------------------------------------

    def after(self, importance: Importance, place: OutboxPosition, most: int, most_bytes: int
              ) -> list[OutboxRow]:
        """
        Read the oldest rows after a position, of one start; at least one if there is one.

        :param most_bytes: limit of their size together.
        """
        found: list[OutboxRow] = []
        size = 0
        for row in self._rows_after(importance, place, most):
            size += row.nbytes
            if found and (size > most_bytes or row.boot != found[0].boot):
                break
            found.append(row)
        return found

    def done(self, rows: Sequence[OutboxRow]) -> None:
        """
        Delete rows that the server has; if this is lost they are sent again, without harm.

        :raises sqlite3.Error: the disk is full, or broken.
        """
        with self._transaction('NORMAL'):
            self._count(self._delete(rows), -1)

    def quarantine(self, row: OutboxRow, why: str) -> None:
        """
        Move a row that the server always refuses to the quarantine, for diagnosis.

        :raises sqlite3.Error: the disk is full, or broken.
        """
        with self._transaction('FULL'):
            self._count(self._delete([row]), -1)
            self._db.execute('INSERT OR REPLACE INTO refused VALUES (?, ?, ?, ?)',
                             (row.boot, row.seq, why[:200], row.text))
            self._db.execute('DELETE FROM refused WHERE rowid <= (SELECT max(rowid) FROM refused) '
                             '- ?', (REFUSED_MOST,))
            self._note({'refused': self.refused + 1})
        self.refused += 1

    def shrink(self) -> None:
        """Return free space to the disk once the queue is empty."""
        if not any(self.rows.values()):
            with suppress(sqlite3.Error):
                self._db.execute('PRAGMA incremental_vacuum(2000)').fetchall()

    # ---- within ------------------------------------------------------------------------------

    @contextmanager
    def _transaction(self, synchronous: str) -> Iterator[None]:
        before = dict(self.rows), dict(self.nbytes)
        self._db.execute(f'PRAGMA synchronous = {synchronous}')
        self._db.execute('BEGIN IMMEDIATE')
        try:
            yield
            self._db.execute('COMMIT')
        except BaseException:
            self.rows, self.nbytes = before
            with suppress(sqlite3.Error):  # SQLite may have done it by itself
                self._db.execute('ROLLBACK')
            raise

    def _note(self, facts: Mapping[str, int]) -> None:
        self._db.executemany('INSERT OR REPLACE INTO fact VALUES (?, ?)', facts.items())

    def _delete(self, rows: Sequence[OutboxRow]) -> list[OutboxRow]:
        """Delete rows; return those that were there."""
        deleted = []
        for row in rows:
            cursor = self._db.execute(
                'DELETE FROM record WHERE importance = ? AND boot = ? AND seq = ?', row[:3])
            if cursor.rowcount:
                deleted.append(row)
        return deleted

    def _after(self, importance: Importance, place: OutboxPosition, most: int) -> list[OutboxRow]:
        return list(self._rows_after(importance, place, most))

    def _rows_after(self, importance: Importance, place: OutboxPosition, most: int
                    ) -> Iterator[OutboxRow]:
        for found in self._db.execute(
                'SELECT importance, boot, seq, lived_s, text FROM record WHERE importance = ? AND '
                '(boot, seq) > (?, ?) ORDER BY boot, seq LIMIT ?', (importance, *place, most)):
            yield OutboxRow(*found)

    def _count(self, rows: Sequence[OutboxRow], sign: int) -> None:
        """Count added and removed rows, in memory and in the file."""
        for row in rows:
            importance = Importance(row.importance)
            self.rows[importance] += sign
            self.nbytes[importance] += sign * row.nbytes
        for each in {Importance(row.importance) for row in rows}:
            self._note({f'{_ROWS}{each.value}': self.rows[each],
                        f'{_BYTES}{each.value}': self.nbytes[each]})


def _is_damage(error: sqlite3.Error) -> bool:
    """Return whether a file is not a database, or is damaged."""
    text = str(error)
    return 'malformed' in text or 'not a database' in text or 'corrupt' in text
