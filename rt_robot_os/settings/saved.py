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
What was changed while the robot ran, as a parameter file that is laid over the others.

It holds the values that differ from the configuration that was loaded. When the file is there
already, what it says is kept up to date too: it may be part of that configuration.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
import os
from pathlib import Path
import tempfile
from typing import Any
from typing import Final

from rt_robot_os.errors import ConfigError
from rt_robot_os.settings.files import read_files
from rt_robot_os.settings.model import RobotSettings
from rt_robot_os.settings.parameters import parameters
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.tree import flatten
import yaml

MARK: Final = '# Parameters that were changed while the robot ran, saved by rt_robot_os.'
_REMEDY: Final = 'give a file in a folder that can be written'


def saved_path(file: str, robot: str) -> Path:
    """
    Give the file that is written.

    :param file: the setting ``parameters_file``.
    :param robot: name of the robot's files, as from ``link.paths.robot_name``.
    """
    if file:
        with suppress(RuntimeError):  # no home
            return Path(file).expanduser()
        return Path(file)
    try:
        home = Path(os.environ.get('ROS_HOME') or '~/.ros').expanduser()
    except RuntimeError:
        home = Path(tempfile.gettempdir())
    return home / f'{robot}.saved.yaml'


def live_values(settings: RobotSettings) -> dict[str, Any]:
    """Give the parameters that may change while the robot runs, by dotted name."""
    return {each.name: each.value for each in parameters(settings) if each.live}


def save(path: Path, robot: str, loaded: Mapping[str, Any], now: Mapping[str, Any], *,
         complete: bool = True) -> dict[str, Any]:
    """
    Write the parameters that were changed; the file is there whole, or as it was.

    :param robot: name of the robot's files; the node's full name follows from it.
    :param loaded: live parameters as the configuration had them, by dotted name.
    :param now: as they are.
    :param complete: these are all; what else the file says is taken out.
    :return: what the file holds; empty when nothing was changed, and no file was written.
    :raises ConfigError: the file cannot be written, or was not written by us.
    """
    values = {name: now.get(name, value) for name, value in _kept(path, robot).items()
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
    body = yaml.safe_dump({_node(robot): {'ros__parameters': tree}}, sort_keys=False)
    _replace(path, f'{MARK}\n# It comes after the file that it was loaded with:\n'
             f'#   --params-file ... --params-file {path.name}\n{body}')
    return values


def told_saved(path: Path, values: Mapping[str, Any]) -> str:
    """Say what :func:`save` has done."""
    if not values:
        return f'nothing differs from the configuration that was loaded; {path} is not needed'
    return f'{path}: {", ".join(f"{name} = {value!r}" for name, value in sorted(values.items()))}'


def _node(robot: str) -> str:
    return '/' + robot.replace('.', '/')


def _kept(path: Path, robot: str) -> dict[str, Any]:
    """Read a file that we have written before."""
    try:
        with path.open(encoding='utf-8', errors='replace') as file:
            first = file.readline().rstrip('\n')
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise ConfigError([f'{path} cannot be written: {error.strerror}: {_REMEDY}']) from error
    if first != MARK:
        raise ConfigError([f'{path} is no file of saved parameters, and is not overwritten: give '
                           'another file, or move it away'])
    namespace, _, name = _node(robot).rpartition('/')
    tree = read_files([path], namespace or '/', name, Problems())
    return {name: leaf.value for name, leaf in flatten(tree).items()}


def _replace(path: Path, text: str) -> None:
    temporary = path.with_name(f'.{path.name}.{os.getpid()}')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open('w', encoding='utf-8') as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        with suppress(OSError):
            temporary.unlink()
        raise ConfigError([f'{path} cannot be written: {error.strerror}: {_REMEDY}']) from error
