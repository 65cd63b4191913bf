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
The parameters that were changed while the robot ran, saved as a parameter file.

The file holds the values that differ from the loaded configuration. Values in an existing file are
updated too, because it may be part of that configuration.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from contextlib import suppress
import json
import os
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.linux.folders import read_file
from rt_robot_os.linux.folders import ros_home
from rt_robot_os.linux.paths import node_of
from rt_robot_os.settings.files import read_files
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.tree import flatten
import yaml

MARK: Final = '# Parameters that were changed while the robot ran, saved by rt_robot_os.'
_CONFIGURATION: Final = '# Its parameter files: '
# Inline parameters of a launch file are in a new file at each start.
_TEMPORARY: Final = 'launch_params_'
_REMEDY: Final = 'give a file in a writable folder'


def saved_path(file: str, robot: str) -> Path:
    """
    Return the path of the file.

    :param file: the setting ``parameters_file``.
    :param robot: name of the robot's files, as from ``linux.paths.robot_name``.
    :raises StartError: the user has no home, see :func:`rt_robot_os.linux.folders.ros_home`.
    """
    if file:
        with suppress(RuntimeError):  # no home
            return Path(file).expanduser()
        return Path(file)
    return ros_home() / f'{robot}.saved.yaml'


def save(path: Path, robot: str, loaded: Mapping[str, Any], now: Mapping[str, Any], *,
         complete: bool = True, files: Sequence[str] = ()) -> dict[str, Any]:
    """
    Write the changed parameters; the file is replaced atomically.

    :param robot: name of the robot's files; the node's full name follows from it.
    :param loaded: the live parameters of the loaded configuration, by dotted name.
    :param now: the current values.
    :param complete: ``now`` has all live parameters; others are removed from the file.
    :param files: the parameter files of the robot: a file that another robot of the same name has
        saved is not overwritten.
    :return: the content of the file; empty when nothing was changed and no file was written.
    :raises ConfigError: the file cannot be written, was not written by this function, or belongs
        to another robot.
    """
    mine = _configuration(files, path)
    values = {name: now.get(name, value) for name, value in _kept(path, robot, mine).items()
              if name in now or not complete}
    values.update({name: value for name, value in now.items()
                   if name not in loaded or loaded[name] != value})
    if not values and not path.exists():
        return {}
    tree: dict[str, Any] = {}
    for name, value in sorted(values.items()):
        *sections, key = name.split('.')
        branch = tree
        for section in sections:
            branch = branch.setdefault(section, {})
        branch[key] = value
    body = yaml.safe_dump({node_of(robot): {'ros__parameters': tree}}, sort_keys=False)
    whose = f'{_CONFIGURATION}{json.dumps(mine)}\n' if mine else ''
    _replace(path, f'{MARK}\n{whose}# It comes after the file that it was loaded with:\n'
             f'#   --params-file ... --params-file {path.name}\n{body}')
    return values


def _configuration(files: Sequence[str], path: Path) -> list[str]:
    """Return the files that distinguish a robot from another with the same name."""
    return [file for file in files if file != os.path.realpath(path)
            and not os.path.basename(file).startswith(_TEMPORARY)]


def describe_saved(path: Path, values: Mapping[str, Any]) -> str:
    """Return a sentence about the result of :func:`save`."""
    if not values:
        return f'nothing differs from the loaded configuration; {path} is not needed'
    return f'{path}: {", ".join(f"{name} = {value!r}" for name, value in sorted(values.items()))}'


def _kept(path: Path, robot: str, mine: Sequence[str]) -> dict[str, Any]:
    """Read a file that was saved before."""
    try:
        first, *more = read_file(path).decode(errors='replace').split('\n', 2)
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise ConfigError([f'{path} cannot be written: {error.strerror}: {_REMEDY}']) from error
    if first != MARK:
        raise ConfigError([f'{path} is not a file of saved parameters, and is not overwritten: '
                           'give another file, or move this one'])
    theirs = _configuration_of(more[0]) if more else []
    if mine and not set(mine) & set(theirs) and any(map(os.path.exists, theirs)):
        raise ConfigError([f'{path} was saved by another robot of this name, which was configured '
                           f'by {", ".join(theirs)}, and is not overwritten: give this robot '
                           'another name or a parameters_file, or move the file'])
    namespace, _, name = node_of(robot).rpartition('/')
    tree = read_files([path], namespace or '/', name, Problems())
    return {name: leaf.value for name, leaf in flatten(tree).items()}


def _configuration_of(line: str) -> list[str]:
    if not line.startswith(_CONFIGURATION):
        return []  # of an earlier release
    try:
        files = json.loads(line.removeprefix(_CONFIGURATION))
    except (ValueError, RecursionError):
        return []
    return [file for file in files if isinstance(file, str)] if isinstance(files, list) else []


def _replace(path: Path, text: str) -> None:
    temporary = path.with_name(f'.{path.name}.{os.getpid()}')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.unlink(missing_ok=True)
        with temporary.open('x', encoding='utf-8') as file:  # an existing link is not followed
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        with suppress(OSError):
            temporary.unlink()
        raise ConfigError([f'{path} cannot be written: {error.strerror}: {_REMEDY}']) from error
