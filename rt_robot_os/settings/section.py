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


"""Reads one section of the tree against its declared fields."""

from __future__ import annotations

from collections.abc import Collection
from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from typing import Any

from rt_robot_os.schema import Field
from rt_robot_os.schema import REQUIRED
from rt_robot_os.settings.problems import description_of
from rt_robot_os.settings.problems import did_you_mean
from rt_robot_os.settings.problems import problem_of
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.tree import Branch
from rt_robot_os.settings.tree import Leaf
from rt_robot_os.settings.tree import Origin


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
        """Say where a key was written, or else its section."""
        return self.origins.get(key, self.origin)

    def reject(self, key: str, remedy: str, problems: Problems) -> None:
        """Report the value of a key and forget it."""
        problems.value(self.where(key), f'{self.name}.{key}', self.values.pop(key), remedy)

    def pick(self, fields: Sequence[Field]) -> Mapping[str, Any]:
        """Give the values of some fields."""
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
    section.values[each.name] = each.coerce(leaf.value)
    section.origins[each.name] = leaf.origin
