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


"""Rings with several publishers and subscribers, against a model of plain lists."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle
from hypothesis.stateful import consumes
from hypothesis.stateful import initialize
from hypothesis.stateful import invariant
from hypothesis.stateful import rule
from hypothesis.stateful import RuleBasedStateMachine
import pytest

from rt_robot_os.base.errors import TopicError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus
from rt_robot_os.topics import Publisher
from rt_robot_os.topics import ReadStatus
from rt_robot_os.topics import Subscription
from rt_robot_os.topics import Topic
from rt_robot_os.topics import Trigger

pytest.importorskip('std_msgs', reason='the ROS 2 message packages are not installed')

NAME = 'ring'
TAIL = 40
STALE_NS = 100_000_000  # ten periods at 100 Hz
MAX_SUBSCRIBERS = 4


@dataclass
class Reader:
    """What a subscriber should know."""

    subscription: Subscription
    began: int
    place: int
    seq: int = -1
    reads: int = 0
    lost: int = 0
    skipped: int = 0
    fresh: bool = False
    seen: list[int] = field(default_factory=list)


class Told(Trigger):
    """Record the samples for which a trigger was evaluated, each within its publication."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self.numbers: list[int] = []

    def published(self, topic: Topic) -> bool:
        assert topic.kernel.locked
        self.numbers.append(topic.head - 1)
        return False


