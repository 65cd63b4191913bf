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

"""Both ends of a ring in wrong hands: buffers, types, subclasses, what they leave behind."""

from __future__ import annotations

from collections.abc import Callable
import gc
import struct
import sys
from typing import Any
import weakref

import pytest

from rt_robot_os.base.compiled import state
from rt_robot_os.base.errors import LayoutError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import Subscription
from rt_robot_os.topics import Topic
from rt_robot_os.topics import Trigger

pytest.importorskip('std_msgs', reason='the ROS 2 message packages are not installed')

S = 1_000_000_000
compiled_only = pytest.mark.skipif(not state().compiled, reason='Python says it by itself')


@pytest.fixture
def bus() -> Bus:
    return Bus(Kernel(VirtualClock(start_ns=S)))


@pytest.fixture(params=[None, 40], ids=['fixed', 'tail'])
def topic(bus: Bus, request: pytest.FixtureRequest) -> Topic:
    kind = 'Float64' if request.param is None else 'String'
    return bus.declare('t', f'std_msgs/msg/{kind}', tail=request.param, depth=4)


def fill(publisher: Publisher, number: int) -> None:
    publisher.msg.data = str(number) if publisher.topic.layout.tail else float(number)


def read(subscription: Subscription) -> int:
    return int(float(subscription.msg.data))


# ---- buffers -----------------------------------------------------------------------------------


@pytest.mark.parametrize('wrong', [
    lambda size: memoryview(bytearray(size - 1)),
    lambda size: memoryview(bytes(size)),
    lambda size: memoryview(b''),
    lambda size: 5,
    lambda size: None,
    lambda size: 'text',
])
def test_a_sample_stays_where_it_is_if_the_buffer_cannot_hold_it(
        bus: Bus, topic: Topic, wrong: Callable[[int], Any]) -> None:
    reader, publisher = bus.subscribe('t', 'reader'), bus.publisher('t')
    fill(publisher, 7)
    publisher.publish()
    right = reader.buffer
    size = publisher.topic.layout.length(publisher.buffer)
    with pytest.raises((TypeError, ValueError)):
        reader.buffer = wrong(size)
        reader.take()
    assert (reader.unread, reader.reads, reader.seq) == (1, 0, -1)
    reader.buffer = right
    assert reader.take() and read(reader) == 7


def test_memory_that_a_subscription_writes_to_is_kept(bus: Bus, topic: Topic) -> None:
    memory = bytearray(topic.layout.max_size)
    reader, publisher = bus.subscribe('t', 'reader', buffer=memoryview(memory)), bus.publisher('t')
    reader.msg = None
    with pytest.raises(BufferError):
        memory.clear()
    try:
        reader.buffer.release()
    except BufferError:  # the C core holds the view
        pass
    publisher.publish()
    try:
        assert reader.take()
    except ValueError:  # "released memoryview"
        assert not state().compiled
    reader.buffer = memoryview(bytearray(topic.layout.max_size))
    memory.clear()


@pytest.mark.parametrize('size', [0, 3, 1000])
def test_a_publisher_whose_buffer_is_of_another_size_publishes_nothing(
        bus: Bus, topic: Topic, size: int) -> None:
    publisher = bus.publisher('t')
    publisher.buffer = memoryview(b'\xff' * size)
    with pytest.raises((LayoutError, ValueError, struct.error)):
        publisher.publish()
    assert (topic.head, publisher.published, topic.kernel.locked) == (0, 0, False)


def test_data_that_is_longer_than_a_slot_is_refused(bus: Bus, topic: Topic) -> None:
    publisher, reader = bus.publisher('t'), bus.subscribe('t', 'reader')
    with pytest.raises(ValueError, match='.'):
        publisher.send(memoryview(bytearray(topic.layout.max_size + 1)))
    assert (topic.head, publisher.published, topic.kernel.locked) == (0, 0, False)
    fill(publisher, 3)
    publisher.publish()
    assert reader.take() and read(reader) == 3


