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

"""A topic: the ring of its samples, its subscribers, and the tasks that it releases."""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from dataclasses import dataclass
import math
from typing import Any
from typing import Final
from typing import Protocol
from typing import TYPE_CHECKING

from rt_robot_os.base.errors import TopicError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.topics.default import Default
from rt_robot_os.topics.pieces import PIECE_BYTES
from rt_robot_os.topics.pieces import touch
from rt_robot_os.topics.ring import TopicCore

if TYPE_CHECKING:
    from rt_robot_os.topics.layout import Layout


DEPTH_MAXIMUM = 1 << 16
DEPTH: Final = Default(16)
SUBSCRIBERS_MAXIMUM = 4096
MAX_SUBSCRIBERS: Final = Default(64)
STALE_PERIODS = 10


@dataclass(frozen=True)
class SubscriberStatistics:
    """
    The counters of a subscriber.

    :ivar reads: samples copied.
    :ivar lost: samples that were overwritten before ``take`` reached them.
    :ivar skipped: samples that ``latest`` skipped.
    """

    name: str
    reads: int
    lost: int
    skipped: int


@dataclass(frozen=True)
class TopicStatistics:
    """
    The counters of a topic.

    :ivar stamp_ns: stamp of the last sample on CLOCK_MONOTONIC; 0 without one.
    """

    name: str
    type_name: str
    depth: int
    slot_bytes: int
    published: int
    stamp_ns: int
    rate_hz: float
    subscribers: tuple[SubscriberStatistics, ...]


class Topic(TopicCore):
    """
    A ring of CDR slots; made by :meth:`rt_robot_os.topics.Bus.declare`.

    :param kernel: its critical section makes each publication atomic under preemption.
    :param name: relative ROS name such as ``imu/data``.
    :param layout: of the messages.
    :param depth: number of slots, a power of two.
    :param rate_hz: expected rate; 0 when there is none. A sample older than ten periods is stale.
    :param max_subscribers: limit of subscribers; mirrors of clients do not count.
    :ivar large: its samples are longer than ``PIECE_BYTES``; ``messages`` are then the views of
        its slots.
    :ivar depth_given: the depth was declared explicitly.
    :ivar limit_given: ``max_subscribers`` was declared explicitly.
    :ivar uncounted: those of ``subscribers`` that ``max_subscribers`` does not limit.
    :raises TopicError: a value is out of range.
    """

    __slots__ = ('depth', 'rate_hz', 'stale_after_ns', 'max_subscribers', 'subscribers',
                 'uncounted', 'messages', 'depth_given', 'limit_given', '_wake_counts')

    triggers: list[Trigger]

    def __init__(self, kernel: Kernel, name: str, layout: Layout, *, depth: int = DEPTH,
                 rate_hz: float = 0.0, max_subscribers: int = MAX_SUBSCRIBERS) -> None:
        check_numbers(name, depth, rate_hz, max_subscribers)
        storage, slots = _storage(layout, depth)
        super().__init__(kernel, name, layout, slots, storage)
        self.depth = int(depth)
        self.depth_given = not isinstance(depth, Default)
        self.rate_hz = rate_hz
        self.stale_after_ns = round(STALE_PERIODS * NS_PER_S / rate_hz) if rate_hz > 0 else 0
        self.max_subscribers = int(max_subscribers)
        self.limit_given = not isinstance(max_subscribers, Default)
        self.messages = [layout.view(slot) for slot in slots] if self.large else []
        self._wake_counts: dict[Task, int] = {}
        self.subscribers: list[SubscriberStatisticsSource] = []
        self.uncounted: set[SubscriberStatisticsSource] = set()

    @property
    def counted(self) -> int:
        """Return the number of subscribers that ``max_subscribers`` limits."""
        return len(self.subscribers) - len(self.uncounted)

    def wake_on_publish(self, task: Task) -> None:
        """
        Release a task with each publication.

        A task above the publisher runs before ``publish`` returns. A task that is added several
        times is released once.
        """
        count = self._wake_counts.get(task, 0)
        self._wake_counts[task] = count + 1
        if not count:
            self.wakes.append(task)

    def stop_waking(self, task: Task) -> None:
        """Undo one :meth:`wake_on_publish`; unknown tasks are ignored."""
        count = self._wake_counts.pop(task, 0)
        if count > 1:
            self._wake_counts[task] = count - 1
        elif count:
            self.wakes.remove(task)

    def release_triggered(self, now_ns: int) -> None:
        """Release the tasks whose triggers are fulfilled; within a publication."""
        for trigger in self.triggers:
            if trigger.published(self):
                self.kernel.wake((trigger.task,), now_ns)

    def statistics(self) -> TopicStatistics:
        """Return the statistics; not for the real-time loop."""
        head = self.head
        return TopicStatistics(
            name=self.name, type_name=self.layout.type_name, depth=self.depth,
            slot_bytes=self.layout.max_size, published=head,
            stamp_ns=self.stamp_of(head - 1) if head else 0, rate_hz=self.rate_hz,
            subscribers=tuple(s.statistics() for s in self.subscribers))


def _storage(layout: Layout, depth: int) -> tuple[bytearray, list[memoryview]]:
    """Return the storage and the slots of a ring; large slots have separate buffers."""
    size = layout.max_size
    if size > PIECE_BYTES:
        buffers = [layout.new_buffer() for _ in range(depth)]
        for buffer in buffers:
            touch(buffer)
        return bytearray(), buffers
    stride = size + -size % 8
    storage = bytearray(depth * stride)
    view = memoryview(storage)
    return storage, [view[start:start + size] for start in range(0, depth * stride, stride)]


def is_depth(number: int) -> bool:
    """Return whether a number of slots is valid: a power of two in range."""
    return 1 <= number <= DEPTH_MAXIMUM and not number & (number - 1)


def check_numbers(name: str, depth: Any, rate_hz: Any, max_subscribers: Any) -> None:
    """
    Validate the numbers in the declaration of a topic.

    :raises TopicError: one is of the wrong type or out of range; the message names it.
    """
    if not _is_int(depth) or not is_depth(depth):
        raise TopicError(f'topic {name!r}: depth {depth!r} must be a power of two from 1 to '
                         f'{DEPTH_MAXIMUM}')
    number = _is_int(rate_hz) or isinstance(rate_hz, float)
    if not number or not math.isfinite(rate_hz) or rate_hz < 0:
        raise TopicError(f'topic {name!r}: rate_hz {rate_hz!r} must be a number of at least 0; '
                         '0 when no rate is expected')
    if not _is_int(max_subscribers) or not 1 <= max_subscribers <= SUBSCRIBERS_MAXIMUM:
        raise TopicError(f'topic {name!r}: max_subscribers {max_subscribers!r} must be an '
                         f'integer from 1 to {SUBSCRIBERS_MAXIMUM}')


def _is_int(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


class SubscriberStatisticsSource(Protocol):
    """A subscriber from the view of its topic."""

    def statistics(self) -> SubscriberStatistics:
        """Return the statistics."""


class Trigger(ABC):
    """
    A condition that decides with each publication whether to release a task.

    :ivar task: to be released.
    """

    __slots__ = ('task',)

    def __init__(self, task: Task) -> None:
        self.task = task

    @abstractmethod
    def published(self, topic: Topic) -> bool:
        """
        Return whether the task is to be released now; called within the publication.

        :param topic: on which a message has just been published.
        """
