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


"""Read the sections of devices and modules: common keys, and those of the driver or module."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import re
from typing import Any
from typing import TypeVar

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.schema import declared
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import made
from rt_robot_os.base.schema import PartTopics
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.settings.catalogue import Catalogue
from rt_robot_os.settings.catalogue import Lookup
from rt_robot_os.settings.catalogue import PartKind
from rt_robot_os.settings.model import DeviceSettings
from rt_robot_os.settings.model import frozen
from rt_robot_os.settings.model import ModuleSettings
from rt_robot_os.settings.model import SIM_PORT
from rt_robot_os.settings.model import TaskSettings
from rt_robot_os.settings.problems import did_you_mean
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.sections import read_section
from rt_robot_os.settings.sections import Section
from rt_robot_os.settings.tree import Branch
from rt_robot_os.settings.tree import Leaf
from rt_robot_os.settings.tree import Origin

_Settings = TypeVar('_Settings', DeviceSettings, ModuleSettings)

_PLACEHOLDERS: Mapping[type, Any] = {bool: False, int: 0, float: 0.0, str: 'x', list: ()}


@dataclass(frozen=True, slots=True)
class PartSection:
    """
    The section of a device or module, before its settings are made.

    :ivar branch: as written.
    :ivar kind: None when its type is unknown.
    :ivar sim: the settings of the simulator; None for a real device.
    """

    section: Section
    branch: Branch
    kind: PartKind | None
    sim: Mapping[str, Any] | None = None

    @property
    def name(self) -> str:
        """Return the name of its section."""
        return self.section.name

    @property
    def enabled(self) -> bool:
        """Return whether it is enabled."""
        return self.section.values.get('enabled', True) is not False

    def own(self) -> Mapping[str, Any]:
        """Return the values of the class's own settings."""
        return self.section.pick(self.kind.fields if self.kind else ())


def common(cls: type, kind: PartKind) -> tuple[Field, ...]:
    """Join common keys and those of the class, which may redefine default or range of a key."""
    theirs = {each.name for each in kind.fields}
    return (*(each for each in declared(cls) if each.name not in theirs), *kind.fields)


def read_device(branch: Branch, name: str, catalogue: Catalogue, problems: Problems
                ) -> PartSection:
    """Read the section of one device and of its simulator."""
    kind, section = _read(branch, name, catalogue.drivers, DeviceSettings, 'driver', ('sim',),
                          problems)
    _check_retry(section, problems)
    sim = _read_simulator(branch, section, catalogue.simulators, problems) if kind else None
    return PartSection(section, branch, kind, sim)


def read_module(branch: Branch, name: str, catalogue: Catalogue, problems: Problems
                ) -> PartSection:
    """Read the section of one module."""
    kind, section = _read(branch, name, catalogue.modules, ModuleSettings, 'module', (), problems)
    if kind is not None and 'rate_hz' not in section.origins:
        if kind.is_coroutine:
            section.values['rate_hz'] = 0.0  # it awaits its own releases
        elif kind.rate_hz is not None:
            section.values['rate_hz'] = kind.rate_hz
    return PartSection(section, branch, kind)


def _read(
    branch: Branch, name: str, lookup: Lookup, ours: type, noun: str,
    elsewhere: tuple[str, ...], problems: Problems,
) -> tuple[PartKind | None, Section]:
    node = branch.children.get('type')
    kind = None
    if isinstance(node, Leaf) and isinstance(node.value, str) and not node.fault:
        try:
            kind = lookup.find(node.value)
        except ConfigError as error:
            for text in error.problems:
                problems.value(node.origin, f'{name}.type', node.value, text)
    elif node is None:
        text = f'{name}.type is missing: must be a {noun}, '
        problems.add(branch.origin, text + did_you_mean('', lookup.names()))
        branch = Branch(branch.origin, {**branch.children, 'type': Leaf(branch.origin, '')})
    if kind is None:
        # Without the class the other keys cannot be checked.
        return None, read_section(branch, name, declared(ours), problems, tuple(branch.children))
    return kind, read_section(branch, name, common(ours, kind), problems, elsewhere)


