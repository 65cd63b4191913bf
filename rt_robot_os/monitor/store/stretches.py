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


"""Time ranges in which a sign had no good value, for charts."""

from __future__ import annotations

from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.monitor.store.records import QUALITIES
from rt_robot_os.monitor.store.tables import PEOPLE
from rt_robot_os.monitor.store.tables import SERIES
from sqlalchemy import Connection
from sqlalchemy import select
from sqlalchemy import text

#: Longest range that is queried: in a longer one each is narrower than a pixel, and rows expire.
LONGEST_NS: Final = 2 * 86400 * NS_PER_S
MOST: Final = 1000
_GOOD: Final = QUALITIES.index('good')

# The index covers the query; the row before the start gives the quality at the start.
_CHANGES: Final = text("""
    SELECT t_ns, quality FROM (
        SELECT t_ns, quality, lag(quality) OVER (ORDER BY t_ns) AS before FROM observations
        WHERE series_id = :series AND t_ns < :end AND t_ns >= coalesce((
            SELECT max(t_ns) FROM observations WHERE series_id = :series AND t_ns <= :start),
            :start)) found
    WHERE before IS NULL OR before <> quality ORDER BY t_ns LIMIT :most""")


def stretches(connection: Connection, person: str, sign: str, start_ns: int, end_ns: int
              ) -> list[dict[str, Any]]:
    """
    Return the ranges in which a sign of a person was not good.

    Each has ``from_ns``, ``to_ns`` and ``quality``.

    A range that begins before the requested time is cut to it; ``to_ns`` is None for one that
    lasts to its end. For more than two days the result is empty.

    :param end_ns: exclusive.
    """
    if end_ns - start_ns > LONGEST_NS:
        return []
    series = connection.execute(select(SERIES.c.id).join(PEOPLE).where(
        PEOPLE.c.person == person, SERIES.c.code == sign)).scalar()
    found: list[dict[str, Any]] = []
    if series is None:
        return found
    for t_ns, quality in connection.execute(_CHANGES, {
            'series': series, 'start': start_ns, 'end': end_ns, 'most': 2 * MOST}):
        at_ns = max(t_ns, start_ns)
        if found and found[-1]['to_ns'] is None:
            found[-1]['to_ns'] = at_ns
        if quality != _GOOD and len(found) < MOST:
            found.append({'from_ns': at_ns, 'to_ns': None, 'quality': QUALITIES[quality]})
    return [each for each in found if each['to_ns'] is None or each['to_ns'] > each['from_ns']]
