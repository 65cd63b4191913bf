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

"""The table of all topics of one kernel."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
import re
from typing import Any

from rt_robot_os.base.errors import TopicError
from rt_robot_os.base.schema import TopicSpec
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.topics.default import Default
from rt_robot_os.topics.layout import Layout
from rt_robot_os.topics.logical import LogicalPublisher
from rt_robot_os.topics.logical import LogicalSubscription
from rt_robot_os.topics.publisher import LargePublisher
from rt_robot_os.topics.publisher import Publisher
from rt_robot_os.topics.subscription import NewestSubscription
from rt_robot_os.topics.subscription import Subscription
from rt_robot_os.topics.topic import check_numbers
from rt_robot_os.topics.topic import DEPTH
from rt_robot_os.topics.topic import MAX_SUBSCRIBERS
from rt_robot_os.topics.topic import Topic
from rt_robot_os.topics.topic import TopicStatistics
from rt_robot_os.topics.trigger import AllOf
from rt_robot_os.topics.trigger import Every

TOPIC_NAME = re.compile(r'[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*')


class Bus:
    """
    Declare topics, then publish and subscribe by name.

    :param kernel: the one that runs the publishing and subscribing tasks.
    """

    def __init__(self, kernel: Kernel) -> None:
        self.kernel = kernel
        self._topics: dict[str, Topic] = {}

    def declare(self, name: str, message: Any, fixed: Mapping[str, Any] | None = None, *,
                tail: int | None = None, depth: int = DEPTH, rate_hz: float = 0.0,
                max_subscribers: int = MAX_SUBSCRIBERS) -> Topic:
        """
        Declare a topic; not for the real-time loop.

        Declaring it again with the same shape returns the same topic. A depth or
        ``max_subscribers`` must then equal that of the first declaration, if one was given there.

        :param name: relative ROS name such as ``imu/data``.
        :param message: ``'sensor_msgs/msg/Imu'`` or the class.
        :param fixed: strings and lengths of sequences, see :class:`Layout`.
        :param tail: maximum length of a variable last field.
        :param depth: number of stored samples, a power of two.
        :param rate_hz: expected rate; 0 when there is none.
        :param max_subscribers: limit of subscribers. Mirrors and recordings of clients do not
            count: they are limited by the number of clients.
        :raises TopicError: the name is not a ROS name or belongs to a topic of another shape, or a
            number is out of range or contradicts an earlier declaration.
        :raises LayoutError: the message does not fit this shape.
        """
        if not TOPIC_NAME.fullmatch(name):
            raise TopicError(f'topic {name!r}: a name consists of letters, digits and _ in parts '
                             "that begin with a letter or _, separated by '/', such as imu/data")
        check_numbers(name, depth, rate_hz, max_subscribers)
        layout = Layout.compile(message, fixed, tail=tail)
        known = self._topics.get(name)
        if known is not None:
            if (known.layout.type_name, known.layout.prototype, known.layout.max_size) != (
                    layout.type_name, layout.prototype, layout.max_size):
                raise TopicError(f'topic {name!r}: declared as {known.layout!r} before and as '
                                 f'{layout!r} now; choose another name for one of them')
            self._check_redeclaration(known, depth, max_subscribers)
            return known
        topic = Topic(self.kernel, name, layout, depth=depth, rate_hz=rate_hz,
                      max_subscribers=max_subscribers)
        self._topics[name] = topic
        return topic

    def add(self, spec: TopicSpec, max_subscribers: int) -> Topic:
        """
        Declare a topic by its specification; not for the real-time loop.

        :param max_subscribers: limit of subscribers; the largest of several counts.
        :raises TopicError: as for :meth:`declare`.
        :raises LayoutError: the message does not fit this shape.
        """
        topic = self.declare(spec.topic, spec.message, spec.fixed, tail=spec.tail,
                             depth=spec.depth, rate_hz=spec.rate_hz)
        check_numbers(spec.topic, topic.depth, topic.rate_hz, max_subscribers)
        if not topic.limit_given or max_subscribers > topic.max_subscribers:
            topic.max_subscribers = int(max_subscribers)
            topic.limit_given = not isinstance(max_subscribers, Default)
        return topic

    def _check_redeclaration(self, topic: Topic, depth: int, max_subscribers: int) -> None:
        """Check a repeated declaration of a topic against the earlier ones."""
        if topic.depth_given and not isinstance(depth, Default) and depth != topic.depth:
            raise TopicError(f'topic {topic.name!r}: declared with depth {topic.depth} before and '
                             f'{depth} now; give both the same')
        if isinstance(max_subscribers, Default):
            return
        before = topic.max_subscribers
        if topic.limit_given and before != max_subscribers:
            raise TopicError(f'topic {topic.name!r}: declared with max_subscribers {before} before'
                             f' and {max_subscribers} now; give both the same')
        if max_subscribers < topic.counted:
            raise TopicError(f'topic {topic.name!r}: max_subscribers {max_subscribers} is less '
                             f'than the {topic.counted} subscribers that it has')
        topic.max_subscribers, topic.limit_given = max_subscribers, True

    def topic(self, name: str) -> Topic:
        """
        Find a topic.

        :raises TopicError: the topic does not exist.
        """
        try:
            return self._topics[name]
        except KeyError:
            known = ', '.join(sorted(self._topics)) or 'none'
            raise TopicError(f'no topic {name!r}; there are: {known}') from None

    @property
    def topics(self) -> tuple[Topic, ...]:
        """All topics in the order of their declaration."""
        return tuple(self._topics.values())

    def publisher(self, name: str, task: Task | None = None) -> Publisher:
        """
        Make a publisher; not for the real-time loop.

        :param task: of the publisher; with logical execution time its messages are published at
            its deadline.
        :raises TopicError: the topic does not exist.
        """
        if task is not None and task.logical is not None:
            return LogicalPublisher(self.topic(name), task.logical)
        topic = self.topic(name)
        return LargePublisher(topic) if topic.large else Publisher(topic)

    def subscribe(self, name: str, subscriber: str, *, initial: bool = False,
                  task: Task | None = None, buffer: memoryview | None = None,
                  newest: bool = False, counted: bool = True) -> Subscription:
        """
        Make a subscription; not for the real-time loop.

        :param name: of the topic.
        :param subscriber: name of the reader, for the statistics.
        :param initial: begin with the last existing sample.
        :param task: released by each publication.
        :param buffer: destination of samples, of the layout's ``max_size`` bytes; by default a new
            one.
        :param newest: ``take`` returns only the newest sample; earlier ones count as skipped.
        :param counted: False for system subscribers, such as a client's mirror: they are not
            limited by ``max_subscribers``.
        :raises TopicError: the topic does not exist, or has ``max_subscribers`` already.
        """
        topic = self._topic_with_capacity(name, subscriber) if counted else self.topic(name)
        kind: type[Subscription] = NewestSubscription if newest else Subscription
        subscription = kind(topic, subscriber, initial=initial, buffer=buffer, task=task)
        if not counted:
            topic.uncounted.add(subscription)
        return self._add(subscription, task)

    def subscribe_logically(self, name: str, task: Task, *, initial: bool = False
                            ) -> Subscription:
        """
        Make a subscription for a task with logical execution time; not for the real-time loop.

        A job sees only samples that were published before its release.

        :raises TopicError: the topic does not exist, it has too many subscribers, or the task has
            no logical execution time.
        """
        if task.logical is None:
            raise TopicError(f'topic {name!r}: task {task.name!r} has no logical execution time; '
                             'declare it with logical=True')
        topic = self._topic_with_capacity(name, task.name)
        return self._add(LogicalSubscription(topic, task.name, task.logical, initial), None)

    def _add(self, subscription: Subscription, task: Task | None) -> Subscription:
        topic = subscription.topic
        topic.subscribers.append(subscription)
        if task is not None:
            topic.wake_on_publish(task)
        return subscription

    def _topic_with_capacity(self, name: str, subscriber: str) -> Topic:
        topic = self.topic(name)
        if topic.counted >= topic.max_subscribers:
            raise TopicError(f'topic {name!r}: {subscriber!r} would be subscriber number '
                             f'{topic.counted + 1}; raise max_subscribers '
                             f'({topic.max_subscribers}) in the section that declares the topic')
        return topic

    def unsubscribe(self, subscription: Subscription) -> None:
        """
        Remove a subscription, for instance of a client that left; unknown ones are ignored.

        It no longer releases its task.
        """
        topic = subscription.topic
        if subscription in topic.subscribers:
            topic.subscribers.remove(subscription)
            topic.uncounted.discard(subscription)
            if subscription.task is not None:
                topic.stop_waking(subscription.task)

    def release_every(self, name: str, task: Task, number: int) -> None:
        """
        Release a task with each n-th publication on a topic, beginning with the n-th from now.

        :raises TopicError: the topic does not exist, or the number is below 1.
        """
        self.topic(name).triggers.append(Every(task, number))

    def release_on_all(self, names: Sequence[str], task: Task) -> None:
        """
        Release a task when each of several topics had a publication since its last release.

        :raises TopicError: a topic does not exist or is given twice, or none is given.
        """
        topics = [self.topic(name) for name in names]
        trigger = AllOf(task, topics)
        for topic in topics:
            topic.triggers.append(trigger)

    def stop_releasing(self, task: Task) -> None:
        """Stop all topics from releasing a task; its subscriptions are not changed."""
        for topic in self._topics.values():
            while task in topic.wakes:
                topic.stop_waking(task)
            topic.triggers[:] = [each for each in topic.triggers if each.task is not task]

    def statistics(self) -> tuple[TopicStatistics, ...]:
        """Return the statistics of all topics; not for the real-time loop."""
        return tuple(topic.statistics() for topic in self._topics.values())