class Rings(RuleBasedStateMachine):
    """One topic: everything ever published is in a list, each reader has a place in it."""

    publishers = Bundle('publishers')
    readers = Bundle('readers')

    message = 'std_msgs/msg/Float64'
    tail: int | None = None

    def value(self, number: int) -> object:
        return float(number)

    @rule()
    def add_trigger(self) -> None:
        if len(self.told) < 3:
            self.told.append((told := Told(self.task), len(self.stamps)))
            self.topic.triggers.append(told)

    @rule()
    def remove_trigger(self) -> None:
        if self.told:
            self.topic.triggers.remove(self.told.pop(0)[0])

    @initialize(depth=st.sampled_from([1, 2, 4, 8]), rate_hz=st.sampled_from([0.0, 100.0]))
    def declare(self, depth: int, rate_hz: float) -> None:
        self.kernel = Kernel(VirtualClock(start_ns=1_000_000_000))
        self.bus = Bus(self.kernel)
        self.topic = self.bus.declare(NAME, self.message, tail=self.tail, depth=depth,
                                      rate_hz=rate_hz, max_subscribers=MAX_SUBSCRIBERS)
        self.stale_ns = STALE_NS if rate_hz else 0
        self.depth = depth
        self.stamps: list[int] = []
        self.present: list[Reader] = []
        self.task = self.kernel.add_task('released', lambda: None, priority=5)
        self.told: list[tuple[Told, int]] = []
        self.of_publisher: dict[int, int] = {}

    # ---- what happens ------------------------------------------------------------------------

    @rule(target=publishers)
    def add_publisher(self) -> Publisher:
        made = self.bus.publisher(NAME)
        self.of_publisher[id(made)] = 0
        return made

    def note(self, publisher: Publisher, stamp_ns: int) -> None:
        self.stamps.append(stamp_ns or self.kernel.now_ns())
        self.of_publisher[id(publisher)] += 1

    @rule(publisher=publishers, stamp_ns=st.sampled_from([0, 5, 999_999_999]))
    def publish(self, publisher: Publisher, stamp_ns: int) -> None:
        publisher.msg.data = self.value(len(self.stamps))
        publisher.publish(stamp_ns)
        self.note(publisher, stamp_ns)

    @rule(publisher=publishers, stamp_ns=st.sampled_from([0, 7]),
          kind=st.sampled_from([bytes, bytearray, memoryview]))
    def publish_cdr(self, publisher: Publisher, stamp_ns: int, kind: type) -> None:
        cdr = self.topic.layout.from_dict({'data': self.value(len(self.stamps))})
        publisher.publish_cdr(kind(cdr), stamp_ns)
        self.note(publisher, stamp_ns)

    @rule(publisher=publishers, count=st.integers(1, 20))
    def burst(self, publisher: Publisher, count: int) -> None:
        for _ in range(count):
            self.publish(publisher, 0)

    @rule(publisher=publishers, data=st.one_of(
        st.binary(max_size=10), st.just(bytes(12))))
    def publish_nonsense(self, publisher: Publisher, data: bytes) -> None:
        with pytest.raises(TopicError, match=NAME):
            publisher.publish_cdr(data)

    @rule(target=readers, initial=st.booleans())
    def subscribe(self, initial: bool) -> Reader | None:
        if len(self.present) == MAX_SUBSCRIBERS:
            with pytest.raises(TopicError, match='max_subscribers'):
                self.bus.subscribe(NAME, 'one too many', initial=initial)
            return None
        began = max(0, len(self.stamps) - 1) if initial else len(self.stamps)
        reader = Reader(self.bus.subscribe(NAME, 'reader', initial=initial), began, began)
        self.present.append(reader)
        return reader

    @rule(reader=consumes(readers))
    def unsubscribe(self, reader: Reader | None) -> None:
        if reader is not None:
            self.bus.unsubscribe(reader.subscription)
            self.bus.unsubscribe(reader.subscription)
            self.present.remove(reader)

    @rule(duration_ns=st.sampled_from([1, STALE_NS // 2, STALE_NS, STALE_NS + 1]))
    def wait(self, duration_ns: int) -> None:
        self.kernel.clock.spend(duration_ns)

    @rule(reader=readers)
    def take(self, reader: Reader | None) -> None:
        if reader is not None:
            self.read(reader, reader.subscription.take())

    @rule(reader=readers)
    def latest(self, reader: Reader | None) -> None:
        if reader is not None:
            passed_over = max(0, len(self.stamps) - 1 - reader.place)
            reader.skipped += passed_over
            reader.place += passed_over
            self.read(reader, reader.subscription.latest())

    @rule(reader=readers)
    def rewind(self, reader: Reader | None) -> None:
        if reader is not None:
            oldest = max(0, len(self.stamps) - self.depth)
            reader.began += oldest - reader.place  # it reads some twice, or leaves some out
            reader.place = oldest
            reader.subscription.rewind()

    @rule(reader=readers)
    def put_back(self, reader: Reader | None) -> None:
        if reader is not None and reader.reads and reader.seq == reader.place - 1:
            reader.place -= 1
            reader.reads -= 1
            reader.subscription.put_back()

    @rule(reader=readers, newest=st.booleans(), named=st.booleans())
    def skip(self, reader: Reader | None, newest: bool, named: bool) -> None:
        if reader is None:
            return
        behind = len(self.stamps) - reader.place
        over = reader.subscription.skip
        assert (over(newest=newest) if named else over(newest)) == (behind > 0)
        if behind <= 0:
            return
        if newest:
            reader.skipped += behind - 1
        else:
            reader.lost += max(0, behind - self.depth)
        reader.place += behind if newest else max(1, behind - self.depth + 1)
        reader.began += 1  # the one that is passed over is counted nowhere

    def read(self, reader: Reader, there_was_one: bool) -> None:
        head = len(self.stamps)
        oldest = max(0, head - self.depth)
        if reader.place < oldest:
            reader.lost += oldest - reader.place
            reader.place = oldest
        assert there_was_one == (reader.place < head)
        reader.fresh = there_was_one
        if there_was_one:
            reader.seq = reader.place
            reader.place += 1
            reader.reads += 1

    # ---- what holds at any time --------------------------------------------------------------

    @invariant()
    def readers_stand_where_the_model_says(self) -> None:
        if not hasattr(self, 'topic'):
            return
        head = len(self.stamps)
        for reader in self.present:
            s = reader.subscription
            assert (s.seq, s.next_seq, s.reads) == (reader.seq, reader.place, reader.reads)
            assert (s.lost, s.skipped) == (reader.lost, reader.skipped)
            assert s.unread == min(head - reader.place, self.depth)
            told = s.statistics()
            assert told.lost == reader.lost + max(0, head - self.depth - reader.place)
            assert told.reads + told.lost + told.skipped + s.unread == head - reader.began
            assert s.status is self.status(reader)
            if reader.seq >= 0:
                assert s.msg.data == self.value(reader.seq)
                cdr = self.topic.layout.from_dict({'data': self.value(reader.seq)})
                assert bytes(s.buffer[:s.length]) == cdr
                assert s.stamp_ns == self.stamps[reader.seq]
                assert s.age_ns == self.kernel.now_ns() - s.stamp_ns
            else:
                assert (s.stamp_ns, s.age_ns) == (0, 0)

    def status(self, reader: Reader) -> ReadStatus:
        if reader.seq < 0:
            return ReadStatus.NONE
        if reader.fresh:
            return ReadStatus.NEW
        old = self.kernel.now_ns() - self.stamps[reader.seq] > self.stale_ns
        return ReadStatus.STALE if self.stale_ns and old else ReadStatus.OLD

    @invariant()
    def the_topic_counts_them_all(self) -> None:
        if not hasattr(self, 'topic'):
            return
        told = self.topic.statistics()
        assert told.published == len(self.stamps) == sum(self.of_publisher.values())
        assert told.stamp_ns == (self.stamps[-1] if self.stamps else 0)
        assert len(told.subscribers) == len(self.present)
        for trigger, since in self.told:
            assert trigger.numbers == list(range(since, len(self.stamps)))
        for number in range(max(0, len(self.stamps) - self.depth), len(self.stamps)):
            assert self.topic.stamp_of(number) == self.stamps[number]
        assert not self.kernel.locked


class RingsWithTail(Rings):
    """Messages of different lengths."""

    message = 'std_msgs/msg/String'
    tail: int | None = TAIL

    def value(self, number: int) -> object:
        return f'{number}:' + 'x' * (number * 7 % 30)


class LargeRings(RingsWithTail):
    """Messages that are copied in pieces, or whose buffers are exchanged."""

    tail = 100_000

    def value(self, number: int) -> object:
        return f'{number}:' + 'x' * (number * 7919 % 90_000)


Rings.TestCase.settings = RingsWithTail.TestCase.settings = settings(
    max_examples=40, stateful_step_count=50)
LargeRings.TestCase.settings = settings(max_examples=10, stateful_step_count=30)
TestRings = Rings.TestCase
TestRingsWithTail = RingsWithTail.TestCase
TestLargeRings = LargeRings.TestCase
