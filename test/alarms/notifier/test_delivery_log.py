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

"""What is remembered of notifications: none is told twice, none is forgotten, whatever is cut."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import StartError
from rt_robot_os.features.alarms.notifier.delivery_log import DeliveryLog
from rt_robot_os.features.alarms.notifier.delivery_log import DeliveryStatus
from rt_robot_os.features.alarms.notifier.delivery_log_file import DeliveryLogFile
from rt_robot_os.features.alarms.notifier.delivery_log_file import LINES_SPARE
from rt_robot_os.messages.notification import DeliveryReport

KEYS = st.text('7.öx"', min_size=1, max_size=6)


def test_a_notification_is_told_once_and_its_report_is_known() -> None:
    log = DeliveryLog()
    assert log.start('7.1') is DeliveryStatus.NEW
    assert log.start('7.1') is DeliveryStatus.RUNNING
    log.finish(DeliveryReport('7.1', 'operator', True, 'told'))
    assert log.start('7.1') is DeliveryStatus.DONE
    assert log.report('7.1') == DeliveryReport('7.1', 'operator', True, 'told')
    assert log.report('7.2') is None


@given(st.lists(st.tuples(KEYS, st.sampled_from((None, True, False))), max_size=12),
       st.integers(0, 2000))
def test_after_a_cut_anywhere_it_knows_what_was_kept_before(
        rows: list[tuple[str, bool | None]], cut: int) -> None:
    first = DeliveryLog()
    lines = []
    for key, ok in rows:
        first.start(key)
        lines.append(first.start_line(key, 'operator') if ok is None else
                     first.finish(DeliveryReport(key, 'operator', ok, 'why')))
    text = ''.join(lines)[:cut]
    kept = text.count('\n')
    second = DeliveryLog()
    second.restore(text.splitlines())
    last = dict(rows[:kept])
    whole = text.endswith('\n') or not text
    for key, ok in last.items():
        if whole or key != rows[kept][0]:
            wanted = DeliveryStatus.AGAIN if ok is None else DeliveryStatus.DONE
            assert second.start(key) is wanted
            assert ok is None or second.report(key) == DeliveryReport(key, 'operator', ok, 'why')
    third = DeliveryLog()
    third.restore(DeliveryLog.lines(first))
    assert all(third.report(key) == first.report(key) for key, _ in rows)


@given(st.lists(st.text(max_size=20) | st.sampled_from((
    '{"key": 7}', '{"key": "a", "ok": 1}', '[]', '{"key": "a", "ok": true}')), max_size=5))
def test_any_lines_are_read(lines: list[str]) -> None:
    DeliveryLog().restore(lines)


def test_the_oldest_are_forgotten_first() -> None:
    log = DeliveryLog(remembered=3)
    for number in range(5):
        log.start(str(number))
        log.finish(DeliveryReport(str(number), '', True))
    assert [each.key for each in log.recent(9)] == ['2', '3', '4']
    assert [each.key for each in log.recent(2)] == ['3', '4']


# ---- its file --------------------------------------------------------------------------------

def test_what_was_cut_does_not_take_the_next_line_with_it(tmp_path: Path) -> None:
    path = tmp_path / 'memory' / 'deliveries.jsonl'
    store = DeliveryLogFile(path)
    assert store.keep('one\n')
    store.close()
    assert path.stat().st_mode & 0o777 == 0o600 and path.parent.stat().st_mode & 0o077 == 0
    with path.open('ab') as file:
        file.write(b'tw')
    store = DeliveryLogFile(path)
    assert store.read() == ['one', 'tw'] and store.keep('three\n')
    store.close()
    assert path.read_text() == 'one\ntw\nthree\n'


def test_a_full_disk_is_told_and_leaves_no_half_line(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / 'deliveries.jsonl'
    store = DeliveryLogFile(path)
    store.keep('one\n')
    real = os.write

    def full(fd: int, data: bytes) -> int:
        real(fd, data[:2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    for write in (full, lambda fd, data: real(fd, data[:2])):
        monkeypatch.setattr(os, 'write', write)
        assert not store.keep('two\n')
        assert 'No space left on device' in store.problem
        assert path.read_text() == 'one\n'
    monkeypatch.setattr(os, 'write', real)
    assert store.keep('two\n') and (store.problem, store.failed) == ('', 2)
    store.close()
    assert not store.keep('three\n')


def test_a_file_that_has_grown_is_rewritten_or_stays_unmodified(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / 'deliveries.jsonl'
    path.write_text('x\n' * (LINES_SPARE + 3))
    store = DeliveryLogFile(path)
    store.read()
    assert store.is_long(2) and not store.is_long(3)

    def broken(*_: Any) -> None:
        raise OSError(errno.EIO, 'broken')

    with monkeypatch.context() as patch:
        patch.setattr(os, 'replace', broken)
        store.rewrite(['a\n'])
    assert 'cannot be rewritten' in store.problem and store.is_long(2)
    assert os.listdir(tmp_path) == ['deliveries.jsonl']
    store.rewrite(['a\n', 'b\n'])
    assert store.keep('c\n') and path.read_text() == 'a\nb\nc\n'
    store.close()


def test_a_folder_that_cannot_be_used_is_told(tmp_path: Path) -> None:
    (tmp_path / 'file').touch()
    with pytest.raises(StartError, match='cannot be written: .*set folder'):
        DeliveryLogFile(tmp_path / 'file' / 'deliveries.jsonl')
