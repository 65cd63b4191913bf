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
Measure the database of the monitor; JSON on standard output.

``./scripts/bench measure_store [--database URL] [--seconds 30] [--year-days 365]``

- ``backlog``: 8 hours of one robot at 60 rows/s (1.7 million) come back as fast as they go; how
  long an alarm of another robot needs meanwhile.
- ``year``: a sign at 1 Hz for a year, rolled up and thinned; its charts.
- ``sustained``: 50 robots with 60 rows/s each, their lateness, the share of a core, and charts of
  a day at the same time.

Without ``--database`` it is SQLite in a temporary folder; ``--postgres`` starts its own PostgreSQL
with the usual syncs.
"""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import contextmanager
from contextlib import ExitStack
import json
import os
from pathlib import Path
import statistics
import sys
import tempfile
import threading
import time
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / 'test' / 'shared'))

from databases import postgres_server  # noqa: E402
from rt_robot_os.monitor.store.retention import RetentionPolicy  # noqa: E402
from rt_robot_os.monitor.store.store import Store  # noqa: E402
from rt_robot_os.monitor.store.writer import RecordWriter  # noqa: E402
from sqlalchemy import text  # noqa: E402

S = 1_000_000_000
ROBOTS, SIGNS = 50, 60
BATCH = 1000
OUTSTANDING = 16


def row(seq: int, t_ns: int, person: str, sign: int) -> dict[str, Any]:
    """Return a record as a gateway sends it."""
    return {'seq': seq, 'importance': 3, 'type': 'observation', 'utc_ns': t_ns, 'content': {
        'person': person, 'sign': f'sign_{sign}', 'value': 60 + (seq * 7 + sign) % 40,
        'quality': 'good', 'source': 'wsn/wrist'}}


def alarm(seq: int, t_ns: int) -> dict[str, Any]:
    """Return an event of an alarm."""
    return {'seq': seq, 'importance': 0, 'type': 'alarm_event', 'utc_ns': t_ns, 'content': {
        'seq': seq, 'alarm': str(seq // 4), 'event': 'raised', 'state': 'raised',
        'level': 'critical', 'subject': 'anna', 'kinds': ['fall'], 'text': 'anna lies', 'by': '',
        'why': ''}}


def percentiles(values: list[float], unit: float = 1000.0) -> dict[str, float]:
    """Return the middle, the 95th and 99th of a hundred, and the worst; in ms."""
    ordered = sorted(values)
    return {'count': len(ordered), **{
        name: round(ordered[min(len(ordered) - 1, int(len(ordered) * part))] * unit, 2)
        for name, part in (('p50', 0.5), ('p95', 0.95), ('p99', 0.99), ('most', 1.0))}}


def server_cpu_s() -> float:
    """Return the time that processes of PostgreSQL below us have computed."""
    ticks, ours = 0, {os.getpid()}
    found = {}
    for path in Path('/proc').glob('[0-9]*/stat'):
        try:
            fields = path.read_text().rpartition(') ')[2].split()
            found[int(path.parent.name)] = int(fields[1]), sum(map(int, fields[11:15]))
        except (OSError, ValueError):
            continue
    for _ in range(4):
        ours |= {pid for pid, (parent, _) in found.items() if parent in ours}
    for pid in ours - {os.getpid()}:
        ticks += found.get(pid, (0, 0))[1]
    return ticks / os.sysconf('SC_CLK_TCK')


@contextmanager
def computing(result: dict[str, Any]) -> Iterator[None]:
    """Note wall time and shares of a core."""
    wall, own, other = time.monotonic(), time.process_time(), server_cpu_s()
    yield
    wall = time.monotonic() - wall
    result['wall_s'] = round(wall, 2)
    result['cpu_share'] = round((time.process_time() - own) / wall, 3)
    result['database_cpu_share'] = round((server_cpu_s() - other) / wall, 3)


async def backlog(writer: RecordWriter, hours: float) -> dict[str, Any]:
    """Bring hours of one robot back; alarms of another come meanwhile."""
    end_ns = time.time_ns()
    seconds = round(hours * 3600)
    total = seconds * SIGNS
    free = asyncio.Semaphore(OUTSTANDING)
    alarms: list[float] = []
    done = asyncio.Event()

    async def put(first: int) -> None:
        records = [row(seq, end_ns - (seconds - seq // SIGNS) * S, 'person_0', seq % SIGNS)
                   for seq in range(first, min(first + BATCH, total))]
        await writer.put('robot_0', 'offline', records, 600.0)
        free.release()

    async def raise_alarms() -> None:
        for seq in range(1_000_000):
            begin = time.perf_counter()
            await writer.put('robot_1', 'alarms', [alarm(seq, time.time_ns())], 60.0)
            alarms.append(time.perf_counter() - begin)
            await asyncio.sleep(0.2)
            if done.is_set():
                return

    result: dict[str, Any] = {'rows': total}
    raising = asyncio.create_task(raise_alarms())
    with computing(result):
        async with asyncio.TaskGroup() as group:
            for first in range(0, total, BATCH):
                await free.acquire()
                group.create_task(put(first))
    done.set()
    await raising
    result['rows_per_s'] = round(total / result['wall_s'])
    result['alarm_ms'] = percentiles(alarms)
    return result


async def sustained(writer: RecordWriter, store: Store, seconds: float) -> dict[str, Any]:
    """Run 50 robots at 60 rows/s, and look at charts at the same time."""
    late: list[float] = []
    charts: list[float] = []
    ended = threading.Event()
    begin_ns = time.time_ns()

    async def robot(number: int) -> None:
        await asyncio.sleep(number / ROBOTS)
        begin, second = time.monotonic(), 0
        while second < seconds:
            now_ns = time.time_ns()
            start = time.perf_counter()
            await writer.put(f'robot_{number}', f'live {begin_ns}', [
                row(second * SIGNS + sign, now_ns, f'person_{number}', sign)
                for sign in range(SIGNS)], 60.0)
            late.append(time.perf_counter() - start)
            second += 1
            await asyncio.sleep(max(0.0, begin + second - time.monotonic()))

    def look() -> None:
        number = 0
        while not ended.wait(0.2):
            number += 1
            end_ns = time.time_ns()
            start = time.perf_counter()
            store.chart('person_0', f'sign_{number % SIGNS}', end_ns - 86400 * S, end_ns, 1000)
            charts.append(time.perf_counter() - start)

    looking = threading.Thread(target=look)
    result: dict[str, Any] = {'rows_per_s': ROBOTS * SIGNS}
    before = writer.commits
    with computing(result):
        looking.start()
        await asyncio.gather(*(robot(number) for number in range(ROBOTS)))
    ended.set()
    looking.join()
    result['commits_per_s'] = round((writer.commits - before) / result['wall_s'], 1)
    result['put_ms'] = percentiles(late)
    result['day_chart_ms'] = percentiles(charts)
    return result


def year(store: Store, days: int) -> dict[str, Any]:
    """Fill a sign with a year at 1 Hz, day by day, through the store's own roll-ups."""
    end_ns = time.time_ns() // (86400 * S) * 86400 * S
    store.add('robot_0', 'year', [row(0, end_ns, 'long', 0)])
    postgres = store.engine.dialect.name == 'postgresql'
    numbers = ('generate_series(0, 86399) AS numbers(i)' if postgres else
               '(WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < 86399) '
               'SELECT i FROM n)')
    first = ('(SELECT * FROM observations WHERE series_id = (SELECT s.id FROM series s JOIN '
             'people p ON p.id = s.person_id WHERE p.person = :person) LIMIT 1) AS o')
    fill = text('INSERT INTO observations (boot_id, seq, t_ns, arrived_ns, series_id, value, '
                f'quality, source) SELECT o.boot_id, i, :day + i * {S}, :day, o.series_id, '
                f'60 + i * 7 % 40 + i / 8640, 0, o.source FROM {numbers}, {first}')
    result: dict[str, Any] = {'rows': days * 86400}
    start = time.monotonic()
    for day in range(days, 0, -1):
        with store.writing() as connection:
            connection.execute(fill, {'day': end_ns - day * 86400 * S, 'person': 'long'})
        while store.roll_up():
            pass
    result['fill_s'] = round(time.monotonic() - start, 1)
    start = time.monotonic()
    store.thin(RetentionPolicy())
    result['thin_s'] = round(time.monotonic() - start, 1)
    for name, span_s in (('year', 365 * 86400), ('month', 30 * 86400), ('day', 86400),
                         ('hour', 3600)):
        times = []
        for number in range(60):
            begin_ns = end_ns - span_s * S - number * 60 * S
            start = time.perf_counter()
            made = store.chart('long', 'sign_0', begin_ns, begin_ns + span_s * S, 1000)
            times.append(time.perf_counter() - start)
        result[f'{name}_chart_ms'] = {**percentiles(times), 'level': made.level,
                                      'entries': len(made.t_ns), 'values': sum(made.count)}
    return result


