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
Roll-ups: lowest, highest, sum and number of the values of each minute, hour and day.

Rows are rolled up in order of arrival, independent of their time, and ``progress`` stores how far.
So rows that arrive hours late count like all others, and duplicates never become rows. A roll-up
is only added to, never recomputed: it outlives its raw rows.
"""

from __future__ import annotations

from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.monitor.store.records import MEASURED
from rt_robot_os.monitor.store.tables import DAYS
from rt_robot_os.monitor.store.tables import HOURS
from rt_robot_os.monitor.store.tables import MINUTES
from rt_robot_os.monitor.store.tables import OBSERVATIONS
from rt_robot_os.monitor.store.tables import PROGRESS
from sqlalchemy import Connection
from sqlalchemy import func
from sqlalchemy import insert
from sqlalchemy import select
from sqlalchemy import Table
from sqlalchemy import text
from sqlalchemy import update

#: The tables, the finest first, and the span of each row in ns.
LEVELS: Final[tuple[tuple[Table, int], ...]] = (
    (MINUTES, 60 * NS_PER_S), (HOURS, 3600 * NS_PER_S), (DAYS, 86400 * NS_PER_S))
#: Most rows that one step rolls up.
STEP_ROWS: Final = 20_000
DONE: Final = 'rolled_up'
#: SQL condition for rows that count: measured at the time of the row.
COUNTS: Final = (f'value IS NOT NULL AND quality IN '
                 f'({", ".join(str(each) for each in sorted(MEASURED))})')

_ROLL_UP: Final = {table.name: text(f"""
    INSERT INTO {table.name} (series_id, t_ns, low, high, total, count)
    SELECT series_id, t_ns / {span_ns} * {span_ns}, min(value), max(value), sum(value), count(*)
    FROM observations WHERE id > :first AND id <= :last AND {COUNTS}
    GROUP BY series_id, t_ns / {span_ns}
    ON CONFLICT (series_id, t_ns) DO UPDATE SET
        low = CASE WHEN excluded.low < {table.name}.low
              THEN excluded.low ELSE {table.name}.low END,
        high = CASE WHEN excluded.high > {table.name}.high
              THEN excluded.high ELSE {table.name}.high END,
        total = {table.name}.total + excluded.total,
        count = {table.name}.count + excluded.count
    """) for table, span_ns in LEVELS}


def progress(connection: Connection, name: str) -> int:
    """Return a counter of the store itself; 0 until it was set."""
    return connection.execute(select(PROGRESS.c.value).where(
        PROGRESS.c.name == name)).scalar() or 0


def set_progress(connection: Connection, name: str, value: int) -> None:
    """Store a counter."""
    changed = connection.execute(update(PROGRESS).where(PROGRESS.c.name == name),
                                 {'value': value})
    if not changed.rowcount:
        connection.execute(insert(PROGRESS), {'name': name, 'value': value})


def waiting(connection: Connection) -> int:
    """Return the most rows that are not rolled up yet; ids may have gaps."""
    last = connection.execute(select(func.max(OBSERVATIONS.c.id))).scalar() or 0
    return int(max(0, last - progress(connection, DONE)))


def roll_up(connection: Connection) -> int:
    """
    Roll up newer rows, at most :data:`STEP_ROWS`, within a transaction that writes.

    :return: the most rows that are left.
    """
    first = progress(connection, DONE)
    newest = connection.execute(select(func.max(OBSERVATIONS.c.id))).scalar() or 0
    last = min(newest, first + STEP_ROWS)
    if last <= first:
        return 0
    for table, _ in LEVELS:
        connection.execute(_ROLL_UP[table.name], {'first': first, 'last': last})
    set_progress(connection, DONE, last)
    return int(newest - last)
