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

"""The journal: cut at every byte, damaged anywhere, killed in every call, full, without power."""

from __future__ import annotations

from collections.abc import Iterator
import json
from random import Random
import zlib

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.features.alarms.journal_file import JournalFile
from rt_robot_os.features.alarms.journal_file import NAME
from rt_robot_os.features.alarms.journal_file import read_journal
from rt_robot_os.features.alarms.journal_lines import decode
from rt_robot_os.features.alarms.journal_lines import encode
from rt_robot_os.features.alarms.journal_lines import encode_record
from rt_robot_os.features.alarms.journal_lines import LINE_BYTES
from rt_robot_os.features.alarms.journal_store import Killed
from rt_robot_os.features.alarms.journal_store import MemoryStore


def record(seq: int, alarm: str = 'a', *, is_open: bool = True, text: str = 'äöü "R1"') -> str:
    return json.dumps({'seq': seq, 'alarm': alarm, 't_ns': seq, 'events': [],
                       'state': {'text': text} if is_open else None}, ensure_ascii=False)


def lines(count: int) -> list[bytes]:
    return [encode_record(record(seq, f'alarm{seq}'), seq) for seq in range(1, count + 1)]


def seqs(data: bytes) -> list[int]:
    return [each.seq for each in decode(data).records]


def journal(store: MemoryStore, limit_bytes: int = 100_000) -> JournalFile:
    clock = iter(range(1, 1_000_000))
    return JournalFile(store, limit_bytes, lambda: next(clock))


# ---- bytes -----------------------------------------------------------------------------------

FALSE_HEADS = {
    'in one line': b'R1 0000fff0 00000000 ' * 50_000,
    'each in a line': b'\nR1 0000fff0 00000000 ' * 48_000,
    'to one end': b''.join(b'R1 %08x 00000000 ' % (21 * each) for each in range(3000, 0, -1)) * 16,
}


