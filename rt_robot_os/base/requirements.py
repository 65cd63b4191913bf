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
The Python libraries of this package: one table of names, versions and extras.

``setup.py`` takes its requirements from here, :mod:`rt_robot_os.base.needs` its messages, and the
scripts the packages that they install. It imports only the standard library, so that the scripts
can run it as a file before anything is installed::

    python3 -I rt_robot_os/base/requirements.py install base monitor  # lines for pip
    python3 -I rt_robot_os/base/requirements.py missing base monitor  # the unsatisfied ones
    python3 -I rt_robot_os/base/requirements.py lowest  # constraints: the oldest versions
    python3 -I rt_robot_os/base/requirements.py extras monitor  # the extras of a program
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import zip_longest
import re
import sys
from typing import Final


@dataclass(frozen=True)
class Library:
    """
    A library from the package index.

    :ivar name: of the distribution.
    :ivar module: its import name.
    :ivar lowest: the oldest version that is supported; ``scripts/lowest`` tests with it.
    :ivar below: exclusive upper bound in the environments of the scripts; '' for none.
    :ivar apt: the package of Ubuntu 24.04; '' where there is none, or it is too old.
    :ivar parts: extras of the library itself.
    :ivar marker: environment marker; '' for all environments.
    :ivar others: other distributions with the same module.
    """

    name: str
    module: str
    lowest: str
    below: str = ''
    apt: str = ''
    parts: str = ''
    marker: str = ''
    others: tuple[str, ...] = ()

    @property
    def requirement(self) -> str:
        """Return the requirement without an upper bound, as packages state it."""
        return f'{self._named}>={self.lowest}{self._where}'

    @property
    def bounded(self) -> str:
        """Return the requirement as the scripts install it."""
        below = f',<{self.below}' if self.below else ''
        return f'{self._named}>={self.lowest}{below}{self._where}'

    @property
    def _named(self) -> str:
        return f'{self.name}[{self.parts}]' if self.parts else self.name

    @property
    def _where(self) -> str:
        return f'; {self.marker}' if self.marker else ''

    def found(self) -> str | None:
        """Return the installed version: None when it is missing, '' when it is unknown."""
        from importlib import metadata  # not needed by the core
        if find_spec(self.module) is None:
            return None
        for name in (self.name, *self.others):
            try:
                return metadata.version(name)
            except metadata.PackageNotFoundError:
                continue
        return ''  # some packages of Debian and Ubuntu come without metadata

    def is_satisfied(self) -> bool:
        """Return whether it is installed and new enough."""
        version = self.found()
        return version is not None and (not version or at_least(version, self.lowest))


_X86: Final = 'platform_machine == "x86_64"'

LIBRARIES: Final = {each.name: each for each in (
    Library('numpy', 'numpy', '1.26', '3', apt='python3-numpy'),
    Library('pyserial', 'serial', '3.5', '4', apt='python3-serial'),
    Library('PyYAML', 'yaml', '6.0.1', '7', apt='python3-yaml'),
    Library('rich', 'rich', '13.7', '16', apt='python3-rich'),
    Library('setuptools', 'setuptools', '68', apt='python3-setuptools'),

    Library('pillow', 'PIL', '10.1', '14', apt='python3-pil'),
    Library('opencv-python-headless', 'cv2', '4.6', '6', apt='python3-opencv',
            others=('opencv-python', 'opencv-contrib-python-headless', 'opencv-contrib-python',
                    'opencv')),
    Library('sounddevice', 'sounddevice', '0.4.6', '1'),
    Library('smbus2', 'smbus2', '0.4', '1', apt='python3-smbus2'),
    Library('vqf', 'vqf', '2.1', '3', marker=_X86),

    Library('mcap', 'mcap', '1.3', '2'),
    Library('lz4', 'lz4', '4.0.2', '5', apt='python3-lz4'),
    Library('zstandard', 'zstandard', '0.22', '1', apt='python3-zstandard'),
    Library('matplotlib', 'matplotlib', '3.6.3', '4', apt='python3-matplotlib'),
    Library('scipy', 'scipy', '1.11.4', '2', apt='python3-scipy'),

    Library('fastapi', 'fastapi', '0.120', '1'),
    Library('pydantic', 'pydantic', '2.7', '3'),
    Library('uvicorn', 'uvicorn', '0.44', '1'),
    Library('websockets', 'websockets', '15', '18'),
    Library('sqlalchemy', 'sqlalchemy', '2.0.23', '3'),
    Library('alembic', 'alembic', '1.13', '2'),
    Library('argon2-cffi', 'argon2', '23.1'),
    Library('cryptography', 'cryptography', '42'),
    Library('psycopg', 'psycopg', '3.1.18', '4', parts='binary'),
    Library('aiortc', 'aiortc', '1.9', '2'),

    Library('hypothesis', 'hypothesis', '6.98', '7', apt='python3-hypothesis'),
    Library('pytest', 'pytest', '7.4', '10', apt='python3-pytest'),
    Library('mcap-ros2-support', 'mcap_ros2', '0.5', '1'),
    Library('rosbags', 'rosbags', '0.10.9', '1'),
    Library('sphinx', 'sphinx', '7.2', '10', apt='python3-sphinx'),

    Library('horus-robotics', 'horus', '0'),
    Library('simpy', 'simpy', '4'),
    Library('vitalscore', 'vitalscore', '0.1', '1'))}

