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

"""The parameter files: locate the shipped ones, read files and merge them."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
import math
import os
from pathlib import Path
import sys
from typing import Any

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.linux.folders import read_file
from rt_robot_os.settings.names import full_name
from rt_robot_os.settings.nodes import expand
from rt_robot_os.settings.nodes import NodeParameters
from rt_robot_os.settings.nodes import select
from rt_robot_os.settings.problems import nearest
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.tree import Branch
from rt_robot_os.settings.tree import COMMAND_LINE
from rt_robot_os.settings.tree import Leaf
from rt_robot_os.settings.tree import merge
from rt_robot_os.settings.tree import NO_VALUE
from rt_robot_os.settings.tree import Origin
from rt_robot_os.settings.tree import RawMap
from rt_robot_os.settings.yaml_text import DEEPEST
from rt_robot_os.settings.yaml_text import INT64_END
from rt_robot_os.settings.yaml_text import parse
from rt_robot_os.settings.yaml_text import YamlProblem

_PACKAGE = 'rt_robot_os'


def default_path(name: str = 'robot.yaml') -> Path:
    """
    Find a configuration file of this package, without asking ament.

    First that of the source tree, if the code runs from there, then the one installed with this
    code, then those of ``AMENT_PREFIX_PATH``.

    :raises ConfigError: there is none; the message lists the paths.
    """
    tried = []
    for folder in _folders():
        path = folder / name
        if path.is_file():
            return path
        tried.append(str(path))
    raise ConfigError([f'{name}: this configuration is not installed; looked for '
                       + ', '.join(dict.fromkeys(tried))])


def path_near(name: str, file: str) -> Path:
    """
    Find a file that another file names: relative to that file, then among those of this package.

    :param name: a path; an absolute path is returned unmodified.
    :param file: the file with the name; for the command line the working folder is used.
    :return: an absolute path, which may not exist.
    """
    folder = Path() if file == COMMAND_LINE else Path(file).parent
    path = (folder / name).absolute()
    if not os.path.lexists(path):
        try:
            return default_path(name).absolute()
        except ConfigError:
            pass  # reported when it is opened
    return path


def _folders() -> Iterator[Path]:
    here = Path(__file__).resolve()
    root = here.parents[2]
    if (root / 'resource' / _PACKAGE).is_file():
        yield root / 'config'
    share = Path('share') / _PACKAGE / 'config'
    # <prefix>/lib/python3.x/site-packages/rt_robot_os/settings/files.py, or one folder deeper.
    for prefix in here.parents[5:7]:
        yield prefix / share
    for entry in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        if entry:
            yield Path(entry) / share
    yield Path(sys.prefix) / share


def read_files(
    paths: Sequence[Path], namespace: str, node: str, problems: Problems, *,
    is_needed: bool = True,
) -> Branch:
    """
    Merge the node's parameters of several files; later ones win.

    :param is_needed: False for files of another node, which may have no section for this one.
    :raises ConfigError: a file cannot be read or is not YAML; nothing else can be checked then.
    """
    read: list[tuple[Path, NodeParameters]] = []
    broken = False
    for path in paths:
        try:
            root = parse(read_text(path), str(path))
        except YamlProblem as problem:
            problems.add(Origin(str(path), problem.line), str(problem))
            broken = True
            continue
        if isinstance(root, Leaf):
            problems.add(root.origin, f"must be parameters: '{node}:', then 'ros__parameters:'")
            broken = True
        elif root is not None:
            read.append((path, select(root, namespace, node, problems)))
        else:
            read.append((path, NodeParameters(Branch(Origin(str(path))), False, ())))
    if broken:
        problems.raise_any()
    _check_matched(read, namespace, node, problems, is_needed)
    tree = Branch(Origin(str(paths[-1]), 1) if paths else Origin(COMMAND_LINE))
    for _, parameters in read:
        tree = merge(tree, parameters.tree)
    return tree


def _check_matched(
    read: Sequence[tuple[Path, NodeParameters]], namespace: str, node: str, problems: Problems,
    is_needed: bool,
) -> None:
    """Find files without parameters for this node, although they should have some."""
    name = full_name(namespace, node)
    none_matched = is_needed and not any(parameters.matched for _, parameters in read)
    for path, parameters in read:
        guess = _misspelt(node, parameters.others)
        if parameters.matched or not (none_matched or guess):
            continue
        there = ', '.join(parameters.others[:5]) or 'nothing'
        hint = f'did you mean {node!r} by {guess!r}?' if guess else f"put them under '{name}:'"
        problems.add(Origin(str(path)), f'has no parameters for {name}, only for {there}: {hint}')


def _misspelt(node: str, sections: Sequence[str]) -> str | None:
    """Find a name similar to the node's; robot1 and robot2 are two robots, not a misspelling."""
    def without_digits(name: str) -> str:
        return ''.join(c for c in name if not c.isdigit())

    lasts = {section.rpartition('/')[2] for section in sections}
    stem = without_digits(node)
    return nearest(node, {last for last in lasts if without_digits(last) != stem})


def read_text(path: Path) -> str:
    """
    Read a file as text; bounded, and never from a file that could block.

    :raises YamlProblem: with the reason.
    """
    if '\0' in str(path):
        raise YamlProblem('cannot be read: its path has a null character')
    try:
        data = read_file(path)
    except OSError as error:
        raise YamlProblem(f'cannot be read: {error.strerror}') from None
    except UnicodeEncodeError:
        raise YamlProblem('cannot be read: its path cannot be encoded') from None
    try:
        return data.decode('utf-8-sig')
    except UnicodeDecodeError as error:
        before = data[:error.start]
        line, column = before.count(b'\n') + 1, error.start - before.rfind(b'\n')
        reason = f'not UTF-8: byte 0x{data[error.start]:02x}'
        raise YamlProblem(reason, line, column) from None


def read_overrides(overrides: Mapping[str, Any], problems: Problems) -> Branch:
    """Convert the values of the command line, by dotted name, to a tree like that of a file."""
    return expand(_raw(overrides, 0), problems)


def _raw(mapping: Mapping[Any, Any], depth: int) -> RawMap:
    origin = Origin(COMMAND_LINE)
    raw = RawMap(origin)
    for key, value in mapping.items():
        name = key if isinstance(key, str) else repr(key)
        if isinstance(value, Mapping) and depth < DEEPEST:
            raw.items.append((name, origin, _raw(value, depth + 1)))
        else:
            raw.items.append((name, origin, _leaf(value, origin)))
    return raw


def _leaf(value: Any, origin: Origin) -> Leaf:
    if isinstance(value, list | tuple):
        if any(isinstance(item, list | tuple | Mapping) for item in value):
            return Leaf(origin, (), 'a list must not contain a section or a list')
        leaves = [_leaf(item, origin) for item in value]
        fault = next((leaf.fault for leaf in leaves if leaf.fault), '')
        return Leaf(origin, tuple(leaf.value for leaf in leaves), fault)
    if isinstance(value, int) and not -INT64_END <= value < INT64_END:
        return Leaf(origin, math.inf if value > 0 else -math.inf)
    if isinstance(value, bool | int | float | str):
        return Leaf(origin, value)
    if value is None:
        return Leaf(origin, None, NO_VALUE)
    return Leaf(origin, type(value).__name__,
                'must be true or false, a number, a string or a list')
