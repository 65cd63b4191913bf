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


"""Check that the parts fit together: ports, topics and their types, mirrors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable
from collections.abc import Iterable
from dataclasses import dataclass
from dataclasses import field
from dataclasses import replace
import os
from typing import Final

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.base.schema import PartTopics
from rt_robot_os.base.schema import STAR
from rt_robot_os.base.schema import star_match
from rt_robot_os.base.schema import TopicRead
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.link.conversions import find as find_conversion
from rt_robot_os.link.conversions import FRAMED
from rt_robot_os.link.conversions import possible
from rt_robot_os.link.conversions import TRANSFORMS
from rt_robot_os.link.stamped_messages import FRAME_ID_BYTES_MAXIMUM
from rt_robot_os.link.stamped_messages import STAMPED_BYTES
from rt_robot_os.settings.catalogue import Catalogue
from rt_robot_os.settings.model import SIM_PORT
from rt_robot_os.settings.names import full_topic
from rt_robot_os.settings.names import message_problem
from rt_robot_os.settings.names import ros_topic_problem
from rt_robot_os.settings.names import topic_problem
from rt_robot_os.settings.parts import PartSection
from rt_robot_os.settings.problems import did_you_mean
from rt_robot_os.settings.problems import Names
from rt_robot_os.settings.problems import Problems
from rt_robot_os.settings.sections import Section
from rt_robot_os.settings.tree import Origin
from rt_robot_os.topics.topic import SUBSCRIBERS_MAXIMUM


# The keys that are removed from a mirror when they are wrong.
_CHECKED: Final = frozenset({'topic', 'ros_topic', 'as', 'stamped', 'frame_id'})


@dataclass(frozen=True, slots=True)
class _Declared:
    spec: TopicSpec
    by: str
    origin: Origin
    shape: Hashable


@dataclass(slots=True)
class TopicTable:
    """
    The topics of the core and the parts that declare them.

    :ivar complete: False if the topics of a part are unknown; then a topic may only seem missing.
    :ivar limits: the maximum number of readers of a topic, with its place.
    :ivar loose: strings of the sections that could not be read; they may be names of topics.
    """

    declared: dict[str, _Declared] = field(default_factory=dict)
    read: list[tuple[TopicRead, str, Origin]] = field(default_factory=list)
    limits: dict[str, tuple[int, str, Origin]] = field(default_factory=dict)
    complete: bool = True
    loose: set[str] = field(default_factory=set)
    names: Names = field(default_factory=Names)

    def missing(self, topic: str) -> str | None:
        """Return the error that a topic is not declared; None if it is, or may be."""
        if topic in self.declared or topic in self.loose:
            return None
        if not self.complete and self.names.nearest(topic) is None:
            return None
        return f'no part declares this topic, {did_you_mean(topic, self.names)}'

    def matching(self, pattern: str) -> tuple[str, ...]:
        """Return the declared topics that match a name, which may have a star."""
        if STAR not in pattern:
            return (pattern,) if pattern in self.declared else ()
        return tuple(name for name in self.declared if star_match(pattern, name) is not None)

    def expanded(self, uses: PartTopics | None) -> PartTopics | None:
        """Replace each read pattern by the matching topics."""
        if uses is None or not any(STAR in each.topic for each in uses.read):
            return uses
        return replace(uses, read=tuple(
            replace(each, topic=topic) for each in uses.read
            for topic in ([each.topic] if STAR not in each.topic else self.matching(each.topic))))

    def message(self, topic: str) -> str:
        """Return the type of a declared topic."""
        return self.declared[topic].spec.message

    def frame_id(self, topic: str) -> str:
        """Return the fixed frame of the messages of a declared topic; empty without one."""
        return str(self.declared[topic].spec.fixed.get('header.frame_id', ''))

    def add_uses(
        self, section: Section, noun: str, uses: PartTopics | None,
        catalogue: Catalogue, problems: Problems,
    ) -> None:
        """Add the topics of one part."""
        if uses is None:
            self.complete = False
            return
        by = f'{noun} {section.name}'
        topics: tuple[TopicSpec | TopicRead, ...] = (*uses.published, *uses.read)
        for each in topics:
            key = getattr(each, 'key', '') or next(
                (k for k, v in section.values.items() if v == each.topic), '')
            label = f'{section.name}.{key}' if key else f'topic of {section.name}'
            name = each.topic
            if isinstance(each, TopicRead) and name.count(STAR) == 1:
                name = name.replace(STAR, 'x')
            if not self._is_name(name, label, section.where(key), problems):
                continue
            if isinstance(each, TopicSpec):
                self._declare(each, label, section.where(key), by, catalogue, problems)
                self._limit(each.topic, section)
            else:
                self.read.append((each, by, section.where(key)))

    def add_topic(self, section: Section, catalogue: Catalogue, problems: Problems) -> None:
        """Add a topic of the list ``topics``."""
        values = section.values
        if 'topic' not in values or 'message' not in values:
            self.complete = False
            return
        topic, by = values['topic'] or section.name, f'topics: {section.name}'
        old = self.declared.get(topic)
        if old is not None:
            text = f'{topic!r} is already declared by {old.by}: delete it here'
            problems.add(section.where('topic'), f'{section.name}: {text}')
            return
        spec = TopicSpec(topic, values['message'], values['fixed'],
                         tail=values.get('tail') or None)
        label = f'{section.name}.topic'
        if self._is_name(topic, label, section.where('topic'), problems):
            self._declare(spec, label, section.where('topic'), by, catalogue, problems,
                          section.where('message'))
        self._limit(topic, section)

    def _is_name(self, topic: str, label: str, origin: Origin, problems: Problems) -> bool:
        wrong = topic_problem(topic)
        if wrong:
            problems.value(origin, label, topic, wrong)
            self.complete = False
            self.loose.add(label.partition('.')[0])
        return not wrong

    def _declare(
        self, spec: TopicSpec, label: str, origin: Origin, by: str, catalogue: Catalogue,
        problems: Problems, message_origin: Origin | None = None,
    ) -> None:
        shape: Hashable = None
        try:
            wrong = message_problem(spec.message)
            shape = None if wrong else catalogue.layout(spec.message, spec.fixed, spec.tail)
        except LayoutError as error:
            wrong = str(error)
        if wrong and message_origin:
            name = label.rpartition('.')[0]
            problems.value(message_origin, f'{name}.message', spec.message, wrong)
        elif wrong:
            problems.add(origin, f'{by} declares {spec.topic!r} as {spec.message!r}: {wrong}')
        self.names.add(spec.topic)
        old = self.declared.setdefault(spec.topic, _Declared(spec, by, origin, shape))
        if shape is not None and old.shape is not None and shape != old.shape:
            difference = f'{old.spec.message} ({old.by}, {old.origin})'
            if old.spec.message == spec.message:
                difference += ' with different fixed fields'
            problems.value(origin, label, spec.topic,
                           f'is {spec.message} here but {difference}: choose another name')
        elif spec.depth != old.spec.depth:
            problems.value(origin, label, spec.topic,
                           f'has depth {spec.depth} here but {old.spec.depth} ({old.by}, '
                           f'{old.origin}): give both the same depth')

    def _limit(self, topic: str, section: Section) -> None:
        """Store the maximum number of readers; of several publishers the largest counts."""
        limit = int(section.values.get('max_subscribers', SUBSCRIBERS_MAXIMUM))
        if topic not in self.limits or limit > self.limits[topic][0]:
            label = f'{section.name}.max_subscribers'
            self.limits[topic] = limit, label, section.where('max_subscribers')

    def check_reads(self, problems: Problems) -> None:
        """Find topics that are read but not declared, or declared with another type."""
        for use, by, origin in self.read:
            if use.check is not None:
                for topic in self.matching(use.topic):
                    for text in use.check(self.declared[topic].spec):
                        problems.add(origin, text)
            if STAR in use.topic:
                if self.complete and not self.matching(use.topic):
                    problems.add(origin, f'{by} reads {use.topic!r}: no topic matches, '
                                 f'{did_you_mean(use.topic, self.names)}')
                continue
            old = self.declared.get(use.topic)
            wrong = self.missing(use.topic)
            if wrong:
                problems.add(origin, f"{by} reads {use.topic!r}: {wrong} Or add it to 'topics'")
            elif old and old.shape and use.message and old.spec.message != use.message:
                problems.add(origin, f'{by} reads {use.topic!r} as {use.message}, but it is '
                             f'{old.spec.message} ({old.by}, {old.origin})')
        for topic, count in Counter(topic for use, _, _ in self.read
                                    for topic in self.matching(use.topic)).items():
            if topic not in self.limits:
                continue
            limit, label, origin = self.limits[topic]
            if count > limit:
                who = 'devices and modules' if any(
                    by.startswith('device ') for each, by, _ in self.read
                    if star_match(each.topic, topic) is not None) else 'modules'
                problems.value(origin, label, limit,
                               f'but {count} {who} read {topic!r}: must be at least {count}')


def check_ports(devices: Iterable[PartSection], problems: Problems) -> None:
    """
    Find two devices on one port, also through links under /dev/serial.

    A bus is shared by devices that allow it: of these, find two with the same address.
    """
    taken: dict[str, PartSection] = {}
    addresses: dict[tuple[str, int], PartSection] = {}
    for part in devices:
        port = part.section.values.get('port', '')
        shares = part.kind is not None and part.kind.shares_port
        if not port or part.kind is None or (port == SIM_PORT and not shares):
            continue
        real = os.path.realpath(port) if shares or port.startswith('/') else port
        other = taken.setdefault(real, part)
        if shares and other.kind is not None and other.kind.shares_port:
            _check_address(part, real, addresses, problems)
        elif other is not part:
            where = other.section.where('port')
            problems.value(part.section.where('port'), f'{part.name}.port', port,
                           f'is the port of {other.name} ({where}): give each its own')


def _check_address(
    part: PartSection, port: str, taken: dict[tuple[str, int], PartSection], problems: Problems,
) -> None:
    address = part.section.values.get('address')
    other = part if address is None else taken.setdefault((port, address), part)
    if other is not part:
        where = other.section.where('address')
        problems.value(part.section.where('address'), f'{part.name}.address', address,
                       f'is the address of {other.name} on this bus ({where}): give each its own')


def check_mirrors(
    mirrors: Iterable[Section], table: TopicTable, namespace: str, node: str, problems: Problems,
) -> None:
    """Find mirrors of unknown topics, duplicate ROS topics, and mirrors that form a loop."""
    taken: dict[tuple[str, str], Section] = {}
    reported: set[str] = set()  # one problem per section, which may have many mirrors
    for mirror in mirrors:
        if mirror.name in reported:
            continue
        _check_mirror(mirror, table, taken, (namespace, node), problems)
        if not _CHECKED <= mirror.values.keys():
            reported.add(mirror.name)


def _check_mirror(
    mirror: Section, table: TopicTable, taken: dict[tuple[str, str], Section],
    node: tuple[str, str], problems: Problems,
) -> None:
    values = mirror.values
    topic, direction = values.get('topic'), values.get('direction')
    if topic is None or not _check_core_topic(mirror, topic, table, problems):
        return
    _check_stamped(mirror, topic, table, problems)
    joined = _check_conversion(mirror, topic, table, problems) == TRANSFORMS
    ros_topic = values.get('ros_topic')
    if ros_topic is None or direction is None:
        return
    key = 'ros_topic' if ros_topic else 'topic'
    wrong = ros_topic_problem(ros_topic) if ros_topic else None
    if wrong:
        mirror.reject('ros_topic', wrong, problems)
        return
    full = full_topic(ros_topic or ('/tf' if joined else topic), *node)
    label, origin = f'{mirror.name}.{key}', mirror.where(key)
    same = taken.setdefault((full, direction), mirror)
    if same is not mirror and not (joined and same.values.get('as') == TRANSFORMS):
        problems.value(origin, label, ros_topic or topic,
                       f'mirror {same.name} ({same.origin}) already has {full} {direction}: '
                       'give each its own')
    opposite = taken.get((full, 'in' if direction == 'out' else 'out'))
    if opposite is not None:
        problems.value(origin, label, ros_topic or topic,
                       f'mirror {opposite.name} ({opposite.origin}) has {full} in the other '
                       'direction: that is a loop, give each its own')


def _check_stamped(mirror: Section, topic: str, table: TopicTable, problems: Problems) -> None:
    frame_id = mirror.values.get('frame_id', '')
    if len(frame_id.encode()) > FRAME_ID_BYTES_MAXIMUM or '\0' in frame_id:
        mirror.reject('frame_id', f'must have at most {FRAME_ID_BYTES_MAXIMUM} bytes', problems)
    if topic not in table.declared:
        return
    message = table.message(topic)
    if not mirror.values.get('stamped'):
        if frame_id and mirror.values.get('as') not in FRAMED:
            mirror.reject('frame_id', 'is used with stamped: true, or as: '
                          f'{" or ".join(FRAMED)}, only', problems)
    elif message not in STAMPED_BYTES:
        mirror.reject('stamped', f'{topic!r} is a {message}: only these types can get a header: '
                      f'{", ".join(STAMPED_BYTES)}', problems)


def _check_conversion(
    mirror: Section, topic: str, table: TopicTable, problems: Problems,
) -> str:
    """Find pairs of types that cannot be converted; return the requested type in ROS."""
    wanted = str(mirror.values.get('as', ''))
    direction = mirror.values.get('direction')
    if not wanted or direction is None or topic not in table.declared:
        return wanted
    message = table.message(topic)
    conversion = find_conversion(message, wanted)
    if conversion is None or conversion.factory(direction) is None:
        mirror.reject('as', f'{topic!r} is a {message}: the conversions for direction: '
                      f'{direction} are {possible(direction)}', problems)
    elif direction == 'in' and table.declared[topic].spec.fixed:
        mirror.reject('as', f'{topic!r} is declared with fixed fields: messages converted from '
                      'ROS have none, delete them', problems)
    return wanted


def _check_core_topic(
    mirror: Section, topic: str, table: TopicTable, problems: Problems,
) -> bool:
    wrong = topic_problem(topic) or table.missing(topic)
    if wrong:
        mirror.reject('topic', wrong, problems)
    return wrong is None
