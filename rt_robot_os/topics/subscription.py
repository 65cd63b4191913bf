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

"""The subscriptions of a topic."""

from __future__ import annotations

from enum import Enum
from typing import Any
from typing import TYPE_CHECKING

from rt_robot_os.kernel import Task
from rt_robot_os.kernel import Wait
from rt_robot_os.topics.pieces import copy_in_pieces
from rt_robot_os.topics.ring import SubscriptionCore
from rt_robot_os.topics.topic import SubscriberStatistics
from rt_robot_os.topics.topic import Topic

if TYPE_CHECKING:
    from rt_robot_os.kernel.coroutine import AsyncBody


class ReadStatus(Enum):
    """How fresh the message of a subscription is (the terms of Orocos RTT, plus *stale*)."""

    NONE = 'none'
    NEW = 'new'
    OLD = 'old'
    STALE = 'stale'


class Subscription(SubscriptionCore):
    """
    Read messages from a topic; made by :meth:`rt_robot_os.topics.Bus.subscribe`.

    :meth:`take` and :meth:`latest` copy a sample into :attr:`msg`. No publisher changes it; it is
    valid until the next call.

    :ivar task: released by each publication; None when the reader polls.
    :ivar msg: a view with the field names of the ROS message; zeros before the first sample.
    :ivar stamp_ns: time of the data in :attr:`msg` on the kernel's clock; 0 before the first.
    :ivar seq: its number in the topic, from 0; -1 before the first.
    :ivar lost: samples overwritten before :meth:`take` reached them.
    :ivar skipped: samples that :meth:`latest` skipped.
    """

    __slots__ = ('name', 'task', 'msg')

    topic: Topic

    def __init__(self, topic: Topic, name: str, *, initial: bool = False,
                 buffer: memoryview | None = None, task: Task | None = None) -> None:
        super().__init__(topic, topic.layout.new_buffer() if buffer is None else buffer,
                         max(0, topic.head - 1) if initial else topic.head)
        self.name = name
        self.task = task
        self.msg: Any = topic.layout.view(self.buffer)

    def put_back(self) -> None:
        """Have the next ``take`` return the same sample as the last one."""
        self.next_seq -= 1
        self.reads -= 1

    def rewind(self) -> None:
        """Go back to the oldest stored sample."""
        self.next_seq = max(0, self.topic.head - self.topic.depth)

    def next(self) -> Wait:  # noqa: A003
        """
        Return an awaitable for coroutine tasks that is ready when :meth:`take` succeeds.

        ``await`` returns the subscription itself, with the oldest unread sample in :attr:`msg`.
        """
        return _NextSample(self)

    def copy_large(self, slot: int) -> None:
        """Copy the sample in a slot of a large topic, in pieces."""
        self.length = length = self.topic.length_of(slot)
        copy_in_pieces(self.buffer, self.topic.slots[slot][:length])

    @property
    def age_ns(self) -> int:
        """Return the age of :attr:`msg`; 0 before the first sample."""
        return self.topic.kernel.now_ns() - self.stamp_ns if self.seq >= 0 else 0

    @property
    def status(self) -> ReadStatus:
        """
        Return how fresh :attr:`msg` is.

        NEW: the last call copied it. OLD: it was read before. STALE: old, and older than ten
        periods of the topic's expected rate. NONE: there was no sample.
        """
        if self.seq < 0:
            return ReadStatus.NONE
        if self.fresh:
            return ReadStatus.NEW
        limit_ns = self.topic.stale_after_ns
        return ReadStatus.STALE if limit_ns and self.age_ns > limit_ns else ReadStatus.OLD

    def statistics(self) -> SubscriberStatistics:
        """Return the statistics; samples overwritten since the last read count as lost."""
        overwritten = max(0, self.topic.head - self.next_seq - self.topic.depth)
        return SubscriberStatistics(self.name, self.reads, self.lost + overwritten, self.skipped)


class NewestSubscription(Subscription):
    """A subscription whose methods all return the newest sample."""

    __slots__ = ()

    def take(self) -> bool:
        """Copy the newest sample; safe in the real-time loop."""
        behind = self.topic.head - self.next_seq - 1
        if behind > 0:
            self.skipped += behind
            self.next_seq += behind
        return super().take()

    def statistics(self) -> SubscriberStatistics:
        """Return the statistics; overwritten samples count as skipped."""
        overwritten = max(0, self.topic.head - self.next_seq - self.topic.depth)
        return SubscriberStatistics(self.name, self.reads, self.lost, self.skipped + overwritten)


class _NextSample(Wait):
    """The next sample of a subscription."""

    __slots__ = ('_subscription', '_taken')

    def __init__(self, subscription: Subscription) -> None:
        self._subscription = subscription
        self._taken = False

    def begin(self, body: AsyncBody) -> None:
        if body.replay_gate is None:
            self._subscription.topic.wake_on_publish(body.task)

    def is_ready(self) -> bool:
        if not self._taken:
            self._taken = self._subscription.take()
        return self._taken

    def end(self, body: AsyncBody) -> None:
        self._subscription.topic.stop_waking(body.task)

    def result(self) -> Subscription:
        return self._subscription
