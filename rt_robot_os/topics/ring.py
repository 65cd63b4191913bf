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


"""
The ring of a topic and its two ends: what runs with each message.

The algorithm, in steps (``head`` counts publications, so sample ``n`` lies in slot ``n mod depth``
and the kept ones are ``head - depth`` to ``head - 1``):

1. publish: inside a critical section copy the message into slot ``head mod depth``, note its
   stamp and length, increment ``head``, make the subscribed tasks ready; leave the section.
2. take: a reader remembers the number of the sample that it wants next. If that is ``head``,
   nothing is new. If it is below ``head - depth`` it was lapped: count what is lost and go to the
   oldest kept one. Copy the slot, then look at ``head`` again: if a publisher that preempted the
   copy lapped it, go to the beginning.
3. latest: the same for sample ``head - 1``; what lies in between is counted as skipped.

A reader never writes to the ring: publishing costs the same with one or a hundred of them.

Here is what it means; where the extension in C is there, its types of the same names are used
(``_ring.c``). Samples longer than ``PIECE_BYTES`` stay in Python on both: they are copied in
pieces, between which a task may be preempted.
"""

from __future__ import annotations

from operator import index
from typing import Any
from typing import TYPE_CHECKING

from rt_robot_os.base.compiled import NATIVE
from rt_robot_os.kernel.black_box import PUBLISH

if TYPE_CHECKING:
    from rt_robot_os.kernel import Kernel
    from rt_robot_os.kernel import Task
    from rt_robot_os.topics.layout import Layout


class TopicCore:
    """
    The part of a topic that is read and written with each message.

    :param slots: as many as the topic is deep, a power of two; each for the longest message.
    :param storage: where the slots lie one after another, each from a multiple of 8 bytes on;
        empty when the topic is large.
    :ivar head: number of publications.
    :ivar mask: the depth less 1.
    :ivar slot_bytes: length of the longest message, or of each if all are as long.
    :ivar has_tail: samples differ in length, or are large.
    :ivar large: samples are longer than ``PIECE_BYTES``; each slot has a buffer of its own.
    :ivar wakes: tasks that each publication releases.
    :ivar triggers: what is asked with each publication whether to release its task.
    """

    __slots__ = ('kernel', 'name', 'layout', 'head', 'mask', 'slots', 'slot_bytes', 'has_tail',
                 'large', 'wakes', 'triggers', '_stamps', '_lengths')

    def __init__(self, kernel: Kernel, name: str, layout: Layout, slots: list[memoryview],
                 storage: bytearray) -> None:
        self.kernel = kernel
        self.name = name
        self.layout = layout
        self.head = 0
        self.mask = len(slots) - 1
        self.slots = slots
        self.slot_bytes = layout.max_size
        self._stamps = [0] * len(slots)
        self._lengths = [layout.size] * len(slots)
        self.large = not storage
        self.has_tail = layout.max_size != layout.size or self.large
        self.wakes: list[Task] = []
        self.triggers: list[Any] = []

    def stamp_of(self, number: int) -> int:
        """Return the moment of the data of a sample that is kept."""
        return self._stamps[number & self.mask]

    def length_of(self, number: int) -> int:
        """Return the length of a sample that is kept, in bytes."""
        return self._lengths[number & self.mask]

    def release_triggered(self, now_ns: int) -> None:
        """Release the tasks whose triggers say so; within a publication."""
        raise NotImplementedError


class PublisherCore:
    """
    The part of a publisher that runs with each message.

    :ivar buffer: the message that is published next; exchanged with those of the slots when the
        topic is large.
    :ivar published: number of publications through this publisher.
    """

    __slots__ = ('topic', 'buffer', 'published')

    def __init__(self, topic: TopicCore, buffer: memoryview) -> None:
        self.topic = topic
        self.buffer = buffer
        self.published = 0

    def publish(self, stamp_ns: int = 0) -> None:
        """
        Publish the message as it stands; safe in the real-time loop.

        Subscribed tasks above the caller's priority run before this returns.

        :param stamp_ns: moment of the data on the kernel's clock; 0 means now.
        """
        topic = self.topic
        if topic.has_tail:
            PublisherCore.send(self, self.buffer[:topic.layout.length(self.buffer)], stamp_ns)
            return
        kernel = topic.kernel
        now_ns = kernel.now_ns()
        kernel.locked = True
        try:
            topic.slots[topic.head & topic.mask][:] = self.buffer
            self.commit(topic.slot_bytes, stamp_ns, now_ns)
        finally:
            kernel.locked = False
        if kernel.pending:
            kernel.settle()

    def send(self, data: memoryview, stamp_ns: int = 0) -> None:
        """
        Publish CDR that fits the layout of the topic; safe in the real-time loop.

        :param data: bytes of format ``B``; without a tail, as many as each message has.
        :param stamp_ns: as for :meth:`publish`.
        """
        topic = self.topic
        kernel = topic.kernel
        now_ns = kernel.now_ns()
        length = len(data)
        kernel.locked = True
        try:
            topic.slots[topic.head & topic.mask][:length] = data
            self.commit(length, stamp_ns, now_ns)
        finally:
            kernel.locked = False
        if kernel.pending:
            kernel.settle()

    def commit(self, length: int, stamp_ns: int, now_ns: int) -> None:
        """
        Make the sample that was written to the slot after the newest one that; locked.

        :param now_ns: the time of the publication.
        """
        topic = self.topic
        kernel = topic.kernel
        head = topic.head
        slot = head & topic.mask
        topic._stamps[slot] = index(stamp_ns) if stamp_ns else now_ns
        topic._lengths[slot] = length
        topic.head = head + 1
        self.published += 1
        kernel.record((PUBLISH, kernel.current, now_ns, topic.name, head))
        if topic.wakes:
            kernel.wake(topic.wakes, now_ns)
        if topic.triggers:
            topic.release_triggered(now_ns)


