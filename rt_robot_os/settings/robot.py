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


"""From the parameters of the node to the settings of the robot: each section, then the whole."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any

from rt_robot_os.base.schema import declared
from rt_robot_os.base.schema import made
from rt_robot_os.base.schema import PartTopics
from rt_robot_os.settings.catalogue import Catalogue
from rt_robot_os.settings.mirror_patterns import expanded
from rt_robot_os.settings.mirror_patterns import is_pattern
from rt_robot_os.settings.model import DeviceSettings
from rt_robot_os.settings.model import frozen
from rt_robot_os.settings.model import MirrorSettings
from rt_robot_os.settings.model import ModuleSettings
from rt_robot_os.settings.model import RobotSettings
from rt_robot_os.settings.model import SECTIONS
from rt_robot_os.settings.model import TopicSettings
from rt_robot_os.settings.mountings import check_mountings
from rt_robot_os.settings.parts import build_part
from rt_robot_os.settings.parts import PartSection
from rt_robot_os.settings.parts import read_device
from rt_robot_os.settings.parts import read_module
from rt_robot_os.settings.parts import topics_of
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.sections import find_sections
from rt_robot_os.settings.sections import read_section
from rt_robot_os.settings.sections import ROS_OWN
from rt_robot_os.settings.sections import Section
from rt_robot_os.settings.sections import texts
from rt_robot_os.settings.service_model import ServiceSettings
from rt_robot_os.settings.services import check_services
from rt_robot_os.settings.tasks import check_tasks
from rt_robot_os.settings.tree import Branch
from rt_robot_os.settings.tree import flatten
from rt_robot_os.settings.tree import Leaf
from rt_robot_os.settings.wiring import check_mirrors
from rt_robot_os.settings.wiring import check_ports
from rt_robot_os.settings.wiring import TopicTable
from rt_robot_os.settings.world import check_world
from rt_robot_os.settings.world import with_world_file
from rt_robot_os.topics.topic import is_depth


def read_robot(
    tree: Branch, namespace: str, node: str, catalogue: Catalogue, problems: Problems,
) -> RobotSettings:
    """
    Check everything and build the settings.

    :raises ConfigError: with every problem, including those found before.
    """
    tree = with_world_file(tree, problems)
    named = find_sections(tree, catalogue, problems)
    top = read_section(tree, '', declared(RobotSettings), problems, set(tree.children) | ROS_OWN)
    sections = {name: _read_named_section(tree, name, kind, problems)
                for name, kind in SECTIONS.items()}
    devices = [read_device(branch, name, catalogue, problems)
               for name, branch in named.listed['devices'].items()]
    modules = [read_module(branch, name, catalogue, problems)
               for name, branch in named.listed['modules'].items()]
    topics = [_read_topic(branch, name, problems)
              for name, branch in named.listed['topics'].items()]
    mirrors = [read_section(branch, name, declared(MirrorSettings), problems)
               for name, branch in named.listed['mirrors'].items()]
    services = [read_section(branch, name, declared(ServiceSettings), problems)
                for name, branch in named.listed['services'].items()]
    check_world(tree, sections['world'], problems)
    at_work = [part for part in devices if part.enabled]
    modules_at_work = [part for part in modules if part.enabled]
    check_ports(at_work, problems)
    frames = check_mountings(at_work, problems)
    table = TopicTable(loose=named.loose, complete=not named.loose)
    uses = _fill_table(table, devices, modules, topics, catalogue, problems)
    table.check_reads(problems)
    uses = {name: table.expanded(each) for name, each in uses.items()}
    single = expanded(mirrors, table, problems)
    check_mirrors(single, table, namespace, node, problems)
    check_services(services, table, namespace, node, problems)
    check_tasks(at_work, modules_at_work, uses, sections['core'], sections['watchdog'],
                problems)
    problems.raise_any()
    patterns = {each.name: each for each in mirrors if is_pattern(each.values['topic'])}
    robot: RobotSettings = made(
        RobotSettings, top.values,
        **{name: made(kind, frozen(sections[name].values)) for name, kind in SECTIONS.items()},
        devices=tuple(build_part(DeviceSettings, part) for part in at_work),
        modules=tuple(build_part(ModuleSettings, part) for part in modules_at_work),
        topics=(*(made(TopicSettings, section.values, name=section.name,
                       fixed=frozen(section.values['fixed'])) for section in topics),
                *_silent_topics([*devices, *modules], topics, uses)),
        mirrors=tuple(_mirror(section, table, patterns) for section in single),
        services=tuple(made(ServiceSettings, section.values, name=section.name)
                       for section in services),
        frames=frames)
    return robot


def _mirror(section: Section, table: TopicTable, patterns: Mapping[str, Section]
            ) -> MirrorSettings:
    """Make the settings of a mirror; that of a pattern keeps the pattern as written."""
    topic: str = section.values['topic']
    written = patterns.get(section.name)
    kept = {} if written is None else {
        'pattern': written.values['topic'], 'ros_pattern': written.values['ros_topic']}
    mirror: MirrorSettings = made(
        MirrorSettings, section.values, name=section.name, message=table.message(topic),
        core_frame_id=table.frame_id(topic), **kept)
    return mirror


def _read_named_section(tree: Branch, name: str, kind: type, problems: Problems) -> Section:
    """Read a section with a fixed name, such as ``core``."""
    node = tree.children.get(name, Branch(tree.origin))
    if isinstance(node, Leaf):
        problems.value(node.origin, name, node.value, 'must be a section')
        node = Branch(tree.origin)
    return read_section(node, name, declared(kind), problems)


def _fill_table(
    table: TopicTable, devices: list[PartSection], modules: list[PartSection],
    topics: list[Section], catalogue: Catalogue, problems: Problems,
) -> Mapping[str, PartTopics | None]:
    """Add every topic to the table; return the topics of each part."""
    found: dict[str, PartTopics | None] = {}
    for noun, parts in (('device', devices), ('module', modules)):
        for part in parts:
            uses = found[part.name] = topics_of(part, noun, problems)
            if uses is None:
                table.loose.update(texts(part.branch))
            table.add_uses(part.section, noun, uses, catalogue, problems)
    for section in topics:
        table.add_topic(section, catalogue, problems)
    return found


def _read_topic(branch: Branch, name: str, problems: Problems) -> Section:
    section = read_section(branch, name, declared(TopicSettings), problems, ('fixed',))
    depth = section.values.get('depth', 1)
    if not is_depth(depth):
        remedy = f'must be a power of two, such as {1 << (depth - 1).bit_length()}'
        section.reject('depth', remedy, problems)
    section.values['fixed'] = _read_fixed(branch, name, problems)
    return section


def _read_fixed(branch: Branch, name: str, problems: Problems) -> Mapping[str, Any]:
    node = branch.children.get('fixed')
    if isinstance(node, Leaf):
        text = f'{name}.fixed must be a section: fields of the message, with a string or length'
        problems.add(node.origin, text)
    if not isinstance(node, Branch):
        return {}
    return {key: leaf.value for key, leaf in flatten(node).items() if not leaf.fault}


def _silent_topics(
    parts: Sequence[PartSection], topics: Sequence[Section],
    uses: Mapping[str, PartTopics | None],
) -> Iterator[TopicSettings]:
    """Yield the topics of disabled parts, so that their readers and mirrors remain valid."""
    published = {section.values['topic'] or section.name for section in topics}
    for part in parts:
        if part.enabled:
            published.update(spec.topic for spec in (uses[part.name] or PartTopics()).published)
    for part in parts:
        for spec in (uses[part.name] or PartTopics()).published:
            if not part.enabled and spec.topic not in published:
                published.add(spec.topic)
                yield TopicSettings(
                    name=f'{part.name}_off_{len(published)}', topic=spec.topic,
                    message=spec.message, depth=1, fixed=frozen(_plain(spec.fixed)),
                    tail=spec.tail)


def _plain(fixed: Mapping[str, Any]) -> dict[str, Any]:
    """Return fixed fields as parameters: for a list of messages their number."""
    return {key: len(value) if isinstance(value, (list, tuple)) and any(
        isinstance(each, Mapping) for each in value) else value for key, value in fixed.items()}
