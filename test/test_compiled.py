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


"""The C core: used when it was made of the C sources beside it, and never otherwise."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.machinery import EXTENSION_SUFFIXES
import os
from pathlib import Path
import shutil
import subprocess
import sys
import sysconfig

import pytest

from rt_robot_os.base import compiled
from rt_robot_os.base.compiled import build

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / compiled.PACKAGE
WARNINGS = ('-std=c11', '-Wall', '-Wextra', '-Werror')

ASK = """
from rt_robot_os.base.compiled import state
try:
    from rt_robot_os.linux.timer import NATIVE
    print(state().compiled, NATIVE is not None, state().stale, state().text)
except ImportError as error:
    print('refused:', error)
"""
USED = 'True True False compiled with '
SOURCES, HEADERS = compiled.c_files(PACKAGE, '.c'), compiled.c_files(PACKAGE, '.h')
NOT_COMPILED = 'False False False pure Python: it was not compiled'
STALE = 'False False True pure Python: its C sources changed after it was compiled'


@pytest.fixture(scope='session')
def binary(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compile the C core of these sources, which takes some seconds."""
    if (why := build.obstacle()) is not None and why != f'{compiled.SWITCH}=0':
        pytest.skip(f'there is {why}')
    folder = tmp_path_factory.mktemp('compiled')
    subprocess.run(
        [sys.executable, 'setup.py', '--quiet', 'build_ext', '--build-lib', folder,
         '--build-temp', folder / 'objects'], cwd=ROOT, env=environment('1'), check=True)
    return next((folder / compiled.PACKAGE).glob('_core*'))


@pytest.fixture
def copy(binary: Path, tmp_path: Path) -> Path:
    """Copy what a decision needs, with the binary in the package, as an installation has it."""
    for name in ('base', 'core', 'linux', 'kernel', 'topics'):
        shutil.copytree(PACKAGE / name, tmp_path / compiled.PACKAGE / name,
                        ignore=shutil.ignore_patterns('__pycache__'))
    for path in PACKAGE.glob('*.py'):
        shutil.copy(path, tmp_path / compiled.PACKAGE)
    shutil.copy(binary, tmp_path / compiled.PACKAGE)
    return tmp_path


def environment(switch: str, path: object = '') -> dict[str, str]:
    """Return the environment of a child."""
    return {**os.environ, 'PYTHONPATH': str(path), compiled.SWITCH: switch}


def ask(installed: Path, switch: str = '', path: Path | str = '') -> str:
    """Return which build a new process runs; with one more folder on its path."""
    told = subprocess.run(
        [sys.executable, '-c', ASK], cwd=installed, capture_output=True, text=True, check=True,
        env=environment(switch, f'{installed}{os.pathsep}{path}'))
    return told.stdout.strip()


def edit(installed: Path, name: str) -> None:
    """Change a source, but not its size and time of change."""
    path = installed / compiled.PACKAGE / name
    before = path.stat()
    text = path.read_text()
    path.write_text(text.replace('Copyright', 'copyrighT', 1))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def test_a_binary_of_these_sources_is_used(copy: Path) -> None:
    assert ask(copy).startswith(USED)
    assert ask(copy, '1').startswith(USED)


def test_a_binary_on_the_path_is_used_as_colcon_builds_elsewhere(copy: Path, binary: Path) -> None:
    (copy / compiled.PACKAGE / binary.name).unlink()
    assert ask(copy).startswith(NOT_COMPILED)
    assert ask(copy, path=binary.parents[1]).startswith(USED)


def test_it_is_not_used_when_that_is_forbidden(copy: Path) -> None:
    assert ask(copy, '0') == 'False False False pure Python: RT_ROBOT_OS_COMPILE=0'


@pytest.mark.parametrize('name', [*SOURCES, *HEADERS])
def test_a_binary_of_other_c_sources_is_not_used(copy: Path, name: str) -> None:
    edit(copy, name)
    told = ask(copy)
    assert told.startswith(STALE) and 'colcon build' in told
    assert ask(copy, '1').startswith('refused: RT_ROBOT_OS_COMPILE=1, but pure Python: its C sou')


def test_a_stale_binary_does_not_hide_one_that_fits(copy: Path, binary: Path) -> None:
    stale = copy / compiled.PACKAGE / binary.name
    digest = compiled.sources_digest(PACKAGE).encode()
    stale.write_bytes(stale.read_bytes().replace(digest, digest[::-1]))
    assert ask(copy).startswith(STALE)
    assert ask(copy, path=binary.parents[1]).startswith(USED)


def test_a_package_without_its_c_sources_trusts_its_binary(copy: Path) -> None:
    for path in copy.rglob('*.[ch]'):
        path.unlink()
    assert ask(copy).startswith(USED)


def test_a_package_with_a_part_of_them_does_not(copy: Path) -> None:
    (copy / compiled.PACKAGE / SOURCES[0]).unlink()
    assert ask(copy).startswith(STALE)


def test_a_binary_that_cannot_be_loaded_is_named(copy: Path, binary: Path) -> None:
    broken = copy / compiled.PACKAGE / binary.name
    broken.write_bytes(compiled.sources_digest(PACKAGE).encode())  # of another processor
    told = ask(copy)
    assert told.startswith(f'False False False pure Python: {broken} cannot be loaded: ')
    assert ask(copy, path=binary.parents[1]).startswith(USED)


def test_what_another_python_made_is_not_looked_at(copy: Path, binary: Path) -> None:
    ours = copy / compiled.PACKAGE / binary.name
    ours.rename(ours.with_name('_core.cpython-39-x86_64-linux-gnu.so'))
    assert ask(copy).startswith(NOT_COMPILED)


