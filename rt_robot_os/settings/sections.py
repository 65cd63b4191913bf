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

"""Find the sections of a file, and read each according to its declared settings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from collections.abc import Iterable
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
import functools
import itertools
from typing import Any
from typing import Final

from rt_robot_os.base.schema import declared
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.settings.catalogue import Catalogue
from rt_robot_os.settings.files import path_near
from rt_robot_os.settings.names import is_token
from rt_robot_os.settings.names import TOKEN_RULE
from rt_robot_os.settings.problems import description_of
from rt_robot_os.settings.problems import did_you_mean
from rt_robot_os.settings.problems import Names
from rt_robot_os.settings.problems import nearest
from rt_robot_os.settings.problems import problem_of
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.tree import Branch
from rt_robot_os.settings.tree import flatten
from rt_robot_os.settings.tree import Leaf
from rt_robot_os.settings.tree import Origin

# Parameters that ROS 2 itself gives a node; a dumped file contains them.
ROS_OWN: Final = frozenset({'use_sim_time', 'start_type_description_service', 'qos_overrides'})

# What drivers declare, and the section within a section.
_MORE: Final = {'devices': {'port', 'baud', 'sim'}, 'topics': {'fixed'}}


def _lists() -> Mapping[str, type]:
    # Late, as below: a program beside the robot has other settings, and these need NumPy.
    from rt_robot_os.settings.model import LISTS
    return LISTS


@functools.cache
def _top() -> frozenset[str]:
    """Return the keys at the top, which name no section of a list."""
    from rt_robot_os.settings.model import RobotSettings
    from rt_robot_os.settings.model import SECTIONS
    return frozenset({each.name for each in declared(RobotSettings)} | set(SECTIONS))


@functools.cache
def _telling() -> Mapping[str, set[str]]:
    """Return the keys that only the sections of one list have, by list."""
    keys = {name: [each.name for each in declared(kind)] for name, kind in _lists().items()}
    often = Counter(itertools.chain(*keys.values()))
    return {name: {key for key in found if often[key] == 1} | _MORE.get(name, set())
            for name, found in keys.items()}


@dataclass(frozen=True, slots=True)
class Section:
    """
    The values of a section that can be used.

    :ivar values: by key; a key whose value is wrong or missing is absent.
    :ivar origins: where each key stands; the section's own place for a default.
    """

    name: str
    origin: Origin
    values: dict[str, Any] = field(default_factory=dict)
    origins: dict[str, Origin] = field(default_factory=dict)

    def where(self, key: str) -> Origin:
        """Return where a key was written, or else its section."""
        return self.origins.get(key, self.origin)

    def reject(self, key: str, remedy: str, problems: Problems) -> None:
        """Report the value of a key and forget it."""
        problems.value(self.where(key), f'{self.name}.{key}', self.values.pop(key), remedy)

    def pick(self, fields: Sequence[Field]) -> Mapping[str, Any]:
        """Return the values of some fields."""
        return {each.name: self.values[each.name] for each in fields if each.name in self.values}


def read_section(
    branch: Branch, name: str, fields: Sequence[Field], problems: Problems,
    elsewhere: Collection[str] = (),
) -> Section:
    """
    Check a section: unknown keys, missing keys, wrong values; fill in the defaults.

    :param name: dotted, for the messages; empty at the top.
    :param elsewhere: keys that somebody else reads.
    """
    section = Section(name, branch.origin)
    prefix = f'{name}.' if name else ''
    known = {each.name for each in fields}
    for key, node in branch.children.items():
        if key not in known and key not in elsewhere:
            guess = did_you_mean(key, known | set(elsewhere))
            problems.add(node.origin, f'{prefix}{key}: unknown key, {guess}')
    for each in fields:
        found = branch.children.get(each.name)
        label = f'{prefix}{each.name}'
        if found is None:
            if each.default is REQUIRED:
                text = f'{label} is missing: must be {each.wanted()}. {description_of(each)}'
                problems.add(branch.origin, text)
            else:
                section.values[each.name] = each.default
        elif isinstance(found, Branch):
            problems.add(found.origin, f'{label} is a section: must be {each.wanted()}')
        elif not found.fault:
            _check(section, each, found, label, problems)
    return section


def _check(section: Section, each: Field, leaf: Leaf, label: str, problems: Problems) -> None:
    remedy = problem_of(each, leaf.value)
    if remedy:
        problems.value(leaf.origin, label, leaf.value, remedy)
        return
    value = each.coerce(leaf.value)
    if each.is_file and value and not value.startswith('~') and '://' not in value:
        value = str(path_near(value, leaf.origin.file))
    section.values[each.name] = value
    section.origins[each.name] = leaf.origin


@dataclass(frozen=True, slots=True)
class Sections:
    """
    The sections that are in a list.

    :ivar listed: by list, then by name in the order of the list.
    :ivar loose: names and strings of sections that are in no known list.
    """

    listed: dict[str, dict[str, Branch]] = field(
        default_factory=lambda: {name: {} for name in _lists()})
    loose: set[str] = field(default_factory=set)


def find_sections(tree: Branch, catalogue: Catalogue, problems: Problems) -> Sections:
    """
    Find the section of each listed name.

    Names without a section, sections in no list and names in two lists are problems.
    """
    sections = Sections()
    known = Names(key for key, node in tree.children.items()
                  if isinstance(node, Branch) and key not in _top())
    owners: dict[str, str] = {}
    broken = {name for name in _lists()
              if not _read_list(name, tree, owners, sections, known, problems)}
    keys = Names([*sorted(_top()), *owners])
    for key, node in tree.children.items():
        if key in owners or key in _top() or key in ROS_OWN:
            continue
        if not isinstance(node, Branch):
            problems.value(node.origin, key, node.value,
                           f'unknown key, {did_you_mean(key, keys)}')
            continue
        sections.loose.update((key, *texts(node)))
        probable = _probable_lists(node, catalogue)
        if not broken.intersection(probable):
            where = ' or '.join(f"'{name}'" for name in probable)
            guess = nearest(key, _top())
            hint = f", or did you mean '{guess}'?" if guess else ''
            problems.add(node.origin, f'{key}: this section is in no list: add {key!r} to {where} '
                         f'or delete it{hint}')
    return sections


def texts(section: Branch) -> Iterable[str]:
    """Return the strings of a section, at any depth."""
    return (leaf.value for leaf in flatten(section).values() if isinstance(leaf.value, str))


def _read_list(
    list_name: str, tree: Branch, owners: dict[str, str], sections: Sections, known: Names,
    problems: Problems,
) -> bool:
    """
    Find the sections of one list.

    :param known: all sections that may be in a list.
    :return: False if it is not a list of names; that is reported where its type is checked.
    """
    node = tree.children.get(list_name, Leaf(tree.origin, ()))
    if not isinstance(node, Leaf) or node.fault or not isinstance(node.value, tuple):
        return False
    if not all(isinstance(name, str) for name in node.value):
        return False
    found = sections.listed[list_name]
    for index, name in enumerate(node.value):
        origin = node.item_origin(index)
        wrong = _name_problem(name, list_name, owners)
        if wrong:
            problems.value(origin, list_name, name, wrong)
            continue
        owners[name] = list_name
        section = tree.children.get(name)
        if isinstance(section, Branch):
            found[name] = section
            continue
        sections.loose.add(name)
        if section is None:
            problems.value(origin, list_name, name, f'has no section{_section_hint(name, known)}')
        elif not section.fault:
            problems.value(section.origin, name, section.value, 'must be a section')
    return True


def _name_problem(name: str, list_name: str, owners: Mapping[str, str]) -> str | None:
    if not is_token(name):
        return f'a name must be {TOKEN_RULE}'
    if name in _top() or name in ROS_OWN:
        return 'is the name of a key: choose another name'
    owner = owners.get(name)
    if owner == list_name:
        return 'is twice in this list: delete one'
    return owner and f"is already in '{owner}': each section is in one list"


def _section_hint(name: str, known: Names) -> str:
    guess = known.nearest(name)
    return f', did you mean {guess!r}?' if guess else f': write {name}: {{...}}'


def _probable_lists(section: Branch, catalogue: Catalogue) -> tuple[str, ...]:
    """Guess from its keys which list a section belongs to."""
    kind = section.children.get('type')
    if isinstance(kind, Leaf) and kind.value in catalogue.drivers.names():
        return ('devices',)
    if isinstance(kind, Leaf) and kind.value in catalogue.modules.names():
        return ('modules',)
    for name, keys in _telling().items():
        if keys & set(section.children):
            return (name,)
    return ('devices', 'modules') if kind else tuple(_lists())