@pytest.mark.parametrize('junk', FALSE_HEADS)
def test_a_megabyte_of_false_heads_costs_little_and_hides_nothing_behind_it(
        junk: str, monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[int] = []

    def checksum(data: bytes) -> int:
        tried.append(len(data))
        return crc32(data)

    crc32 = zlib.crc32
    each = lines(3)
    data = each[0] + FALSE_HEADS[junk] + b'\n' + each[1] + each[2]
    monkeypatch.setattr(zlib, 'crc32', checksum)
    assert seqs(data) == [1, 2, 3]
    assert sum(tried) < 40 << 20


def test_a_cut_at_every_byte_loses_the_record_that_is_cut_and_no_other() -> None:
    each = lines(6)
    data = b''.join(each)
    ends = [sum(map(len, each[:count])) for count in range(7)]
    for cut in range(len(data) + 1):
        found = decode(data[:cut])
        # One of which only the end of the line is missing is whole.
        whole = sum(end - 1 <= cut for end in ends[1:])
        assert [one.seq for one in found.records] == list(range(1, whole + 1))
        assert found.damaged == 0
        assert found.torn_bytes == cut - found.end == cut - min(cut, ends[whole])


def test_a_flipped_bit_anywhere_costs_one_record_and_is_counted() -> None:
    each = lines(5)
    data = b''.join(each)
    for position in range(len(data)):
        for bit in (0, 3, 7):
            broken = bytearray(data)
            broken[position] ^= 1 << bit
            found = decode(bytes(broken))
            assert len(found.records) >= 4, position
            lost = {1, 2, 3, 4, 5} - {one.seq for one in found.records}
            assert (found.damaged + bool(found.torn_bytes)) >= len(lost)


@given(st.binary(max_size=300), st.lists(st.sampled_from(lines(4)), max_size=4),
       st.binary(max_size=300))
def test_no_bytes_raise_and_whole_records_are_found_among_them(
        before: bytes, between: list[bytes], after: bytes) -> None:
    found = decode(before + b''.join(between) + after)
    assert len(found.records) >= len(between)


def test_a_record_in_the_text_of_a_record_is_no_record() -> None:
    inner = encode_record(record(99), 1).decode()
    data = encode_record(record(1, text=inner), 1)
    assert seqs(data) == [1]
    assert seqs(data[5:]) == []  # the outer one damaged


def test_a_line_is_bounded() -> None:
    with pytest.raises(ValueError, match='at most'):
        encode('x' * (LINE_BYTES + 1))


# ---- the file --------------------------------------------------------------------------------

def test_what_was_committed_is_there_after_a_cut_of_the_power_at_any_moment() -> None:
    for kill_at in range(1, 60):
        random = Random(kill_at)
        store = MemoryStore()
        committed = 0
        kept = journal(store, 2000)
        store.kill_at = kill_at
        try:
            kept.open()
            for seq in range(1, 40):
                kept.append(record(seq, f'alarm{seq % 5}', is_open=bool(seq % 3)), seq)
                if seq % 2:
                    committed = kept.commit()
        except Killed:
            pass
        store.kill_at = 0
        store.lose_power(random)
        found = read_journal(store)
        assert max((each.seq for each in found.records), default=0) >= committed
        assert found.damaged == 0
        again = journal(store, 2000)
        last = {each.alarm: each.seq for each in again.open().living()}
        for seq in range(max(1, committed - 4), committed + 1):
            newer = [s for s in range(seq + 1, committed + 1) if s % 5 == seq % 5]
            if seq % 3 and not newer:
                assert last[f'alarm{seq % 5}'] >= seq, (kill_at, committed, last)
        again.append(record(1000), 1000)
        assert again.commit() == 1000
        assert read_journal(store).records[-1].seq == 1000


def test_open_alarms_outlive_any_number_of_new_files_and_old_ones_go() -> None:
    store = MemoryStore()
    kept = journal(store, 4000)
    kept.open()
    kept.append(record(1, 'oldest'), 1)
    for seq in range(2, 2000):
        kept.append(record(seq, f'alarm{seq}', is_open=False), seq)
    kept.commit()
    assert len(store.read(NAME)) < 8000
    found = read_journal(store)
    assert [(each.alarm, each.seq) for each in found.living()] == [
        ('oldest', 1), ('alarm1999', 1999)]
    assert found.generation > 10 and len(found.records) > 5


def test_a_damaged_file_is_made_up_for_by_the_one_before() -> None:
    store = MemoryStore()
    kept = journal(store)
    kept.open()
    for seq in (1, 2, 3):
        kept.append(record(seq, f'alarm{seq}'), seq)
    kept.commit()
    kept = journal(store)
    kept.open()  # a new generation: three records carried over
    kept.append(record(4, 'alarm4'), 4)
    kept.commit()
    data = bytearray(store.read(NAME))
    data[data.index(b'alarm2')] ^= 1
    store.write(NAME, bytes(data))
    found = journal(store).open()
    assert [each.alarm for each in found.living()] == ['alarm1', 'alarm2', 'alarm3', 'alarm4']
    assert found.damaged == 1


def test_a_full_disk_is_an_error_that_leaves_nothing_half_done() -> None:
    store = MemoryStore(room=3000)  # too little to keep some of it free
    kept = journal(store)
    kept.open()
    kept.append(record(1), 1)
    kept.commit()
    store.room = len(store.read(NAME)) + 50
    with pytest.raises(OSError, match='No space'):
        kept.append(record(2), 2)
    assert decode(store.read(NAME)).torn_bytes == 0
    # It can still be read, and used on when there is room for a record but not for a new file.
    again = journal(store)
    assert [each.seq for each in again.open().records] == [1]
    store.room += 200
    again.append(record(2), 2)
    assert again.commit() == 2
    assert [each.seq for each in read_journal(store).records] == [1, 2]


def test_a_record_that_comes_twice_is_kept_once() -> None:
    store = MemoryStore()
    kept = journal(store)
    kept.open()
    for seq in (1, 2, 2, 1, 3):
        kept.append(record(seq), seq)
    assert kept.commit() == 3
    assert [each.seq for each in read_journal(store).records] == [1, 2, 3]


@settings(max_examples=40)
@given(st.lists(st.tuples(st.sampled_from(['append', 'commit', 'reopen', 'power']),
                          st.integers(0, 4)), max_size=40), st.randoms(use_true_random=False))
def test_a_journal_is_what_was_written_whatever_happens(
        steps: list[tuple[str, int]], random: Random) -> None:
    store = MemoryStore()
    kept = journal(store, 1500)
    kept.open()
    seq = committed = 0
    written: dict[str, tuple[int, bool]] = {}
    for step, number in steps:
        if step == 'append':
            seq += 1
            written[f'alarm{number}'] = seq, bool(seq % 4)
            kept.append(record(seq, f'alarm{number}', is_open=bool(seq % 4)), seq)
        elif step == 'commit':
            committed = kept.commit()
        else:
            if step == 'power':
                store.lose_power(random)
            kept = journal(store, 1500)
            found = kept.open()
            assert kept.seq >= committed
            seq = committed = kept.seq
            written = {alarm: (at, is_open) for alarm, (at, is_open) in written.items()
                       if at <= seq}
            living = {each.alarm: each.seq for each in found.living() if each.is_needed}
            for alarm, (at, is_open) in written.items():
                if is_open:
                    assert living[alarm] == at


def cuts_and_flips(data: bytes) -> Iterator[bytes]:
    for cut in range(0, len(data), 7):
        yield data[:cut]
        yield data[cut:]
        yield data[:cut] + b'\0' * 9 + data[cut:]


def test_a_file_in_any_state_can_be_opened_and_written_on() -> None:
    store = MemoryStore()
    kept = journal(store)
    kept.open()
    for seq in range(1, 5):
        kept.append(record(seq, f'alarm{seq}'), seq)
    for data in cuts_and_flips(store.read(NAME)):
        broken = MemoryStore()
        broken.write(NAME, data)
        again = journal(broken)
        before = [each.seq for each in again.open().records]
        again.append(record(9), 9)
        again.commit()
        assert [each.seq for each in read_journal(broken).records] == [*before, 9]
