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


"""Rules on the topics of a robot: samples in, transitions out."""

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
from rt_robot_os.features.health.rule.fields import error_lines
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

#: Deadlines are evaluated with this delay, and with the stamp at which they were due: an earlier
#: sample may still be in transit, from a device that stamps what it reads.
SETTLING_NS: Final = 10 * NS_PER_MS

Reader = Callable[[Any], 'float | str | None']


class Feed(NamedTuple):
    """
    A topic that rules read.

    :ivar subscription: its subscription.
    :ivar wanted: rule, index of the field in the rule, and its reader; None for the topic as a
        whole.
    """

    subscription: Subscription
    wanted: list[tuple[RuleState, int, Reader | None]]


def star_names(rule: Rule, topics: Iterable[str]) -> tuple[str, ...]:
    """Return the names that the star stands for: those with a topic for each field."""
    starred = [ref for ref in refs_of(rule) if STAR in ref.topic]
    if not starred:
        return ('',)
    known = tuple(topics)
    found = [[name for topic in known if (name := ref.matched(topic)) is not None]
             for ref in starred]
    return tuple(name for name in found[0] if all(name in each for each in found[1:]))


def bind_rules(key: str, text: str, rule: Rule, layouts: Mapping[str, Layout]
               ) -> dict[str, Rule]:
    """
    Bind a rule to the topics; not for the real-time loop.

    :param key: of the rule, for errors.
    :param text: of the rule, for errors.
    :param layouts: of all topics, by name.
    :return: the bound rules, by the name that the star stands for.
    :raises ConfigError: a topic or a field does not exist, or does not fit.
    """
    stars = star_names(rule, layouts)
    if not stars:
        raise ConfigError([f'{key}: {STAR} matches no name in all of '
                           f'{", ".join(str(ref) for ref in refs_of(rule) if STAR in ref.topic)}'])
    problems: list[str] = []
    for star in stars:
        for ref in refs_of(rule):
            topic = ref.starred(star).topic
            problem = f'no topic {topic} is declared'
            if topic in layouts:
                problem = problem_of(rule, ref, topic, layouts[topic])
            if problem:
                problems += error_lines(key, RuleError(problem, text, ref.span))
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
                raise ConfigError(error_lines(key, RuleError(
                    'a number and a string cannot be compared', text, each.right.span)))


class RuleSet:
    """
    Named rules and the topics that they read; safe in the real-time loop.

    :param rules: bound ones, by name.
    :param subscribe: subscribes to a topic.
    :ivar received_ns: stamp of the newest sample; -1 before.
    :ivar no_values: samples that were skipped because a field was NaN or no value.
    """

    def __init__(self, rules: Mapping[str, RuleState], subscribe: Callable[[str], Subscription]
                 ) -> None:
        self.states = dict(rules)
        self.no_values = 0
        self.received_ns = -1
        self._names = {id(state): name for name, state in self.states.items()}
        feeds: dict[str, Feed] = {}
        for state in self.states.values():
            for number, ref in enumerate(state.refs):
                feed = feeds.get(ref.topic)
                if feed is None:
                    feed = feeds[ref.topic] = Feed(subscribe(ref.topic), [])
                feed.wanted.append((state, number, field_reader(
                    feed.subscription.topic.layout, ref.path).read if ref.path else None))
        self._feeds = tuple(feeds.values())

    @property
    def lost(self) -> int:
        """Return how many samples were overwritten before they were read."""
        return sum(feed.subscription.lost for feed in self._feeds)

    def step(self, now_ns: int) -> Iterator[tuple[str, Transition]]:
        """
        Process new samples and deadlines.

        :return: the transitions, with the name of the rule.
        """
        for stamp_ns, changes in self._samples(now_ns):
            touched = {id(state): state for state, _, _ in changes}
            for key, state in touched.items():
                for each in state.advance(stamp_ns, through=False):
                    yield self._names[key], each
            for state, number, value in changes:
                state.update(number, value, stamp_ns)
            for key, state in touched.items():
                for each in state.advance(stamp_ns):
                    yield self._names[key], each
        settled_ns = now_ns - SETTLING_NS
        for name, state in self.states.items():
            if state.due_ns <= settled_ns:
                for each in state.advance(settled_ns):
                    yield name, each

    def start(self, now_ns: int) -> None:
        """Start the rules, once."""
        for state in self.states.values():
            state.start(now_ns)

    def due_ns(self) -> float:
        """Return the next deadline, with the delay."""
        due_ns = min((state.due_ns for state in self.states.values()), default=math.inf)
        return due_ns + SETTLING_NS

    def _samples(self, now_ns: int
                 ) -> list[tuple[int, list[tuple[RuleState, int, Value | None]]]]:
        """Return the new samples, grouped and ordered by stamp."""
        found: dict[int, list[tuple[RuleState, int, Value | None]]] = {}
        for subscription, wanted in self._feeds:
            while subscription.take():
                stamp_ns = min(subscription.stamp_ns, now_ns)
                self.received_ns = max(self.received_ns, stamp_ns)
                changes = found.setdefault(stamp_ns, [])
                for state, number, read in wanted:
                    if read is None:
                        changes.append((state, number, None))
                        continue
                    value = read(subscription.buffer)
                    if value is None or value != value:  # NaN
                        self.no_values += 1
                    else:
                        changes.append((state, number, value))
        return sorted(found.items()) if len(found) > 1 else list(found.items())
