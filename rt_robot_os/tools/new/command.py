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

"""The command line of the program `new`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import os
from pathlib import Path
import shlex
import shutil
import sys

from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.programs import BAD_USE
from rt_robot_os.base.programs import OK
from rt_robot_os.base.programs import warn
from rt_robot_os.tools.new.package import Package
from rt_robot_os.tools.new.package import problems_of


def _arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='new', allow_abbrev=False, description='Write a package with a working and tested '
                                                    'driver or module, for you to change.')
    parser.add_argument('package', help='name of the package, such as my_robot')
    parser.add_argument('--driver', metavar='NAME', default='',
                        help='with a driver for a serial device, and a simulated device')
    parser.add_argument('--module', metavar='NAME', default='', help='with a function module')
    parser.add_argument('--into', metavar='DIR', type=Path, default=Path('.'),
                        help='folder in which the package is made, such as the src of a workspace '
                             '(default: the current one)')
    arguments = parser.parse_args(argv)
    if not arguments.driver and not arguments.module:
        parser.error('choose the content: --driver NAME, --module NAME, or both')
    return arguments


def run(argv: Sequence[str]) -> int:
    """
    Write a package.

    :param argv: without the program's name.
    :return: the exit code: 2 for an error, without anything written.
    """
    arguments = _arguments(argv)
    folder: Path = arguments.into / arguments.package
    try:
        problems = problems_of(arguments.package, arguments.driver, arguments.module)
        if not arguments.into.is_dir():
            problems.append(f'{arguments.into}: this folder does not exist')
        elif folder.exists() or folder.is_symlink():
            problems.append(f'{folder}: exists already, and nothing is overwritten')
        if not problems:
            Package(arguments.package, arguments.driver, arguments.module).write(folder)
    except OSError as error:
        problems = [f'{error.filename or folder}: cannot be written: {error.strerror}']
    except RtRobotError as error:
        problems = [str(error)]
    if problems:
        for problem in problems:
            warn('new', problem)
        return BAD_USE
    print(f'{folder} is written. {next_steps(folder, arguments.package)}')
    return OK


def next_steps(folder: Path, package: str) -> str:
    """Return the commands that build, test and start a package here: with ROS 2 or without."""
    clone = Path(__file__).resolve().parents[3]
    if shutil.which('ros2') or not (clone / 'scripts' / 'run').is_file():
        return ('In its workspace:\n'
                f'  colcon build --symlink-install --packages-select {package}\n'
                '  source install/setup.bash\n'
                f'  colcon test --packages-select {package} && colcon test-result --verbose\n'
                f'  ros2 launch {package} {package}.launch.xml')
    place = shlex.quote(os.path.relpath(folder, clone))
    python = shlex.quote(os.path.relpath(sys.executable, clone) if (
        Path(sys.prefix).parent == clone) else sys.executable)
    return (f'Without ROS 2, in {clone}:\n'
            '  ./scripts/install test\n'
            f'  {python} -m pip install --no-deps --no-build-isolation -e {place}\n'
            f'  {python} -m pytest {place}/test\n'
            f'  ./scripts/run robot {place}/config/{package}.yaml\n'
            f'In a workspace of ROS 2 it is a package like any other: see {folder}/README.md')
