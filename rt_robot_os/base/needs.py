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
Check optional libraries before they are imported, and report how to install the missing ones.

Code that imports an optional library first calls this module with the name of its distribution in
:data:`rt_robot_os.base.requirements.LIBRARIES`, so that an outdated version is reported like a
missing library::

    require('mapping', 'scipy')                                  # raises StartError
    require('--picture', 'matplotlib', error=ConfigError)
    text = lacking('voice', 'aiortc')                            # '' when it is installed

The message names the feature, each library with its version, and the command for this
environment; see ``docs/libraries.md``. Nothing here is for the real-time loop.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence
from pathlib import Path
import platform
import shlex
import shutil
import sys
import sysconfig
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.errors import StartError
from rt_robot_os.base.requirements import at_least
from rt_robot_os.base.requirements import EXTRAS
from rt_robot_os.base.requirements import LIBRARIES
from rt_robot_os.base.requirements import libraries
from rt_robot_os.base.requirements import Library

PAGE: Final = 'docs/libraries.md'
_SCRIPT: Final = Path('scripts', 'install')
# Marker files of the scripts in an environment that they created or adopted.
_STAMPS: Final = '.rt_robot_os*'
# The oldest release of a distribution with the packages in the table.
_PACKAGED: Final = {'debian': '13', 'ubuntu': '24.04'}


def require(feature: str, *names: str, error: type[RtRobotError] = StartError) -> None:
    """
    Make sure that libraries are installed and new enough; nothing is imported.

    :param feature: that needs them, as the subject of a sentence.
    :param names: of distributions.
    :param error: the type to raise.
    :raises RtRobotError: one is missing or too old; the message says how to install it.
    """
    text = lacking(feature, *names)
    if text:
        raise ConfigError([text]) if error is ConfigError else error(text)


def lacking(feature: str, *names: str) -> str:
    """
    Return which libraries are missing or too old and how to install them; '' when none is.

    :param feature: that needs the libraries, as the subject of a sentence.
    :param names: of distributions.
    """
    missing = [LIBRARIES[name] for name in names if not LIBRARIES[name].is_satisfied()]
    if not missing:
        return ''
    return f'{feature} needs {" and ".join(map(_state, missing))}: {remedy(missing)}'


def _state(library: Library) -> str:
    version = library.found()
    return (f'{library.name} {library.lowest} or newer '
            f'({"not installed" if version is None else f"{version} is installed"})')


def remedy(missing: Sequence[Library]) -> str:
    """Return the command that installs libraries in the environment of this process."""
    if _is_of_scripts():
        return f'./{_SCRIPT} {" ".join(_extras(missing))}'
    wanted = ' '.join(shlex.quote(each.requirement.partition(';')[0]) for each in missing)
    if not _is_managed():
        return f'{_python()} -m pip install {wanted}'
    if _has_packages() and all(each.apt and each.found() is None for each in missing):
        return f'sudo apt install {" ".join(each.apt for each in missing)}'
    return ('python3 -m venv --system-site-packages ~/rt_robot_os_venv && '
            f'~/rt_robot_os_venv/bin/pip install {wanted}, and run it from there: {PAGE}')


def _extras(missing: Iterable[Library]) -> list[str]:
    """Return the smallest extras that include libraries; ``base`` for those in none."""
    found: dict[str, None] = {}
    for each in missing:
        if not any(each in libraries([extra]) for extra in found):
            bringing = [extra for extra, names in EXTRAS.items() if each.name in names]
            found[min(bringing, key=lambda extra: len(EXTRAS[extra]), default='base')] = None
    return list(found)


def _is_of_scripts() -> bool:
    """Return whether scripts/run created this environment and can extend it."""
    root = Path(__file__).resolve().parents[2]
    return (root / _SCRIPT).is_file() and any(Path(sys.prefix).glob(_STAMPS))


def _is_managed() -> bool:
    """Return whether pip must not install here (PEP 668), as in the system's Python."""
    return sys.prefix == sys.base_prefix and Path(
        sysconfig.get_path('stdlib'), 'EXTERNALLY-MANAGED').is_file()


def _has_packages() -> bool:
    """Return whether the packages of this distribution are new enough."""
    try:
        about = platform.freedesktop_os_release()
    except OSError:
        return False
    oldest = _PACKAGED.get(about['ID'])
    return oldest is not None and at_least(about.get('VERSION_ID', '0'), oldest)


def _python() -> str:
    """Return the command of this interpreter in a shell."""
    found = shutil.which('python3')
    # Compare the folders: the interpreter of a virtual environment is a symbolic link.
    same = found is not None and Path(found).parent.resolve() == Path(
        sys.executable).parent.resolve()
    return 'python3' if same else shlex.quote(sys.executable)


def ros_remedy(package: str) -> str:
    """
    Return the command that installs a package of ROS messages; '' where there is none.

    :param package: such as ``tf2_msgs``.
    """
    from importlib import metadata
    try:
        metadata.version('ros-jazzy-rclpy')
    except metadata.PackageNotFoundError:
        return f'sudo apt install ros-jazzy-{package.replace("_", "-")}'
    return './scripts/tf2_msgs' if package == 'tf2_msgs' else ''
