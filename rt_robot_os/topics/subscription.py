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

"""The reading end of a topic."""

from __future__ import annotations

from enum import Enum
from typing import Any
from typing import Final
from typing import TYPE_CHECKING

from rt_robot_os.kernel import Task
from rt_robot_os.kernel import Wait
from rt_robot_os.topics.pieces import copy_in_pieces
from rt_robot_os.topics.pieces import PIECE_BYTES
from rt_robot_os.topics.topic import SubscriberStatistics
from rt_robot_os.topics.topic import SubscriberStatisticsSource
from rt_robot_os.topics.topic import Topic

if TYPE_CHECKING:
    from rt_robot_os.kernel.coroutine import AsyncBody

_ALL: Final = slice(None)  # not made anew each time


class ReadStatus(Enum):
    """How fresh the message of a subscription is (the terms of Orocos RTT, plus *stale*)."""

    NONE = 'none'
    NEW = 'new'
    OLD = 'old'
    STALE = 'stale'


class Subscription(SubscriberStatisticsSource):
    """
    Read messages from a topic; made by :meth:`rt_robot_os.topics.Bus.subscribe`.

    :meth:`take` and :meth:`latest` copy a sample into :attr:`msg`, which no publisher changes: it
    stays as it is until the next call.

    :ivar task: released by each publication; None when the reader looks by itself.
    :ivar msg: a view with the field names of the ROS message; zeros before the first sample.
    :ivar stamp_ns: moment of the data in :attr:`msg` on the kernel's clock; 0 before the first.
    :ivar seq: its number in the topic, from 0; -1 before the first.
    :ivar lost: samples overwritten before :meth:`take` reached them.
    :ivar skipped: samples that :meth:`latest` passed over.
    """

    __slots__ = ('topic', 'name', 'task', 'msg', 'buffer', 'stamp_ns', 'seq', 'length', 'lost',
                 'skipped', 'reads', '_fresh', '_next', '_depth', '_mask', '_slots',
                 '_stamps', '_has_tail')

    def __init__(self, topic: Topic, name: str, *, initial: bool = False,
                 buffer: memoryview | None = None, task: Task | None = None) -> None:
        self.topic = topic
        self.name = name
        self.task = task
        self.buffer = topic.layout.new_buffer() if buffer is None else buffer
        self.msg: Any = topic.layout.view(self.buffer)
        self.stamp_ns = 0
        self.seq = -1
        self.length = topic.layout.size
        self.lost = self.skipped = self.reads = 0
        self._fresh = False
        self._next = max(0, topic.head - 1) if initial else topic.head
        self._depth = topic.depth
        self._mask = topic.mask
        self._slots = topic.slots
        self._stamps = topic.stamps
        self._has_tail = topic.has_tail

    def take(self) -> bool:
        """
        Copy the oldest unread sample into :attr:`msg`; safe in the real-time loop.

        A reader that was lapped goes to the oldest kept sample; what it lost is counted.

        :return: whether there was one.
        """
        topic, depth = self.topic, self._depth
        wanted = self._next
        while True:
            head = topic.head
            if wanted >= head:
                self._fresh = False
                return False
            if head - wanted > depth:
                self.lost += head - depth - wanted
                self._next = wanted = head - depth
            index = wanted & self._mask
            if self._has_tail:
                self._copy_tail(index)
            else:
                self.buffer[_ALL] = self._slots[index]
            stamp_ns = self._stamps[index]
            if topic.head - wanted <= depth:  # not lapped while copying
                break
        self.stamp_ns = stamp_ns
        self.seq = wanted
        self._next = wanted + 1
        self.reads += 1
        self._fresh = True
        return True

    def latest(self) -> bool:
        """
        Copy the newest sample into :attr:`msg`; safe in the real-time loop.

        :return: whether it is newer than the one read before.
        """
        behind = self.topic.head - self._next - 1
        if behind > 0:
            self.skipped += behind
            self._next += behind
        return self.take()

    def put_back(self) -> None:
        """Have the next ``take`` return the same sample as the last one."""
        self._next -= 1
        self.reads -= 1

    def rewind(self) -> None:
        """Go back to the oldest sample that is kept."""
        self._next = max(0, self.topic.head - self._depth)

    def next(self) -> Wait:  # noqa: A003
        """
        Return something to await in a task that is a coroutine: over when :meth:`take` succeeded.

        ``await`` gives the subscription itself, with the oldest unread sample in :attr:`msg`.
        """
        return _NextSample(self)

    def _copy_tail(self, index: int) -> None:
        length = self.topic.lengths[index]
        if length <= PIECE_BYTES:
            self.buffer[:length] = self._slots[index][:length]
        else:
            copy_in_pieces(self.buffer, self._slots[index][:length])
        self.length = length

    def pass_over(self, newest: bool = False) -> bool:
        """
        Pass over a sample without copying it; safe in the real-time loop.

        :param newest: the newest one, those before it count as skipped; else the oldest unread.
        :return: whether there was one.
        """
        behind = self.topic.head - self._next
        if behind <= 0:
            return False
        if newest:
            self.skipped += behind - 1
            self._next += behind - 1
        elif behind > self._depth:
            self.lost += behind - self._depth
            self._next += behind - self._depth
        self._next += 1
        return True

    @property
    def next_seq(self) -> int:
        """Return the number of the sample that is read next, unless it is overwritten before."""
        return self._next

    @property
    def unread(self) -> int:
        """How many samples wait, those that are lost already not counted."""
        return min(self.topic.head - self._next, self._depth)

    @property
    def age_ns(self) -> int:
        """How old :attr:`msg` is; 0 before the first sample."""
        return self.topic.kernel.now_ns() - self.stamp_ns if self.seq >= 0 else 0

    @property
    def status(self) -> ReadStatus:
        """
        How fresh :attr:`msg` is.

        New: the last call copied it. Old: it was read before. Stale: old, and older than ten
        periods of the topic's expected rate. None: there has been no sample.
        """
        if self.seq < 0:
            return ReadStatus.NONE
        if self._fresh:
            return ReadStatus.NEW
        limit_ns = self.topic.stale_after_ns
        return ReadStatus.STALE if limit_ns and self.age_ns > limit_ns else ReadStatus.OLD

    def statistics(self) -> SubscriberStatistics:
        """Take the statistics; what was overwritten since the last read counts as lost."""
        overwritten = max(0, self.topic.head - self._next - self._depth)
        return SubscriberStatistics(self.name, self.reads, self.lost + overwritten, self.skipped)


class NewestSubscription(Subscription):
    """A subscription whose reader wants nothing but the newest sample, however it reads."""

    __slots__ = ()

    def take(self) -> bool:
        """Copy the newest sample; safe in the real-time loop."""
        behind = self.topic.head - self._next - 1
        if behind > 0:
            self.skipped += behind
            self._next += behind
        return super().take()

    def statistics(self) -> SubscriberStatistics:
        """Take the statistics; what was overwritten was not wanted: it counts as skipped."""
        overwritten = max(0, self.topic.head - self._next - self._depth)
        return SubscriberStatistics(self.name, self.reads, self.lost, self.skipped + overwritten)


class _NextSample(Wait):
    """The next sample of a subscription."""

    __slots__ = ('_subscription', '_taken')

    def __init__(self, subscription: Subscription) -> None:
        self._subscription = subscription
        self._taken = False

    def begin(self, body: AsyncBody) -> None:
        if body.by_schedule is None:
            self._subscription.topic.wake_on_publish(body.task)

    def over(self) -> bool:
        if not self._taken:
            self._taken = self._subscription.take()
        return self._taken

    def end(self, body: AsyncBody) -> None:
        self._subscription.topic.wake_no_more(body.task)

    def result(self) -> Subscription:
        return self._subscription