class SubscriptionCore:
    """
    The part of a subscription that runs with each message.

    :ivar buffer: where samples are copied to.
    :ivar stamp_ns: moment of the data of the sample in it; 0 before the first.
    :ivar seq: its number in the topic, from 0; -1 before the first.
    :ivar length: its length in bytes.
    :ivar next_seq: number of the sample that is read next, unless it is overwritten before.
    :ivar lost: samples overwritten before :meth:`take` reached them.
    :ivar skipped: samples that :meth:`latest` passed over.
    :ivar reads: samples copied out.
    :ivar fresh: the last call copied one.
    """

    __slots__ = ('topic', 'buffer', 'stamp_ns', 'seq', 'length', 'next_seq', 'lost', 'skipped',
                 'reads', 'fresh')

    def __init__(self, topic: TopicCore, buffer: memoryview, next_seq: int) -> None:
        self.topic = topic
        self.buffer = buffer
        self.stamp_ns = 0
        self.seq = -1
        self.length = topic.layout.size
        self.next_seq = next_seq
        self.lost = self.skipped = self.reads = 0
        self.fresh = False

    def take(self) -> bool:
        """
        Copy the oldest unread sample into :attr:`msg`; safe in the real-time loop.

        A reader that was lapped goes to the oldest kept sample; what it lost is counted.

        :return: whether there was one.
        """
        topic = self.topic
        depth = topic.mask + 1
        wanted = self.next_seq
        while True:
            head = topic.head
            if wanted >= head:
                self.fresh = False
                return False
            if head - wanted > depth:
                self.lost += head - depth - wanted
                self.next_seq = wanted = head - depth
            slot = wanted & topic.mask
            if not topic.has_tail:
                self.buffer[:] = topic.slots[slot]
            elif topic.large:
                self.copy_large(slot)
            else:
                self.length = length = topic._lengths[slot]
                self.buffer[:length] = topic.slots[slot][:length]
            stamp_ns = topic._stamps[slot]
            if topic.head - wanted <= depth:  # not lapped while copying
                break
        self.stamp_ns = stamp_ns
        self.seq = wanted
        self.next_seq = wanted + 1
        self.reads += 1
        self.fresh = True
        return True

    def latest(self) -> bool:
        """
        Copy the newest sample into :attr:`msg`; safe in the real-time loop.

        Who overrides :meth:`take` overrides this as well: it does not call the method.

        :return: whether it is newer than the one read before.
        """
        behind = self.topic.head - self.next_seq - 1
        if behind > 0:
            self.skipped += behind
            self.next_seq += behind
        return SubscriptionCore.take(self)

    def copy_large(self, slot: int) -> None:
        """Copy the sample in a slot of a large topic, in pieces."""
        raise NotImplementedError

    def skip(self, newest: bool = False) -> bool:
        """
        Pass over a sample without copying it; safe in the real-time loop.

        :param newest: the newest one, those before it count as skipped; else the oldest unread.
        :return: whether there was one.
        """
        behind = self.topic.head - self.next_seq
        if behind <= 0:
            return False
        if newest:
            self.skipped += behind - 1
            self.next_seq += behind - 1
        elif behind > self.topic.mask + 1:
            self.lost += behind - self.topic.mask - 1
            self.next_seq += behind - self.topic.mask - 1
        self.next_seq += 1
        return True

    @property
    def unread(self) -> int:
        """How many samples wait, those that are lost already not counted."""
        return min(self.topic.head - self.next_seq, self.topic.mask + 1)


if not TYPE_CHECKING and NATIVE is not None:
    TopicCore = NATIVE.TopicCore  # noqa: F811
    PublisherCore = NATIVE.PublisherCore  # noqa: F811
    SubscriptionCore = NATIVE.SubscriptionCore  # noqa: F811
