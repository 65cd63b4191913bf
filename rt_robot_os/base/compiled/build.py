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
Compile the C core, as a command of setuptools that `colcon build` and `pip install` run.

Nothing here is needed at run time. On a machine without a C compiler the Python classes of the
same package run. Additional flags, as for sanitizers, come from the environment (``CFLAGS``).
"""

from __future__ import annotations

import os
from pathlib import Path
import shutil
import sys
import sysconfig
from typing import Final

from rt_robot_os.base.compiled import c_files
from rt_robot_os.base.compiled import EXTENSION
from rt_robot_os.base.compiled import is_made_of
from rt_robot_os.base.compiled import PACKAGE
from rt_robot_os.base.compiled import sources_digest
from rt_robot_os.base.compiled import SWITCH
from rt_robot_os.base.compiled import wanted
from setuptools import Extension
from setuptools.command.build_ext import build_ext
from setuptools.errors import BaseError
from setuptools.errors import CCompilerError
from setuptools.errors import ExecError

# One binary runs on all versions from this one on; 3.10 and debug builds need their own.
OLDEST_STABLE: Final = (3, 11)
STABLE: Final = sys.version_info >= OLDEST_STABLE and not sysconfig.get_config_var('Py_DEBUG')
WARNINGS: Final = ('-Wall', '-Wextra')

# The commands that produce a usable package.
_BUILDS: Final = {'bdist_wheel', 'build', 'develop', 'editable_wheel', 'install'}


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
    return None


def macros(package: Path) -> dict[str, str]:
    """Return the macros for the compiler."""
    found = {'RT_ROBOT_OS_SOURCES': f'"{sources_digest(package)}"'}
    if STABLE:
        found['Py_LIMITED_API'] = '0x{:02X}{:02X}0000'.format(*OLDEST_STABLE)
    return found


def extensions() -> list[Extension]:
    """
    Return the extension modules for setup(): one where it can be compiled.

    :raises ExecError: it is required and cannot be compiled.
    """
    why = obstacle()
    if why is None:
        return [Extension(
            EXTENSION, [f'{PACKAGE}/{name}' for name in c_files(Path(PACKAGE), '.c')],
            depends=[f'{PACKAGE}/{name}' for name in c_files(Path(PACKAGE), '.h')],
            define_macros=list(macros(Path(PACKAGE)).items()), py_limited_api=STABLE,
            extra_compile_args=['-std=c11', '-fvisibility=hidden', *WARNINGS],
            optional=not wanted())]
    if wanted():
        raise ExecError(f'{SWITCH}=1, but there is {why}')
    if _BUILDS.intersection(sys.argv) and wanted() is None:  # colcon shows the error stream
        print(f'{PACKAGE}: pure Python, there is {why}', file=sys.stderr, flush=True)
    return []


def wheel_options() -> dict[str, dict[str, str]]:
    """Return the options of setup() for a wheel with the C core that fits all later versions."""
    if not STABLE or obstacle() is not None:
        return {}
    return {'bdist_wheel': {'py_limited_api': 'cp{}{}'.format(*OLDEST_STABLE)}}


class BuildCore(build_ext):
    """Compile the extension unless there is one of the same sources."""

    force: bool

    def build_extension(self, extension: Extension) -> None:
        """Compile it; a failure ends the build of the package only if the C core is required."""
        digest = sources_digest(Path(PACKAGE))
        if not self.force and is_made_of(Path(self.get_ext_fullpath(extension.name)), digest):
            return
        self.force = True  # setuptools would compare times only
        try:
            super().build_extension(extension)
        except (BaseError, CCompilerError) as error:
            if wanted():
                raise
            print(f'{PACKAGE}: pure Python, it could not be compiled: {error}', file=sys.stderr,
                  flush=True)
