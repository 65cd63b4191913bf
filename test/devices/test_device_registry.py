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

"""Are devices found by name, also of other packages, and does a broken one harm no other."""

from __future__ import annotations

from collections.abc import Iterator
import importlib
from pathlib import Path
import subprocess
import sys

from driver_fakes import settings_of
import pytest

from rt_robot_os import devices
from rt_robot_os.base import features
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.devices.bmp280.driver import Bmp280
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.signatures import known_chips
from rt_robot_os.devices.signatures import SignatureTable
from rt_robot_os.devices.simulators import SIMULATORS

FILES = {
    'their_lidar/__init__.py':
        'from rt_robot_os.devices import DeviceParts, Signature\n'
        "PARTS = DeviceParts(driver='.driver:Lidar', simulated='.simulated:SimulatedLidar',\n"
        "                    signatures=(Signature('lidar frames', '.wire:is_lidar'),),\n"
        "                    chips='.wire:CHIPS')\n",
    'their_lidar/driver.py':
        'from rt_robot_os.devices.nmea.driver import NmeaGps\n'
        'class Lidar(NmeaGps):\n    pass\n',
    'their_lidar/simulated.py':
        'from rt_robot_os.devices.nmea.simulated import SimulatedNmea\n'
        'class SimulatedLidar(SimulatedNmea):\n    pass\n',
    'their_lidar/wire.py':
        "CHIPS = {0x0F: {0x33: 'LIDAR-1'}}\n"
        "def is_lidar(data):\n    return data.count(b'LIDAR') > 1\n",
    'their_drivers.py':
        'from rt_robot_os.devices.parts import DeviceParts\n'
        'def driver(name):\n'
        "    return DeviceParts(driver=name, chips='their_drivers:not_a_class')\n"
        "PARTS = driver('their_lidar.driver:Lidar')\n"
        "MISSING = driver('their_missing:X')\n"
        "NOTHING = driver('their_drivers:Nothing')\n"
        "NUMBER = driver('their_drivers:not_a_class')\n"
        "OTHER = driver('their_drivers:NotADevice')\n"
        'not_a_class = 3\n'
        'class NotADevice:\n    pass\n',
    'their_broken.py': '1 / 0\n',
    'their_object.py':
        'from rt_robot_os.devices import DeviceParts\n'
        'from their_lidar.driver import Lidar\n'
        'PARTS = DeviceParts(driver=Lidar)\n',
    'their_comma.py':
        'from rt_robot_os.devices import DeviceParts, Signature\n'
        "PARTS = DeviceParts(driver='their_lidar.driver:Lidar',\n"
        "                    signatures=(Signature('frames', '.wire:is_it')))\n",
    'their_drivers-1.0.dist-info/METADATA':
        'Metadata-Version: 2.1\nName: their-drivers\nVersion: 1.0\n',
    'their_drivers-1.0.dist-info/entry_points.txt':
        '[rt_robot_os.devices]\n'
        'lidar = their_lidar [extra]\n'
        'raises = their_broken\n'
        'gone = their_missing\n'
        'missing = their_drivers:MISSING\n'
        'nothing = their_drivers:NOTHING\n'
        'number = their_drivers:NUMBER\n'
        'other = their_drivers:OTHER\n'
        'bare = their_lidar.driver:Lidar\n'
        'object = their_object\n'
        'comma = their_comma\n'
        'lonely = their_drivers\n'
        'nmea = their_lidar\n'
        '[rt_robot_os.drivers]\n'
        'old_lidar = their_lidar.driver:Lidar\n'
        'lidar = their_broken:X\n'
        '[rt_robot_os.simulators]\n'
        'old_lidar = their_lidar.simulated:SimulatedLidar\n',
}


pytestmark = pytest.mark.filterwarnings('ignore:type old_lidar')


