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


"""Dumps in files: what is written is read, and nothing else is taken for a dump."""

from __future__ import annotations

from dataclasses import replace
import errno
import gzip
import json
import os
from pathlib import Path
from typing import Any

from black_box_stories import stories
from black_box_stories import Story
from black_box_stories import TEXTS
from hypothesis import given
from hypothesis import HealthCheck
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import BlackBoxError
from rt_robot_os.core.dumps.dump_parts import KINDS
from rt_robot_os.core.dumps.dump_parts import parts
from rt_robot_os.kernel import black_box
from rt_robot_os.kernel import BlackBoxDump
from rt_robot_os.tools.black_box import join
from rt_robot_os.tools.black_box import read_dump
from rt_robot_os.tools.black_box import understand
from rt_robot_os.tools.black_box import write_parts

FUNCTION = HealthCheck.function_scoped_fixture


def _example() -> BlackBoxDump:
    story = Story()
    story.job(1, [3, [1, [2]], 5, 8])
    story.job(3, [7, 9])
    return story.dump()


def _lines(path: Path) -> list[dict[str, Any]]:
    with gzip.open(path) as stream:
        return [json.loads(line) for line in stream]


def _rewrite(path: Path, lines: list[Any]) -> None:
    with gzip.open(path, 'wb') as stream:
        stream.writelines(json.dumps(line).encode() + b'\n' for line in lines)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    made = tmp_path / 'dump.rtbb.gz'
    write_parts(parts(_example(), {'robot': 'arm', 'pid': 7}), made)
    return made


@settings(max_examples=60, deadline=None, suppress_health_check=[FUNCTION])
@given(stories(), TEXTS, st.dictionaries(TEXTS, TEXTS | st.integers(0, 9), max_size=3))
def test_what_is_written_is_read(tmp_path: Path, story: Story, reason: str,
                                 facts: dict[str, str | int]) -> None:
    path = tmp_path / 'dump.rtbb.gz'
    dump = replace(story.dump(), reason=reason)
    assert write_parts(parts(dump, facts), path) == path.stat().st_size
    found = read_dump(path)
    assert found.dump == dump
    assert found.facts == facts


def test_the_kinds_have_the_numbers_of_the_kernel() -> None:
    assert [getattr(black_box, kind.upper()) for kind in KINDS] == list(range(len(KINDS)))


def test_parts_need_no_file() -> None:
    dump = _example()
    assert join(parts(dump)) == dump
    assert join(json.loads(json.dumps(list(parts(dump))))) == dump


def test_a_file_cut_anywhere_is_refused(path: Path) -> None:
    whole = path.read_bytes()
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        with pytest.raises(BlackBoxError, match='dump.rtbb.gz'):
            read_dump(path)


def test_lines_that_are_missing_are_noticed(path: Path) -> None:
    lines = _lines(path)
    for gone in range(len(lines)):
        if 'running' not in lines[gone]:  # none ran: nothing is lost with it
            _rewrite(path, lines[:gone] + lines[gone + 1:])
            with pytest.raises(BlackBoxError):
                read_dump(path)


@settings(max_examples=60, deadline=None, suppress_health_check=[FUNCTION])
@given(st.data())
def test_a_changed_byte_is_noticed_or_changes_nothing(path: Path, tmp_path: Path,
                                                      data: st.DataObject) -> None:
    whole = bytearray(path.read_bytes())
    whole[data.draw(st.integers(0, len(whole) - 1))] ^= data.draw(st.integers(1, 255))
    changed = tmp_path / 'changed'
    changed.write_bytes(whole)
    try:
        assert read_dump(changed).dump == _example()
    except BlackBoxError as error:
        assert 'changed' in str(error)


JSON = st.recursive(st.none() | st.booleans() | st.integers() | st.floats() | TEXTS,
                    lambda inner: st.lists(inner, max_size=3)
                    | st.dictionaries(TEXTS, inner, max_size=3), max_leaves=5)


@settings(max_examples=100, deadline=None, suppress_health_check=[FUNCTION])
@given(st.integers(0, 3), st.sampled_from(
    ('format', 'version', 'reason', 'at_ns', 'facts', 'kinds', 'tasks', 'running', 'records',
     'end', 'full')), JSON)
def test_nonsense_in_a_line_gives_a_clear_error_or_a_dump_that_can_be_shown(
    path: Path, number: int, key: str, value: Any,
) -> None:
    write_parts(parts(_example()), path)
    lines = _lines(path)
    lines[number][key] = value
    _rewrite(path, lines)
    try:
        found = read_dump(path)
    except BlackBoxError as error:
        assert str(path) in str(error)
    else:
        understand(found.dump, found.kinds)


def test_the_error_names_file_line_and_value(path: Path) -> None:
    lines = _lines(path)
    lines[3]['records'][1] = [0, 99, 1, 2, 3, 0]
    _rewrite(path, lines)
    with pytest.raises(BlackBoxError, match=r'dump\.rtbb\.gz, line 4: .*\[0, 99, 1, 2, 3, 0\]'):
        read_dump(path)


def test_another_version_is_refused_with_the_remedy(path: Path) -> None:
    lines = _lines(path)
    lines[0]['version'] = 2
    _rewrite(path, lines)
    with pytest.raises(BlackBoxError, match='version 2 .* reads version 1; use the release'):
        read_dump(path)


@pytest.mark.parametrize('content', [b'', b'no dump'])
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / 'other'
    path.write_bytes(content)
    with pytest.raises(BlackBoxError, match='other'):
        read_dump(path)


@pytest.mark.parametrize('content', [b'', b'{}\n', b'\xff\n', b'[' * 9999 + b'\n',
                                     b'{"format": "another"}\n'])
def test_other_compressed_files_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / 'other'
    path.write_bytes(gzip.compress(content))
    with pytest.raises(BlackBoxError, match='other'):
        read_dump(path)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(BlackBoxError, match='missing cannot be read: No such file'):
        read_dump(tmp_path / 'missing')


def test_a_line_without_end_does_not_fill_the_memory(tmp_path: Path) -> None:
    path = tmp_path / 'bomb'
    path.write_bytes(gzip.compress(b' ' * (3 << 20), 1))
    with pytest.raises(BlackBoxError, match='not a dump of a black box'):
        read_dump(path)


def test_kinds_of_a_later_release_are_named_and_counted(path: Path) -> None:
    lines = _lines(path)
    lines[0]['kinds'].append('migration')
    lines[3]['records'] += [[9, 0, 17, 'cpu3'], [9, 1, 18, None], [10, 5]]
    lines[-1]['end'] += 3
    _rewrite(path, lines)
    found = read_dump(path)
    history = understand(found.dump, found.kinds)
    assert history.unknown == {'migration': 2, 'kind 10': 1}
    assert history.jobs == understand(_example()).jobs


def test_a_full_disk_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch
                                           ) -> None:
    def full(fd: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, 'fsync', full)
    with pytest.raises(BlackBoxError, match='No space left .*free space on the disk'):
        write_parts(parts(_example()), tmp_path / 'dump.rtbb.gz')
    assert list(tmp_path.iterdir()) == []


def test_parts_that_break_off_leave_the_file_before(path: Path) -> None:
    def broken() -> Any:
        yield from list(parts(_example()))[:2]
        raise BlackBoxError('cut')

    before = path.read_bytes()
    with pytest.raises(BlackBoxError):
        write_parts(broken(), path)
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]
