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


"""Where the shipped configuration is found."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.settings import default_path
from rt_robot_os.settings import files

Install = Callable[[str], Path]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Pretend that the code lies somewhere under a folder, with nothing else on the machine."""
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    monkeypatch.setattr('sys.prefix', str(tmp_path / 'nowhere'))

    def run(folder: str) -> Path:
        file = tmp_path / folder / 'rt_robot_os' / 'settings' / 'files.py'
        file.parent.mkdir(parents=True)
        monkeypatch.setattr(files, '__file__', str(file))
        return tmp_path

    return run


def put(folder: Path) -> Path:
    path = folder / 'robot.yaml'
    folder.mkdir(parents=True)
    path.touch()
    return path


def test_the_source_tree_comes_first(install: Install, monkeypatch: pytest.MonkeyPatch) -> None:
    root = install('src')
    (root / 'src' / 'resource').mkdir()
    (root / 'src' / 'resource' / 'rt_robot_os').touch()
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(root / 'ament'))
    put(root / 'ament' / 'share' / 'rt_robot_os' / 'config')
    path = put(root / 'src' / 'config')
    assert default_path() == path


@pytest.mark.parametrize('packages', [
    'lib/python3.12/site-packages', 'local/lib/python3.12/dist-packages'])
def test_the_prefix_of_the_code_comes_before_those_of_ament(
    packages: str, install: Install, monkeypatch: pytest.MonkeyPatch,
) -> None:
    root = install(f'prefix/{packages}')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(root / 'ament'))
    put(root / 'ament' / 'share' / 'rt_robot_os' / 'config')
    path = put(root / 'prefix' / 'share' / 'rt_robot_os' / 'config')
    assert default_path() == path


def test_the_first_ament_prefix_that_has_it(
    install: Install, monkeypatch: pytest.MonkeyPatch,
) -> None:
    root = install('elsewhere')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f"{root / 'a'}::{root / 'b'}:{root / 'c'}")
    put(root / 'c' / 'share' / 'rt_robot_os' / 'config')
    path = put(root / 'b' / 'share' / 'rt_robot_os' / 'config')
    assert default_path() == path


def test_what_is_not_installed_is_said_with_the_places(install: Install) -> None:
    root = install('elsewhere')
    with pytest.raises(ConfigError, match='my.yaml: this configuration is') as caught:
        default_path('my.yaml')
    assert str(root / 'nowhere' / 'share' / 'rt_robot_os' / 'config') in str(caught.value)
