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

"""The compiled build: used when it fits its sources to the letter, and never otherwise."""

from __future__ import annotations

import json
import os
from pathlib import Path
import shutil
import subprocess
import sys
import sysconfig

import pytest

from rt_robot_os import compiled
from rt_robot_os.compiled import build

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / compiled.PACKAGE

ASK = """
from rt_robot_os.compiled import state
try:
    import rt_robot_os.kernel.scheduler as scheduler
    print(state().compiled, scheduler.__file__.endswith('.so'), state().text)
except ImportError as error:
    print('refused:', error)
"""


def made() -> Path | None:
    """Return the folder of binaries that fit these sources, where there is one."""
    for folder in (Path(compiled.__file__).parents[2], ROOT, ROOT / 'build' / compiled.PACKAGE):
        manifest = compiled.read_manifest(folder / compiled.FOLDER)
        if manifest is not None and not compiled.changed_since(manifest, PACKAGE):
            return folder / compiled.FOLDER
    return None


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Copy the sources and their binaries, as an installation has them."""
    folder = made()
    if folder is None:
        pytest.skip('there is no compiled build of these sources')
    shutil.copytree(PACKAGE, tmp_path / compiled.PACKAGE,
                    ignore=shutil.ignore_patterns('__pycache__', 'clients', 'devices', 'tools'))
    shutil.copytree(folder, tmp_path / compiled.FOLDER)
    return tmp_path


def ask(installed: Path, switch: str = '', path: Path | str = '') -> str:
    """Return which build a new process runs; with one more folder on its path."""
    environment = {**os.environ, 'PYTHONPATH': f'{installed}{os.pathsep}{path}',
                   compiled.SWITCH: switch}
    told = subprocess.run([sys.executable, '-c', ASK], env=environment, cwd=installed,
                          capture_output=True, text=True, check=True)
    return told.stdout.strip()


def test_binaries_that_fit_are_used(copy: Path) -> None:
    assert ask(copy).startswith('True True compiled with mypyc')
    assert ask(copy, '1').startswith('True True compiled with mypyc')


def test_binaries_on_the_path_are_used_as_colcon_builds_elsewhere(copy: Path) -> None:
    (copy / 'build').mkdir()
    (copy / compiled.FOLDER).rename(copy / 'build' / compiled.FOLDER)
    assert ask(copy).startswith('False False pure Python: it was not compiled')
    assert ask(copy, path=copy / 'build').startswith('True True compiled with mypyc')


def test_they_are_not_used_when_that_is_forbidden(copy: Path) -> None:
    assert ask(copy, '0') == 'False False pure Python: RT_ROBOT_OS_COMPILE=0'


def test_an_edited_source_is_what_runs(copy: Path) -> None:
    source = copy / compiled.PACKAGE / 'kernel' / 'scheduler.py'
    before = source.stat()
    source.write_text(source.read_text() + 'GRACE_NS = 21\n')
    os.utime(source, ns=(before.st_atime_ns, before.st_mtime_ns))
    told = ask(copy)
    assert told.startswith('False False pure Python: kernel/scheduler.py changed after it was')
    assert 'colcon build' in told
    assert ask(copy, '1').startswith('refused: RT_ROBOT_OS_COMPILE=1, but pure Python: kernel/')


def test_a_constant_that_the_binaries_contain_counts_as_theirs(copy: Path) -> None:
    source = copy / compiled.PACKAGE / 'kernel' / 'spec.py'
    source.write_text(source.read_text() + 'PRIORITY_MAXIMUM = 98\n')
    assert ask(copy).startswith('False False pure Python: kernel/spec.py changed')


def test_a_source_that_is_gone_is_told(copy: Path) -> None:
    (copy / compiled.PACKAGE / 'kernel' / 'one_shot.py').unlink()
    environment = {**os.environ, 'PYTHONPATH': str(copy), compiled.SWITCH: ''}
    told = subprocess.run(
        [sys.executable, '-c', 'from rt_robot_os.compiled import state; print(state())'],
        env=environment, cwd=copy, capture_output=True, text=True, check=True)
    assert 'kernel/one_shot.py changed' in told.stdout and 'stale=True' in told.stdout


def test_what_another_python_made_is_not_looked_at(copy: Path) -> None:
    manifest = compiled.manifest_path(copy / compiled.FOLDER)
    manifest.rename(manifest.with_name('manifest.cpython-39-x86_64-linux-gnu.json'))
    assert ask(copy).startswith('False False pure Python: it was not compiled')


@pytest.mark.parametrize('text', ['', '{', '[]', '{"files": {}}'])
def test_a_manifest_that_was_cut_short_is_none(copy: Path, text: str) -> None:
    compiled.manifest_path(copy / compiled.FOLDER).write_text(text)
    assert ask(copy).startswith('False False pure Python: it was not compiled')


def test_a_list_of_modules_that_has_grown_makes_binaries_stale(tmp_path: Path) -> None:
    manifest = {'modules': list(compiled.MODULES[1:]), 'sources': {}, 'files': {}}
    assert compiled.changed_since(manifest, PACKAGE) == ['compiled.__init__']


def test_the_switch_has_two_positions(tmp_path: Path) -> None:
    environment = {**os.environ, 'PYTHONPATH': str(ROOT), compiled.SWITCH: 'yes'}
    told = subprocess.run([sys.executable, '-c', 'import rt_robot_os.kernel'], env=environment,
                          capture_output=True, text=True)
    assert told.returncode == 1
    assert told.stderr.splitlines()[-1] == (
        "ImportError: RT_ROBOT_OS_COMPILE='yes' must be 0 (pure Python) or 1 (compiled), or unset")


@pytest.mark.parametrize('switch, words', [
    ('yes', "doctor: RT_ROBOT_OS_COMPILE='yes' must be 0 (pure Python) or 1 (compiled), or unset"),
    ('1', 'doctor: RT_ROBOT_OS_COMPILE=1, but pure Python: it was not compiled')])
def test_a_program_says_in_one_line_that_it_cannot_have_the_build(
        switch: str, words: str, tmp_path: Path) -> None:
    (tmp_path / compiled.PACKAGE).symlink_to(PACKAGE)
    code = ('import sys; sys.path.insert(0, "."); from rt_robot_os import compiled; '
            'compiled._finder._folders = lambda: []; '
            'from rt_robot_os.tools.doctor.program import main; sys.exit(main([]))')
    told = subprocess.run([sys.executable, '-c', code], cwd=tmp_path, capture_output=True,
                          text=True, env={**os.environ, compiled.SWITCH: switch})
    assert (told.returncode, told.stdout, told.stderr.count('\n')) == (2, '', 1)
    assert told.stderr.startswith(words)


# ---- building ----------------------------------------------------------------------------------

def test_each_module_of_the_list_has_a_source() -> None:
    assert [module for module in compiled.MODULES
            if not compiled.source_of(module, PACKAGE).is_file()] == []
    assert list(compiled.MODULES) == sorted(set(compiled.MODULES))


def test_constants_come_from_modules_that_are_watched() -> None:
    assert {'kernel.spec', 'kernel.clock', 'kernel.scheduler', 'units'} <= set(
        build.sources(PACKAGE))


def test_what_is_missing_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(compiled.SWITCH, raising=False)
    monkeypatch.setattr(build, 'find_spec', lambda name: None)
    if shutil.which('cc') is not None and Path(
            sysconfig.get_path('include'), 'Python.h').is_file():
        assert 'pip install mypy' in (build.obstacle() or '')
    monkeypatch.setenv('CC', 'no-such-compiler')
    assert (build.obstacle() or '').startswith('no C compiler (no-such-compiler): sudo apt')
    assert build.extensions() == []
    monkeypatch.setenv(compiled.SWITCH, '1')
    with pytest.raises(build.ExecError, match='RT_ROBOT_OS_COMPILE=1, but there is no C comp'):
        build.extensions()
    monkeypatch.setenv(compiled.SWITCH, '0')
    assert build.obstacle() == 'RT_ROBOT_OS_COMPILE=0'


def test_binaries_that_fit_are_not_made_again(
    copy: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    from setuptools import Distribution
    monkeypatch.chdir(copy)
    monkeypatch.setattr(build, 'obstacle', lambda: None)
    monkeypatch.setattr(build.BuildCompiled, '_compile', lambda *_: pytest.fail('compiled again'))
    command = build.BuildCompiled(Distribution({'name': 'x'}))
    command.ensure_finalized()
    command.inplace = True
    command.run()
    assert 'compiled with mypyc' in capsys.readouterr().out
    manifest = json.loads(compiled.manifest_path(copy / compiled.FOLDER).read_text())
    assert all((copy / path).is_file() for path in command.get_outputs())
    assert len(command.get_outputs()) == len(manifest['files']) + 1


def test_a_fault_of_the_compiler_leaves_the_sources_as_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
) -> None:
    from setuptools import Distribution

    def fail(*_: object) -> None:
        raise ValueError('value is not in list')  # as that of mypy 1.9 may

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(build, 'obstacle', lambda: None)
    monkeypatch.setattr(build.BuildCompiled, '_compile', fail)
    monkeypatch.delenv(compiled.SWITCH, raising=False)
    command = build.BuildCompiled(Distribution({'name': 'x'}))
    command.ensure_finalized()
    command.inplace = True
    command.run()
    assert command.get_outputs() == []
    assert 'pure Python, it could not be compiled: ValueError: value is not in list' in (
        ''.join(capsys.readouterr()))
    monkeypatch.setenv(compiled.SWITCH, '1')
    with pytest.raises(ValueError):
        command.run()