def _check_retry(section: Section, problems: Problems) -> None:
    first, longest = section.values.get('retry_s'), section.values.get('retry_max_s')
    if first is not None and longest is not None and longest < first:
        section.reject('retry_max_s', f'must be at least retry_s, {first:g} (s)', problems)


def _read_simulator(
    branch: Branch, section: Section, simulators: Lookup, problems: Problems,
) -> Mapping[str, Any] | None:
    node = branch.children.get('sim')
    wanted = section.values.get('port') == SIM_PORT
    if isinstance(node, Leaf):
        problems.add(node.origin, f"{section.name}.sim must be a section of the simulator's keys")
        return None
    if node is None and not wanted:
        return None
    driver = section.values.get('type', '')
    try:
        kind = simulators.find(driver)
    except ConfigError as error:
        key = 'port' if wanted else 'sim'
        origin = section.where(key) if node is None else node.origin
        for text in error.problems:
            problems.add(origin, f'{section.name}.{key}: {text}')
        return None
    tree = Branch(section.origin) if node is None else node
    found = read_section(tree, f'{section.name}.sim', kind.fields, problems)
    if not wanted:
        return None
    if len(found.values) == len(kind.fields):
        _check_simulator(found, kind, section.values, problems)
    return found.values


def _check_simulator(
    found: Section, kind: PartKind, device: Mapping[str, Any], problems: Problems,
) -> None:
    try:
        kind.check(found.name, found.values, device)
    except ConfigError as error:
        for text in error.problems:
            problems.add(found.origin, text)
    except Exception as error:  # a class from elsewhere may fail in any way
        text = f'{found.name}: this simulator cannot be made from these settings: {error!r}'
        problems.add(found.origin, text)


def topics_of(part: PartSection, noun: str, problems: Problems) -> PartTopics | None:
    """
    Query the class for its topics with these settings.

    A wrong value is replaced by its default, so that one mistake does not cause further errors.

    :return: None when they cannot be determined.
    """
    if part.kind is None:
        return None
    values = dict(part.own())
    complete = True
    for each in part.kind.fields:
        if each.name not in values:
            complete = False
            values[each.name] = _stand_in(each)
    try:
        return part.kind.topics(part.name, values)
    except RtRobotError as error:
        if complete:
            for line in str(error).splitlines():
                # Some classes name the section in their errors, others do not.
                named = line.startswith((f'{part.name}:', f'{part.name}.'))
                problems.add(_place(part.section, line),
                             line if named else f'{part.name}: {line}')
    except Exception as error:  # a class from elsewhere may fail in any way
        if complete:
            text = f'{part.name}: this {noun} cannot be made from these settings: {error!r}'
            problems.add(part.section.origin, text)
    return None


def _place(section: Section, line: str) -> Origin:
    """Return the place of the key that a problem begins with, otherwise of the section."""
    found = re.match(r'\w+', line.removeprefix(f'{section.name}.'))
    return section.where(found[0] if found and line.startswith(f'{section.name}.') else '')


def _stand_in(field: Field) -> Any:
    if field.default is not REQUIRED:
        return field.default
    if field.choices:
        return field.choices[0]
    if field.minimum is not None and field.kind in (int, float):
        return field.kind(field.minimum)
    return _PLACEHOLDERS[field.kind]


def build_part(cls: type[_Settings], part: PartSection) -> _Settings:
    """Make the settings of a device or a module without problems."""
    others: dict[str, Any] = {'name': part.name, 'settings': frozen(part.own())}
    if cls is DeviceSettings:
        others |= {'port': part.section.values.get('port', ''), 'read': _when_read(part),
                   'sim': None if part.sim is None else frozen(part.sim)}
    settings: _Settings = made(cls, frozen(part.section.values), **others)
    return settings


def _when_read(part: PartSection) -> str:
    """Return when it is read: a device that answers requests on interrupt, if possible."""
    answers = part.kind is not None and part.kind.answers and not task_of(part).logical_execution
    return 'interrupt' if answers else str(part.section.values['read'])


def task_of(part: PartSection) -> TaskSettings:
    """Return the task settings of a part; a wrong value is replaced by its default."""
    task: TaskSettings = made(TaskSettings, frozen(part.section.values))
    return task
