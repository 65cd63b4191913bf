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

"""
Compile the hot path, as a command of setuptools: what `colcon build` and `pip install` run.

Nothing here is needed at run time. A machine without a C compiler or without mypy gets the same
package, and its sources run as they are.
"""

from __future__ import annotations

import ast
from importlib.util import find_spec
import json
import os
from pathlib import Path
import shutil
import sys
import sysconfig
from typing import Any

from rt_robot_os.compiled import C_MODULES
from rt_robot_os.compiled import changed_since
from rt_robot_os.compiled import digest
from rt_robot_os.compiled import FOLDER
from rt_robot_os.compiled import manifest_path
from rt_robot_os.compiled import MODULES
from rt_robot_os.compiled import PACKAGE
from rt_robot_os.compiled import read_manifest
from rt_robot_os.compiled import source_of
from rt_robot_os.compiled import SWITCH
from rt_robot_os.compiled import wanted
from rt_robot_os.requirements import LIBRARIES
from setuptools import Extension
from setuptools.command.build_ext import build_ext
from setuptools.errors import ExecError

# The commands that end with a package which runs.
_BUILDS = {'bdist_wheel', 'build', 'develop', 'editable_wheel', 'install'}
# What is said of types elsewhere, or by another mypy than the one of the tests, must not end it.
_MYPY_OPTIONS = ('--config-file=', '--follow-imports=silent', '--ignore-missing-imports')


def obstacle() -> str | None:
    """Return why this machine cannot compile, in a few words; None when it can."""
    if wanted() is False:
        return f'{SWITCH}=0'
    compiler = os.environ.get('CC') or sysconfig.get_config_var('CC') or 'cc'
    if shutil.which(str(compiler).split()[0]) is None:
        return f'no C compiler ({compiler}): sudo apt install gcc python3-dev'
    header = Path(sysconfig.get_path('include'), 'Python.h')
    if not header.is_file():
        return f'no {header}: sudo apt install python3-dev'
    mypy = LIBRARIES['mypy']
    if find_spec('mypyc') is None or not mypy.is_satisfied():
        return f'no mypyc {mypy.lowest}: sudo apt install python3-mypy, or pip install mypy'
    return None


def sources(package: Path) -> dict[str, str]:
    """
    Return the hash of each source that the binaries depend on.

    Those are the compiled modules, and the package's modules whose constants they contain.
    """
    found: dict[str, str] = {}
    for module in MODULES:
        path = source_of(module, package)
        for name in (module, *_imports(path.read_bytes())):
            found[name] = digest(source_of(name, package))
    found.update((module, digest(source_of(module, package))) for module in C_MODULES)
    return {name: value for name, value in found.items() if value}


def _imports(text: bytes) -> set[str]:
    """Return the modules of the package that a source imports, without the package's name."""
    names = {node.module for node in ast.walk(ast.parse(text))
             if isinstance(node, ast.ImportFrom) and node.module}
    return {name[len(PACKAGE) + 1:] for name in names if name.startswith(f'{PACKAGE}.')}


def extensions() -> list[Extension]:
    """
    Return what setup() is to be told: something to build when it can be built.

    :raises ExecError: it is demanded, and cannot be.
    """
    why = obstacle()
    if why is None:
        return [Extension(FOLDER, sources=[])]  # a placeholder, for BuildCompiled
    if wanted():
        raise ExecError(f'{SWITCH}=1, but there is {why}')
    if _BUILDS.intersection(sys.argv) and wanted() is None:  # colcon shows the error stream
        print(f'{PACKAGE}: pure Python, there is {why}', file=sys.stderr, flush=True)
    return []


def file_name(module: str) -> str:
    """Name the file of an extension module for this Python; mypyc expects it in the folders."""
    return module.replace('.', '/') + str(sysconfig.get_config_var('EXT_SUFFIX'))


