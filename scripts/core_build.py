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


"""Copies of the package, and their compilation with other options, for the scripts here."""

from __future__ import annotations

from collections.abc import Sequence
import os
from pathlib import Path
import shutil
import subprocess
import sys

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from rt_robot_os.base.compiled import c_files  # noqa: E402, I100
from rt_robot_os.base.compiled import sources_digest  # noqa: E402

C_SOURCES = c_files(ROOT / 'rt_robot_os', '.c')
COPIED = ('rt_robot_os', 'test', 'scripts', 'setup.py', 'setup.cfg', 'pyproject.toml',
          'package.xml', 'resource', 'config', 'launch', 'docs', 'README.md')
STABLE = ('-DPy_LIMITED_API=0x030B0000',)


class BuildError(Exception):
    """The compiler refused; the text is its own."""


def copy_tree(folder: Path, root: Path = ROOT) -> None:
    """Copy the files that the tests need, without compiled ones."""
    for name in COPIED:
        source = root / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns(
                '__pycache__', '_core.*.so', '.mypy_cache'))
        elif source.exists():
            shutil.copy(source, folder / name)


def compiler() -> str:
    """Return the compiler to use."""
    return os.environ.get('CC', 'gcc')


def include_folder(python: str = sys.executable) -> str:
    """Return where the headers of a Python are."""
    return _ask(python, 'import sysconfig; print(sysconfig.get_path("include"))')


def build(folder: Path, flags: Sequence[str], python: str = sys.executable) -> None:
    """
    Compile the C core of a copy.

    :param flags: of the compiler, ``STABLE`` for the limited API.
    :param python: for which.
    :raises BuildError: it cannot be compiled.
    """
    package = folder / 'rt_robot_os'
    suffix = _ask(python, 'import sysconfig; print(sysconfig.get_config_var("EXT_SUFFIX"))')
    done = subprocess.run(
        [compiler(), '-shared', '-fPIC', '-std=c11', '-fvisibility=hidden', '-Wall', '-Wextra',
         f'-I{include_folder(python)}',
         f'-DRT_ROBOT_OS_SOURCES="{sources_digest(package)}"', *flags,
         *(f'rt_robot_os/{name}' for name in C_SOURCES), '-o', f'rt_robot_os/_core{suffix}'],
        cwd=folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if done.returncode:
        raise BuildError(done.stdout)


def environment(folder: Path, **more: str) -> dict[str, str]:
    """Return the environment in which the compiled build of a copy runs."""
    return {**os.environ, 'RT_ROBOT_OS_COMPILE': '1', 'PYTHONPATH': os.pathsep.join(
        [str(folder), str(folder / 'test' / 'kernel')]), **more}


def _ask(python: str, program: str) -> str:
    return subprocess.run([python, '-c', program], check=True, text=True,
                          stdout=subprocess.PIPE).stdout.strip()