@pytest.fixture
def other_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install a package that adds good devices and several bad ones."""
    for name, text in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    for name in [name for name in sys.modules if name.startswith('their_')]:
        monkeypatch.delitem(sys.modules, name)


def imported_by(code: str) -> set[str]:
    """Give the modules that some code imports in a process of its own."""
    found = subprocess.run(
        [sys.executable, '-c', f'{code}\nimport sys\nprint(*sys.modules)'],
        capture_output=True, text=True, check=True, timeout=60)
    return set(found.stdout.split())


def test_the_devices_of_this_package() -> None:
    assert {'witmotion', 'nmea'} <= set(DRIVERS.names())
    assert DRIVERS.load('witmotion').__name__ == 'WitMotion'
    assert DRIVERS.load('nmea').__name__ == 'NmeaGps'
    assert SIMULATORS.load('nmea').__name__ == 'SimulatedNmea'
    own = set(DRIVERS.names()) - set(DRIVERS.foreign_names())
    assert own <= set(SIMULATORS.names())
    for name in own:
        DRIVERS.load(name)
        SIMULATORS.load(name)


def test_a_folder_with_a_driver_is_a_device() -> None:
    package = Path(devices.__file__).parents[1]
    folders = {path.parent.relative_to(package) for path in package.rglob('driver.py')}
    own = {Path(*place.split('.')[1:]) for place in features.devices().values()}
    named = {path.name for path in folders - own} | features.devices().keys()
    assert named == set(DRIVERS.names()) - set(DRIVERS.foreign_names())


def test_drivers_import_no_simulated_devices_and_these_no_drivers() -> None:
    drivers = imported_by(
        'from rt_robot_os.devices.registry import DRIVERS\n'
        'from rt_robot_os.devices.signatures import SIGNATURES\n'
        "[DRIVERS.load(name) for name in ('bmp280', 'nmea')]\nSIGNATURES.prepare()")
    assert 'rt_robot_os.devices.ublox.wire' in drivers
    assert [name for name in drivers if name.endswith('.simulated')] == []
    assert not any(name.startswith('rt_robot_os.sim') for name in drivers)
    simulated = imported_by(
        'from rt_robot_os.devices.simulators import SIMULATORS\nSIMULATORS.names()\n'
        "[SIMULATORS.load(name) for name in ('bmp280', 'nmea')]")
    assert 'rt_robot_os.devices.bmp280.simulated' in simulated
    assert [name for name in simulated if name.endswith('.driver')] == []
    # What drivers derive from would bring NumPy and the topics: three times the start.
    assert not {'numpy', 'serial', 'rt_robot_os.devices.device', 'rt_robot_os.topics'} & simulated


def test_the_front_for_authors_of_drivers_is_whole_and_imports_what_is_asked_for() -> None:
    for name in devices.__all__:
        assert getattr(devices, name).__name__ == name
    with pytest.raises(AttributeError, match='NoSuchDevice'):
        getattr(devices, 'NoSuchDevice')
    seen = imported_by('from rt_robot_os.devices import DeviceParts, FrameDecoder')
    assert not {'serial', 'rt_robot_os.devices.serial.device', 'numpy'} & seen


def test_an_unknown_name_lists_what_exists() -> None:
    with pytest.raises(ConfigError, match="no driver 'witmotoin': use one of .*nmea, .*"
                       'entry-point group rt_robot_os.devices'):
        DRIVERS.load('witmotoin')


@pytest.mark.usefixtures('other_package')
def test_a_device_of_another_package_is_the_same_thing() -> None:
    assert 'lidar' in DRIVERS.names() and 'lidar' in SIMULATORS.names()
    assert 'their_lidar' not in sys.modules or 'their_lidar.simulated' not in sys.modules
    assert DRIVERS.load('lidar').__name__ == 'Lidar'
    assert 'their_lidar.simulated' not in sys.modules
    assert SIMULATORS.load('lidar').__name__ == 'SimulatedLidar'
    assert SignatureTable().identify(b'LIDAR 1 LIDAR 2', 9600) == (
        'these are lidar frames at 9600 baud: set type: lidar, or swap the ports')


def asked_of_the_bus(answers: dict[int, int]) -> str:
    """Give what a driver says of another chip, with these values in its registers."""
    driver = Bmp280('baro', settings_of(Bmp280, port='/dev/none'))
    asking = driver.probably()
    try:
        transfer = next(asking)
        while True:
            driver._not_yielded = None  # as if the bus had taken it
            transfer = asking.send(bytes([answers.get(transfer.data[0], 0)]))
    except StopIteration as end:
        return str(end.value)


@pytest.fixture
def chips_anew() -> Iterator[None]:
    """Let the chips of all devices be looked up again."""
    known_chips.cache_clear()
    yield
    known_chips.cache_clear()


@pytest.mark.usefixtures('other_package', 'chips_anew')
def test_chips_of_another_package_are_named_too() -> None:
    assert 'probably a LIDAR-1: change type' in asked_of_the_bus({0x0F: 0x33})
    assert 'probably a MPU-6500: change type' in asked_of_the_bus({0x75: 0x70})
    assert 'probably a BMP180: change type' in asked_of_the_bus({0xD0: 0x55, 0x0F: 0x33})
    assert 'an unknown chip' in asked_of_the_bus({})


@pytest.mark.usefixtures('other_package')
def test_a_device_needs_no_simulated_device() -> None:
    assert DRIVERS.load('lonely').__name__ == 'Lidar'
    assert 'lonely' not in SIMULATORS.names()
    with pytest.raises(ConfigError, match="no simulated device for the driver 'lonely': use one"):
        SIMULATORS.load('lonely')


@pytest.mark.usefixtures('other_package')
@pytest.mark.parametrize('name, message', [
    ('raises', 'ZeroDivisionError'), ('gone', 'cannot be imported'),
    ('missing', 'cannot be imported'), ('nothing', 'AttributeError'),
    ('number', 'not a class derived from Device'), ('other', 'not a class derived from Device'),
    ('bare', r'must declare PARTS = DeviceParts\(...\)'),
    ('object', "driver = <class 'their_lidar.driver.Lidar'>: must be a name in quotes"),
    ('comma', 'must be a tuple of Signature, also of one')])
def test_a_broken_driver_is_reported_and_the_others_work(name: str, message: str) -> None:
    with pytest.raises(ConfigError, match=f'{name}.*{message}'):
        DRIVERS.load(name)
    assert DRIVERS.load('lidar').__name__ == 'Lidar'
    assert DRIVERS.load('nmea').__name__ == 'NmeaGps'
    assert any(name in problem for problem in DRIVERS.problems())
    assert 'lidar frames' in SignatureTable().identify(b'LIDAR LIDAR', 0)


@pytest.mark.usefixtures('other_package')
def test_a_name_of_this_package_cannot_be_taken_over_silently() -> None:
    assert DRIVERS.load('nmea').__name__ == 'NmeaGps'
    assert any("'nmea' of the entry point" in problem for problem in DRIVERS.problems())


# --- the entry-point groups of the release before -----------------------------------------------

@pytest.mark.usefixtures('other_package')
def test_the_old_groups_work_and_name_the_new_one() -> None:
    assert 'old_lidar' in DRIVERS.names() and 'old_lidar' in SIMULATORS.names()
    with pytest.warns(DeprecationWarning, match='must name it in rt_robot_os.devices'):
        assert DRIVERS.load('old_lidar').__name__ == 'Lidar'
    with pytest.warns(DeprecationWarning, match='group rt_robot_os.simulators will be removed'):
        assert SIMULATORS.load('old_lidar').__name__ == 'SimulatedLidar'
    assert 'old_lidar' in DRIVERS.deprecation('old_lidar')


@pytest.mark.usefixtures('other_package')
def test_a_package_may_name_a_device_in_both() -> None:
    assert DRIVERS.load('lidar').__name__ == 'Lidar'
    assert DRIVERS.deprecation('lidar') == DRIVERS.deprecation('nmea') == ''