def test_a_slot_may_be_published_itself(bus: Bus, topic: Topic) -> None:
    publisher, reader = bus.publisher('t'), bus.subscribe('t', 'reader')
    fill(publisher, 3)
    for _ in range(4):
        publisher.publish()
    publisher.publish_cdr(topic.slots[0][:topic.length_of(0)])
    assert reader.latest() and read(reader) == 3


# ---- wrong types -------------------------------------------------------------------------------


@pytest.mark.parametrize('stamp', ['5', 1.5, [1]])
def test_a_stamp_is_a_whole_number(bus: Bus, topic: Topic, stamp: Any) -> None:
    publisher = bus.publisher('t')
    with pytest.raises(TypeError):
        publisher.publish(stamp)
    with pytest.raises(TypeError):
        publisher.publish_cdr(bytes(topic.layout.prototype), stamp)
    assert (topic.head, publisher.published, topic.kernel.locked) == (0, 0, False)
    publisher.publish(stamp_ns=5)
    assert topic.stamp_of(0) == 5


def test_publish_takes_nothing_but_a_stamp(bus: Bus, topic: Topic) -> None:
    publisher: Any = bus.publisher('t')
    for wrong in (lambda: publisher.publish(1, 2), lambda: publisher.publish(stamp=1),
                  lambda: publisher.publish(1, stamp_ns=2), lambda: publisher.send(),
                  lambda: publisher.publish(1, nothing=2)):
        with pytest.raises(TypeError):
            wrong()
    assert topic.head == 0


@pytest.mark.parametrize('kind, method', [
    (Publisher, 'publish'), (Subscription, 'take'), (Subscription, 'latest'),
    (Subscription, 'skip'), (Subscription, 'unread'), (Subscription, 'statistics')])
def test_what_was_not_made_says_so(kind: Any, method: str) -> None:
    with pytest.raises(AttributeError):
        getattr(kind.__new__(kind), method)()


@compiled_only
def test_only_what_belongs_together_is_put_together(bus: Bus, topic: Topic) -> None:
    for wrong in (lambda: Topic(None, 'x', topic.layout),  # type: ignore[arg-type]
                  lambda: Topic(bus.kernel, 5, topic.layout),  # type: ignore[arg-type]
                  lambda: Publisher.__base__.__init__(bus.publisher('t'), topic, bytearray(9)),
                  lambda: Topic.__base__.__init__(topic, bus.kernel, 't', topic.layout, [], b''),
                  lambda: Subscription.__base__(None, bytearray(9), 0)):
        with pytest.raises(TypeError):
            wrong()
    made: Any = Topic.__base__
    for slots in [], [1, 2, 3], [1, 2, 3, 4]:  # none, no power of two, more than there is room for
        with pytest.raises(ValueError):
            made(bus.kernel, 'x', topic.layout, slots, bytearray(24))

    class Odd:
        length_rule = (8, 4, 0, -1, 0, 0)

    for rule in (8, 4, 0, -1, 0, 0), (-8, 4, 0, -1, 0, 0):  # the shortest is longer, below 0
        Odd.length_rule = rule
        with pytest.raises(ValueError):
            made(bus.kernel, 'x', Odd(), [memoryview(bytearray(8))], bytearray(8))
    with pytest.raises(AttributeError):
        Publisher.__base__(Topic.__new__(Topic), bytearray(9))  # type: ignore[call-arg]
    with pytest.raises(AttributeError):
        Topic.__new__(Topic).stamp_of(0)
    with pytest.raises(AttributeError):
        del bus.publisher('t').buffer


@compiled_only
@pytest.mark.parametrize('name', ['head', 'mask', 'slot_bytes', 'wakes', 'triggers', 'kernel'])
def test_what_the_c_core_goes_by_is_read_only(topic: Topic, name: str) -> None:
    with pytest.raises(AttributeError):
        setattr(topic, name, 1 << 40)


# ---- what others do meanwhile ------------------------------------------------------------------


class Broken(Trigger):
    """A trigger with a defect."""

    def published(self, topic: Topic) -> bool:
        raise ZeroDivisionError('a defect')