def test_python_3_10_does_not_use_what_is_made_for_later_ones(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / compiled.PACKAGE
    folder.mkdir()
    for suffix in EXTENSION_SUFFIXES:
        (folder / f'_core{suffix}').touch()
    found = [path.name for path in compiled._binaries(folder) if path.parent == folder]
    monkeypatch.setattr(sys, 'version_info', (3, 10, 12))
    older = [path.name for path in compiled._binaries(folder) if path.parent == folder]
    assert set(found) - set(older) == {'_core.abi3.so'}


def test_the_switch_has_two_positions() -> None:
    told = subprocess.run([sys.executable, '-c', 'import rt_robot_os.kernel'], cwd=ROOT,
                          env=environment('yes', ROOT), capture_output=True, text=True)
    assert told.returncode == 1
    assert told.stderr.splitlines()[-1] == (
        "ImportError: RT_ROBOT_OS_COMPILE='yes' must be 0 (pure Python) or 1 (compiled), or unset")


@pytest.mark.parametrize('switch, words', [
    ('yes', "doctor: RT_ROBOT_OS_COMPILE='yes' must be 0 (pure Python) or 1 (compiled), or unset"),
    ('1', 'doctor: RT_ROBOT_OS_COMPILE=1, but pure Python: it was not compiled')])
def test_a_program_says_in_one_line_that_it_cannot_have_the_build(switch: str, words: str) -> None:
    code = ('from rt_robot_os.base import compiled; compiled._binaries = lambda package: []; '
            'from rt_robot_os.tools.doctor.program import main; import sys; sys.exit(main([]))')
    told = subprocess.run([sys.executable, '-c', code], cwd=ROOT, capture_output=True, text=True,
                          env=environment(switch, ROOT))
    assert (told.returncode, told.stdout, told.stderr.count('\n')) == (2, '', 1)
    assert told.stderr.startswith(words)


# ---- the build -------------------------------------------------------------------------------

def test_each_c_file_of_the_package_counts() -> None:
    assert sorted(path.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob('*.[ch]')) == (
        sorted((*SOURCES, *HEADERS)))


def test_what_is_missing_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(compiled.SWITCH, raising=False)
    monkeypatch.setenv('CC', sys.executable)
    monkeypatch.setattr(sysconfig, 'get_path', lambda name: '/nowhere')
    assert build.obstacle() == 'no /nowhere/Python.h: sudo apt install python3-dev'
    monkeypatch.setenv('CC', 'no-such-compiler -pipe')
    assert (build.obstacle() or '').startswith('no C compiler (no-such-compiler -pipe): sudo apt')
    assert build.extensions() == [] and build.wheel_options() == {}
    monkeypatch.setenv(compiled.SWITCH, '1')
    with pytest.raises(build.ExecError, match='RT_ROBOT_OS_COMPILE=1, but there is no C comp'):
        build.extensions()
    monkeypatch.setenv(compiled.SWITCH, '0')
    assert build.obstacle() == 'RT_ROBOT_OS_COMPILE=0'


def build_with(compiler: Path, installed: Path, switch: str = '') -> tuple[int, str, str]:
    """Run the command in a copy with another compiler; return its exit code and its output."""
    shutil.copy(ROOT / 'setup.py', installed)
    done = subprocess.run(
        [sys.executable, 'setup.py', 'build_ext', '--inplace'], cwd=installed,
        env={**environment(switch), 'CC': str(compiler)}, capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


@pytest.fixture
def failing(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Return a compiler that fails."""
    path = tmp_path_factory.mktemp('compiler') / 'cc'
    path.write_text('#!/bin/sh\nexit 1\n')
    path.chmod(0o755)
    yield path


def test_a_binary_that_fits_is_not_made_again(
        copy: Path, binary: Path, failing: Path, tmp_path: Path) -> None:
    lib = tmp_path / 'build' / f'lib.{sysconfig.get_platform()}-{sys.implementation.cache_tag}'
    (lib / compiled.PACKAGE).mkdir(parents=True)
    shutil.copy(binary, lib / compiled.PACKAGE)
    for path in copy.rglob('*.c'):
        path.touch()  # as after a fresh clone
    assert build_with(failing, copy, '1')[0] == 0
    edit(copy, 'base/_core.h')
    assert build_with(failing, copy, '1')[0] == 1


def test_a_fault_of_the_compiler_leaves_pure_python_unless_it_is_demanded(
        copy: Path, failing: Path) -> None:
    edit(copy, 'base/_core.h')
    code, _, told = build_with(failing, copy)
    assert code == 0
    assert 'rt_robot_os: pure Python, it could not be compiled: command' in told
    assert ask(copy).startswith(STALE)
    code, _, told = build_with(failing, copy, '1')
    assert code == 1 and 'failed with exit code 1' in told


@pytest.mark.linter
@pytest.mark.parametrize('compiler', ['gcc', 'clang', 'aarch64-linux-gnu-gcc'])
@pytest.mark.parametrize('stable', [True, False])
def test_the_c_sources_have_no_warnings(compiler: str, stable: bool) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f'there is no {compiler}')
    include = sysconfig.get_path('include')
    if not Path(include, 'Python.h').is_file():
        pytest.skip(f'there is no {include}/Python.h')
    macros = [f'-D{name}={value}' for name, value in build.macros(PACKAGE).items()
              if stable or name != 'Py_LIMITED_API']
    done = subprocess.run(
        [compiler, '-fsyntax-only', *WARNINGS, *macros, '-isystem', include,
         *(str(PACKAGE / name) for name in SOURCES)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, '')
