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
Kill who writes the records, in the middle of it, again and again; JSON on standard output.

``PYTHONPATH=. python3 scripts/kill_monitor.py --kills 100 [--postgres] [--database URL]``

A process writes records of several robots through the store's writer and prints what was
acknowledged; it is killed (SIGKILL) at a random moment, and the next one begins with the records
that were not acknowledged, as a robot does. At the end: every acknowledged record has to be there
once (``lost``, ``double``), the database whole (``integrity``), roll-ups equal to the rows
(``rollups_wrong``).
"""

from __future__ import annotations

import argparse
import asyncio
from contextlib import ExitStack
import json
import os
from pathlib import Path
import random
import signal
import sys
import tempfile
import threading
import time
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test' / 'shared')]

from rt_robot_os.monitor.store.store import Store  # noqa: E402
from rt_robot_os.monitor.store.upkeep import check  # noqa: E402
from rt_robot_os.monitor.store.writer import RecordWriter  # noqa: E402
from sqlalchemy import text  # noqa: E402

ROBOTS = 5
BATCH = 60
S = 1_000_000_000


def records(robot: int, first: int, now_ns: int) -> list[dict[str, Any]]:
    """Return a batch; the fifth of it are events of alarms."""
    made = []
    for seq in range(first, first + BATCH):
        if seq % 20 == 0:
            made.append({'seq': seq, 'importance': 0, 'type': 'alarm_event', 'utc_ns': now_ns,
                         'content': {'seq': seq, 'alarm': f'{seq // 100}', 'event': 'raised',
                                     'state': 'raised', 'level': 'urgent', 'subject': 'anna',
                                     'kinds': ['x'], 'text': '', 'by': '', 'why': ''}})
        else:
            made.append({'seq': seq, 'importance': 3, 'type': 'observation',
                         'utc_ns': now_ns - seq * S // 10, 'content': {
                             'person': f'person_{robot}', 'sign': f'sign_{seq % 7}', 'value': seq,
                             'quality': 'good', 'source': ''}})
    return made


async def write(url: str, begin: dict[int, int], told: int) -> None:
    """Write for ever; a line into a pipe for what is acknowledged."""
    store = Store.open(url)
    writer = RecordWriter(store)

    async def robot(number: int) -> None:
        first = begin[number]
        while True:
            await writer.put(f'robot_{number}', 'boot', records(number, first, time.time_ns()),
                             60.0)
            os.write(told, f'{number} {first}\n'.encode())
            first += BATCH

    await asyncio.gather(*(robot(number) for number in range(ROBOTS)))


def run_and_kill(url: str, begin: dict[int, int], rng: random.Random) -> int:
    """Start a writer, kill it, and take over what it had acknowledged; return how much."""
    reading, writing = os.pipe()
    # Forked, since to import it all takes longer than the rest.
    pid = os.fork()
    if not pid:
        try:
            os.close(reading)
            asyncio.run(write(url, begin, writing))
        finally:
            os._exit(1)
    os.close(writing)
    timer = None
    count = 0
    with open(reading) as lines:
        for line in lines:
            if timer is None:
                # From the first acknowledgement on, which comes when it runs.
                timer = threading.Timer(rng.uniform(0.0, 0.25), os.kill, (pid, signal.SIGKILL))
                timer.start()
            if line.endswith('\n'):
                number, seq = map(int, line.split())
                begin[number] = max(begin[number], seq + BATCH)
                count += BATCH
    os.waitpid(pid, 0)
    if timer is None:
        raise SystemExit('the writer ended before it had written anything')
    timer.join()
    return count


def account(url: str, begin: dict[int, int]) -> dict[str, Any]:
    """Compare what was acknowledged with what is there."""
    store = Store.open(url)
    while store.roll_up():
        pass
    lost = double = wrong = 0
    with store.reading() as connection:
        for number, end in begin.items():
            seqs: list[int] = []
            for table in ('observations', 'alarm_events'):
                seqs += connection.execute(text(
                    f'SELECT x.seq FROM {table} x JOIN boots b ON b.id = x.boot_id JOIN robots r '
                    'ON r.id = b.robot_id WHERE r.robot = :robot'), {
                        'robot': f'robot_{number}'}).scalars().all()
            lost += len(set(range(end)) - set(seqs))
            double += len(seqs) - len(set(seqs))
        for table, span in (('minutes', 60 * S), ('hours', 3600 * S), ('days', 86400 * S)):
            wrong += connection.execute(text(
                'SELECT count(*) FROM (SELECT series_id, '
                f't_ns / {span} * {span} AS begun, min(value) AS low, max(value) AS high, '
                'count(*) AS count FROM observations GROUP BY series_id, begun) a LEFT JOIN '
                f'{table} b ON a.series_id = b.series_id AND a.begun = b.t_ns AND a.low = b.low '
                'AND a.high = b.high AND a.count = b.count WHERE b.series_id IS NULL')).scalar() or 0
        open_alarms = connection.execute(text('SELECT count(*) FROM alarms')).scalar()
    problems = check(store)
    store.close()
    return {'lost': lost, 'double': double, 'rollups_wrong': wrong, 'alarms': open_alarms,
            'integrity': problems or 'ok'}


def kill(url: str, kills: int, seed: int) -> dict[str, Any]:
    """Kill so many times, and account."""
    rng = random.Random(seed)
    begin = dict.fromkeys(range(ROBOTS), 0)
    Store.open(url).close()
    acknowledged = sum(run_and_kill(url, begin, rng) for _ in range(kills))
    return {'kills': kills, 'acknowledged': acknowledged, **account(url, begin)}


def main() -> int:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--kills', type=int, default=100)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--database', metavar='URL')
    parser.add_argument('--postgres', action='store_true')
    arguments = parser.parse_args()
    with ExitStack() as stack:
        url = arguments.database
        if arguments.postgres:
            from databases import postgres_server
            url = stack.enter_context(postgres_server('fsync=on', 'full_page_writes=on'))
        elif url is None:
            url = os.path.join(stack.enter_context(tempfile.TemporaryDirectory()), 'monitor.db')
        result = kill(url, arguments.kills, arguments.seed)
    print(json.dumps(result, indent=1))
    return int(bool(result['lost'] or result['double'] or result['rollups_wrong']
                    or result['integrity'] != 'ok'))


if __name__ == '__main__':
    sys.exit(main())
