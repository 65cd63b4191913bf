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


"""Reader of the YAML file of a scenario; reports all problems with file, line and remedy."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import declared
from rt_robot_os.base.schema import made
from rt_robot_os.features.wsn.simulator.faults import fault
from rt_robot_os.features.wsn.simulator.faults import nodes_of
from rt_robot_os.features.wsn.simulator.scenario import Scenario
from rt_robot_os.features.wsn.simulator.scenario import SECTIONS
from rt_robot_os.features.wsn.simulator.scenario import settled
from rt_robot_os.features.wsn.simulator.scenario import wrong
from rt_robot_os.features.wsn.simulator.sink_route import read_point
from rt_robot_os.features.wsn.simulator.topology import make_topology
from rt_robot_os.features.wsn.simulator.topology import Topology
from rt_robot_os.messages.survey import node
from rt_robot_os.settings.files import default_path
from rt_robot_os.settings.files import read_overrides
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
from rt_robot_os.settings.tree import RawMap
from rt_robot_os.settings.yaml_text import parse
from rt_robot_os.settings.yaml_text import YamlProblem

_READERS: Final[Mapping[str, Callable[[str], Any]]] = {
    'faults': fault, 'sink.way': read_point, 'topology.nodes': node}


def find_scenario(name: str) -> Path:
    """
    Find a scenario: a file, or the name of one of this package, such as ``home12``.

    :raises ConfigError: neither exists.
    """
    path = Path(name)
    if path.exists() or path.suffix or len(path.parts) > 1:
        return path
    try:
        return default_path(f'scenarios/{name}.yaml')
    except ConfigError:
        try:
            folder = default_path('scenarios/home12.yaml').parent
            known = ', '.join(sorted(each.stem for each in folder.glob('*.yaml')))
        except ConfigError:
            known = 'none'
        raise ConfigError([f'{name}: no such file, and no scenario of this package: '
                           f'{known}']) from None


def load_scenario(path: Path, overrides: Mapping[str, Any] | None = None,
                  assignments: Sequence[str] = ()) -> tuple[Scenario, Topology]:
    """
    Read a scenario and check it before it runs, files included.

    :param overrides: values that override the file, by section as in the file.
    :param assignments: strings such as ``traffic.period_ms=500``, which override both.
    :return: the complete scenario, and its topology.
    :raises ConfigError: with one line for each problem.
    """
    problems = Problems([str(path), COMMAND_LINE])
    tree = _tree(path, problems)
    if overrides:
        tree = merge(tree, read_overrides(overrides, problems))
    for text in assignments:
        tree = merge(tree, _assigned(text, problems))
    sections = _sections(tree, problems)
    _check_strings(sections, tree, problems)
    problems.raise_any()
    scenario = _build(sections)
    found = list(wrong(scenario))
    for key, remedy in found:
        _add_problem(key, remedy, sections, tree, problems)
    if any(key.startswith(('topology', 'sink')) for key, _ in found):
        problems.raise_any()
    scenario = settled(replace(scenario, name=scenario.name or path.stem))
    try:
        topology = make_topology(scenario)
    except ConfigError as error:
        for text in error.problems:
            problems.add(_place(text, sections, tree), text)
        problems.raise_any()
    _check_ids(scenario, topology, sections, tree, problems)
    problems.raise_any()
    return scenario, topology


def _tree(path: Path, problems: Problems) -> Branch:
    try:
        raw = parse(read_text(path), str(path))
    except YamlProblem as problem:
        problems.add(Origin(str(path), problem.line), str(problem))
        problems.raise_any()
        raise AssertionError from None
    if raw is None or isinstance(raw, Leaf):
        problems.add(Origin(str(path)), 'must have the keys of a scenario, such as topology: '
                     '{grid: 4x5}')
        problems.raise_any()
        raise AssertionError from None
    _mix_numbers(raw)
    return expand(raw, problems)


def _assigned(text: str, problems: Problems) -> Branch:
    key, equals, value = text.partition('=')
    if not equals or not key.strip():
        problems.add(Origin(COMMAND_LINE), f'{text}: must be KEY=VALUE, such as protocol=ctp')
        return Branch(Origin(COMMAND_LINE))
    try:
        raw = parse(f'{key.strip()}: {value}', COMMAND_LINE)
    except YamlProblem as problem:
        problems.add(Origin(COMMAND_LINE), f'{text}: {problem}')
        raw = None
    if not isinstance(raw, RawMap):
        return Branch(Origin(COMMAND_LINE))
    _mix_numbers(raw)
    return expand(raw, problems)


def _mix_numbers(raw: RawMap) -> None:
    """Allow lists with integers and floats, unlike parameters of ROS 2."""
    for index, (key, origin, found) in enumerate(raw.items):
        if isinstance(found, RawMap):
            _mix_numbers(found)
        elif found.fault and isinstance(found.value, tuple) and found.value and all(
                type(item) in (int, float) for item in found.value):
            mixed = Leaf(found.origin, tuple(map(float, found.value)), '', found.lines)
            raw.items[index] = (key, origin, mixed)


def _sections(tree: Branch, problems: Problems) -> dict[str, Section]:
    found = {'': read_section(tree, '', declared(Scenario), problems, tuple(SECTIONS))}
    for name, kind in SECTIONS.items():
        below = tree.children.get(name, Branch(tree.origin))
        if isinstance(below, Leaf):
            problems.value(below.origin, name, below.value, 'must be a section: its keys are '
                           f'{", ".join(each.name for each in declared(kind))}')
            below = Branch(below.origin)
        found[name] = read_section(below, name, declared(kind), problems)
    return found


def _leaf(key: str, tree: Branch) -> Leaf | None:
    found: Branch | Leaf | None = tree
    for part in key.split('.'):
        found = found.children.get(part) if isinstance(found, Branch) else None
    return found if isinstance(found, Leaf) else None


def _check_strings(sections: Mapping[str, Section], tree: Branch, problems: Problems) -> None:
    for key, reader in _READERS.items():
        section, _, name = key.rpartition('.')
        leaf = _leaf(key, tree)
        for index, text in enumerate(sections[section].values.get(name, ())):
            try:
                reader(text)
            except ValueError as error:
                origin = leaf.item_origin(index) if leaf is not None else tree.origin
                problems.value(origin, key, text, str(error))


def _build(sections: Mapping[str, Section]) -> Scenario:
    parts = {name: made(kind, frozen(sections[name].values)) for name, kind in SECTIONS.items()}
    found: Scenario = made(Scenario, frozen(sections[''].values), **parts)
    return found


def _origin(key: str, sections: Mapping[str, Section], tree: Branch) -> Origin:
    section, _, name = key.rpartition('.')
    if key in tree.children:
        return tree.children[key].origin
    return sections[section].where(name) if section in sections else tree.origin


def _add_problem(key: str, remedy: str, sections: Mapping[str, Section], tree: Branch,
                 problems: Problems) -> None:
    leaf = _leaf(key, tree)
    origin = _origin(key, sections, tree)
    if leaf is None:
        problems.add(origin, f'{key} {remedy}')
    else:
        problems.value(origin, key, leaf.value, remedy)


def _place(text: str, sections: Mapping[str, Section], tree: Branch) -> Origin:
    """Find the key at the start of a problem of the topology."""
    key = text.partition(' ')[0].rstrip(':')
    known = {f'{name}.{each.name}' for name, kind in SECTIONS.items() for each in declared(kind)}
    if key in known:
        return _origin(key, sections, tree)
    return _origin('topology', sections, tree)


def _check_ids(scenario: Scenario, topology: Topology, sections: Mapping[str, Section],
               tree: Branch, problems: Problems) -> None:
    leaf = _leaf('faults', tree)
    for index, text in enumerate(scenario.faults):
        one = fault(text)
        try:
            nodes_of(one, topology.places, topology.sinks, Random(0))
            if one.kind == 'move' and not topology.located:
                raise ValueError('the nodes of a links file have no position')
            if one.kind == 'noise' and topology.links is not None:
                raise ValueError('a links file has no noise: change its links with lines '
                                 '"@ t from to prr rssi lqi"')
        except ValueError as error:
            origin = leaf.item_origin(index) if leaf is not None else tree.origin
            problems.value(origin, 'faults', text, str(error))
    for each in scenario.traffic.sources:
        if each not in topology.places or each in topology.sinks:
            what = 'is the sink' if each in topology.sinks else 'is not a node'
            _add_problem('traffic.sources', f'{each} {what}', sections, tree, problems)
