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

"""The publishers of a topic."""

from __future__ import annotations

from typing import Any

from rt_robot_os.base.errors import TopicError
from rt_robot_os.topics.pieces import copy_in_pieces
from rt_robot_os.topics.pieces import PIECE_BYTES
from rt_robot_os.topics.pieces import touch
from rt_robot_os.topics.ring import PublisherCore
from rt_robot_os.topics.topic import Topic


class Publisher(PublisherCore):
    """
    Write messages to a topic; made by :meth:`rt_robot_os.topics.Bus.publisher`.

    Set the fields of :attr:`msg`, then :meth:`publish`. The message retains its values, so
    constant fields are set once. Several publishers may share a topic; each has its own message.

    :ivar msg: a view with the field names of the ROS message.
    :ivar published: number of publications through this publisher.
    """

    __slots__ = ('msg',)

    topic: Topic

    def __init__(self, topic: Topic) -> None:
        super().__init__(topic, topic.layout.new_buffer())
        self.msg: Any = topic.layout.view(self.buffer)

    def fill(self, data: memoryview) -> None:
        """
        Set the tail, or the longest sequence, from bytes; safe in the real-time loop.

        A task above the caller can preempt it after every 64 KiB.

        :param data: whole elements; all of them for a sequence of fixed length.
        :raises TopicError: too many or too few elements.
        """
        layout = self.topic.layout
        start, room, item = layout.bulk
        octets = memoryview(data).cast('B')
        length = len(octets)
        if length > room or length % item or (layout.tail is None and length != room):
            raise TopicError(f'topic {self.topic.name!r}: {length} bytes for a sequence of '
                             f'{"at most " if layout.tail is not None else ""}{room}, {item} for '
                             'each element')
        target = self.buffer[start:start + length]
        if length <= PIECE_BYTES:
            target[:] = octets
        else:
            copy_in_pieces(target, octets)
        layout.set_tail_bytes(self.buffer, length)

    def publish_cdr(self, data: bytes | memoryview, stamp_ns: int = 0) -> None:
        """
        Publish a message in CDR, for instance from a raw ROS 2 subscription.

        :param data: with its four bytes of encapsulation.
        :param stamp_ns: as for :meth:`publish`.
        :raises TopicError: the bytes do not match the layout of the topic; nothing is published.
        """
        layout = self.topic.layout
        octets = memoryview(data).cast('B')
        reason = layout.check(octets)
        if reason is not None:
            raise TopicError(f'topic {self.topic.name!r}: {reason}')
        self.send(octets[:layout.length(octets)], stamp_ns)


class LargePublisher(Publisher):
    """
    Write large messages: publishing hands over the buffer instead of copying it.

    The next message is another object, so read :attr:`msg` again after each publication. Its
    fields equal those of the last one, except for the tail or the longest sequence: that contains
    an older sample and has to be filled each time.
    """

    __slots__ = ('_before', '_after')

    def __init__(self, topic: Topic) -> None:
        super().__init__(topic)
        touch(self.buffer)
        start, room, _ = topic.layout.bulk
        self._before, self._after = start, start + room

    def publish(self, stamp_ns: int = 0) -> None:
        """
        Publish the message; safe in the real-time loop, whatever its length.

        :param stamp_ns: time of the data on the kernel's clock; 0 means now.
        """
        topic = self.topic
        kernel = topic.kernel
        full, message = self.buffer, self.msg
        length = topic.layout.length(full)
        now_ns = kernel.now_ns()
        kernel.locked = True
        try:
            index = topic.head & topic.mask
            self.buffer, self.msg = topic.slots[index], topic.messages[index]
            topic.slots[index], topic.messages[index] = full, message
            self.buffer[:self._before] = full[:self._before]
            self.buffer[self._after:] = full[self._after:]
            self.commit(length, stamp_ns, now_ns)
        finally:
            kernel.locked = False
        if kernel.pending:
            kernel.settle()

    def publish_shared(self, data: memoryview, stamp_ns: int = 0) -> None:
        """
        Publish CDR from memory that another process may still modify: the copy is validated.

        :param data: with its four bytes of encapsulation.
        :param stamp_ns: as for :meth:`publish`.
        :raises TopicError: the bytes do not match the layout of the topic; nothing is published.
        """
        layout = self.topic.layout
        length = min(len(data), layout.max_size)  # padding may follow
        copied = self.buffer[:length]
        copy_in_pieces(copied, data[:length])
        reason = layout.check(copied)
        if reason is not None:
            raise TopicError(f'topic {self.topic.name!r}: {reason}')
        self.publish(stamp_ns)

    def send(self, data: memoryview, stamp_ns: int = 0) -> None:
        """Copy CDR in chunks and publish it; safe in the real-time loop."""
        copy_in_pieces(self.buffer, data)
        self.publish(stamp_ns)
