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

"""The paths of simulated devices, after a simulator was killed and beside another one."""

from __future__ import annotations

from pathlib import Path

import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.linux.lock_file import LockFile
from rt_robot_os.sim.paths import hold_paths
from rt_robot_os.sim.paths import release


def test_a_path_is_served_by_one_simulator(tmp_path: Path) -> None:
    held = hold_paths(tmp_path, ['imu', 'gps'])
    with pytest.raises(DeviceError, match=r'gps is simulated by another process \(pid \d+\)'):
        hold_paths(tmp_path, ['laser', 'gps'])
    laser = hold_paths(tmp_path, ['laser'])
    release(laser)
    release(held)
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_simulator_left_goes_with_the_next_start(tmp_path: Path) -> None:
    (tmp_path / 'imu').symlink_to('/dev/pts/0')  # by now perhaps somebody's terminal
    (tmp_path / '.imu.lock').touch()
    (tmp_path / 'mine').symlink_to('/dev/null')
    lives = LockFile(tmp_path / '.gps.lock')
    assert lives.acquire()
    (tmp_path / 'gps').symlink_to('/dev/null')
    release(hold_paths(tmp_path, ['laser']))
    lives.release()
    assert sorted(path.name for path in tmp_path.iterdir()) == ['gps', 'mine']


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / 'file').touch()
    with pytest.raises(DeviceError, match='cannot be used .*choose another folder'):
        hold_paths(tmp_path / 'file' / 'x', ['imu'])
