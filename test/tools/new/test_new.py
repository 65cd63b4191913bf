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

"""`new` writes a package whose tests and linters pass, and nothing when something is wrong."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
import re
import shutil
import stat
import subprocess
import sys

import pytest

from rt_robot_os.tools.new.program import main

pytest.importorskip('sensor_msgs', reason='the ROS 2 message packages are not installed')

ROOT = Path(__file__).resolve().parents[3]
# The longest that are allowed, and a package that is sorted before ours and one after.
NAMES = [('zz_package_with_a_long_na', 'thermometer_in_the_a', 'angle_to_the_verti_c'),
         ('aa', 'temp', ''), ('zz', '', 'tilted')]
LINT = 'import sys; from ament_{0}.main import main; sys.exit(main())'


def make(folder: Path, package: str, driver: str = '', module: str = '') -> int:
    arguments = [package, '--into', str(folder)]
    arguments += ['--driver', driver] if driver else []
    arguments += ['--module', module] if module else []
    return main(arguments)


def run(folder: Path, *arguments: str) -> str:
    """Run Python where only the package and ours are to be found."""
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, env={**os.environ, 'PYTHONPATH': os.pathsep.join(
            [str(folder), str(ROOT), os.environ.get('PYTHONPATH', '')])})
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.mark.parametrize(('package', 'driver', 'module'), NAMES)
def test_the_tests_and_linters_of_a_package_pass(
        tmp_path: Path, package: str, driver: str, module: str) -> None:
    assert make(tmp_path, package, driver, module) == 0
    folder = tmp_path / package
    assert ' passed' in run(folder, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', 'test')
    for linter in ('flake8', 'pep257'):
        if importlib.util.find_spec(f'ament_{linter}') is not None:
            run(tmp_path, '-c', LINT.format(linter), package)


@pytest.mark.parametrize(('package', 'driver', 'module'), NAMES)
def test_its_configuration_has_no_problem_once_it_is_installed(
        tmp_path: Path, package: str, driver: str, module: str) -> None:
    assert make(tmp_path, package, driver, module) == 0
    folder = tmp_path / package
    setup = (folder / 'setup.py').read_text().replace('from setuptools import setup', '')
    points: dict[str, list[str]] = {}
    exec(setup, {'setup': lambda **values: points.update(values['entry_points'])})
    info = folder / f'{package}-0.1.0.dist-info'
    info.mkdir()
    (info / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {package}\nVersion: 0.1.0\n')
    (info / 'entry_points.txt').write_text(''.join(
        f'[{group}]\n{lines[0]}\n' for group, lines in points.items()))
    code = ('from pathlib import Path; from rt_robot_os.settings import load; '
            f'robot = load([Path("config/{package}.yaml")]); '
            'print([part.name for part in (*robot.devices, *robot.modules)])')
    names = [driver] if driver else []
    names += ['imu', module] if module else []
    assert run(folder, '-c', code).strip() == str(names)


def test_everything_is_in_the_package_and_nothing_else_lies_about(tmp_path: Path) -> None:
    assert make(tmp_path, 'mine', 'sonar', 'stop') == 0
    assert [path.name for path in tmp_path.iterdir()] == ['mine']
    files = [path for path in (tmp_path / 'mine').rglob('*') if path.is_file()]
    assert len(files) == 15
    assert not [path for path in files if re.search(r'@\w+@', path.read_text() + path.name)]
    umask = os.umask(0)
    os.umask(umask)
    assert stat.S_IMODE((tmp_path / 'mine').stat().st_mode) == 0o777 & ~umask


@pytest.mark.parametrize(('package', 'driver', 'module', 'problem'), [
    ('My-Robot', 'sonar', '', "package 'My-Robot': must have 2 to 25 lower-case letters"),
    ('mine', 'a', '', "driver 'a': must have 2 to 20"), ('mine', 'sonar_', '', 'not end with _'),
    ('a__b', 'sonar', '', 'single _'), ('7up', 'sonar', '', 'begin with a letter'),
    ('x' * 26, 'sonar', '', '2 to 25'), ('../up', 'sonar', '', 'must have 2 to 25'),
    ('json', 'sonar', '', "package 'json': Python has a module of that name"),
    ('rt_robot_os', 'sonar', '', 'Python has a module of that name'),
    ('mine', 'class', '', "driver 'class': is a keyword of Python"),
    ('mine', 'witmotion', '', "driver 'witmotion': exists already"),
    ('mine', '', 'twist_guard', "module 'twist_guard': exists already"),
    ('mine', 'mirrors', '', 'is a reserved key'), ('mine', 'imu', '', 'is a reserved key'),
    ('mine', 'same', 'same', "driver and module are both 'same'")])
def test_a_wrong_name_is_told_and_nothing_is_written(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], package: str, driver: str,
        module: str, problem: str) -> None:
    assert make(tmp_path, package, driver, module) == 2
    assert problem in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'mine').mkdir()
    (tmp_path / 'mine' / 'kept').write_text('mine')
    assert make(tmp_path, 'mine', 'sonar') == 2
    assert 'exists already, and nothing is overwritten' in capsys.readouterr().err
    assert [path.name for path in (tmp_path / 'mine').iterdir()] == ['kept']
    (tmp_path / 'link').symlink_to(tmp_path / 'nowhere')
    assert make(tmp_path, 'link', 'sonar') == 2
    assert make(tmp_path / 'nowhere', 'mine', 'sonar') == 2
    assert 'this folder does not exist' in capsys.readouterr().err


def test_without_anything_to_write_it_says_what_is_missing(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        make(tmp_path, 'mine')
    assert ended.value.code == 2
    assert 'choose the content: --driver NAME, --module NAME, or both' in capsys.readouterr().err


def test_what_comes_next_fits_the_machine(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(shutil, 'which', lambda name: None)
    assert make(tmp_path, 'mine', 'sonar') == 0
    said = capsys.readouterr().out
    place = os.path.relpath(tmp_path / 'mine', ROOT)
    assert f'Without ROS 2, in {ROOT}:' in said and 'colcon' not in said
    assert f' -m pip install --no-deps --no-build-isolation -e {place}\n' in said
    assert f'./scripts/run robot {place}/config/mine.yaml\n' in said
    monkeypatch.setattr(shutil, 'which', lambda name: f'/opt/ros/{name}')
    assert make(tmp_path, 'yours', 'sonar') == 0
    said = capsys.readouterr().out
    assert 'colcon build --symlink-install --packages-select yours' in said
    assert 'scripts/run' not in said
