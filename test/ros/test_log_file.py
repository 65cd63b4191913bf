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


"""The file of the log is bounded, tells what it lacks, and holds up nobody."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import time

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from rt_robot_os.ros.log_file import line_of  # noqa: E402, I100
from rt_robot_os.ros.log_file import LogFile  # noqa: E402


def wait_for(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def test_a_line_has_time_severity_source_and_text() -> None:
    line = line_of(1_700_000_000_123_456_789, 'WARN', 'imu', 'silent\nfor long\n')
    at, severity, rest = line.split(' ', 2)
    assert at[19:23] == '.123' and severity == 'WARN'
    assert rest == 'imu: silent\n    for long\n'


@pytest.mark.parametrize('files', [1, 3])
def test_files_are_rotated_and_their_number_and_size_is_bounded(
        tmp_path: Path, files: int) -> None:
    told: list[str] = []
    log = LogFile(tmp_path / 'sub' / 'r.log', 100, files, told.append)
    for number in range(50):
        log.write(f'line number {number:3}\n')  # 16 bytes: six in a file
    log.close()
    log.close()
    assert log.written == 50 and log.lost == 0 and told == []
    there = sorted(path.name for path in (tmp_path / 'sub').iterdir())
    assert there == ['r.log', 'r.log.1', 'r.log.2'][:files]
    assert all(path.stat().st_size <= 100 for path in (tmp_path / 'sub').iterdir())
    text = ''.join((tmp_path / 'sub' / name).read_text() for name in reversed(there))
    numbers = [int(line.split()[-1]) for line in text.splitlines()]
    assert numbers == list(range(50 - len(numbers), 50))


def test_a_file_that_is_there_is_continued(tmp_path: Path) -> None:
    path = tmp_path / 'r.log'
    path.write_text('before\n')
    log = LogFile(path, 1000, 2, print)
    log.write('after\n')
    log.close()
    assert path.read_text() == 'before\nafter\n'


def test_lines_that_the_disk_does_not_take_are_counted_told_once_and_named_later(
        tmp_path: Path) -> None:
    path = tmp_path / 'r.log'
    path.symlink_to('/dev/full')
    told: list[str] = []
    log = LogFile(path, 1000, 2, told.append, retry_s=0.0)
    for number in range(5):
        log.write(f'{number}\n')
    wait_for(lambda: log.lost == 5)
    assert len(told) == 1 and 'No space left' in told[0] and 'log.folder' in told[0]
    path.unlink()
    log.write('again\n')
    log.close()
    assert path.read_text() == '... 5 lines are missing: the disk failed\nagain\n'
    assert log.written == 1 and log.lost == 5
    assert len(told) == 2 and '5 lines were lost' in told[1]


def test_a_disk_that_hangs_holds_up_nobody(tmp_path: Path) -> None:
    path = tmp_path / 'r.log'
    os.mkfifo(path)  # opening it waits for a reader
    log = LogFile(path, 1000, 2, print)
    for _ in range(5000):
        log.write('x\n')
    assert log.lost >= 5000 - 4096 - 1
    with open(path) as reader:  # the disk is back
        wait_for(lambda: log.written + log.lost == 5000)
        log.close()
        assert 'they came too fast' in reader.read()
