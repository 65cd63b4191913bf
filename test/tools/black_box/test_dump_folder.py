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


"""The folder of the dumps: names, order, and how many are kept."""

from __future__ import annotations

from datetime import datetime
from datetime import tzinfo
import os
from pathlib import Path
import tempfile

from black_box_stories import Story
from black_box_stories import TEXTS
from hypothesis import given
from hypothesis import settings
import pytest

from rt_robot_os.base.errors import BlackBoxError
from rt_robot_os.base.errors import StartError
from rt_robot_os.core.dumps.dump_parts import parts
from rt_robot_os.core.dumps.folder import keep
from rt_robot_os.tools.black_box import default_folder
from rt_robot_os.tools.black_box import dumps
from rt_robot_os.tools.black_box import file_name
from rt_robot_os.tools.black_box import newest
from rt_robot_os.tools.black_box import read_dump

MOMENT = datetime(2026, 3, 4, 5, 6, 7, 89_000)


def _keep(folder: Path, robot: str = 'robot', kept: int = 20) -> tuple[Path, list[Path]]:
    path, _, deleted = keep(parts(Story().dump()), folder, robot, 'a fault', kept)
    return path, deleted


def test_a_name_tells_robot_time_and_reason() -> None:
    assert file_name('arm.robot', "task 'imu': OSError: gone", MOMENT) == (
        'black_box_arm_robot_20260304_050607_089_task_imu_oserror_gone.rtbb.gz')


@settings(max_examples=60, deadline=None)
@given(TEXTS, TEXTS)
def test_any_reason_makes_a_name(robot: str, reason: str) -> None:
    name = file_name(robot, reason * 20, MOMENT)
    assert name.isascii() and '/' not in name and len(name) < 120


def test_the_folder_is_that_of_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('HOME', '/somewhere')
    for variable in ('ROS_LOG_DIR', 'ROS_HOME'):
        monkeypatch.delenv(variable, raising=False)
    assert default_folder() == Path('/somewhere/.ros/log')
    monkeypatch.setenv('ROS_HOME', '/other')
    assert default_folder() == Path('/other/log')
    monkeypatch.setenv('ROS_LOG_DIR', '/logs')
    assert default_folder() == Path('/logs')


def test_a_user_without_a_home_has_a_private_folder(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ('ROS_LOG_DIR', 'ROS_HOME', 'HOME'):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr(os.path, 'expanduser', lambda path: path)
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    private = tmp_path / f'rt_robot_os-{os.getuid()}'
    assert default_folder() == private / 'log'
    assert private.stat().st_mode & 0o777 == 0o700
    private.chmod(0o777)  # somebody was there first
    with pytest.raises(StartError, match='not a private folder of this user.*ROS_HOME'):
        default_folder()


def test_the_oldest_dumps_of_a_robot_give_way(tmp_path: Path) -> None:
    folder = tmp_path / 'made' / 'for it'
    other, _ = _keep(folder, 'robot_2')
    made, gone = [], []
    for number in range(5):
        path, deleted = _keep(folder, kept=3)
        os.utime(path, ns=(number, number))
        made.append(path)
        gone += deleted
    assert gone == made[:2]
    assert set(folder.iterdir()) == {other, *made[2:]}
    assert dumps(folder, 'robot') == made[2:]
    assert read_dump(made[-1]).dump.reason == 'a test'


def test_the_newest_is_that_written_last(tmp_path: Path) -> None:
    first, _ = _keep(tmp_path, 'z')
    second, _ = _keep(tmp_path, 'a')
    os.utime(first, ns=(1, 1))
    (tmp_path / 'other.log').write_text('')
    assert newest(tmp_path) == second


def test_an_empty_folder_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(BlackBoxError, match='holds no dump .* `black_box dump`'):
        newest(tmp_path)
    assert dumps(tmp_path / 'not there') == []


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    with pytest.raises(BlackBoxError, match='file/sub cannot be created.*core.black_box_folder'):
        _keep(tmp_path / 'file' / 'sub')


def test_two_dumps_in_one_millisecond_are_two_files(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Frozen(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> datetime:  # type: ignore[override]
            return MOMENT

    monkeypatch.setattr('rt_robot_os.core.dumps.folder.datetime', Frozen)
    assert len({_keep(tmp_path)[0] for _ in range(3)}) == 3
    assert len(dumps(tmp_path)) == 3