def measure(url: str, arguments: argparse.Namespace) -> dict[str, Any]:
    """Run all parts on one database."""
    store = Store.open(url)
    result: dict[str, Any] = {'database': store.engine.dialect.name}
    parts: dict[str, Callable[[], Any]] = {}
    writer = RecordWriter(store)
    parts['backlog'] = lambda: asyncio.run(backlog(writer, arguments.hours))
    parts['sustained'] = lambda: asyncio.run(sustained(writer, store, arguments.seconds))
    if arguments.year_days:
        parts['year'] = lambda: year(store, arguments.year_days)
    for name, part in parts.items():
        result[name] = part()
        print(name, result[name], file=sys.stderr)
    result['bytes_per_row'] = size_of(store) / max(1, rows_of(store))
    writer.close()
    store.close()
    return result


def rows_of(store: Store) -> int:
    """Return how many observations there are."""
    with store.reading() as connection:
        return int(connection.execute(text('SELECT count(*) FROM observations')).scalar() or 0)


def size_of(store: Store) -> float:
    """Return what the database takes on the disk."""
    with store.reading() as connection:
        if connection.dialect.name == 'postgresql':
            return float(connection.execute(text(
                'SELECT pg_database_size(current_database())')).scalar() or 0)
        return float(os.path.getsize(store.engine.url.database or ''))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--database', metavar='URL')
    parser.add_argument('--postgres', action='store_true')
    parser.add_argument('--folder', help='where SQLite is made (default: a temporary folder)')
    parser.add_argument('--seconds', type=float, default=30.0)
    parser.add_argument('--hours', type=float, default=8.0)
    parser.add_argument('--year-days', type=int, default=0)
    parser.add_argument('--runs', type=int, default=1, help='the median is of the backlog')
    arguments = parser.parse_args()
    runs = []
    for _ in range(arguments.runs):
        with ExitStack() as stack:
            if arguments.postgres:
                url = stack.enter_context(postgres_server('fsync=on', 'full_page_writes=on',
                                                          'autovacuum=on'))
            else:
                folder = stack.enter_context(tempfile.TemporaryDirectory(dir=arguments.folder))
                url = arguments.database or f'{folder}/monitor.db'
            runs.append(measure(url, arguments))
    print(json.dumps({'runs': runs, 'backlog_s': statistics.median(
        run['backlog']['wall_s'] for run in runs)}, indent=1))


if __name__ == '__main__':
    main()
