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

"""A library that is missing or too old is reported with the command that works here."""

from __future__ import annotations

from collections.abc import Callable
from importlib import invalidate_caches
import os
from pathlib import Path
import platform
import subprocess
import sys
import sysconfig

import pytest

from rt_robot_os.base import needs
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.errors import StartError
from rt_robot_os.base.needs import lacking
from rt_robot_os.base.needs import require
from rt_robot_os.base.needs import ros_remedy
from rt_robot_os.base.requirements import at_least
from rt_robot_os.base.requirements import LIBRARIES

ROOT = Path(__file__).resolve().parents[1]
Install = Callable[[str, str], None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Install a distribution in front of all others; its module is empty."""
    monkeypatch.syspath_prepend(tmp_path)

    def add(name: str, version: str) -> None:
        library = LIBRARIES.get(name)
        folder = tmp_path / f'{name.replace("-", "_")}-{version}.dist-info'
        folder.mkdir()
        (folder / 'METADATA').write_text(
            f'Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n')
        (tmp_path / f'{library.module if library else name}.py').touch()
        invalidate_caches()
    return add


@pytest.fixture
def plain(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make this a virtual environment that the user has made and entered."""
    python = tmp_path / 'venv' / 'bin' / 'python3'
    python.parent.mkdir(parents=True)
    python.symlink_to(sys.executable)
    monkeypatch.setattr(sys, 'prefix', str(python.parents[1]))
    monkeypatch.setattr(sys, 'executable', str(python))
    monkeypatch.setenv('PATH', str(python.parent))


@pytest.fixture
def managed(plain: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make this the Python of Ubuntu 24.04, into which pip may not install."""
    (tmp_path / 'EXTERNALLY-MANAGED').touch()
    monkeypatch.setattr(sys, 'base_prefix', sys.prefix)
    monkeypatch.setattr(sysconfig, 'get_path', lambda name: str(tmp_path))
    monkeypatch.setattr(platform, 'freedesktop_os_release',
                        lambda: {'ID': 'ubuntu', 'VERSION_ID': '24.04'})


def test_the_type_of_tf_is_a_package_of_ros_or_generated_where_ros_is_of_wheels(
        install: Install, monkeypatch: pytest.MonkeyPatch) -> None:
    install('ros-jazzy-rclpy', '7.1.6')
    assert ros_remedy('tf2_msgs') == './scripts/tf2_msgs'
    assert ros_remedy('nav2_msgs') == ''
    monkeypatch.setattr(sys, 'path', [])
    assert ros_remedy('tf2_msgs') == 'sudo apt install ros-jazzy-tf2-msgs'


# What Ubuntu 24.04 and Debian 12 have.
@pytest.mark.parametrize('name, version', [
    ('websockets', '10.4'), ('uvicorn', '0.27.1'), ('sqlalchemy', '1.4.50'),
    ('fastapi', '0.101.0'), ('pydantic', '1.10.14')])
def test_a_library_that_is_too_old_is_named_with_both_versions(
        name: str, version: str, plain: None, install: Install) -> None:
    install(name, version)
    lowest = LIBRARIES[name].lowest
    assert lacking('the monitor', name) == (
        f'the monitor needs {name} {lowest} or newer ({version} is installed): '
        f"python3 -m pip install '{name}>={lowest}'")


@pytest.mark.parametrize('program, arguments, name, version', [
    ('monitor', ['--demo', '--port', '0'], 'uvicorn', '0.27.1'),
    ('monitor', ['user', 'list'], 'sqlalchemy', '1.4.50'),
    ('gateway', ['--server', 'ws://127.0.0.1:9'], 'websockets', '10.4'),
    ('recording.record', ['imu/data'], 'mcap', '0.9'),
    ('features.mapping.cli', [], 'scipy', '1.8.0')])
def test_a_program_with_a_library_that_is_too_old_says_so_in_one_line(
        program: str, arguments: list[str], name: str, version: str, install: Install,
        tmp_path: Path) -> None:
    install(name, version)
    module = f'rt_robot_os.{program}' + ('_program' if program.endswith('record') else '.program')
    done = subprocess.run(
        [sys.executable, '-m', module, *arguments], capture_output=True, text=True, timeout=120,
        cwd=tmp_path, env={**os.environ, 'HOME': str(tmp_path), 'PYTHONPATH': os.pathsep.join(
            [str(tmp_path), str(ROOT), os.environ.get('PYTHONPATH', '')])})
    assert done.returncode in (1, 2)
    assert f'needs {name} {LIBRARIES[name].lowest} or newer ({version} is installed): ' in (
        done.stderr)
    assert done.stderr.count('\n') == 1


def test_what_is_new_enough_is_not_mentioned(plain: None, install: Install) -> None:
    install('websockets', LIBRARIES['websockets'].lowest)
    install('uvicorn', '0.9')
    text = lacking('the monitor', 'websockets', 'uvicorn')
    assert text.count('websockets') == 0 and 'uvicorn' in text
    assert lacking('the gateway', 'websockets') == ''


def test_the_error_is_that_of_the_caller(plain: None, install: Install) -> None:
    install('scipy', '1.8.0')
    with pytest.raises(StartError, match=r'^mapping needs scipy .*1\.8\.0 is installed'):
        require('mapping', 'scipy')
    with pytest.raises(DeviceError, match='^a camera needs'):
        require('a camera', 'scipy', error=DeviceError)
    with pytest.raises(ConfigError) as caught:
        require('--picture', 'scipy', error=ConfigError)
    assert len(caught.value.problems) == 1


def test_an_environment_that_is_not_entered_is_named_by_its_python(
        plain: None, install: Install, monkeypatch: pytest.MonkeyPatch) -> None:
    install('scipy', '1.8.0')
    monkeypatch.setenv('PATH', '/usr/bin:/bin')
    assert f'{sys.executable} -m pip install' in lacking('mapping', 'scipy')


def test_an_environment_of_the_scripts_is_extended_by_them(
        plain: None, install: Install) -> None:
    (Path(sys.prefix) / '.rt_robot_os-extra-base').touch()
    install('aiortc', '1.8')
    install('scipy', '1.8.0')
    install('websockets', '10.4')
    assert lacking('voice', 'aiortc').endswith(': ./scripts/install voice')
    assert lacking('it', 'scipy', 'websockets').endswith(': ./scripts/install slam gateway')
    install('rich', '9.0')
    assert lacking('it', 'rich').endswith(': ./scripts/install base')


def test_where_pip_may_not_install_it_is_a_package_or_a_virtual_environment(
        managed: None, install: Install, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(LIBRARIES['scipy']), 'found', lambda self: None)
    assert lacking('mapping', 'scipy').endswith(': sudo apt install python3-scipy')
    text = lacking('the monitor', 'argon2-cffi', 'websockets')
    assert 'python3 -m venv --system-site-packages ' in text and needs.PAGE in text
    assert "pip install 'argon2-cffi>=23.1' 'websockets>=15'" in text
    # The package of the distribution is there, and too old.
    monkeypatch.setattr(type(LIBRARIES['scipy']), 'found', lambda self: '1.8')
    assert 'venv --system-site-packages' in lacking('mapping', 'scipy')


def test_packages_of_an_older_distribution_are_not_recommended(
        managed: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(LIBRARIES['scipy']), 'found', lambda self: None)
    monkeypatch.setattr(platform, 'freedesktop_os_release',
                        lambda: {'ID': 'debian', 'VERSION_ID': '12'})
    assert 'venv --system-site-packages' in lacking('mapping', 'scipy')


@pytest.mark.parametrize('version, lowest, enough', [
    ('10.4', '13', False), ('13', '13.0', True), ('13.0', '13', True), ('13.0.1', '13', True),
    ('2.10', '2.9', True), ('2.9', '2.10', False), ('0.27.1', '0.36', False),
    ('1.26.4+ubuntu1', '1.26.4', True), ('2.0.0rc1', '2', True), ('1:2.0', '1', True)])
def test_versions_are_compared_by_their_numbers(version: str, lowest: str, enough: bool) -> None:
    assert at_least(version, lowest) is enough
