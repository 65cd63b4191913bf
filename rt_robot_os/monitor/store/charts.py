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
Charts: lowest, mean and highest value per pixel, from the coarsest sufficient roll-up.

A year at 1 Hz is 31.5 million rows, and a screen has a thousand columns: the roll-ups are read,
and the rows that are not rolled up yet. The chart is exact: each entry consists of whole entries
of the roll-up.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from dataclasses import dataclass
from dataclasses import field
from typing import Any
from typing import Final

from rt_robot_os.monitor.store.rollups import COUNTS
from rt_robot_os.monitor.store.rollups import DONE
from rt_robot_os.monitor.store.rollups import LEVELS
from rt_robot_os.monitor.store.rollups import progress
from rt_robot_os.monitor.store.tables import PEOPLE
from rt_robot_os.monitor.store.tables import SERIES
from rt_robot_os.monitor.store.thinned import horizon
from sqlalchemy import Connection
from sqlalchemy import select
from sqlalchemy import Table
from sqlalchemy import text

RAW: Final = 'raw'
PIXELS_MOST: Final = 10_000


@dataclass
class SignChart:
    """
    The values of a sign over time: one entry for each span that has values.

    :ivar unit: as shown to people.
    :ivar level: the data it was computed from: ``raw``, ``minutes``, ``hours``, ``days``.
    :ivar width_ns: the span of an entry.
    :ivar t_ns: start times of the entries, UTC.
    :ivar count: number of values in each entry.
    :ivar limits: the limits of the sign that the robot sent last.
    :ivar alarms: alarms about the person that were open in this time.
    """

    person: str
    sign: str
    unit: str
    start_ns: int
    end_ns: int
    level: str
    width_ns: int
    t_ns: list[int] = field(default_factory=list)
    low: list[float] = field(default_factory=list)
    mean: list[float] = field(default_factory=list)
    high: list[float] = field(default_factory=list)
    count: list[int] = field(default_factory=list)
    limits: list[Any] = field(default_factory=list)
    alarms: list[dict[str, Any]] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """Return its JSON form."""
        return asdict(self)


# "+ 0" prevents the use of an index on time: the newest rows are found by their ids.
_NEWEST: Final = f"""
    SELECT (t_ns - :origin) / :width AS entry, min(value), max(value), sum(value), count(*)
    FROM observations WHERE id > :done AND series_id + 0 = :series
    AND t_ns + 0 >= :start AND t_ns + 0 < :end AND {COUNTS} GROUP BY entry"""
_RAW: Final = text(f"""
    SELECT (t_ns - :origin) / :width AS entry, min(value), max(value), sum(value), count(*)
    FROM observations WHERE series_id = :series
    AND t_ns >= :start AND t_ns < :end AND {COUNTS} GROUP BY entry ORDER BY entry""")
_ROLLED: Final = {table.name: text(f"""
    SELECT entry, min(low), max(high), sum(total), sum(count) FROM (
        SELECT (t_ns - :origin) / :width AS entry, low, high, total, count
        FROM {table.name} WHERE series_id = :series AND t_ns >= :start AND t_ns < :end
        UNION ALL {_NEWEST}) found
    GROUP BY entry ORDER BY entry""") for table, _ in LEVELS}


def chart(connection: Connection, person: str, sign: str, unit: str, start_ns: int, end_ns: int,
          pixels: int) -> SignChart:
    """
    Make a chart; it is empty for an unknown person or sign.

    :param end_ns: exclusive; when it lies within an entry of the level, that entry is included
        whole.
    :param pixels: the most entries.
    """
    end_ns = max(end_ns, start_ns + 1)
    level, span_ns = _level(connection, start_ns, (end_ns - start_ns) / _bounded(pixels))
    # Whole entries of the level; one fewer when the first begins before the start.
    begin_ns = start_ns if level is None else start_ns // span_ns * span_ns
    width_ns = -(-(end_ns - begin_ns) // (span_ns * _bounded(pixels))) * span_ns
    made = SignChart(person, sign, unit, start_ns, end_ns, RAW if level is None else level.name,
                     width_ns)
    series = connection.execute(select(SERIES.c.id).join(PEOPLE).where(
        PEOPLE.c.person == person, SERIES.c.code == sign)).scalar()
    if series is None:
        return made
    bounds = {'series': series, 'origin': begin_ns, 'width': width_ns, 'start': begin_ns,
              'end': end_ns if level is None else -(-end_ns // span_ns) * span_ns}
    if level is None:
        _fill(made, begin_ns, connection.execute(_RAW, bounds))
    else:
        _fill(made, begin_ns, connection.execute(
            _ROLLED[level.name], {**bounds, 'done': progress(connection, DONE)}))
    return made


def _fill(made: SignChart, begin_ns: int, rows: Iterable[Any]) -> None:
    for entry, low, high, total, count in rows:
        made.t_ns.append(begin_ns + int(entry) * made.width_ns)
        made.low.append(low)
        # The mean of identical values is that value, however their sum is rounded.
        made.mean.append(min(max(total / int(count), low), high))
        made.high.append(high)
        made.count.append(int(count))


def _bounded(pixels: int) -> int:
    return max(1, min(pixels, PIXELS_MOST))


def _level(connection: Connection, start_ns: int, pixel_ns: float) -> tuple[Table | None, int]:
    """Return the coarsest level that is fine enough and available; None for the raw rows."""
    found: tuple[Table | None, int] | None = None
    if start_ns >= horizon(connection, RAW):
        found = None, 1
    for table, span_ns in LEVELS:
        if (found is None or span_ns <= pixel_ns) and start_ns >= horizon(connection, table.name):
            found = table, span_ns
    return found or LEVELS[-1]
