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

"""Nothing is acknowledged that is not on the disk: full disks, databases away, kills."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
import subprocess
import sys
import threading
import time
from typing import Any

import databases
import pytest
from rt_robot_os.base.errors import StoreError
from rt_robot_os.monitor.store.adding import Added
from rt_robot_os.monitor.store.adding import ReceivedBatch
from rt_robot_os.monitor.store.store import Store
from rt_robot_os.monitor.store.writer import RecordWriter
from sqlalchemy import event

ROOT = Path(__file__).resolve().parents[3]
NOW_NS = 1_800_000_000_000_000_000


def batch(first: int, count: int = 10, kind: str = 'observation', importance: int = 3
          ) -> list[dict[str, Any]]:
    return [{'seq': seq, 'importance': importance, 'type': kind, 'utc_ns': NOW_NS, 'content': {
        'person': 'anna', 'sign': 'pulse_per_min', 'value': 60.0, 'quality': 'good',
        'seq': seq, 'alarm': '7', 'event': 'raised', 'state': 'raised', 'level': 'urgent',
        'subject': 'anna', 'text': 'x' * 500}} for seq in range(first, first + count)]


class SlowStore(Store):
    """A store that notes what is written together, and can be held up."""

    groups: list[list[tuple[str, int]]]
    go: threading.Event

    def add_all(self, batches: Any) -> list[Added]:
        """Note and wait."""
        self.groups.append([(each.robot, len(each.records)) for each in batches])
        assert self.go.wait(30)
        return super().add_all(batches)


def test_robots_share_a_commit_and_alarms_go_first(url: str) -> None:
    store = SlowStore.open(url, lambda: NOW_NS)
    assert isinstance(store, SlowStore)
    store.groups, store.go = [], threading.Event()
    writer = RecordWriter(store)

    async def all_of_them() -> list[Added]:
        first = asyncio.create_task(writer.put('r0', 'b', batch(0)))
        while not store.groups:
            await asyncio.sleep(0.001)
        others = [asyncio.create_task(writer.put(f'r{number}', 'b', batch(0)))
                  for number in range(1, 6)]
        alarm = asyncio.create_task(writer.put('r9', 'b', batch(0, 1, 'alarm_event', 0)))
        while writer.waiting < 51:
            await asyncio.sleep(0.001)
        store.go.set()
        return await asyncio.gather(first, *others, alarm)

    assert [each.fresh for each in asyncio.run(all_of_them())] == [10] * 6 + [1]
    assert store.groups == [[('r0', 10)], [('r9', 1), *((f'r{n}', 10) for n in range(1, 6))]]
    writer.close()
    store.close()


def test_who_waits_too_long_is_told_and_what_waits_is_bounded(url: str) -> None:
    store = SlowStore.open(url, lambda: NOW_NS)
    assert isinstance(store, SlowStore)
    store.groups, store.go = [], threading.Event()
    writer = RecordWriter(store, waiting_records=25)

    async def too_many() -> None:
        first = [asyncio.create_task(writer.put('r1', 'b', batch(0)))]
        while not store.groups:
            await asyncio.sleep(0.001)
        first += [asyncio.create_task(writer.put('r1', 'b', batch(number * 10)))
                  for number in (1, 2)]
        await asyncio.sleep(0)
        with pytest.raises(StoreError, match='not written within 0.2 s: too many records'):
            await writer.put('r2', 'b', batch(0), 0.2)
        # An alarm is let in all the same.
        alarm = asyncio.create_task(writer.put('r3', 'b', batch(0, 1, 'alarm_event', 0)))
        while writer.waiting < 21:
            await asyncio.sleep(0.001)
        store.go.set()
        await asyncio.gather(*first, alarm)

    asyncio.run(too_many())
    writer.close()
    with pytest.raises(StoreError, match='about to end'):
        asyncio.run(writer.put('r1', 'b', batch(99)))
    assert len(store.observations('anna', limit=100)) == 30
    store.close()


def test_a_full_disk_is_told_and_nothing_is_acknowledged_until_there_is_room(
        all_databases: databases.Databases) -> None:
    store = Store.open(all_databases.fresh('sqlite'), lambda: NOW_NS)

    def limit(pages: int) -> None:
        @event.listens_for(store.engine, 'checkout')
        def _(connection: Any, *_: Any) -> None:
            connection.execute(f'PRAGMA max_page_count = {pages}')
        store.engine.dispose()

    with store.reading() as connection:
        pages = connection.exec_driver_sql('PRAGMA page_count').scalar() or 0
    limit(pages + 20)
    writer = RecordWriter(store)

    async def fill() -> int:
        kept = 0
        while True:
            try:
                await writer.put('r1', 'b', batch(kept, 50, 'alarm_event'), 0.3)
            except StoreError as error:
                if 'too many records are queued' in str(error):
                    continue  # a busy machine; the same records once more are known or fresh
                assert 'database or disk is full' in str(error)
                return kept
            kept += 50

    kept = asyncio.run(fill())
    assert kept > 0
    found = store.alarm('r1', '7')
    assert found is not None and len(found['events']) == kept
    assert 'full' in writer.fault
    limit(1 << 30)
    added = asyncio.run(writer.put('r1', 'b', batch(kept, 50, 'alarm_event')))
    assert added.fresh + added.known == 50
    found = store.alarm('r1', '7')
    assert found is not None and len(found['events']) == kept + 50
    assert writer.fault == ''
    writer.close()
    store.close()


def test_a_database_that_goes_away_is_told_and_found_again(
        all_databases: databases.Databases) -> None:
    url = all_databases.fresh('postgresql')
    store = Store.open(url, lambda: NOW_NS)
    writer = RecordWriter(store)
    assert asyncio.run(writer.put('r1', 'b', batch(0))).fresh == 10
    name = databases.name_of(url)
    with all_databases.away(url):
        with pytest.raises(StoreError, match='database'):
            store.observations('anna')
        with pytest.raises(StoreError, match='database'):
            store.add('r1', 'b', batch(10))

        async def put() -> None:
            with pytest.raises(StoreError, match=f'not written within 0.3 s.*{name}'):
                await writer.put('r1', 'b', batch(10), 0.3)
        asyncio.run(put())
        assert writer.failures
    added = asyncio.run(writer.put('r1', 'b', batch(10)))
    assert added.fresh + added.known == 10
    assert len(store.observations('anna')) == 20
    writer.close()
    store.close()
    all_databases.drop(url)


def test_a_locked_file_is_told_and_harms_nothing(
        all_databases: databases.Databases, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('rt_robot_os.monitor.store.engine.BUSY_MS', 10)
    url = all_databases.fresh('sqlite')
    store, other = Store.open(url, lambda: NOW_NS), Store.open(url, lambda: NOW_NS)
    with other.writing(), pytest.raises(StoreError, match='locked'):
        store.add('r1', 'b', batch(0))
    assert store.add('r1', 'b', batch(0)) == 10
    store.close()
    other.close()


def test_two_writers_on_one_database_store_each_record_once(url: str) -> None:
    stores = [Store.open(url, lambda: NOW_NS) for _ in range(2)]
    counts: list[int] = []

    def add(store: Store) -> None:
        for first in range(0, 300, 10):
            counts.append(store.add_all([ReceivedBatch('r1', 'b', batch(first))])[0].fresh)

    threads = [threading.Thread(target=add, args=(store,)) for store in stores]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert sum(counts) == 300
    assert len(stores[0].observations('anna')) == 300
    for store in stores:
        store.close()


def test_no_acknowledged_record_is_lost_when_the_server_is_killed(
        all_databases: databases.Databases) -> None:
    for kind, kills in (('sqlite', 3), ('postgresql', 2)):
        url = all_databases.fresh(kind)
        done = subprocess.run(
            [sys.executable, ROOT / 'scripts' / 'kill_monitor.py', '--kills', str(kills),
             '--database', url, '--seed', str(time.time_ns())], capture_output=True, text=True,
            timeout=300)
        assert done.returncode == 0, done.stdout + done.stderr
        found = json.loads(done.stdout)
        assert found['acknowledged'] >= kills * 60
        assert (found['lost'], found['double'], found['integrity']) == (0, 0, 'ok')
        all_databases.drop(url)
