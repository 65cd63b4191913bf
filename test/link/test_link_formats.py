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


"""Packets, records and paths of the link by themselves."""

from __future__ import annotations

import json
import os
from pathlib import Path
import stat

from hypothesis import given
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.base.errors import StartError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import TaskSpec
from rt_robot_os.kernel import TaskState
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.link.protocol import decode_json
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.protocol import parse_header
from rt_robot_os.link.protocol import VERSION
from rt_robot_os.link.task_records import decode_task
from rt_robot_os.link.task_records import encode_task
from rt_robot_os.linux.paths import robot_name
from rt_robot_os.linux.paths import runtime_folder
from rt_robot_os.linux.paths import socket_path

COUNTS = st.integers(0, (1 << 62) - 1)
DURATIONS = st.lists(st.integers(0, 1 << 44), max_size=50)


@given(st.text(max_size=40).filter(lambda t: t.isprintable()), st.integers(1, 99), COUNTS, COUNTS,
       COUNTS, DURATIONS, DURATIONS, DURATIONS)
def test_statistics_of_a_task_survive_the_link(
        name: str, priority: int, period_ns: int, runs: int, missed: int, latency: list[int],
        execution: list[int], jitter: list[int]) -> None:
    task = Task(TaskSpec(name, priority, period_ns), print, 0)
    task.runs, task.missed, task.releases = runs, missed, runs + missed
    task.coalesced, task.failures, task.gap_maximum_ns = missed // 2, runs // 3, runs
    task.blocked_maximum_ns = task.execution_total_ns = missed
    task.state = list(TaskState)[runs % 4]
    task.overruns = task.aborted = task.budget_exceeded = task.response_maximum_ns = runs
    task.deadline_missed = missed
    if missed:
        task.miss, task.suspects = (missed, runs, period_ns), ('imu', name)[:runs % 3]
    for histogram, durations in ((task.latency, latency), (task.execution, execution),
                                 (task.jitter, jitter)):
        for duration_ns in durations:
            histogram.add(duration_ns)
    assert decode_task(encode_task(task)) == task.statistics()
    assert decode_task(memoryview(b'head' + encode_task(task))[4:]) == task.statistics()


def test_statistics_of_a_task_that_ran_survive_the_link() -> None:
    kernel = Kernel(VirtualClock())
    task = kernel.add_task('task', lambda: kernel.clock.spend(task.runs % 900 * 1000), priority=5,
                           rate_hz=997.0)
    kernel.add_task('other', lambda: kernel.clock.spend(1_300_000), priority=50, rate_hz=300.0)
    kernel.run(3_000_000_000)
    assert task.runs > 1000 and task.missed > 0
    assert decode_task(encode_task(task)) == task.statistics()
    assert len(encode_task(task)) < 3 * 320 * 8 + 200


@given(st.sampled_from(PacketKind), st.integers(0, 65535), st.integers(0, 1 << 40),
       st.integers(-(1 << 63), (1 << 63) - 1), st.integers(0, (1 << 64) - 1))
def test_a_header_survives_the_link(
        kind: PacketKind, channel: int, missed: int, stamp_ns: int, seq: int) -> None:
    packet = header(kind, channel, missed, stamp_ns, seq)
    assert len(packet) == HEADER_BYTES == 24
    assert parse_header(packet) == (kind, VERSION, channel, missed % (1 << 32), stamp_ns, seq)


@given(st.binary(max_size=60))
def test_any_bytes_are_a_header_or_refused(packet: bytes) -> None:
    try:
        parsed = parse_header(packet)
    except LinkError:
        assert len(packet) < HEADER_BYTES or packet[1] != VERSION
    else:
        assert parsed.kind == packet[0]


JSON = st.recursive(st.none() | st.booleans() | st.integers() | st.text(),
                    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
                    max_leaves=8)


@given(st.dictionaries(st.text(), JSON))
def test_content_survives_the_link(content: dict[str, object]) -> None:
    assert decode_json(encode_json(PacketKind.REPLY, content, seq=3)) == content


@given(st.binary(max_size=60))
def test_any_bytes_are_an_object_or_refused(body: bytes) -> None:
    try:
        content = decode_json(header(PacketKind.REQUEST) + body)
    except LinkError:
        return
    assert content == json.loads(body)


def test_an_answer_says_whether_more_follows() -> None:
    assert parse_header(encode_json(PacketKind.REPLY, {}, more=True)).channel == 1
    assert parse_header(encode_json(PacketKind.REPLY, {})).channel == 0


# ---- paths -----------------------------------------------------------------------------------

@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv('RT_ROBOT_OS_RUNTIME_DIR', str(tmp_path / 'run'))
    return tmp_path / 'run'


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_the_runtime_folder_is_made_for_its_user_alone(folder: Path) -> None:
    assert runtime_folder() == folder
    assert mode(folder) == 0o700
    assert socket_path('a') == folder / 'a.sock'


def test_a_folder_that_others_could_enter_is_closed_to_them(folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o755)
    assert runtime_folder() == folder
    assert mode(folder) == 0o700


def test_a_session_folder_comes_before_that_for_temporary_files(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv('RT_ROBOT_OS_RUNTIME_DIR', raising=False)
    monkeypatch.setenv('XDG_RUNTIME_DIR', str(tmp_path))
    assert runtime_folder() == tmp_path / 'rt_robot_os'
    monkeypatch.setenv('XDG_RUNTIME_DIR', str(tmp_path / 'none'))
    monkeypatch.setattr('tempfile.tempdir', str(tmp_path))
    assert runtime_folder() == tmp_path / f'rt_robot_os-{os.getuid()}'


def test_a_link_or_file_in_the_place_of_the_folder_is_refused(
        folder: Path, tmp_path: Path) -> None:
    folder.symlink_to(tmp_path)
    with pytest.raises(StartError, match='not a folder of this user; remove it, or set RT_ROBOT'):
        runtime_folder()
    folder.unlink()
    folder.write_text('')
    with pytest.raises(StartError, match='set RT_ROBOT_OS_RUNTIME_DIR'):
        runtime_folder()


def test_a_folder_of_another_user_is_refused(folder: Path) -> None:
    if os.getuid() != 0:
        pytest.skip('not root: cannot give a folder away')
    folder.mkdir()
    os.chown(folder, 65534, 65534)
    with pytest.raises(StartError, match='not a folder of this user'):
        runtime_folder()


@pytest.mark.parametrize(('node', 'namespace', 'name'), [
    ('robot', '/', 'robot'), ('arm', '/left', 'left.arm'), ('arm', '/a/b/', 'a.b.arm')])
def test_robots_of_other_names_have_other_files(node: str, namespace: str, name: str) -> None:
    assert robot_name(node, namespace) == name
