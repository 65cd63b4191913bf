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

"""Read the world of the simulated devices: its section, its own file, its map and its entries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import declared
from rt_robot_os.base.schema import made
from rt_robot_os.settings.files import path_near
from rt_robot_os.settings.files import read_text
from rt_robot_os.settings.model import frozen
from rt_robot_os.settings.nodes import expand
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.sections import read_section
from rt_robot_os.settings.sections import Section
from rt_robot_os.settings.tree import Branch
from rt_robot_os.settings.tree import COMMAND_LINE
from rt_robot_os.settings.tree import Leaf
from rt_robot_os.settings.tree import merge
from rt_robot_os.settings.tree import Origin
from rt_robot_os.settings.yaml_text import parse
from rt_robot_os.settings.yaml_text import YamlProblem
from rt_robot_os.sim.world_settings import OPEN_FLOOR
from rt_robot_os.sim.world_settings import WorldSettings

SECTION: Final = 'world'

_COUNTS: Final = {'start': 3, 'wheel_radius_error': 2}


def load_world(path: Path) -> WorldSettings:
    """
    Read a file with a world, as ``simulator --world`` does.

    :raises ConfigError: with every problem, each with file and line.
    """
    problems = Problems([str(path)])
    leaf = Leaf(Origin(COMMAND_LINE), str(path))
    branch = _with_file(Branch(leaf.origin, {'file': leaf}), leaf, problems)
    problems.raise_any()
    section = read_section(branch, SECTION, declared(WorldSettings), problems)
    check_world(Branch(branch.origin, {SECTION: branch}), section, problems)
    problems.raise_any()
    found: WorldSettings = made(WorldSettings, frozen(section.values))
    if not found.map:
        raise ConfigError([f'{path}: map is missing: it must be the YAML file of a map, or '
                           f'{OPEN_FLOOR}'])
    return replace(found, file=str(path))


def with_world_file(tree: Branch, problems: Problems) -> Branch:
    """Merge the section of the world over the file that it names, if it names one."""
    section = tree.children.get(SECTION)
    name = section.children.get('file') if isinstance(section, Branch) else None
    if not isinstance(section, Branch) or not isinstance(name, Leaf) or not (
            isinstance(name.value, str) and name.value and not name.fault):
        return tree
    merged = _with_file(section, name, problems)
    return Branch(tree.origin, {**tree.children, SECTION: merged})


def _with_file(section: Branch, name: Leaf, problems: Problems) -> Branch:
    """Merge a section over a file; return the section if the file is not valid."""
    path = path_near(name.value, name.origin.file)
    try:
        raw = parse(read_text(path), str(path))
    except YamlProblem as problem:
        problems.add(Origin(str(path), problem.line), str(problem))
        return section
    if raw is None or isinstance(raw, Leaf):
        problems.add(Origin(str(path)), 'must have the keys of a world, such as map: flat.yaml')
        return section
    file = expand(raw, problems)
    if (deeper := file.children.pop('file', None)) is not None:
        problems.add(deeper.origin, 'file: a file with a world must not name another file')
    return Branch(section.origin, merge(file, section).children)


def check_world(tree: Branch, section: Section, problems: Problems) -> None:
    """Check the map and every entry; the map's path becomes absolute."""
    branch = tree.children.get(SECTION)
    for key, count in _COUNTS.items():
        if len(section.values.get(key, range(count))) != count:
            section.reject(key, f'must be {count} numbers', problems)
    _check_map(section, problems)
    if not isinstance(branch, Branch):
        return
    # Late: the core reads its settings as JSON, and all that it imports is locked in memory.
    from rt_robot_os.sim.world.scene import clashes
    from rt_robot_os.sim.world.scene import READERS
    for key, reader in READERS.items():
        leaf = branch.children.get(key)
        if not isinstance(leaf, Leaf) or key not in section.values:
            continue
        things = _things(leaf, key, reader, section.values[key], problems)
        for text in clashes(key, things):
            problems.add(leaf.origin, text)
    if not problems:
        _check_whole(section, problems)


def _check_map(section: Section, problems: Problems) -> None:
    name = section.values.get('map', '')
    if not name or name == OPEN_FLOOR:
        return
    origin = section.where('map')
    path = path_near(name, origin.file)
    section.values['map'] = str(path)
    from rt_robot_os.motion.grid_map import GridMap
    try:
        GridMap.load(path)
    except ConfigError as error:
        for text in error.problems:
            problems.add(origin, f'{SECTION}.map: {text}')


def _things(
    leaf: Leaf, key: str, reader: Callable[[str], Any], texts: list[str], problems: Problems,
) -> list[Any]:
    things = []
    for index, text in enumerate(texts):
        try:
            things.append(reader(text))
        except ValueError as error:
            problems.value(leaf.item_origin(index), f'{SECTION}.{key}', text, str(error))
    return things


def _check_whole(section: Section, problems: Problems) -> None:
    """Find problems of the whole world, such as a robot that starts in a wall."""
    if not section.values['map']:
        return
    from rt_robot_os.sim.world.world import World
    try:
        World(made(WorldSettings, frozen(section.values)))
    except ConfigError as error:
        for text in error.problems:
            key = text.partition(':')[0].removeprefix(f'{SECTION}.')
            problems.add(section.where(key), text)
