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

"""Topics of large samples: exchanged buffers keep what rings promise, copies can be preempted."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
import numpy as np
import pytest

from rt_robot_os.base.errors import TopicError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus
from rt_robot_os.topics.pieces import PIECE_BYTES
from rt_robot_os.topics.subscription import Subscription

pytest.importorskip('sensor_msgs.msg', reason='the ROS 2 messages are not installed')

SIZE = 3 * PIECE_BYTES + 7


def declare(depth: int = 4, **shape: Any) -> Bus:
    bus = Bus(Kernel(VirtualClock()))
    bus.declare('image', 'sensor_msgs/msg/Image',
                {'encoding': 'mono8', 'header.frame_id': 'eye', 'data': SIZE}, depth=depth)
    bus.declare('jpeg', 'sensor_msgs/msg/CompressedImage', {'format': 'jpeg'}, tail=SIZE,
                depth=depth)
    bus.declare('cloud', 'sensor_msgs/msg/PointCloud2', {'data': SIZE}, depth=depth)
    return bus


def fill(publisher: Any, value: int, size: int = SIZE) -> None:
    publisher.fill(memoryview(np.full(size, value, np.uint8)))


def test_what_is_not_the_array_stays_from_message_to_message() -> None:
    bus = declare()
    publisher, reader = bus.publisher('cloud'), bus.subscribe('cloud', 'test')
    publisher.msg.height, publisher.msg.width = 1, SIZE
    publisher.msg.is_dense = True  # it comes after the data
    for number in range(9):
        publisher.msg.row_step = number
        fill(publisher, number)
        publisher.publish()
        assert reader.take()
        assert (reader.msg.height, reader.msg.width, reader.msg.row_step) == (1, SIZE, number)
        assert reader.msg.is_dense is True
        assert set(reader.msg.data.tolist()) == {number}


def test_a_tail_is_as_long_as_each_message_needs() -> None:
    bus = declare()
    publisher, reader = bus.publisher('jpeg'), bus.subscribe('jpeg', 'test')
    sizes = [5, SIZE, 0, PIECE_BYTES, PIECE_BYTES + 1, 1]
    for number, size in enumerate(sizes):
        fill(publisher, number + 1, size)
        publisher.publish()
        assert reader.take()
        assert reader.msg.data.tolist() == [number + 1] * size


@pytest.mark.parametrize('topic, size', [
    ('image', SIZE - 1), ('image', SIZE + 1), ('image', 0), ('jpeg', SIZE + 1)])
def test_another_length_is_refused(topic: str, size: int) -> None:
    publisher = declare().publisher(topic)
    with pytest.raises(TopicError, match=f"topic '{topic}': {size} bytes for a sequence"):
        fill(publisher, 1, size)


@examples(max_examples=40, deadline=None)
@given(st.lists(st.sampled_from(['a', 'b', 'cdr', 'take', 'latest', 'pass']), max_size=40))
def test_two_publishers_and_a_reader_agree_with_a_simple_ring(steps: list[str]) -> None:
    bus = declare(depth=2)
    publishers = {'a': bus.publisher('jpeg'), 'b': bus.publisher('jpeg')}
    reader = bus.subscribe('jpeg', 'test')
    topic = bus.topic('jpeg')
    head = following = 0
    for step in steps:
        if step == 'cdr':
            made = topic.layout.from_dict({'data': [head % 251] * 9})
            publishers['a'].publish_cdr(made)
            head += 1
        elif step in publishers:
            fill(publishers[step], head % 251, 1 + head)
            publishers[step].publish()
            head += 1
        elif step == 'pass':
            assert reader.skip() == (following < head)
            following = max(following, head - 2) + (following < head)
        else:
            following = max(following, head - (1 if step == 'latest' else 2))
            assert (reader.take() if step == 'take' else reader.latest()) == (following < head)
            if following < head:
                assert reader.seq == following
                assert set(reader.msg.data.tolist()) == {following % 251}
                following += 1
        assert reader.next_seq + max(0, head - 2 - reader.next_seq) >= following
    buffers = {id(slot.obj) for slot in topic.slots}
    assert len(buffers | {id(p.buffer.obj) for p in publishers.values()}) == 4


def test_a_reader_that_is_lapped_between_two_chunks_starts_over(
        monkeypatch: pytest.MonkeyPatch) -> None:
    bus = declare(depth=2)
    publisher, reader = bus.publisher('image'), bus.subscribe('image', 'test')
    fill(publisher, 0)
    publisher.publish()
    pieces: list[int] = []

    def preempted(target: memoryview, source: memoryview) -> None:
        half = PIECE_BYTES
        target[:half] = source[:half]
        if not pieces:  # whatever preempts it publishes more than the ring holds
            for number in range(1, 5):
                pieces.append(number)
                publisher.msg.data[:] = number
                publisher.publish()
        target[half:len(source)] = source[half:]

    monkeypatch.setattr('rt_robot_os.topics.subscription.copy_in_pieces', preempted)
    assert reader.take()
    assert (reader.seq, reader.lost) == (3, 3)
    assert set(reader.msg.data.tolist()) == {3}


def test_copies_are_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    bus = declare()
    longest: list[int] = []
    from rt_robot_os.topics import pieces as module

    class Watched:
        def __init__(self, view: memoryview) -> None:
            self.view = view

        def __setitem__(self, key: slice, value: memoryview) -> None:
            longest.append(len(value))
            self.view[key] = value

    target = bytearray(SIZE)
    source = bytes(range(256)) * (SIZE // 256) + bytes(SIZE % 256)
    module.copy_in_pieces(Watched(memoryview(target)), memoryview(source))  # type: ignore
    assert target == source and max(longest) == PIECE_BYTES
    assert isinstance(bus.subscribe('image', 'test'), Subscription)
