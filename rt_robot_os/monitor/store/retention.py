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
Retention: raw rows are kept for days, minutes for a year, hours and days for ever.

Alarms, their events and notes, and actions of the agent are never deleted. Rows are rolled up
before they are deleted, also those that arrive after their retention time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.monitor.store.charts import RAW
from rt_robot_os.monitor.store.engine import reading
from rt_robot_os.monitor.store.engine import writing
from rt_robot_os.monitor.store.rollups import DONE
from rt_robot_os.monitor.store.rollups import progress
from rt_robot_os.monitor.store.rollups import roll_up
from rt_robot_os.monitor.store.rollups import set_progress
from rt_robot_os.monitor.store.tables import MINUTES
from rt_robot_os.monitor.store.tables import NODES
from rt_robot_os.monitor.store.tables import OBSERVATIONS
from rt_robot_os.monitor.store.tables import PLACES
from rt_robot_os.monitor.store.tables import SERIES
from rt_robot_os.monitor.store.tables import UNKNOWN
from rt_robot_os.monitor.store.thinned import horizon
from rt_robot_os.monitor.store.thinned import horizon_name
from sqlalchemy import ColumnElement
from sqlalchemy import Connection
from sqlalchemy import delete
from sqlalchemy import Engine
from sqlalchemy import func
from sqlalchemy import select
from sqlalchemy import Table

#: Most rows that one transaction deletes: it limits how long a writer waits.
STEP_ROWS: Final = 2000
_DAY_NS: Final = 86400 * NS_PER_S
_MINUTE_NS: Final = 60 * NS_PER_S


@dataclass(frozen=True)
class RetentionPolicy:
    """
    How many days each class is kept; 0 means for ever.

    :ivar raw_days: observations and places of people, unmodified.
    :ivar minutes_days: their roll-ups by minute; those by hour and day are kept for ever.
    :ivar network_days: batteries and packet losses of nodes.
    :ivar unknown_days: records stored aside.
    """

    raw_days: float = 30.0
    minutes_days: float = 400.0
    network_days: float = 90.0
    unknown_days: float = 90.0


def thin(engine: Engine, kept: RetentionPolicy, now_ns: int) -> dict[str, int]:
    """
    Delete expired rows, in small transactions.

    :param now_ns: UTC.
    :return: rows deleted, by table.
    :raises StoreError: the database is unavailable or full; the next call continues.
    """
    raw_ns, minutes_ns = _before(now_ns, kept.raw_days), _before(now_ns, kept.minutes_days)
    left = 1
    while left:
        with writing(engine) as connection:
            left = roll_up(connection)
    with writing(engine) as connection:
        # First, so that no chart uses a level that is partly deleted.
        _move(connection, RAW, raw_ns)
        _move(connection, MINUTES.name, minutes_ns)
        done = progress(connection, DONE)
        series = list(connection.execute(select(SERIES.c.id)).scalars())
    gone = dict.fromkeys(('observations', 'minutes', 'places', 'nodes', 'unknown'), 0)
    for number in series:
        gone['observations'] += drop(engine, OBSERVATIONS, OBSERVATIONS.c.series_id == number,
                                     OBSERVATIONS.c.t_ns < raw_ns, OBSERVATIONS.c.id <= done)
        gone['minutes'] += _drop_minutes(engine, number, minutes_ns)
    gone['places'] = drop(engine, PLACES, PLACES.c.t_ns < raw_ns)
    gone['nodes'] = drop(engine, NODES, NODES.c.t_ns < _before(now_ns, kept.network_days))
    gone['unknown'] = drop(engine, UNKNOWN,
                           UNKNOWN.c.arrived_ns < _before(now_ns, kept.unknown_days))
    return gone


def _before(now_ns: int, days: float) -> int:
    """Return the time before which rows expire: a full hour, so that no roll-up is split."""
    hour_ns = 60 * _MINUTE_NS
    return max(0, int(now_ns - days * _DAY_NS)) // hour_ns * hour_ns if days > 0 else 0


def _move(connection: Connection, level: str, to_ns: int) -> None:
    if to_ns > horizon(connection, level):
        set_progress(connection, horizon_name(level), to_ns)


def drop(engine: Engine, table: Table, *which: ColumnElement[bool]) -> int:
    """
    Delete rows step by step; the search for them does not block writers.

    :return: the number of deleted rows.
    """
    gone = 0
    while True:
        with reading(engine) as connection:
            ids = list(connection.execute(select(table.c.id).where(*which).limit(
                STEP_ROWS)).scalars())
        if ids:
            with writing(engine) as connection:
                connection.execute(delete(table).where(table.c.id.in_(ids)))
        gone += len(ids)
        if len(ids) < STEP_ROWS:
            return gone


def _drop_minutes(engine: Engine, series: int, before_ns: int) -> int:
    gone = 0
    own = MINUTES.c.series_id == series
    while True:
        with reading(engine) as connection:
            oldest_ns = connection.execute(select(func.min(MINUTES.c.t_ns)).where(own)).scalar()
        if oldest_ns is None or oldest_ns >= before_ns:
            return gone
        with writing(engine) as connection:
            gone += connection.execute(delete(MINUTES).where(own, MINUTES.c.t_ns < min(
                before_ns, oldest_ns + STEP_ROWS * _MINUTE_NS))).rowcount