# Required by every program.
BASE: Final = ('numpy', 'pyserial', 'PyYAML', 'rich', 'setuptools')

EXTRAS: Final = {
    'attitude': ('vqf',),
    'camera': ('opencv-python-headless', 'pillow'),
    'docs': ('sphinx',),
    'gateway': ('websockets',),
    'i2c': ('smbus2',),
    'monitor': ('alembic', 'argon2-cffi', 'cryptography', 'fastapi', 'pydantic', 'sqlalchemy',
                'uvicorn', 'websockets'),
    'peers': ('horus-robotics', 'simpy', 'vitalscore'),
    'pictures': ('pillow',),
    'plot': ('matplotlib',),
    'postgres': ('psycopg',),
    'record': ('lz4', 'mcap', 'zstandard'),
    'slam': ('scipy',),
    'sound': ('sounddevice',),
    'test': ('hypothesis', 'mcap', 'mcap-ros2-support', 'pillow', 'pytest', 'rosbags'),
    'voice': ('aiortc', 'sounddevice')}

# The extras that `./scripts/run PROGRAM` installs before the first start, in addition to `base`.
PROGRAMS: Final = {
    'core': ('pictures',),
    'gateway': ('gateway',),
    'i2c_bridge': ('i2c',),
    'mapping': ('pictures', 'record', 'slam'),
    'monitor': ('gateway', 'monitor', 'pictures'),
    'record': ('record',),
    'replay': ('record',),
    'robot': ('pictures',),
    # Installed by `./scripts/test`; the others need more than a wheel, or are for comparisons.
    'test': ('attitude', 'docs', 'gateway', 'i2c', 'monitor', 'pictures', 'plot', 'postgres',
             'record', 'slam', 'test', 'voice')}

# Build tools; their oldest versions come with the distributions.
_TOOLS: Final = ('setuptools',)


def at_least(version: str, lowest: str) -> bool:
    """Return whether a version is as new as another; only the release numbers are compared."""
    pairs = zip_longest(_release(version), _release(lowest), fillvalue=0)
    return next((one > other for one, other in pairs if one != other), True)


def _release(version: str) -> list[int]:
    found = re.match(r'(?:\d+!)?(\d+(?:\.\d+)*)', version)
    return [int(part) for part in found[1].split('.')] if found else []


def libraries(extras: Iterable[str]) -> list[Library]:
    """
    Return the libraries of extras, each once.

    ``base`` stands for those that every robot needs.

    :raises KeyError: an extra does not exist.
    """
    groups = {**EXTRAS, 'base': BASE}
    names = dict.fromkeys(name for extra in extras for name in groups[extra])
    return [LIBRARIES[name] for name in names]


def install_requires() -> list[str]:
    """Return ``install_requires`` of ``setup.py``."""
    return [each.requirement for each in libraries(['base'])]


def extras_require() -> dict[str, list[str]]:
    """Return ``extras_require`` of ``setup.py``."""
    return {extra: [each.requirement for each in libraries([extra])] for extra in EXTRAS}


def main(argv: Sequence[str]) -> int:
    """Run a command of the scripts; the exit code is 2 for an unknown command or extra."""
    command, *names = argv or ['']
    if command == 'extras':
        lines = [' '.join(PROGRAMS.get(names[0], ()))]
    elif command == 'lowest':
        lines = [f'{each.name}=={each.lowest}' for each in libraries(['base', *PROGRAMS['test']])
                 if each.name not in _TOOLS]
    elif command in ('install', 'missing'):
        unknown = [name for name in names if name not in ('base', *EXTRAS)]
        if unknown:
            print(f"no extra '{unknown[0]}', there are: {' '.join(EXTRAS)}", file=sys.stderr)
            return 2
        lines = [each.bounded for each in libraries(names)
                 if command == 'install' or not each.is_satisfied()]
    else:
        print(f"no command '{command}', there are: extras install lowest missing",
              file=sys.stderr)
        return 2
    print('\n'.join(lines))
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
