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

"""Old imports lead to the new places, and say so."""

from __future__ import annotations

import importlib
from pathlib import Path
import subprocess
import sys

import pytest

from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.moved import MOVED
from rt_robot_os.schema import TopicSpec


def test_an_old_import_works_and_names_the_new_place() -> None:
    with pytest.warns(DeprecationWarning, match=r'is now rt_robot_os\.devices\.serial\.device\.'):
        from rt_robot_os.drivers.serial_device import SerialDevice as Old
    assert Old is SerialDevice


def test_a_name_that_has_another_name_now_is_the_same_thing() -> None:
    with pytest.warns(DeprecationWarning, match=r'is now rt_robot_os\.schema\.TopicSpec'):
        from rt_robot_os.drivers.device import Publication
    assert Publication is TopicSpec
    old = Publication('imu/data', 'sensor_msgs/msg/Imu', {'header.frame_id': 'imu'}, 16, 100.0)
    assert (old.topic, old.tail) == ('imu/data', None)


def test_a_name_that_never_was_there_is_no_attribute() -> None:
    with pytest.raises(ImportError, match='cannot import name'):
        from rt_robot_os.drivers.serial_device import Nobody  # noqa: F401


@pytest.mark.parametrize('place', sorted({place for places in MOVED.values() for place in places}))
def test_every_new_place_is_there(place: str) -> None:
    assert importlib.import_module(f'rt_robot_os.{place}')


def test_a_folder_that_an_update_left_behind_is_not_taken_for_the_module(tmp_path: Path) -> None:
    package = tmp_path / 'rt_robot_os'
    package.symlink_to(Path(__file__).parents[1] / 'rt_robot_os')
    code = ('import rt_robot_os, pathlib, sys; rt_robot_os.__path__.append(sys.argv[1]); '
            'from rt_robot_os.drivers.nmea import NmeaGps; print(NmeaGps.__module__)')
    (tmp_path / 'left' / 'drivers' / '__pycache__').mkdir(parents=True)
    done = subprocess.run([sys.executable, '-c', code, str(tmp_path / 'left')], cwd=tmp_path,
                          capture_output=True, text=True, check=False)
    assert done.stdout == 'rt_robot_os.devices.nmea.driver\n', done.stderr
