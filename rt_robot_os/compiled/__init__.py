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
The compiled build of the hot path: which modules, and whether this process runs it.

mypyc makes binaries of the very sources that are here (:mod:`rt_robot_os.compiled.build`). They
lie in a folder ``rt_robot_os_compiled`` beside the package or on the path, with a manifest of what
they were made of. A set that does not fit its sources to the letter is never used, nor a part of
it: the modules of a set know the layout of each other's objects. Without a set, the sources run as
they are.

Set to 0, ``RT_ROBOT_OS_COMPILE`` forbids it, and 1 demands it, when the package is built and when
it runs.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ExtensionFileLoader
from importlib.machinery import ModuleSpec
from importlib.util import source_hash
from importlib.util import spec_from_file_location
import json
import os
from pathlib import Path
import sys
import sysconfig
from types import ModuleType
from typing import Any
from typing import Final

PACKAGE: Final = 'rt_robot_os'
FOLDER: Final = f'{PACKAGE}_compiled'
SWITCH: Final = 'RT_ROBOT_OS_COMPILE'

# What is hot. Left out is what users subclass, and what takes long and must stay preemptible:
# compiled code is not interrupted.
MODULES: Final = (
    'kernel.alarms',
    'kernel.consequences',
    'kernel.coroutine',
    'kernel.count',
    'kernel.histogram',
    'kernel.interrupts',
    'kernel.kernel',
    'kernel.logical',
    'kernel.logical_tasks',
    'kernel.one_shot',
    'kernel.releases',
    'kernel.resource',
    'kernel.scheduler',
    'kernel.stolen',
    'kernel.task',
    'kernel.timers',
    'topics.logical',
    'topics.publisher',
    'topics.subscription',
    'topics.topic',
)
# What is written in C: the same in Python stands beside it.
C_MODULES: Final = ('linux._timer',)


@dataclass(frozen=True)
class State:
    """
    Which build runs.

    :ivar compiled: the binaries of mypyc.
    :ivar text: the same in one line, with the reason and the remedy.
    :ivar stale: there are binaries, of other sources than these.
    """

    compiled: bool
    text: str
    stale: bool = False


def wanted() -> bool | None:
    """
    Return what the user said: True demands the compiled build, False forbids it.

    :raises ImportError: the environment variable has another value than 0 or 1.
    """
    value = os.environ.get(SWITCH, '')
    if value not in ('', '0', '1'):
        raise ImportError(f'{SWITCH}={value!r} must be 0 (pure Python) or 1 (compiled), or unset',
                          name=FOLDER)
    return {'': None, '0': False, '1': True}[value]


def source_of(module: str, package: Path) -> Path:
    """Return the file of a module."""
    suffix = '.c' if module in C_MODULES else '.py'
    return package.joinpath(*module.split('.')).with_suffix(suffix)


def digest(path: Path) -> str:
    """Return the hash of a file by which Python itself knows its sources; empty without one."""
    try:
        return source_hash(path.read_bytes()).hex()
    except OSError:
        return ''


def manifest_path(folder: Path) -> Path:
    """Return the file that says what the binaries for this Python were made of."""
    return folder / f'manifest.{sysconfig.get_config_var("SOABI")}.json'


def changed_since(manifest: Mapping[str, Any], package: Path) -> list[str]:
    """Return the sources that are not what a manifest says; all of them must be what it says."""
    if manifest['modules'] != [*MODULES, *C_MODULES]:
        return ['compiled.__init__']
    return [module for module, recorded in manifest['sources'].items()
            if digest(source_of(module, package)) != recorded]


def read_manifest(folder: Path) -> dict[str, Any] | None:
    """Return what is known of the binaries in a folder; None without any for this Python."""
    try:
        manifest = json.loads(manifest_path(folder).read_text())
    except (OSError, ValueError):
        return None
    complete = isinstance(manifest, dict) and {'modules', 'sources', 'files'} <= set(manifest)
    return manifest if complete else None


class _Finder(MetaPathFinder):
    """Finds the binaries, once they have been compared with their sources."""

    def __init__(self, package: Path) -> None:
        self._package = package
        self._names = {f'{PACKAGE}.{module}' for module in (*MODULES, *C_MODULES)}
        self._files: dict[str, str] = {}
        self._state: State | None = None

    def state(self) -> State:
        """Say which build runs; decided once, when it is first asked."""
        if self._state is None:
            self._state = self._decide()
            if wanted() and not self._state.compiled:
                raise ImportError(f'{SWITCH}=1, but {self._state.text}', name=FOLDER)
        return self._state

    def _decide(self) -> State:
        if wanted() is False:
            return State(False, f'pure Python: {SWITCH}=0')
        stale: list[str] = []
        for folder in self._folders():
            manifest = read_manifest(folder)
            changed = changed_since(manifest, self._package) if manifest is not None else []
            if manifest is not None and not changed:
                self._files = {name: str(folder / file)
                               for name, file in manifest['files'].items()}
                return State(True, f'compiled with mypyc {manifest["mypyc"]}: '
                                   f'{len(MODULES)} modules')
            stale = stale or changed
        if not stale:
            return State(False, 'pure Python: it was not compiled; with a C compiler and mypy '
                                'installed `colcon build` does that')
        more = f' and {len(stale) - 1} more' if len(stale) > 1 else ''
        return State(False, f'pure Python: {stale[0].replace(".", "/")}.py{more} changed '
                            'after it was compiled; `colcon build` compiles it again',
                     stale=True)

    def _folders(self) -> Iterator[Path]:
        """
        Yield where binaries may lie: beside the package, or where an installation has put them.

        Tests run the sources of a workspace, and colcon builds elsewhere. What it has made of
        these very sources is used, wherever it is.
        """
        places = [self._package.parent, *map(Path, filter(None, sys.path))]
        yield from dict.fromkeys(place / FOLDER for place in places)

    def find_spec(self, fullname: str, path: Sequence[str] | None = None,
                  target: ModuleType | None = None) -> ModuleSpec | None:
        if fullname not in self._files and (
                fullname not in self._names or not self.state().compiled):
            return None
        file = self._files[fullname]
        return spec_from_file_location(fullname, file, loader=ExtensionFileLoader(fullname, file))


_finder = _Finder(Path(__file__).parents[1])


def use() -> None:
    """
    Let the binaries be found before the sources, if they may be used.

    A wrong value is told when the first module is imported that could be compiled: a program can
    say it in one line then.
    """
    if _finder not in sys.meta_path and os.environ.get(SWITCH) != '0':
        sys.meta_path.insert(0, _finder)


def state() -> State:
    """
    Say which build runs.

    :raises ImportError: the compiled build is demanded, and there is none that fits the sources.
    """
    return _finder.state()
