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

"""Files of alarms: whole or not there, once, and nobody reaches another one's."""

from __future__ import annotations

import hashlib
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.monitor.media_store import FileRefused
from rt_robot_os.monitor.media_store import JPEG
from rt_robot_os.monitor.media_store import MediaStore
from rt_robot_os.monitor.media_store import Offered
from rt_robot_os.monitor.media_store import type_of

PART = 64 << 10


def picture(size: int = 200_000, fill: bytes = b'x') -> bytes:
    return b'\xff\xd8\xff\xe0' + fill * (size - 4)


def offered(content: bytes) -> Offered:
    return Offered(hashlib.sha256(content).hexdigest(), len(content))


def send(store: MediaStore, content: bytes, robot: str = 'r1', parts: int = 1000) -> int:
    offset = store.begin(robot, offered(content))
    while offset < len(content) and parts > 0:
        offset = store.add(robot, offered(content), offset, content[offset:offset + PART])
        parts -= 1
    return offset


def test_a_file_goes_on_where_it_was_after_any_break(tmp_path: Path) -> None:
    content = picture()
    assert send(MediaStore(tmp_path, 10.0), content, parts=2) == 2 * PART
    store = MediaStore(tmp_path, 10.0)  # the server was started again
    found = offered(content)
    assert store.find('r1', found.sha256) is None
    assert store.begin('r1', found) == 2 * PART
    assert send(store, content) == len(content)
    path, kind = store.find('r1', found.sha256) or (Path(), '')
    assert (path.read_bytes(), kind) == (content, JPEG)
    assert (path.stat().st_mode & 0o777, path.parent.stat().st_mode & 0o777) == (0o600, 0o700)


def test_a_file_that_is_sent_twice_is_kept_once(tmp_path: Path) -> None:
    store, content = MediaStore(tmp_path, 10.0), picture()
    send(store, content)
    assert store.begin('r1', offered(content)) == len(content)
    assert store.add('r1', offered(content), 0, content[:PART]) == len(content)
    assert store.counts().files == 1
    assert MediaStore(tmp_path, 10.0).begin('r1', offered(content)) == len(content)


def test_a_part_that_comes_again_or_early_is_passed_over(tmp_path: Path) -> None:
    store, content = MediaStore(tmp_path, 10.0), picture()
    found = offered(content)
    assert store.add('r1', found, 0, content[:PART]) == PART
    assert store.add('r1', found, 0, content[:PART]) == PART
    assert store.add('r1', found, 2 * PART, content[2 * PART:3 * PART]) == PART


def test_a_file_with_another_hash_is_not_kept_and_may_come_again(tmp_path: Path) -> None:
    store, content = MediaStore(tmp_path, 10.0), picture()
    damaged = content[:-1] + b'y'
    promised = offered(content)
    for offset in range(0, len(damaged), PART):
        if offset + PART < len(damaged):
            store.add('r1', promised, offset, damaged[offset:offset + PART])
    with pytest.raises(FileRefused, match='SHA-256') as refused:
        store.add('r1', promised, offset, damaged[offset:])
    assert refused.value.retry_s > 0
    assert store.find('r1', promised.sha256) is None
    assert store.begin('r1', promised) == 0
    assert send(store, content) == len(content)


def test_nothing_but_pictures_clips_and_sound_is_kept(tmp_path: Path) -> None:
    store, page = MediaStore(tmp_path, 10.0), b'<html><script>alert(1)</script></html>'
    with pytest.raises(FileRefused, match='neither JPEG'):
        send(store, page)
    assert list(tmp_path.rglob('*.part')) == []


def test_no_robot_reaches_a_file_of_another_by_its_hash_or_a_path(tmp_path: Path) -> None:
    store, content = MediaStore(tmp_path / 'media', 10.0), picture()
    send(store, content)
    assert store.find('r2', offered(content).sha256) is None
    assert store.begin('r2', offered(content)) == 0
    for odd in ('../r1', '..', '/etc', 'a/b', '', 'x' * 500):
        assert store.find(odd, offered(content).sha256) is None
        send(store, content, robot=odd)
    for odd in ('../../etc/passwd', 'A' * 64, '0' * 63, ''):
        assert store.find('r1', odd) is None
        with pytest.raises(FileRefused):
            store.begin('r1', Offered(odd, 5))
    outside = [path for path in tmp_path.rglob('*') if path.is_file()
               and path.parent.parent != tmp_path / 'media']
    assert outside == []


def test_a_full_folder_takes_room_from_the_robot_that_has_the_most(tmp_path: Path) -> None:
    store = MediaStore(tmp_path, 1.0)
    modest = picture(100_000, b'm')
    send(store, modest, 'modest')
    many = [picture(200_000, bytes([65 + n])) for n in range(8)]
    for each in many:
        send(store, each, 'greedy')
    assert store.counts().bytes <= 1_000_000
    assert store.counts().made_room == 4
    assert store.has('modest', offered(modest).sha256)
    assert [store.has('greedy', offered(each).sha256) for each in many] == 4 * [False] + 4 * [True]


def test_what_is_too_old_goes(tmp_path: Path) -> None:
    store, content = MediaStore(tmp_path, 10.0, keep_days=2.0), picture()
    send(store, content)
    assert store.expire() == 0
    moment = (store.find('r1', offered(content).sha256) or (Path(), ''))[0].stat().st_mtime
    assert store.expire(moment + 3 * 86400) == 1
    assert store.find('r1', offered(content).sha256) is None


def test_a_robot_begins_no_end_of_files_and_ends_none(tmp_path: Path) -> None:
    store = MediaStore(tmp_path, 10.0)
    for n in range(20):
        send(store, picture(fill=bytes([65 + n])), parts=1)
    assert len(list(tmp_path.rglob('*.part'))) <= 4


def test_too_much_is_refused_before_it_is_sent(tmp_path: Path) -> None:
    store = MediaStore(tmp_path, 1.0)
    with pytest.raises(FileRefused, match='media_mb'):
        store.begin('r1', Offered('0' * 64, 2_000_000))
    with pytest.raises(FileRefused):
        store.begin('r1', Offered('0' * 64, 1 << 40))
    with pytest.raises(FileRefused):
        store.begin('r1', Offered('0' * 64, 0))


@given(st.binary(max_size=40))
def test_only_three_kinds_of_files_have_a_type(head: bytes) -> None:
    assert type_of(head) in ('', 'image/jpeg', 'video/x-msvideo', 'audio/wav')
    assert not type_of(head) or head[:3] == b'\xff\xd8\xff' or head[:4] == b'RIFF'
