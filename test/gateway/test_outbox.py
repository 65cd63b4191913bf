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

"""What waits for the server: each record arrives once or is counted, whatever fails in between."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import shutil
import sqlite3
import tempfile
from typing import Any

from broad import examples
from hypothesis import HealthCheck
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize
from hypothesis.stateful import invariant
from hypothesis.stateful import precondition
from hypothesis.stateful import rule
from hypothesis.stateful import RuleBasedStateMachine
import pytest

pytest.importorskip('websockets', reason='websockets is not installed')

from outbox_keeper import keeper_in  # noqa: E402, I100
from rt_robot_os.gateway.outbox import Mark  # noqa: E402
from rt_robot_os.gateway.outbox import Outbox  # noqa: E402
from rt_robot_os.gateway.outbox import OutboxRow  # noqa: E402
from rt_robot_os.gateway.part import Record  # noqa: E402
from rt_robot_os.messages.uplink.importance import Importance  # noqa: E402
from rt_robot_os.messages.uplink.messages import decode  # noqa: E402
from rt_robot_os.messages.uplink.records import BatchRefused  # noqa: E402
from rt_robot_os.messages.uplink.records import BatchStored  # noqa: E402


class Delivery(RuleBasedStateMachine):
    """A keeper, a server of a few lines, and everything that goes wrong between them."""

    @initialize()
    def begin(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix='outbox'))
        self.now_s = 1000.0
        self.server: dict[tuple[str, int], dict[str, Any]] = {}
        self.order: list[tuple[int, str, int]] = []
        self.made = self.synced = 0
        self.may_be_lost: set[int] = set()
        self.waiting: list[dict[str, Any]] = []
        self.said: list[str] = []
        self.connection = False
        self.gave_way_before = 0
        self.keeper = keeper_in(self.folder, lambda: self.now_s, self.said)

    def teardown(self) -> None:
        self.keeper.outbox.close()
        shutil.rmtree(self.folder)

    @rule(importance=st.sampled_from(Importance), count=st.integers(1, 30))
    def records_come(self, importance: Importance, count: int) -> None:
        for _ in range(count):
            self.keeper.keep(Record(importance, 'log', {'n': self.made}, self.made),
                             Mark('t', 'run', self.made))
            self.made += 1
        self.drain()

    @rule(seconds=st.floats(0.01, 40.0))
    def time_passes(self, seconds: float) -> None:
        self.now_s += seconds
        self.drain()

    @rule()
    def the_network_comes(self) -> None:
        self.connection = True
        self.waiting.clear()
        self.keeper.met_server()
        self.drain()

    @rule()
    def the_network_goes(self) -> None:
        self.connection = False
        self.waiting.clear()
        self.keeper.lost_server()
        self.drain()

    @precondition(lambda self: self.waiting)
    @rule(what=st.sampled_from(['store', 'store', 'lose the answer', 'refuse', 'lose']))
    def the_server_gets_a_batch(self, what: str) -> None:
        batch = self.waiting.pop(0)
        if what in ('store', 'lose the answer'):
            self.take(batch)
        if what == 'store':
            self.keeper.receive(BatchStored(batch['batch']))
        if what == 'refuse':
            self.keeper.receive(BatchRefused(batch['batch'], 'no', 0.1))
        self.drain()

    @rule(share=st.floats(0.0, 1.0))
    def the_power_goes(self, share: float) -> None:
        """Start anew from what was synced, and any part of what was written since."""
        self.write_now()
        wal = self.folder / 'outbox.sqlite3-wal'
        before = wal.stat().st_size
        db = sqlite3.connect(self.folder / 'outbox.sqlite3')
        # Written and torn, as far as a share of it: nobody was told that it is kept.
        db.execute("INSERT OR REPLACE INTO fact VALUES ('torn', ?)", (self.made,))
        copy = Path(tempfile.mkdtemp(prefix='outbox'))
        db.commit()
        for path in self.folder.glob('outbox.sqlite3*'):
            if not path.name.endswith('-shm'):
                shutil.copy(path, copy / path.name)
        db.close()
        torn = copy / wal.name
        after = torn.stat().st_size
        if after > before:  # else it began at its start again, over what is in the file by now
            with open(torn, 'r+b') as file:
                file.truncate(before + int(share * (after - before - 1)))
        self.start_anew(copy)

    @rule()
    def the_gateway_is_killed(self) -> None:
        """Start anew from the files as they are."""
        self.write_now()
        copy = Path(tempfile.mkdtemp(prefix='outbox'))
        for path in self.folder.glob('outbox.sqlite3*'):
            if not path.name.endswith('-shm'):
                shutil.copy(path, copy / path.name)
        self.start_anew(copy)

    @rule(records=st.integers(1, 400))
    def the_disk_is_full_for_a_while(self, records: int) -> None:
        self.write_now()
        db = self.keeper.outbox._db
        pages = db.execute('PRAGMA page_count').fetchone()[0]
        db.execute(f'PRAGMA max_page_count = {pages}')
        for _ in range(records):
            self.keeper.keep(Record(Importance.OBSERVATION, 'log',
                                    {'n': self.made, 'long': 'x' * 200}, self.made))
            self.made += 1
        self.now_s += 1.0
        self.drain()
        self.now_s += 2.0
        self.drain()
        db.execute('PRAGMA max_page_count = 1073741823')
        self.now_s += 2.0
        self.drain()
        assert not len(self.keeper.spare) and not self.keeper.problem

    # ---- the rest ----------------------------------------------------------------------------

    def write_now(self) -> None:
        self.now_s += 1.0
        self.drain()

    def start_anew(self, folder: Path) -> None:
        self.keeper.outbox.close()
        shutil.rmtree(self.folder)
        self.folder = folder
        self.connection = False
        self.waiting.clear()
        self.keeper = keeper_in(self.folder, lambda: self.now_s, self.said)
        assert self.keeper.outbox.damaged is None

    def drain(self) -> None:
        items = []
        while not self.keeper._queue.empty():
            items.append(self.keeper._queue.get())
        self.keeper.step(items)
        while self.connection and (text := self.keeper.next_text()) is not None:
            self.waiting.append(decode(text))

    def take(self, batch: dict[str, Any]) -> None:
        for each in batch['records']:
            key = batch['boot'], each['seq']
            known = self.server.get(key)
            assert known is None or known == each, 'one key for two records'
            self.server[key] = each

    def deliver_all(self) -> None:
        """Let the network be there and the server well until nothing is left."""
        self.the_network_comes()
        for _ in range(10_000):
            if not any(self.keeper.outbox.rows.values()) and not self.waiting:
                return
            if self.waiting:
                self.take(batch := self.waiting.pop(0))
                self.keeper.receive(BatchStored(batch['batch']))
            else:
                self.now_s += 1.0
            self.drain()
        raise AssertionError(f'{self.keeper.statistics()}')

    @invariant()
    def the_counters_are_those_of_the_file(self) -> None:
        if not hasattr(self, 'keeper'):
            return
        box = self.keeper.outbox
        found = dict(box._db.execute('SELECT importance, count(*) FROM record GROUP BY '
                                     'importance').fetchall())
        assert {each: n for each, n in box.rows.items() if n} == found

    @rule()
    def all_that_was_kept_arrives_once(self) -> None:
        self.write_now()
        self.deliver_all()
        numbers = sorted(each['content']['n'] for each in self.server.values())
        lost = sum(self.keeper.outbox.lost.values())
        assert len(numbers) == len(set(numbers)), 'one record under two keys'
        assert len(numbers) + lost == self.made, (len(numbers), lost, self.made)
        assert not self.keeper.outbox.refused


TestDelivery = Delivery.TestCase
TestDelivery.settings = settings(
    max_examples=examples(10), stateful_step_count=20, deadline=None,
    suppress_health_check=list(HealthCheck))


@pytest.fixture
def box(tmp_path: Path) -> Iterator[Outbox]:
    made = Outbox(tmp_path / 'outbox.sqlite3', 'a', 100_000, 100.0)
    yield made
    made.close()


def rows(box: Outbox, importance: Importance, count: int, first: int = 0, size: int = 100
         ) -> list[OutboxRow]:
    return [OutboxRow(importance, box.boot, first + number, box.lived_s,
                      json.dumps({'n': number, 'fill': 'x' * size})) for number in range(count)]


def test_the_oldest_of_the_least_important_gives_way_and_is_counted(box: Outbox) -> None:
    box.add(rows(box, Importance.ALARM, 300))
    box.add(rows(box, Importance.NETWORK, 300, 1000))
    box.add(rows(box, Importance.OBSERVATION, 300, 2000))
    while box.over():
        assert box.evict({})
    assert box.lost[Importance.NETWORK] == 300 and box.rows[Importance.NETWORK] == 0
    assert box.lost[Importance.OBSERVATION] > 0 and box.rows[Importance.ALARM] == 300
    left = box.after(Importance.OBSERVATION, (-1, -1), 1000, 10 ** 9)
    assert left[-1].seq == 2299  # the newest
    lost = dict(box.lost)
    box.close()
    assert Outbox(box.path, 'b', 100_000, 100.0).lost == lost


def test_age_is_time_that_the_gateway_ran_and_alarms_wait_for_ever(box: Outbox) -> None:
    box.add([*rows(box, Importance.ALARM, 3), *rows(box, Importance.OBSERVATION, 3, 10)])
    box.lived_s = 90
    box.add(rows(box, Importance.OBSERVATION, 2, 20))
    assert box.expire({}) == 0
    box.lived_s = 101
    assert box.expire({}) == 3
    assert box.rows[Importance.ALARM] == 3 and box.rows[Importance.OBSERVATION] == 2


def test_a_file_that_is_no_database_is_put_aside(tmp_path: Path) -> None:
    path = tmp_path / 'outbox.sqlite3'
    path.write_bytes(b'this is no database' * 1000)
    box = Outbox(path, 'a', 100_000, 100.0)
    assert box.damaged is not None and box.damaged.exists()
    box.add(rows(box, Importance.ALARM, 3))
    box.close()
    assert path.stat().st_mode & 0o077 == 0


def test_a_clock_that_is_set_back_by_years_changes_no_order_and_deletes_nothing(
        tmp_path: Path) -> None:
    now_s = 0.0
    kept = keeper_in(tmp_path, lambda: now_s, [])
    years_ns = 20 * 365 * 86400 * 10 ** 9
    for number in range(6):
        kept.keep(Record(Importance.OBSERVATION, 'log', {'n': number},
                         2 * years_ns - (number > 2) * years_ns))
    kept.met_server()
    items = [kept._queue.get() for _ in range(7)]
    kept.step(items)
    now_s = 100.0  # a minute of the gateway, not of the clock
    kept.step(())
    text = kept.next_text()
    assert text is not None
    batch = decode(text)['records']
    assert [each['content']['n'] for each in batch] == list(range(6))
    assert batch[2]['utc_ns'] - batch[3]['utc_ns'] == years_ns  # as it was said: the server judges
    assert not any(kept.outbox.lost.values())
    kept.outbox.close()
