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

"""Files under names that others know, and what a user names as a file."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.devices.calibration import load as load_calibration
from rt_robot_os.devices.camera.camera_info import load_calibration as load_camera_info
from rt_robot_os.linux.folders import open_to_append
from rt_robot_os.linux.folders import read_file


def test_a_pipe_is_no_file_and_is_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / 'pipe.yaml'
    os.mkfifo(pipe)
    with pytest.raises(OSError, match='it is not a regular file'):
        read_file(pipe)
    with pytest.raises(ConfigError, match='pipe.yaml: it is not a regular file: use a file of '
                                          'camera_calib'):
        load_camera_info(str(pipe), 640, 480)
    with pytest.raises(OSError, match='it is not a regular file'):
        load_calibration(pipe, 'imu', ['acceleration'])


def test_a_file_has_its_bytes_up_to_a_limit(tmp_path: Path) -> None:
    path = tmp_path / 'file'
    path.write_bytes(b'12345')
    assert read_file(path, 5) == b'12345'
    with pytest.raises(OSError, match='longer than 4 bytes'):
        read_file(path, 4)
    with pytest.raises(OSError, match='it is not a regular file'):
        read_file(tmp_path)


def test_in_a_folder_of_all_others_lead_us_nowhere(tmp_path: Path) -> None:
    victim, log = tmp_path / 'victim', tmp_path / 'all' / 'robot.log'
    victim.write_text('mine')
    log.parent.mkdir()
    log.parent.chmod(0o1777)
    log.symlink_to(victim)
    with pytest.raises(OSError):
        open_to_append(log)
    log.unlink()
    os.link(victim, log)
    with pytest.raises(OSError, match='not a file of this user'):
        open_to_append(log)
    log.unlink()
    os.mkfifo(log)
    with pytest.raises(OSError):
        open_to_append(log)
    log.unlink()
    os.close(open_to_append(log))
    os.close(open_to_append(log))
    assert victim.read_text() == 'mine'


def test_in_a_folder_of_ones_own_a_link_is_followed(tmp_path: Path) -> None:
    log = tmp_path / 'robot.log'
    log.symlink_to(tmp_path / 'elsewhere.log')
    os.close(open_to_append(log))
    assert (tmp_path / 'elsewhere.log').exists()
