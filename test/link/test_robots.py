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

"""One robot of a name on a machine, and who holds it."""

from __future__ import annotations

import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any

import pytest
from rt_robot_os.base.errors import StartError
from rt_robot_os.core.placement import choose_cpu
from rt_robot_os.core.placement import least_used
from rt_robot_os.link.robots import core_lock_path
from rt_robot_os.link.robots import lock_core
from rt_robot_os.link.robots import lock_robot
from rt_robot_os.link.robots import others_than
from rt_robot_os.link.robots import remove_dead_lock
from rt_robot_os.link.robots import remove_leftovers
from rt_robot_os.link.robots import running_cores
from rt_robot_os.linux.lock_file import holder
from rt_robot_os.linux.lock_file import LockFile
from rt_robot_os.linux.paths import node_of
from rt_robot_os.linux.paths import robot_of
from rt_robot_os.linux.paths import runtime_folder
from rt_robot_os.linux.paths import socket_path

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv('RT_ROBOT_OS_RUNTIME_DIR', str(tmp_path / 'r'))
    return runtime_folder()


def in_another_process(code: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, '-c', f'from rt_robot_os.link.robots import *; {code}'], text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT)


HOLD = 'lock = lock_robot("robot"); print("held", flush=True); input()'


def test_the_second_of_a_name_is_told_who_holds_it() -> None:
    first = in_another_process(HOLD)
    assert first.stdout is not None and first.stdout.readline() == 'held\n'
    with pytest.raises(StartError, match=rf'/robot already runs on .* \(pid {first.pid}, '
                       r'since \d{4}-.*stop it, or give this robot another name.*__node:=other'):
        lock_robot('robot')
    lock_robot('other').release()
    first.communicate('\n', timeout=60)
    lock_robot('robot').release()


def test_a_kill_frees_the_name() -> None:
    first = in_another_process(HOLD)
    assert first.stdout is not None and first.stdout.readline() == 'held\n'
    first.send_signal(signal.SIGKILL)
    first.communicate(timeout=60)
    lock_robot('robot').release()


def test_nothing_is_left_of_a_lock_that_was_released(folder: Path) -> None:
    lock = lock_robot('robot')
    assert [path.name for path in folder.iterdir()] == ['robot.lock']
    lock.release()
    lock.release()
    assert list(folder.iterdir()) == []


def test_a_child_that_was_forked_does_not_hold_it(folder: Path) -> None:
    lock = LockFile(folder / 'x')
    assert lock.acquire()
    child = os.fork()
    if not child:
        signal.pause()
    try:
        os.close(lock._fd)  # as when this process is killed
        lock._fd = -1
        assert LockFile(folder / 'x').acquire()
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def test_a_core_is_waited_for_when_its_node_is_dead(monkeypatch: pytest.MonkeyPatch) -> None:
    path = socket_path()
    there = lock_core(path, parent=1 << 30)  # nobody's parent
    monkeypatch.setattr('rt_robot_os.link.robots.time.sleep', lambda _: there.release())
    lock_core(path).release()


def test_a_core_that_lives_is_not_waited_for() -> None:
    path = socket_path()
    there = lock_core(path, parent=os.getppid())
    with pytest.raises(StartError, match=r'core robot already runs on .* \(pid .*spawn:=false'):
        lock_core(path)
    there.release()


def test_a_socket_that_is_served_is_not_removed() -> None:
    path = socket_path()
    path.touch()
    there = lock_core(path)
    remove_leftovers(path)
    assert path.exists()
    there.release()
    remove_leftovers(path)
    assert not path.exists() and not core_lock_path(path).exists()


def test_what_a_killed_node_leaves_goes_with_its_core(folder: Path) -> None:
    (folder / 'robot.lock').write_text('{}')
    remove_dead_lock(socket_path())
    assert list(folder.iterdir()) == []
    there = lock_robot('robot')
    remove_dead_lock(socket_path())
    assert there.path.exists()
    there.release()


