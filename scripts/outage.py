#!/usr/bin/env python3
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
How long a gateway takes to tell a monitor what happened while there was no network.

The outbox is filled as a robot fills it in some hours, without waiting for them; then a gateway
and a monitor are started, each a process as users run it, and it is counted what the database of
the monitor has, when, and in which order. Prints JSON.

    scripts/outage.py --hours 8 --rows-per-s 60
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
from typing import Any
from uuid import uuid4

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from rt_robot_os.gateway.outbox import Outbox  # noqa: E402
from rt_robot_os.gateway.outbox import OutboxRow  # noqa: E402
from rt_robot_os.gateway.part import Record  # noqa: E402
from rt_robot_os.gateway.record_queue import FILE  # noqa: E402
from rt_robot_os.gateway.record_queue import record_text  # noqa: E402
from rt_robot_os.messages.uplink.importance import Importance  # noqa: E402
from rt_robot_os.monitor.server import DATABASE  # noqa: E402

SIGNS = ('pulse_per_min', 'spo2_percent', 'respiration_per_min', 'body_temperature')
#: Which table of the monitor has records of which importance, the most important first.
TABLES = ('alarm_events', 'events', 'observations', 'nodes')
CHUNK = 20_000
LOOK_S = 0.2


def record(number: int, utc_ns: int) -> Record:
    """Make a record as a robot does: mostly vital signs, now and then a node, rarely an alarm."""
    if number % 3000 == 0:
        return Record(Importance.ALARM, 'alarm_event', {
            'seq': number // 3000 + 1, 'alarm': str(number // 30_000), 'event': 'notified',
            'state': 'raised', 'level': 'urgent', 'subject': 'anna', 'kinds': ['fall'],
            'text': 'operator told', 't_ns': number}, utc_ns)
    if number % 600 == 0:
        return Record(Importance.EVENT, 'transition', {
            'from': 'approach', 'to': 'ask', 'cause': 'arrived', 'alarm': '7', 't_ns': number},
            utc_ns)
    if number % 15 == 0:
        return Record(Importance.NETWORK, 'node', {
            'node': f'node{number % 30}', 'state': 'good', 'battery_v': 2.9, 'delivery': 0.98,
            'received': number, 'lost': number // 50}, utc_ns)
    sign = SIGNS[number % len(SIGNS)]
    return Record(Importance.OBSERVATION, 'observation', {
        'person': 'anna', 'sign': sign, 'value': 60 + number % 40, 'quality': 'good',
        'source': f'wsn/wrist/{sign}'}, utc_ns)


def fill(folder: Path, hours: float, rows_per_s: float) -> dict[str, Any]:
    """Fill an outbox."""
    count = round(hours * 3600 * rows_per_s)
    folder.mkdir(mode=0o700, parents=True)
    began_s = time.monotonic()
    box = Outbox(folder / FILE, str(uuid4()), 10 ** 12, 1e12)
    first_ns = time.time_ns() - round(hours * 3600e9)
    step_ns = round(1e9 / rows_per_s)
    for start in range(0, count, CHUNK):
        rows = []
        for number in range(start, min(count, start + CHUNK)):
            made = record(number, first_ns + number * step_ns)
            text = record_text(number + 1, made)
            assert text is not None
            rows.append(OutboxRow(made.importance, box.boot, number + 1, 0, text))
        box.add(rows)
    expected = {each.name.lower(): n for each, n in box.rows.items() if n}
    size = sum(box.nbytes.values())
    box.close()
    return {'rows': count, 'by_class': expected, 'mb': round(size / 1e6, 1),
            'filled_s': round(time.monotonic() - began_s, 1)}


def program(module: str, *arguments: object) -> list[str]:
    """Return the command line of a program of this package."""
    return [sys.executable, '-m', f'rt_robot_os.{module}', *map(str, arguments)]


def free_port() -> int:
    """Return a port that nobody has at present."""
    with socket.socket() as made:
        made.bind(('127.0.0.1', 0))
        return int(made.getsockname()[1])


def counts(database: Path) -> dict[str, int]:
    """Count what the monitor has."""
    with sqlite3.connect(f'file:{database}?mode=ro', uri=True, timeout=10.0) as db:
        return {table: db.execute(f'SELECT count(*) FROM {table}').fetchone()[0]
                for table in TABLES}


def judged(database: Path) -> dict[str, Any]:
    """Say whether each is there once, and whether what is important came first."""
    with sqlite3.connect(f'file:{database}?mode=ro', uri=True, timeout=60.0) as db:
        spans = {table: db.execute(f'SELECT min(arrived_ns), max(arrived_ns), count(*), '
                                   f'count(DISTINCT boot_id * 1000000000000 + seq) FROM {table}'
                                   ).fetchone() for table in TABLES}
        aside = db.execute('SELECT count(*) FROM unknown').fetchone()[0]
    there = [spans[table] for table in TABLES if spans[table][2]]
    return {'each_once': all(span[2] == span[3] for span in there), 'not_understood': aside,
            'by_importance': all(a[1] <= b[0] for a, b in zip(there, there[1:])),
            'in_order_s': {table: [round((each - there[0][0]) / 1e9, 2) for each in span[:2]]
                           for table, span in spans.items() if span[2]}}


def run(folder: Path, hours: float, rows_per_s: float, limit_s: float
        ) -> dict[str, Any]:
    """Fill, start both, and wait until all is there."""
    monitor, token, port = folder / 'monitor', folder / 'token', free_port()
    found = fill(folder / 'gateway', hours, rows_per_s)
    environ = {**os.environ, 'RT_ROBOT_OS_RUNTIME_DIR': str(folder / 'run'),
               'PYTHONPATH': str(ROOT)}
    subprocess.run(program('monitor.program', 'robot', 'add', 'robot', '--folder', monitor,
                           '--token-file', token), check=True, env=environ,
                   stdout=subprocess.DEVNULL)
    processes = []
    try:
        processes.append(subprocess.Popen(
            program('monitor.program', '--folder', monitor, '--port', port),
            env=environ, stdout=subprocess.DEVNULL))
        while True:  # until it listens
            try:
                socket.create_connection(('127.0.0.1', port), 1.0).close()
                break
            except OSError:
                time.sleep(LOOK_S)
        began_s = time.monotonic()
        processes.append(subprocess.Popen(
            program('gateway.program', '--server', f'ws://127.0.0.1:{port}',
                    '--ros-args', '-p', f'token_file:={token}', '-p',
                    f'folder:={folder / "gateway"}'),
            env=environ, stdout=subprocess.DEVNULL))
        path = monitor / DATABASE
        there = counts(path)
        while sum(there.values()) < found['rows'] and time.monotonic() - began_s < limit_s:
            time.sleep(LOOK_S)
            there = counts(path)
        elapsed_s = time.monotonic() - began_s
        found |= {'there': sum(there.values()), 'took_s': round(elapsed_s, 1),
                  'rows_per_s': round(sum(there.values()) / elapsed_s), **judged(path)}
        for name, process in zip(('monitor', 'gateway'), processes):
            words = Path(f'/proc/{process.pid}/stat').read_text().rpartition(')')[2].split()
            ticks = int(words[11]) + int(words[12])
            found[f'{name}_cpu_s'] = round(ticks / os.sysconf('SC_CLK_TCK'), 1)
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait(30.0)
    found['met'] = bool(found['there'] == found['rows'] and found['each_once']
                        and found['by_importance'] and found['took_s'] <= limit_s)
    return found


def main() -> int:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().split('\n')[0])
    parser.add_argument('--hours', type=float, default=8.0, help='without a network')
    parser.add_argument('--rows-per-s', type=float, default=60.0)
    parser.add_argument('--limit-s', type=float, default=120.0, help='how long it may take')
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix='outage') as folder:
        found = run(Path(folder), arguments.hours, arguments.rows_per_s, arguments.limit_s)
    print(json.dumps({'hours': arguments.hours, **found}, indent=2))
    return 0 if found['met'] else 1


if __name__ == '__main__':
    sys.exit(main())
