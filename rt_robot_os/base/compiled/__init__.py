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
The compiled build: whether this process uses the C core, and why not.

Every class is written in Python. Those that each job and each message use also exist in C, in the
extension module ``rt_robot_os._core``, which :mod:`rt_robot_os.base.compiled.build` builds. At the
end of its Python module the C type replaces the class of the same name. Without the extension, or
with one that was built from C sources other than those of this package, the Python classes run.

``RT_ROBOT_OS_COMPILE=0`` disables the C core, and 1 requires it, when the package is built and
when it runs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.machinery import ExtensionFileLoader
from importlib.util import module_from_spec
from importlib.util import spec_from_file_location
import os
from pathlib import Path
import sys
from typing import Any
from typing import Final
from typing import NamedTuple

PACKAGE: Final = 'rt_robot_os'
EXTENSION: Final = f'{PACKAGE}._core'
SWITCH: Final = 'RT_ROBOT_OS_COMPILE'

#: The extension module, or None; decided on first access (``__getattr__``).
NATIVE: Any


@dataclass(frozen=True)
class BuildState:
    """
    The build that runs.

    :ivar compiled: the C core is used.
    :ivar text: the same in one line, with the reason and the remedy.
    :ivar stale: there is a C core, but it was built from other sources.
    """

    compiled: bool
    text: str
    stale: bool = False


class _Decision(NamedTuple):
    native: Any
    state: BuildState


def wanted() -> bool | None:
    """
    Return the choice of the user: True requires the C core, False disables it, None allows both.

    :raises ImportError: the environment variable has another value than 0 or 1.
    """
    value = os.environ.get(SWITCH, '')
    if value not in ('', '0', '1'):
        raise ImportError(f'{SWITCH}={value!r} must be 0 (pure Python) or 1 (compiled), or unset',
                          name=EXTENSION)
    return {'': None, '0': False, '1': True}[value]


def c_files(package: Path, suffix: str) -> list[str]:
    """
    Return the C files of a package, sorted, from its folder: those whose names begin with ``_``.

    :param suffix: ``.c`` for the sources of the extension, ``.h`` for what they include.
    """
    return sorted(path.relative_to(package).as_posix() for path in package.glob(f'*/_*{suffix}'))


def sources_digest(package: Path) -> str:
    """Return the hash of the C files of a package; empty when it has none."""
    names = [*c_files(package, '.c'), *c_files(package, '.h')]
    if not names:
        return ''
    texts = (name.encode() + (package / name).read_bytes() for name in names)
    return sha256(b'\0'.join(sha256(text).digest() for text in texts)).hexdigest()


def is_made_of(binary: Path, digest: str) -> bool:
    """Return whether a binary was built from the sources with this hash, without loading it."""
    try:
        return digest.encode() in binary.read_bytes()
    except OSError:
        return False


def _binaries(package: Path) -> Iterator[Path]:
    """
    Yield the binaries for this Python: of the package, then of its other installations.

    Tests run the sources of a workspace, and colcon may have built in another folder: a binary of
    the same sources is used from anywhere on the path.
    """
    # A binary for the stable ABI needs Python 3.11 or later.
    suffixes = [suffix for suffix in EXTENSION_SUFFIXES
                if sys.version_info >= (3, 11) or 'abi3' not in suffix]
    places = [package, *(Path(place, PACKAGE) for place in sys.path if place)]
    for place in dict.fromkeys(places):
        for suffix in suffixes:
            path = place / f'_core{suffix}'
            if path.is_file():
                yield path


def _load(path: Path) -> Any:
    loader = ExtensionFileLoader(EXTENSION, str(path))
    spec = spec_from_file_location(EXTENSION, path, loader=loader)
    if spec is None:
        raise ImportError(f'{path} is not an extension module', name=EXTENSION)
    module = module_from_spec(spec)
    loader.exec_module(module)
    return module


def _decide(package: Path) -> _Decision:
    """Load the C core if it is allowed and one matches the sources."""
    if wanted() is False:
        return _Decision(None, BuildState(False, f'pure Python: {SWITCH}=0'))
    digest = sources_digest(package)
    why, stale = 'it was not compiled; with a C compiler `colcon build` does that', False
    for path in _binaries(package):
        if is_made_of(path, digest):
            try:
                native = _load(path)
            except ImportError as error:  # built for another processor or C library
                why = f'{path} cannot be loaded: {error}; `colcon build` compiles it again'
                continue
            return _Decision(native, BuildState(True, f'compiled with {native.BUILD}'))
        if not stale:
            why, stale = ('its C sources changed after it was compiled; `colcon build` compiles '
                          'it again'), True
    if wanted():
        raise ImportError(f'{SWITCH}=1, but pure Python: {why}', name=EXTENSION)
    return _Decision(None, BuildState(False, f'pure Python: {why}', stale))


_decision: _Decision | None = None


def _decided() -> _Decision:
    global _decision
    if _decision is None:
        _decision = _decide(Path(__file__).parents[2])
    return _decision


def state() -> BuildState:
    """
    Return which build runs.

    :raises ImportError: the C core is required, and none matches the sources.
    """
    return _decided().state


def __getattr__(name: str) -> Any:
    """Decide on first access: programs can report an error in one line; setup.py needs none."""
    if name == 'NATIVE':
        return _decided().native
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