def test_a_lock_that_says_nothing_is_held_all_the_same(folder: Path) -> None:
    lock = LockFile(folder / 'x-core.lock')
    assert holder(lock.path) is None
    assert lock.acquire()
    assert holder(lock.path) == {}
    lock.path.write_text('[')
    assert dict(running_cores()) == {'x': {}}
    lock.release()


def test_robots_spread_over_the_cpus(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('os.sched_getaffinity', lambda _: {0, 1, 2})
    locks = [lock_core(socket_path(name)) for name in 'abcd']
    assert [choose_cpu(-1, lock) for lock in locks] == [2, 1, 0, 2]
    locks[1].release()
    assert choose_cpu(-1, lock_core(socket_path('e'))) == 1
    assert choose_cpu(0, locks[0]) == 0
    assert choose_cpu(-2, locks[0]) == -2


@pytest.mark.parametrize(('taken', 'cpu'), [([], 5), ([5], 4), ([5, 4, 3], 5), ([9, 9], 5)])
def test_the_least_used_cpu(taken: list[int], cpu: int) -> None:
    assert least_used({3, 4, 5}, taken) == cpu


@pytest.mark.parametrize('text', ['/arm/robot', 'arm/robot', 'arm.robot', '/arm/robot/'])
def test_a_robot_may_be_written_as_its_node_or_its_files(text: str) -> None:
    assert robot_of(text) == 'arm.robot'
    assert node_of('arm.robot') == '/arm/robot'


def test_a_path_too_long_for_a_socket_is_refused_with_the_remedy() -> None:
    with pytest.raises(StartError, match='has .* bytes, and Linux allows 107: set RT_ROBOT_OS_RUNT'
                       '.*or give the robot a shorter name'):
        socket_path('a' * 100)


@pytest.mark.parametrize(('mode', 'problem'), [
    (0o777, 'is not private: .* can be written by other users'), (0o1777, ''), (0o755, '')])
def test_folders_above_are_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: int,
                                     problem: str) -> None:
    above = tmp_path / 'above'
    above.mkdir()
    above.chmod(mode)
    monkeypatch.setenv('RT_ROBOT_OS_RUNTIME_DIR', str(above / 'run'))
    if problem:
        with pytest.raises(StartError, match=problem):
            runtime_folder()
    else:
        assert runtime_folder() == above / 'run'


def test_a_link_of_another_user_on_the_way_is_refused(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if os.getuid() != 0:
        pytest.skip('not root: cannot give a link away')
    (tmp_path / 'mine').mkdir()
    (tmp_path / 'link').symlink_to(tmp_path / 'mine')
    os.lchown(tmp_path / 'link', 65534, 65534)
    monkeypatch.setenv('RT_ROBOT_OS_RUNTIME_DIR', str(tmp_path / 'link' / 'run'))
    with pytest.raises(StartError, match='link belongs to another user'):
        runtime_folder()


def test_a_folder_that_others_can_write_is_refused_and_stays_as_it_is(folder: Path) -> None:
    folder.chmod(0o1777)
    with pytest.raises(StartError, match='can be written by other users'):
        runtime_folder()
    assert folder.stat().st_mode & 0o7777 == 0o1777


def test_a_home_is_not_closed_to_others(folder: Path, monkeypatch: Any) -> None:
    folder.chmod(0o755)
    monkeypatch.setenv('HOME', str(folder))
    assert runtime_folder() == folder
    assert folder.stat().st_mode & 0o777 == 0o755


def test_a_core_that_runs_and_does_not_answer_is_not_taken_for_none() -> None:
    assert 'No robot of this user runs on this machine' in others_than('robot')
    core = lock_core(socket_path('robot'), parent=os.getppid())
    try:
        told = others_than('robot')
        assert f'Its core runs (pid {os.getpid()},' in told and 'does not answer' in told
        assert others_than('arm.robot') == ' Running robots: --robot /robot'
    finally:
        core.release()
