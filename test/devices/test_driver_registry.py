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


"""Are drivers found by name, also of other packages, and does a broken one harm no other."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.errors import ConfigError


@pytest.fixture
def other_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install a package that adds a good driver and several bad ones."""
    (tmp_path / 'their_drivers.py').write_text(
        'from rt_robot_os.devices.nmea.driver import NmeaGps\n'
        'class Lidar(NmeaGps):\n    pass\n'
        'not_a_class = 3\n'
        'class NotADevice:\n    pass\n')
    (tmp_path / 'their_broken.py').write_text('1 / 0\n')
    info = tmp_path / 'their_drivers-1.0.dist-info'
    info.mkdir()
    (info / 'METADATA').write_text('Metadata-Version: 2.1\nName: their-drivers\nVersion: 1.0\n')
    (info / 'entry_points.txt').write_text(
        '[rt_robot_os.drivers]\n'
        'lidar = their_drivers:Lidar [extra]\n'
        'raises = their_broken:X\n'
        'missing = their_missing:X\n'
        'nothing = their_drivers:Nothing\n'
        'number = their_drivers:not_a_class\n'
        'other = their_drivers:NotADevice\n'
        'nmea = their_drivers:Lidar\n')
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()


def test_the_drivers_of_this_package() -> None:
    assert {'witmotion', 'nmea'} <= set(DRIVERS.names())
    assert DRIVERS.load('witmotion').__name__ == 'WitMotion'
    assert DRIVERS.load('nmea').__name__ == 'NmeaGps'
    assert DRIVERS.problems() == ()


def test_an_unknown_name_lists_what_exists() -> None:
    with pytest.raises(ConfigError, match="no driver 'witmotoin': use one of .*nmea, "):
        DRIVERS.load('witmotoin')


@pytest.mark.usefixtures('other_package')
def test_a_driver_of_another_package() -> None:
    assert 'lidar' in DRIVERS.names()
    assert DRIVERS.load('lidar').__name__ == 'Lidar'


@pytest.mark.usefixtures('other_package')
@pytest.mark.parametrize('name, message', [
    ('raises', 'ZeroDivisionError'), ('missing', 'cannot be imported'),
    ('nothing', 'AttributeError'), ('number', 'not a class derived from Device'),
    ('other', 'not a class derived from Device')])
def test_a_broken_driver_is_reported_and_the_others_work(name: str, message: str) -> None:
    with pytest.raises(ConfigError, match=f'{name}.*{message}'):
        DRIVERS.load(name)
    assert DRIVERS.load('lidar').__name__ == 'Lidar'
    assert DRIVERS.load('nmea').__name__ == 'NmeaGps'
    assert any(name in problem and message in problem for problem in DRIVERS.problems())


@pytest.mark.usefixtures('other_package')
def test_a_name_of_this_package_cannot_be_taken_over_silently() -> None:
    assert DRIVERS.load('nmea').__name__ == 'NmeaGps'
    assert any("'nmea' of the entry point" in problem for problem in DRIVERS.problems())
