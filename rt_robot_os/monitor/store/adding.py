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

"""Insert records into the database: each once, several batches in one transaction."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import json
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.monitor.store.alarm_states import follow
from rt_robot_os.monitor.store.engine import POSTGRES
from rt_robot_os.monitor.store.metadata import METADATA
from rt_robot_os.monitor.store.names import NameTable
from rt_robot_os.monitor.store.names import seen
from rt_robot_os.monitor.store.received import ReceivedNumbers
from rt_robot_os.monitor.store.records import Aside
from rt_robot_os.monitor.store.records import read
from rt_robot_os.monitor.store.records import Sent
from rt_robot_os.monitor.store.robot_clock import RobotClock
from rt_robot_os.monitor.store.tables import MEDIA
from rt_robot_os.monitor.store.tables import UNKNOWN
from sqlalchemy import Connection
from sqlalchemy import func
from sqlalchemy import insert
from sqlalchemy import select
from sqlalchemy import Table
from sqlalchemy import text

# Fewer rows than this are inserted faster one by one.
_AS_ARRAYS: Final = 20
#: Most invalid records stored aside for one start of a robot; further ones are refused and stay on
#: the robot.
ASIDE_MOST: Final = 10_000
#: Type of the event that states by how much the times of records were corrected.
CLOCK_ERROR: Final = 'clock_error'


class ReceivedBatch(NamedTuple):
    """
    Records of one start of a robot.

    :ivar clock: the robot's clock when they arrived.
    """

    robot: str
    boot: str
    records: Sequence[object]
    clock: RobotClock = RobotClock()


class Added(NamedTuple):
    """
    The result of adding a batch.

    :ivar fresh: new records, including those stored aside.
    :ivar known: records that were received before.
    :ivar aside: new records that are invalid and were stored aside.
    :ivar refused: invalid records that were not stored because the limit is reached. The robot
        must keep them.
    :ivar misdated: new records whose time was corrected.
    """

    fresh: int = 0
    known: int = 0
    aside: int = 0
    refused: int = 0
    misdated: int = 0


class Adding:
    """One transaction that adds records."""

    def __init__(self, connection: Connection, names: NameTable, now_ns: int) -> None:
        self._connection = connection
        self._names = names
        self._now_ns = now_ns
        self._received = ReceivedNumbers(connection)
        self._rows: dict[str, list[dict[str, Any]]] = {}
        self._seen: set[tuple[int, int]] = set()

    def add(self, batches: Sequence[ReceivedBatch]) -> list[Added]:
        """Accept batches; :meth:`save` writes them."""
        self._names.learn(self._connection)
        who: list[tuple[int, int]] = []
        found: list[list[Sent | Aside]] = []
        numbers: dict[int, set[int]] = {}
        for batch in batches:
            robot = self._names.robot(self._connection, batch.robot, self._now_ns)
            boot = self._names.boot(self._connection, robot, batch.boot, self._now_ns)
            records = [read(record, self._now_ns, batch.clock) for record in batch.records]
            who.append((robot, boot))
            found.append(records)
            numbers.setdefault(boot, set()).update(
                each.seq for each in records if each.seq is not None)
        # One query for all robots: the round trip takes longer than the query itself.
        self._received.load(numbers)
        self._seen.update(who)
        return [self._add(robot, boot, records)
                for (robot, boot), records in zip(who, found, strict=True)]

    def _add(self, robot: int, boot: int, records: Sequence[Sent | Aside]) -> Added:
        fresh: list[Sent] = []
        odd: list[Aside] = []
        known = refused = 0
        room = self._room_aside(boot) if any(isinstance(each, Aside) for each in records) else 0
        for each in records:
            if each.seq is not None and not self._received.is_new(boot, each.seq):
                known += 1
                continue
            if isinstance(each, Sent):
                fresh.append(each)
            elif len(odd) < room:
                odd.append(each)
            else:
                refused += 1
                continue
            if each.seq is not None:
                self._received.take(boot, each.seq)
        for one in fresh:
            self._take(robot, boot, one)
        self._set_aside(boot, odd)
        misdated = [each for each in fresh if each.clock_error_ns]
        if misdated:
            self._mark(robot, boot, misdated)
        return Added(len(fresh) + len(odd), known, len(odd), refused, len(misdated))

    def _mark(self, robot: int, boot: int, misdated: Sequence[Sent]) -> None:
        """Store by how much times were corrected: one event of the robot for each batch."""
        errors_s = [each.clock_error_ns / NS_PER_S for each in misdated]
        numbers = [each.seq for each in misdated]
        content = {'records': len(misdated), 'first_seq': min(numbers), 'last_seq': max(numbers),
                   'clock_error_s': [min(errors_s), max(errors_s)]}
        self._rows.setdefault('events', []).append({
            't_ns': self._now_ns, 'type': CLOCK_ERROR, 'content': json.dumps(content),
            'boot_id': boot, 'seq': numbers[0], 'arrived_ns': self._now_ns, 'robot_id': robot})

    def save(self) -> None:
        """Write all accepted batches; the caller commits the transaction."""
        events = self._rows.pop('alarm_events', None)
        media = self._rows.pop('media', None)
        for name, rows in self._rows.items():
            write(self._connection, METADATA.tables[name], rows)
        if events:
            follow(self._connection, events)
        if media:
            self._add_media(media)
        self._received.save()
        seen(self._connection, self._seen, self._now_ns)

    def _take(self, robot: int, boot: int, one: Sent) -> None:
        row = one.row
        row['boot_id'], row['seq'], row['arrived_ns'] = boot, one.seq, self._now_ns
        if one.person:
            person = self._names.person(self._connection, robot, one.person, self._now_ns)
            if one.code:
                row['series_id'] = self._names.series(self._connection, person, one.code)
            else:
                row['person_id'] = person
        elif one.table in _OF_A_ROBOT:
            row['robot_id'] = robot
        self._rows.setdefault(one.table, []).append(row)

    def _room_aside(self, boot: int) -> int:
        there = self._connection.execute(select(func.count()).select_from(
            UNKNOWN).where(UNKNOWN.c.boot_id == boot)).scalar() or 0
        return max(0, ASIDE_MOST - there)

    def _set_aside(self, boot: int, odd: Sequence[Aside]) -> None:
        if odd:
            self._connection.execute(insert(UNKNOWN), [
                {'boot_id': boot, 'seq': each.seq, 'arrived_ns': self._now_ns, 'type': each.type,
                 'why': each.why, 'content': each.content} for each in odd])

    def _add_media(self, rows: Sequence[Mapping[str, Any]]) -> None:
        # The same file announced under two numbers is stored once.
        for row in rows:
            found = self._connection.execute(select(MEDIA.c.id).where(
                MEDIA.c.robot_id == row['robot_id'], MEDIA.c.media == row['media'])).first()
            if found is None:
                self._connection.execute(insert(MEDIA), row)


def write(connection: Connection, table: Table, rows: Sequence[dict[str, Any]]) -> None:
    """Insert rows with the same columns."""
    if connection.dialect.name != POSTGRES or len(rows) < _AS_ARRAYS:
        connection.execute(insert(table), rows)
        return
    # One statement with an array for each column costs the server a third of single inserts.
    names = list(rows[0])
    arrays = ', '.join(
        f'CAST(:{name} AS {table.c[name].type.compile(connection.dialect)}[])' for name in names)
    connection.execute(
        text(f'INSERT INTO {table.name} ({", ".join(names)}) SELECT * FROM unnest({arrays})'),
        {name: [row[name] for row in rows] for name in names})


def _with_robot(table: Table) -> bool:
    return 'robot_id' in table.c


_OF_A_ROBOT: Final = frozenset(
    name for name, table in METADATA.tables.items() if _with_robot(table)) | {'alarm_events'}