class _BuildBinaries(build_ext):
    """Build the extensions that mypyc describes, all into one folder."""

    def get_ext_filename(self, fullname: str) -> str:
        """Name the file of a module."""
        return file_name(fullname)

    def get_ext_fullpath(self, ext_name: str) -> str:
        """Say where it is built."""
        return str(Path(self.build_lib) / file_name(ext_name))


class BuildCompiled(build_ext):
    """Make the binaries and their manifest; does nothing where they fit their sources already."""

    _made: list[str] = []

    def run(self) -> None:
        """Compile, and put all in its place at the end: a running robot has the files open."""
        if obstacle() is not None:
            return
        root = Path.cwd() if self.inplace else Path(self.build_lib)
        folder = root / FOLDER
        manifest = read_manifest(folder)
        if manifest is None or changed_since(manifest, Path(PACKAGE)):
            print(f'{PACKAGE}: compiling {len(MODULES)} modules, half a minute', flush=True)
            try:
                manifest = self._compile(folder)
            # mypy ends the program with its message; old ones of it stumble over faults of theirs.
            except (Exception, SystemExit) as error:
                if wanted():
                    raise
                print(f'{PACKAGE}: pure Python, it could not be compiled: '
                      f'{type(error).__name__}: {error}',
                      file=sys.stderr, flush=True)
                return
        self._made = [str(folder / name) for name in manifest['files'].values()]
        self._made.append(str(manifest_path(folder)))
        print(f'{PACKAGE}: compiled with mypyc {manifest["mypyc"]}: {len(MODULES)} modules')

    def _compile(self, folder: Path) -> dict[str, Any]:
        from mypy.version import __version__ as mypyc_version
        from mypyc.build import mypycify

        temporary = Path(self.build_temp).absolute() / FOLDER
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir(parents=True)
        options = [*_MYPY_OPTIONS, f'--cache-dir={temporary / "mypy_cache"}']
        paths = [str(source_of(module, Path(PACKAGE))) for module in MODULES]
        made_of = sources(Path(PACKAGE))
        extensions = mypycify([*options, *paths], target_dir=str(temporary / 'c'),
                              debug_level='0', opt_level='3')
        for extension in extensions:
            # A newer compiler warns of newer things. A product and a sum rounded once instead of
            # twice (what ARM does when it may) is another number than the sources compute.
            extension.extra_compile_args = [
                *(option for option in extension.extra_compile_args if option != '-Werror'),
                '-ffp-contract=off']
        extensions += [Extension(f'{PACKAGE}.{module}', [str(source_of(module, Path(PACKAGE)))],
                                 extra_compile_args=['-O3']) for module in C_MODULES]
        self._build(extensions, temporary)
        manifest = {
            'mypyc': mypyc_version, 'modules': [*MODULES, *C_MODULES], 'sources': made_of,
            'files': {extension.name: file_name(extension.name)
                      for extension in extensions}}
        self._put_in_place(temporary, folder, manifest)
        return manifest

    def _build(self, extensions: list[Extension], folder: Path) -> None:
        self.distribution.ext_modules, before = extensions, self.distribution.ext_modules
        try:
            command = _BuildBinaries(self.distribution)
            command.ensure_finalized()
            command.build_lib, command.inplace = str(folder), False
            command.build_temp, command.parallel = str(folder / 'objects'), True
            command.run()
        finally:
            self.distribution.ext_modules = before

    def _put_in_place(self, temporary: Path, folder: Path, manifest: dict[str, Any]) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        manifest_path(folder).unlink(missing_ok=True)
        for old in folder.rglob(file_name('*')):
            old.unlink()
        for name in manifest['files'].values():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.move(temporary / name, folder / name)
        manifest_path(folder).write_text(json.dumps(manifest, indent=1))

    # ---- what setuptools asks ----------------------------------------------------------------

    def get_source_files(self) -> list[str]:
        """Return nothing: the sources are the package's."""
        return []

    def get_outputs(self) -> list[str]:
        """Return what was made."""
        return self._made

    def get_output_mapping(self) -> dict[str, str]:
        """Return nothing: an editable installation finds the folder beside the package."""
        return {}
