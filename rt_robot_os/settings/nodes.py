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
Select the parameters of a node from a file.

The rules are those of rcl: ``robot:``, ``/robot:``, ``/lab: {robot: ...}``, ``/lab/robot:`` and
the wildcards ``*`` (one name) and ``**`` (any number), applied in the order of the file.
"""

from __future__ import annotations

from dataclasses import dataclass

from rt_robot_os.settings.names import full_name
from rt_robot_os.settings.problems import nearest
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.tree import Branch
from rt_robot_os.settings.tree import Leaf
from rt_robot_os.settings.tree import merge
from rt_robot_os.settings.tree import NO_VALUE
from rt_robot_os.settings.tree import Origin
from rt_robot_os.settings.tree import RawMap

PARAMETERS = 'ros__parameters'


@dataclass(frozen=True, slots=True)
class NodeParameters:
    """
    The parameters of a file for this node.

    :ivar tree: the parameters, merged from all matching sections.
    :ivar matched: whether any section matches the node.
    :ivar others: the full names of the sections that do not match.
    """

    tree: Branch
    matched: bool
    others: tuple[str, ...]


def select(root: RawMap, namespace: str, node: str, problems: Problems) -> NodeParameters:
    """Select the parameters of one node from one file."""
    found: list[tuple[str, RawMap]] = []
    _walk(root, '', found, problems)
    wanted = [token for token in full_name(namespace, node).split('/') if token]
    tree = Branch(root.origin)
    matched = False
    others: list[str] = []
    for name, parameters in found:
        if matches([token for token in name.split('/') if token], wanted):
            tree = merge(tree, expand(parameters, problems))
            matched = True
        else:
            others.append(name)
    return NodeParameters(tree, matched, tuple(others))


def matches(pattern: list[str], name: list[str]) -> bool:
    """Return whether the tokens of a section's name, with wildcards, match a node's full name."""
    reached = {0}
    for token in pattern:
        if token == '**':
            reached = set(range(min(reached), len(name) + 1)) if reached else reached
        else:
            reached = {i + 1 for i in reached if i < len(name) and token in ('*', name[i])}
    return len(name) in reached


def _walk(
    node: RawMap, path: str, found: list[tuple[str, RawMap]], problems: Problems,
) -> None:
    seen: dict[str, Origin] = {}
    for key, origin, value in node.items:
        where = f"{path.rstrip('/')}/{key.strip('/')}"
        if key in seen:
            problems.add(origin, f'{where} already exists at line {seen[key].line}: join the two')
            continue
        seen[key] = origin
        if key == PARAMETERS and path:
            if isinstance(value, RawMap):
                found.append((path, value))
            else:
                problems.add(origin, f'{where} must be a section: write {{}} when it is empty')
        elif key == PARAMETERS:
            problems.add(origin, f"{PARAMETERS} must be below the node's name: robot:")
        elif isinstance(value, RawMap) and nearest(key, [PARAMETERS]) is None:
            _walk(value, where, found, problems)
        else:
            guess = f"did you mean '{PARAMETERS}:'?" if isinstance(value, RawMap) else (
                f"parameters must be below 'robot:' and then '{PARAMETERS}:'")
            problems.add(origin, f"{where} is outside '{PARAMETERS}': {guess}")
            if isinstance(value, Leaf):
                # For a file without that level one error is enough, not one for each key.
                break


def expand(raw: RawMap, problems: Problems) -> Branch:
    """Expand dotted keys (``imu.rate_hz: 5``) and find keys that are given twice."""
    branch = Branch(raw.origin)
    _fill(branch, raw, '', problems)
    return branch


def _fill(branch: Branch, raw: RawMap, prefix: str, problems: Problems) -> None:
    written: dict[str, Origin] = {}
    for key, origin, value in raw.items:
        *parents, last = key.split('.')
        name = f'{prefix}{key}'
        first = written.setdefault(key, origin)
        if not all([*parents, last]):
            problems.add(origin, f'{name!r} is not a parameter name: a part of it is empty')
        elif first is not origin:
            _report_twice(name, origin, first, problems)
        else:
            at = _descend(branch, parents, name, origin, problems)
            if at is not None:
                _put(at, last, name, origin, value, problems)


def _descend(
    branch: Branch, keys: list[str], name: str, origin: Origin, problems: Problems,
) -> Branch | None:
    for key in keys:
        step = branch.children.setdefault(key, Branch(origin))
        if isinstance(step, Leaf):
            problems.add(origin, f'{name} is below a value: see line {step.origin.line}')
            return None
        branch = step
    return branch


def _put(
    at: Branch, key: str, name: str, origin: Origin, value: Leaf | RawMap, problems: Problems,
) -> None:
    old = at.children.get(key)
    if isinstance(value, RawMap) and not isinstance(old, Leaf):
        section = Branch(origin, {} if old is None else old.children)
        at.children[key] = section
        _fill(section, value, f'{name}.', problems)
    elif old is not None:
        _report_twice(name, origin, old.origin, problems)
    elif isinstance(value, Leaf):
        at.children[key] = value
        if value.fault == NO_VALUE:
            problems.add(origin, f'{name} {NO_VALUE}')
        elif value.fault:
            problems.value(origin, name, value.value, value.fault)


def _report_twice(name: str, origin: Origin, first: Origin, problems: Problems) -> None:
    where = f'first at line {first.line}' if first.line else 'and cannot be both'
    problems.add(origin, f'{name} is given a second time ({where}): delete one')
