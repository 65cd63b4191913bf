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

"""The room that a journal keeps on its disk: full, killed, cut and full for long, and not kept."""

from __future__ import annotations

import errno
from itertools import count
import json
from pathlib import Path
from random import Random

import pytest

from rt_robot_os.features.alarms.journal_device.folder import JournalFolder
from rt_robot_os.features.alarms.journal_file import JournalFile
from rt_robot_os.features.alarms.journal_file import NAME
from rt_robot_os.features.alarms.journal_file import NEW
from rt_robot_os.features.alarms.journal_file import OLDER
from rt_robot_os.features.alarms.journal_file import read_journal
from rt_robot_os.features.alarms.journal_lines import decode
from rt_robot_os.features.alarms.journal_store import Killed
from rt_robot_os.features.alarms.journal_store import MemoryStore

LIMIT = 20_000


def record(seq: int, *, is_open: bool = True) -> str:
    return json.dumps({'seq': seq, 'alarm': f'alarm{seq}', 't_ns': seq, 'events': ['x' * 60],
                       'state': {} if is_open else None})


def journal(store: MemoryStore | JournalFolder) -> JournalFile:
    clock = count(1)
    made = JournalFile(store, LIMIT, lambda: next(clock))
    made.open()
    return made


def add(kept: JournalFile, most: int) -> int:
    """Add records of alarms that are over, and return how many were stored."""
    for done in range(most):
        seq = kept.seq + 1
        try:
            kept.append(record(seq, is_open=False), seq)
            assert kept.commit() == seq
        except OSError as error:
            assert error.errno == errno.ENOSPC
            return done
    return most


def test_on_a_full_disk_records_are_stored_until_the_room_is_used_up_and_then_it_is_told() -> None:
    store = MemoryStore()
    kept = journal(store)
    kept.append(record(1), 1)
    before = kept.keep_room()
    assert before.problem is None and before.kept_bytes > LIMIT
    store.room = 0
    assert add(kept, 50) == 50
    after = kept.keep_room()
    # It was written anew in the room kept for that, and nobody left room for the next time.
    stored = add(kept, 10_000)
    assert 50 < stored < 10_000 and kept.put_off > 0
    assert after.kept_bytes < before.kept_bytes
    assert kept.keep_room().problem is not None and kept.keep_room().kept_bytes < 200
    found = read_journal(store)
    assert [each.seq for each in found.living()] == [1, kept.seq] and not found.damaged
    store.room = 1 << 30
    kept = journal(store)
    assert kept.seq == stored + 51 and kept.keep_room().problem is None
    assert kept.keep_room().kept_bytes > LIMIT


def test_who_is_killed_while_the_disk_is_full_goes_on_with_what_was_kept() -> None:
    for kill_at in range(1, 40):
        store = MemoryStore()
        kept = journal(store)
        add(kept, 10)
        store.room = 0
        store.kill_at = store.calls + kill_at
        stored = kept.seq
        try:
            for _ in range(30):
                add(kept, 1)
                stored = kept.seq
        except Killed:
            pass
        store.kill_at = 0
        for _ in range(3):  # and killed again and again
            kept = journal(store)
            assert kept.seq >= stored
            assert add(kept, 5) == 5
            stored = kept.seq
        assert read_journal(store).damaged == 0


def test_the_power_goes_while_the_disk_is_full() -> None:
    for seed in range(60):
        random = Random(seed)
        store = MemoryStore()
        kept = journal(store)
        add(kept, 10)
        store.room = 0
        store.kill_at = store.calls + random.randint(1, 20)
        try:
            add(kept, 30)
        except Killed:
            pass
        store.kill_at = 0
        stored = max(each.seq for each in read_journal(store).records)
        store.lose_power(random)
        kept = journal(store)
        assert kept.seq >= stored - 1  # the one that nobody was told is stored
        assert add(kept, 5) == 5


class FullFolder(JournalFolder):
    """A folder on a disk that is full: there is no byte but those that files have already."""

    full = False

    def append(self, name: str, data: bytes) -> None:
        free = self.kept(name) - (self.path / name).stat().st_size if self.full else len(data)
        super().append(name, data[:max(0, free)])
        if free < len(data):
            raise OSError(errno.ENOSPC, 'No space left on device')

    def write(self, name: str, data: bytes) -> None:
        if self.full and self.kept(name) < len(data):
            raise OSError(errno.ENOSPC, 'No space left on device')
        super().write(name, data)

    def keep(self, name: str, size: int) -> None:
        if self.full:
            raise OSError(errno.ENOSPC, 'No space left on device')
        super().keep(name, size)


def test_a_real_file_system_keeps_the_room(tmp_path: Path) -> None:
    store = FullFolder(tmp_path)
    kept = journal(store)
    room = kept.keep_room()
    if room.problem is not None:
        pytest.skip(f'{tmp_path}: no room can be kept here: {room.problem.strerror}')
    assert (tmp_path / NAME).stat().st_size < 200 and room.kept_bytes > LIMIT
    store.full = True
    assert add(kept, 20) == 20
    store.close()
    store = FullFolder(tmp_path)
    store.full = True
    kept = journal(store)  # written anew in the room of the next file
    assert kept.begun and kept.seq == 20 and (tmp_path / OLDER).stat().st_size
    assert 100 < add(kept, 10_000) < 10_000
    assert not (tmp_path / NEW).exists() or not (tmp_path / NEW).stat().st_size
    store.close()


def opened_after_a_cut(store: MemoryStore | FullFolder, data: bytes, cut: int) -> None:
    """Open what a cut has left on a disk that is full, with room kept behind it, and go on."""
    whole = [each.seq for each in decode(data[:cut]).records]
    store.append(NAME, data[:cut])
    store.append(NEW, data[:cut // 2])  # a next file that was not finished
    store.keep(NAME, LIMIT)
    if whole and isinstance(store, MemoryStore):
        store.room = 0
    elif isinstance(store, FullFolder):
        store.full = bool(whole)
    kept = journal(store)
    assert kept.seq == len(whole)
    assert add(kept, 2) == 2
    found = read_journal(store)
    assert [each.seq for each in found.records] == [*whole, len(whole) + 1, len(whole) + 2]
    assert not found.damaged


def test_a_cut_at_every_byte_leaves_what_was_before_and_the_room(tmp_path: Path) -> None:
    first = MemoryStore()
    add(journal(first), 4)
    data = first.read(NAME)
    for cut in range(len(data) + 1):
        opened_after_a_cut(MemoryStore(), data, cut)
    for cut in range(3, len(data), 97):
        store = FullFolder(tmp_path / str(cut))
        opened_after_a_cut(store, data, cut)
        store.close()


def test_a_disk_that_keeps_no_room_is_told_and_everything_else_works() -> None:
    class Plain(MemoryStore):
        def keep(self, name: str, size: int) -> None:
            raise OSError(errno.EOPNOTSUPP, 'Operation not supported')

    kept = journal(Plain())
    assert add(kept, 1000) == 1000
    room = kept.keep_room()
    assert room.problem is not None and room.problem.errno == errno.EOPNOTSUPP
    assert room.kept_bytes == 0
