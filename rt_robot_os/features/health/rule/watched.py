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


"""A rule on the topics of a robot: samples in, transitions out."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterable
from collections.abc import Iterator
from collections.abc import Mapping
import math
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import STAR
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.features.health.rule.evaluation import RuleState
from rt_robot_os.features.health.rule.evaluation import Transition
from rt_robot_os.features.health.rule.evaluation import Value
from rt_robot_os.features.health.rule.fields import bound
from rt_robot_os.features.health.rule.fields import lines_of
from rt_robot_os.features.health.rule.fields import problem_of
from rt_robot_os.features.health.rule.terms import Compare
from rt_robot_os.features.health.rule.terms import conditions_of
from rt_robot_os.features.health.rule.terms import Ref
from rt_robot_os.features.health.rule.terms import refs_of
from rt_robot_os.features.health.rule.terms import Rule
from rt_robot_os.features.health.rule.tokens import RuleError
from rt_robot_os.topics import Layout
from rt_robot_os.topics import Subscription
from rt_robot_os.topics.field_path import field_reader

#: What is due by time alone is judged so much later, with the stamp at which it was due: a sample
#: of before that moment may still be on its way, from a device that stamps what it reads.
SETTLING_NS: Final = 10 * NS_PER_MS

Reader = Callable[[Any], 'float | str | None']


class Feed(NamedTuple):
    """
    A topic that rules read.

    :ivar take: its subscription.
    :ivar wanted: which rule wants which field, by its number in the rule, and what reads it; None
        when the topic as a whole is meant.
    """

    take: Subscription
    wanted: list[tuple[RuleState, int, Reader | None]]


def names_of(rule: Rule, topics: Iterable[str]) -> tuple[str, ...]:
    """Return what the star can stand for: what gives a topic for each of its fields."""
    starred = [ref for ref in refs_of(rule) if STAR in ref.topic]
    if not starred:
        return ('',)
    known = tuple(topics)
    found = [[name for topic in known if (name := ref.matched(topic)) is not None]
             for ref in starred]
    return tuple(name for name in found[0] if all(name in each for each in found[1:]))


def bound_rules(key: str, text: str, rule: Rule, layouts: Mapping[str, Layout]
                ) -> dict[str, Rule]:
    """
    Find the topics of a rule; not for the real-time loop.

    :param key: of the rule, for errors.
    :param text: of the rule, for errors.
    :param layouts: of all topics, by name.
    :return: by what the star stands for, the rule with these topics, its numbers in their units.
    :raises ConfigError: a topic or a field is not there, or does not fit.
    """
    stars = names_of(rule, layouts)
    if not stars:
        raise ConfigError([f'{key}: there is nothing that {STAR} could stand for in all of '
                           f'{", ".join(str(ref) for ref in refs_of(rule) if STAR in ref.topic)}'])
    problems: list[str] = []
    for star in stars:
        for ref in refs_of(rule):
            topic = ref.starred(star).topic
            problem = f'nobody declares {topic}'
            if topic in layouts:
                problem = problem_of(rule, ref, topic, layouts[topic])
            if problem:
                problems += lines_of(key, RuleError(problem, text, ref.span))
    if problems:
        raise ConfigError(list(dict.fromkeys(problems)))
    found = {star: bound(rule, star, layouts.__getitem__) for star in stars}
    _check_kinds(key, text, next(iter(found.values())), layouts)
    return found


def _check_kinds(key: str, text: str, rule: Rule, layouts: Mapping[str, Layout]) -> None:
    for each in conditions_of(rule):
        if isinstance(each, Compare) and isinstance(each.right, Ref):
            kinds = {field_reader(layouts[ref.topic], ref.path).is_text
                     for ref in (each.left, each.right)}
            if len(kinds) > 1:
                raise ConfigError(lines_of(key, RuleError(
                    'a number and a text cannot be compared', text, each.right.span)))


class WatchedRules:
    """
    Rules, by a name each, and the topics that they read; safe in the real-time loop.

    :param rules: bound ones, by name.
    :param subscribe: subscribes to a topic.
    :ivar heard_ns: stamp of the newest sample that was taken; -1 before.
    :ivar no_values: samples in which a field was no number, such as NaN: they are passed over.
    """

    def __init__(self, rules: Mapping[str, RuleState], subscribe: Callable[[str], Subscription]
                 ) -> None:
        self.states = dict(rules)
        self.no_values = 0
        self.heard_ns = -1
        self._names = {id(state): name for name, state in self.states.items()}
        feeds: dict[str, Feed] = {}
        for state in self.states.values():
            for number, ref in enumerate(state.refs):
                feed = feeds.get(ref.topic)
                if feed is None:
                    feed = feeds[ref.topic] = Feed(subscribe(ref.topic), [])
                feed.wanted.append((state, number, field_reader(
                    feed.take.topic.layout, ref.path).read if ref.path else None))
        self._feeds = tuple(feeds.values())

    @property
    def lost(self) -> int:
        """Return how many samples were overwritten before they were read."""
        return sum(feed.take.lost for feed in self._feeds)

    def step(self, now_ns: int) -> Iterator[tuple[str, Transition]]:
        """
        Take what came, and let time pass.

        :return: what began or is over, by the name of the rule.
        """
        for stamp_ns, changes in self._samples(now_ns):
            touched = {id(state): state for state, _, _ in changes}
            for key, state in touched.items():
                for each in state.pass_time(stamp_ns, through=False):
                    yield self._names[key], each
            for state, number, value in changes:
                state.take(number, value, stamp_ns)
            for key, state in touched.items():
                for each in state.pass_time(stamp_ns):
                    yield self._names[key], each
        settled_ns = now_ns - SETTLING_NS
        for name, state in self.states.items():
            if state.due_ns <= settled_ns:
                for each in state.pass_time(settled_ns):
                    yield name, each

    def begin(self, now_ns: int) -> None:
        """Begin to look, once."""
        for state in self.states.values():
            state.begin(now_ns)

    def due_ns(self) -> float:
        """Return when time alone may change something."""
        due_ns = min((state.due_ns for state in self.states.values()), default=math.inf)
        return due_ns + SETTLING_NS

    def _samples(self, now_ns: int
                 ) -> list[tuple[int, list[tuple[RuleState, int, Value | None]]]]:
        """Take all that came, by stamps; what has the same stamp together."""
        found: dict[int, list[tuple[RuleState, int, Value | None]]] = {}
        for take, wanted in self._feeds:
            while take.take():
                stamp_ns = min(take.stamp_ns, now_ns)
                self.heard_ns = max(self.heard_ns, stamp_ns)
                changes = found.setdefault(stamp_ns, [])
                for state, number, read in wanted:
                    if read is None:
                        changes.append((state, number, None))
                        continue
                    value = read(take.buffer)
                    if value is None or value != value:  # NaN
                        self.no_values += 1
                    else:
                        changes.append((state, number, value))
        return sorted(found.items()) if len(found) > 1 else list(found.items())