def test_a_trigger_that_fails_leaves_the_kernel_and_the_topic_as_they_are(
        bus: Bus, topic: Topic) -> None:
    publisher, reader = bus.publisher('t'), bus.subscribe('t', 'reader')
    topic.triggers.append(Broken(bus.kernel.add_task('released', lambda: None, priority=5)))
    fill(publisher, 1)
    with pytest.raises(ZeroDivisionError):
        publisher.publish()
    assert (topic.head, publisher.published, topic.kernel.locked) == (1, 1, False)
    del topic.triggers[:]
    fill(publisher, 2)
    publisher.publish()
    assert [reader.take() and read(reader) for _ in range(3)] == [1, 2, False]


def test_a_clock_that_fails_publishes_nothing() -> None:
    times: list[int] = [5]
    clock: Any = VirtualClock()
    clock.now_ns = lambda: times[0]
    bus = Bus(Kernel(clock))
    topic = bus.declare('t', 'std_msgs/msg/Float64')
    publisher = bus.publisher('t')
    publisher.publish()
    times.clear()
    with pytest.raises(IndexError):
        publisher.publish()
    assert (topic.head, bus.kernel.locked, topic.stamp_of(0)) == (1, False, 5)


def test_each_publication_is_recorded(bus: Bus, topic: Topic) -> None:
    publisher = bus.publisher('t')
    seen: list[tuple[Any, ...]] = []
    publisher.publish()
    bus.kernel.add_observer(seen.append)
    publisher.publish(5)
    assert [record[1:] for record in bus.kernel.black_box.records] == [
        (None, S, 't', 0), (None, S, 't', 1)]
    assert [record[1:] for record in seen] == [(None, S, 't', 1)]


# ---- subclasses, and what is left of them ------------------------------------------------------


def test_publishers_and_subscriptions_may_be_subclassed(topic: Topic) -> None:
    class Doubling(Publisher):
        def __init__(self, topic: Topic, *, name: str) -> None:
            super().__init__(topic)
            self.name = name

        def publish(self, stamp_ns: int = 0) -> None:
            super().publish(stamp_ns)
            super().publish(stamp_ns)

    class Odd(Subscription):
        def take(self) -> bool:
            return super().take() and super().take()

    publisher, reader = Doubling(topic, name='twice'), Odd(topic, 'reader')
    fill(publisher, 1)
    publisher.publish()
    fill(publisher, 2)
    publisher.publish()
    assert reader.take() and read(reader) == 1
    assert reader.latest() and read(reader) == 2
    assert (publisher.name, publisher.published, topic.head) == ('twice', 4, 4)


class Watched(Publisher):
    """A publisher that can be asked whether it is gone."""


def test_a_cycle_through_publisher_topic_and_kernel_is_collected() -> None:
    bus = Bus(Kernel(VirtualClock()))
    topic = bus.declare('t', 'std_msgs/msg/Float64')
    publisher = Watched(topic)
    reader = bus.subscribe('t', 'reader')
    task = bus.kernel.add_task('publishes', publisher.publish, priority=5)
    topic.wake_on_publish(task)
    reader.msg = (reader, publisher)  # what users do
    gone = weakref.ref(publisher)
    del bus, topic, publisher, reader, task
    gc.collect()
    assert gone() is None


def test_a_hundred_thousand_messages_leave_nothing_behind(bus: Bus, topic: Topic) -> None:
    publisher, reader = bus.publisher('t'), bus.subscribe('t', 'reader')
    fill(publisher, 1)
    objects = (bus.kernel, topic, topic.name, topic.layout, publisher, reader, publisher.buffer,
               reader.buffer, None, True, False)

    def many(count: int) -> None:
        for _ in range(count):
            publisher.publish()
            reader.take()
            reader.take()
            reader.buffer = reader.buffer

    many(3000)  # the black box is full
    gc.collect()
    before, blocks = [sys.getrefcount(each) for each in objects], sys.getallocatedblocks()
    many(100_000)
    gc.collect()
    after = [sys.getrefcount(each) for each in objects]
    assert all(abs(b - a) < 100 for a, b in zip(before, after))
    assert sys.getallocatedblocks() - blocks < 10_000  # other tests' objects may go meanwhile
