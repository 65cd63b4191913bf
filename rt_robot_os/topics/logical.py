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


"""Publisher and subscription of tasks with logical execution time (LET)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rt_robot_os.topics.publisher import Publisher
from rt_robot_os.topics.subscription import Subscription

if TYPE_CHECKING:
    from rt_robot_os.kernel.logical import Logical
    from rt_robot_os.topics.topic import Topic


class _HeldMessage:
    """A message that waits for the deadline."""

    __slots__ = ('data', 'length', 'stamp_ns')

    def __init__(self, size: int) -> None:
        self.data = memoryview(bytearray(size))
        self.length = 0
        self.stamp_ns = 0


class LogicalPublisher(Publisher):
    """
    Hold the messages of a job until its deadline.

    :ivar discarded: messages that were not published, because the job was late or published more
        than the topic holds.
    """

    __slots__ = ('discarded', '_held', '_count')

    def __init__(self, topic: Topic, logical: Logical) -> None:
        super().__init__(topic)
        self.discarded = 0
        # Allocated in advance: nothing is allocated in the loop.
        self._held = [_HeldMessage(topic.layout.max_size) for _ in range(topic.depth)]
        self._count = 0
        logical.outputs.append(self._end)

    def publish(self, stamp_ns: int = 0) -> None:
        """
        Queue the message for publication at the deadline; safe in the real-time loop.

        :param stamp_ns: time of the data; 0 means the deadline.
        """
        self.send(self.buffer[:self.topic.layout.length(self.buffer)], stamp_ns)

    def send(self, data: memoryview, stamp_ns: int = 0) -> None:
        """Queue CDR for publication at the deadline; safe in the real-time loop."""
        if self._count == len(self._held):
            self.discarded += 1
            return
        kept = self._held[self._count]
        kept.data[:len(data)] = data
        kept.length, kept.stamp_ns = len(data), stamp_ns
        self._count += 1

    def _end(self, in_time: bool) -> None:
        count, self._count = self._count, 0
        if not in_time:
            self.discarded += count
            return
        for kept in self._held[:count]:
            super().send(kept.data[:kept.length], kept.stamp_ns)


class LogicalSubscription(Subscription):
    """
    Read only samples that were published before the release of the job.

    The topic must be deep enough for the publications within a deadline: overwritten samples are
    lost and counted, as for every other reader.
    """

    __slots__ = ('_limit',)

    def __init__(self, topic: Topic, name: str, logical: Logical, initial: bool) -> None:
        super().__init__(topic, name, initial=initial)
        self._limit = self.next_seq
        logical.inputs.append(self._fix)

    def take(self) -> bool:
        """Copy the oldest unread sample from before the release; see Subscription.take."""
        limit = self._limit
        if self.topic.head - limit >= self.topic.depth and self.next_seq < limit:
            self.lost += limit - self.next_seq
            self.next_seq = limit
        if self.next_seq >= limit:
            self.fresh = False
            return False
        return super().take()

    def latest(self) -> bool:
        """Copy the newest sample from before the release; see Subscription.latest."""
        behind = self._limit - self.next_seq - 1
        if behind > 0:
            self.skipped += behind
            self.next_seq += behind
        return self.take()

    @property
    def unread(self) -> int:
        """Return the number of unread samples from before the release."""
        return max(0, self._limit - max(self.next_seq, self.topic.head - self.topic.depth))

    def _fix(self) -> None:
        self._limit = self.topic.head
