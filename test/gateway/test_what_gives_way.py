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

"""What a gateway gives up first: at its limit, on a full disk, and in memory."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import pytest

pytest.importorskip('websockets', reason='websockets is not installed')

from outbox_keeper import keeper_in  # noqa: E402, I100
from rt_robot_os.gateway.memory_fallback import MemoryFallback  # noqa: E402
from rt_robot_os.gateway.memory_fallback import ROWS_MOST  # noqa: E402
from rt_robot_os.gateway.outbox import CHUNK  # noqa: E402
from rt_robot_os.gateway.outbox import Outbox  # noqa: E402
from rt_robot_os.gateway.outbox import OutboxRow  # noqa: E402
from rt_robot_os.gateway.part import Record  # noqa: E402
from rt_robot_os.gateway.record_queue import RecordQueue  # noqa: E402
from rt_robot_os.messages.uplink.importance import Importance  # noqa: E402

ALL = tuple(Importance)


def rows(importance: Importance, number: int, first: int = 1, size: int = 100) -> list[OutboxRow]:
    return [OutboxRow(importance, 1, seq, 0, 'x' * size) for seq in range(first, first + number)]


def seqs(box: Outbox, importance: Importance) -> list[int]:
    return [each.seq for each in box.after(importance, (-1, -1), 10_000, 10 ** 9)]


@pytest.fixture
def box(tmp_path: Path) -> Iterator[Outbox]:
    made = Outbox(tmp_path / 'outbox.sqlite3', 'a', 100_000, 100.0)
    yield made
    made.close()


# ---- at the limit ----------------------------------------------------------------------------

def test_a_class_gives_way_when_all_that_are_less_important_are_gone(box: Outbox) -> None:
    for importance in ALL:
        box.add(rows(importance, 2))
    gone: list[Importance] = []
    while box.evict({}):
        gone += [each for each in ALL if box.lost[each] and each not in gone]
    assert gone == [Importance.NETWORK, Importance.OBSERVATION, Importance.MEDIA,
                    Importance.EVENT, Importance.ALARM]


def test_of_one_class_the_oldest_give_way_a_chunk_at_a_time(box: Outbox) -> None:
    box.add(rows(Importance.NETWORK, CHUNK + 3))
    assert box.evict({}) == CHUNK
    assert seqs(box, Importance.NETWORK) == [CHUNK + 1, CHUNK + 2, CHUNK + 3]
    assert box.lost[Importance.NETWORK] == CHUNK


def test_what_is_on_its_way_to_the_server_stays(box: Outbox) -> None:
    box.add(rows(Importance.NETWORK, 5))
    box.add(rows(Importance.MEDIA, 5))
    assert box.evict({Importance.NETWORK: (1, 3)}) == 2
    assert seqs(box, Importance.NETWORK) == [1, 2, 3]
    assert box.evict({Importance.NETWORK: (1, 3)}) == 5  # the next class then
    assert seqs(box, Importance.NETWORK) == [1, 2, 3] and not seqs(box, Importance.MEDIA)


@pytest.mark.parametrize('least', ALL)
def test_what_is_more_important_than_is_allowed_stays(box: Outbox, least: Importance) -> None:
    for importance in ALL:
        box.add(rows(importance, 2))
    while box.evict({}, least):
        pass
    assert {each for each in ALL if not box.rows[each]} == {each for each in ALL if each >= least}


def test_up_to_its_limit_an_outbox_is_not_too_full(tmp_path: Path) -> None:
    found = rows(Importance.EVENT, 2)
    limit = sum(each.nbytes for each in found)
    box = Outbox(tmp_path / 'outbox.sqlite3', 'a', limit, 100.0)
    box.add(found)
    assert not box.over()
    box.add(rows(Importance.EVENT, 1, 3, 0))
    assert box.over()
    box.close()


def test_what_has_waited_as_long_as_it_may_stays_and_a_second_later_it_goes(box: Outbox) -> None:
    box.add([row for each in ALL for row in rows(each, 1)])
    box.lived_s = 100
    assert box.expire({}) == 0
    box.lived_s = 101
    assert box.expire({Importance.MEDIA: (1, 1)}) == 2  # its picture is on its way
    assert {each for each in ALL if not box.rows[each]} == {
        Importance.OBSERVATION, Importance.NETWORK}
    assert box.expire({}) == 1
    assert box.rows[Importance.ALARM] == box.rows[Importance.EVENT] == 1


# ---- on a full disk --------------------------------------------------------------------------

class FullDisk:
    """A keeper whose disk takes nothing more than what gives way for it."""

    def __init__(self, folder: Path, waiting: Iterable[Importance]) -> None:
        self.now_s = 1000.0
        self.said: list[str] = []
        self.numbers = count()
        self.keeper: RecordQueue = keeper_in(folder, lambda: self.now_s, self.said)
        for each in waiting:
            self.keep(each, 400)
        db = self.keeper.outbox._db
        pages = db.execute('PRAGMA page_count').fetchone()[0]
        db.execute(f'PRAGMA max_page_count = {pages}')

    def keep(self, importance: Importance, records: int = 1, size: int = 200) -> None:
        self.keeper.step([(Record(importance, 'log', {
            'n': next(self.numbers), 'long': 'x' * size}, 1), None) for _ in range(records)])
        for _ in range(2):  # first it is written, then it is tried again
            self.now_s += 2.0
            self.keeper.step(())

    def lost(self) -> dict[Importance, int]:
        return {each: n for each, n in self.keeper.outbox.lost.items() if n}


@pytest.mark.parametrize(('comes', 'gives_way'), [
    (Importance.ALARM, Importance.NETWORK), (Importance.EVENT, Importance.NETWORK),
    (Importance.MEDIA, Importance.NETWORK), (Importance.OBSERVATION, Importance.NETWORK)])
def test_for_a_new_record_some_of_the_least_important_give_way(
        tmp_path: Path, comes: Importance, gives_way: Importance) -> None:
    full = FullDisk(tmp_path, ALL)
    full.keep(comes, size=8000)
    assert full.lost() == {gives_way: CHUNK}
    assert full.keeper.outbox.rows[comes] == 401
    assert not full.keeper.problem and 'can be written again' in full.said[-1]
    full.keeper.stop()


@pytest.mark.parametrize(('comes', 'waiting', 'gives_way'), [
    (Importance.ALARM, (Importance.ALARM, Importance.EVENT, Importance.MEDIA), Importance.MEDIA),
    (Importance.EVENT, (Importance.EVENT, Importance.MEDIA), Importance.MEDIA),
    (Importance.ALARM, (Importance.ALARM, Importance.EVENT), None),
    (Importance.EVENT, (Importance.EVENT,), None),
    (Importance.MEDIA, (Importance.EVENT, Importance.MEDIA), None),
    (Importance.MEDIA, (Importance.MEDIA, Importance.OBSERVATION), Importance.OBSERVATION),
    (Importance.OBSERVATION, (Importance.MEDIA, Importance.OBSERVATION), None),
    (Importance.NETWORK, (Importance.OBSERVATION, Importance.NETWORK), None)])
def test_nothing_gives_way_for_what_is_no_more_important_and_no_event_for_an_alarm(
        tmp_path: Path, comes: Importance, waiting: tuple[Importance, ...],
        gives_way: Importance | None) -> None:
    full = FullDisk(tmp_path, waiting)
    full.keep(comes, size=8000)
    assert full.lost() == ({} if gives_way is None else {gives_way: CHUNK})
    # What found no room is in memory, and is sent from there.
    assert full.keeper.statistics()['unkept'] == (gives_way is None)
    assert bool(full.keeper.problem) is (gives_way is None)
    full.keeper.stop()


def test_what_gives_way_for_several_records_is_judged_by_the_most_important_of_them(
        tmp_path: Path) -> None:
    full = FullDisk(tmp_path, [Importance.NETWORK])
    full.keeper.step([(Record(each, 'log', {'long': 'x' * 8000}, 1), None)
                      for each in (Importance.ALARM, Importance.NETWORK)])
    for _ in range(2):
        full.now_s += 2.0
        full.keeper.step(())
    assert full.lost() == {Importance.NETWORK: CHUNK}
    assert full.keeper.outbox.rows[Importance.ALARM] == 1 and not full.keeper.problem
    full.keeper.stop()


# ---- in memory -------------------------------------------------------------------------------

def test_of_what_the_disk_did_not_take_the_oldest_of_the_least_important_is_dropped() -> None:
    spare = MemoryFallback()
    assert spare.add(rows(Importance.ALARM, 10), []) == []
    assert spare.add(rows(Importance.NETWORK, 5, 100), []) == []
    assert spare.add(rows(Importance.OBSERVATION, ROWS_MOST - 15, 200), []) == []
    gone = spare.add(rows(Importance.EVENT, 7, 10_000), [])
    assert [(each.importance, each.seq) for each in gone] == [
        *((Importance.NETWORK, seq) for seq in range(100, 105)),
        (Importance.OBSERVATION, 200), (Importance.OBSERVATION, 201)]
    assert len(spare) == ROWS_MOST


def test_what_was_not_written_is_written_in_order_the_most_important_first() -> None:
    spare = MemoryFallback()
    spare.add([*rows(Importance.NETWORK, 1, 1), *rows(Importance.ALARM, 2, 5)], [])
    assert [each.seq for each in spare.rows()] == [5, 6, 1]
