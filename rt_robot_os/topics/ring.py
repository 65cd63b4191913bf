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
The ring of a topic, its publisher and its subscription: the code that runs with each message.

The algorithm (``head`` counts publications, so sample ``n`` is in slot ``n mod depth``, and the
stored ones are ``head - depth`` to ``head - 1``):

1. publish: in a critical section copy the message into slot ``head mod depth``, store its stamp
   and length, increment ``head``, make the subscribed tasks ready; leave the section.
2. take: a reader stores the number of the next sample. If that is ``head``, there is no new
   sample. If it is below ``head - depth`` the reader was lapped: count the lost samples and go to
   the oldest stored one. Copy the slot, then read ``head`` again: if a publisher that preempted
   the copy lapped the reader, start over.
3. latest: the same for sample ``head - 1``; the samples in between count as skipped.

A reader never writes to the ring: publishing costs the same with one reader or a hundred.

This is the specification; where the C core is built, its types of the same names are used
(``_ring.c``). Samples longer than ``PIECE_BYTES`` are handled in Python in both builds: they are
copied in chunks, between which a task may be preempted.
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

    :param slots: one per sample, their number a power of two; each fits the longest message.
    :param storage: the memory of the slots, each at a multiple of 8 bytes; empty when the topic is
        large.
    :ivar head: number of publications.
    :ivar mask: the depth minus 1.
    :ivar slot_bytes: length of the longest message.
    :ivar has_tail: samples differ in length, or are large.
    :ivar large: samples are longer than ``PIECE_BYTES``; each slot has a separate buffer.
    :ivar wakes: tasks that each publication releases.
    :ivar triggers: conditions for releasing tasks, evaluated with each publication.
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
        """Return the stamp of a stored sample."""
        return self._stamps[number & self.mask]

    def length_of(self, number: int) -> int:
        """Return the length of a stored sample, in bytes."""
        return self._lengths[number & self.mask]

    def release_triggered(self, now_ns: int) -> None:
        """Release the tasks whose triggers are fulfilled; within a publication."""
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
        Publish the message; safe in the real-time loop.

        Subscribed tasks above the caller's priority run before this returns.

        :param stamp_ns: time of the data on the kernel's clock; 0 means now.
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
        Publish CDR that matches the layout of the topic; safe in the real-time loop.

        :param data: bytes of format ``B``; without a tail, of the length of the message.
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
        Make the message in the next slot the newest sample; locked.

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

    :ivar buffer: destination of samples.
    :ivar stamp_ns: time of the data of the sample in it; 0 before the first.
    :ivar seq: its number in the topic, from 0; -1 before the first.
    :ivar length: its length in bytes.
    :ivar next_seq: number of the next sample, unless it is overwritten before.
    :ivar lost: samples overwritten before :meth:`take` reached them.
    :ivar skipped: samples that :meth:`latest` skipped.
    :ivar reads: samples copied.
    :ivar fresh: the last call copied a sample.
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

        A reader that was lapped continues with the oldest stored sample; lost ones are counted.

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

        A class that overrides :meth:`take` must override this as well: it does not call take().

        :return: whether it is newer than the one read before.
        """
        behind = self.topic.head - self.next_seq - 1
        if behind > 0:
            self.skipped += behind
            self.next_seq += behind
        return SubscriptionCore.take(self)

    def copy_large(self, slot: int) -> None:
        """Copy the sample in a slot of a large topic, in chunks."""
        raise NotImplementedError

    def skip(self, newest: bool = False) -> bool:
        """
        Skip a sample without copying it; safe in the real-time loop.

        :param newest: the newest one, earlier ones count as skipped; otherwise the oldest unread.
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
        """Return the number of unread samples, without those that are lost already."""
        return min(self.topic.head - self.next_seq, self.topic.mask + 1)


if not TYPE_CHECKING and NATIVE is not None:
    TopicCore = NATIVE.TopicCore  # noqa: F811
    PublisherCore = NATIVE.PublisherCore  # noqa: F811
    SubscriptionCore = NATIVE.SubscriptionCore  # noqa: F811
