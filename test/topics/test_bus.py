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


"""Topics by name: declared once, refused clearly, counted."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from typing import Any

import pytest

from rt_robot_os.base.errors import LayoutError
from rt_robot_os.base.errors import TopicError
from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.topics import Bus
from rt_robot_os.topics import ReadStatus

pytest.importorskip('std_msgs', reason='the ROS 2 message packages are not installed')

FLOAT = 'std_msgs/msg/Float64'
TWIST = 'geometry_msgs/msg/Twist'


@pytest.fixture
def bus() -> Bus:
    return Bus(Kernel(VirtualClock(start_ns=5_000_000_000)))


def publish(bus: Bus, name: str, values: Iterable[float]) -> None:
    publisher = bus.publisher(name)
    for value in values:
        publisher.msg.data = value
        publisher.publish()


@pytest.mark.parametrize('name', [
    '', '/imu', 'imu/', 'imu//data', '7up', 'imu/7', 'a b', 'imu-data', 'ä', 'imu\n', '~/x',
    '{x}'])
def test_a_name_that_is_no_ros_name_is_refused(bus: Bus, name: str) -> None:
    with pytest.raises(TopicError, match='such as imu/data'):
        bus.declare(name, FLOAT)
    assert bus.topics == ()


@pytest.mark.parametrize('depth', [0, -1, 3, 6, 1 << 17, 2.0, '4'])
def test_a_depth_that_is_no_power_of_two_is_refused(bus: Bus, depth: Any) -> None:
    with pytest.raises(TopicError, match='power of two'):
        bus.declare('t', FLOAT, depth=depth)
    assert bus.topics == ()


def test_declaring_a_topic_again_gives_the_same_one(bus: Bus) -> None:
    first = bus.declare('t', TWIST, depth=4)
    assert bus.declare('t', TWIST) is first
    assert bus.topics == (first,)
    assert bus.topic('t') is first


@pytest.mark.parametrize(('message', 'options'), [
    (FLOAT, {}),
    ('sensor_msgs/msg/Imu', {'fixed': {'header.frame_id': 'other'}}),
    ('sensor_msgs/msg/Imu', {}),
])
def test_declaring_a_topic_with_another_shape_is_refused(
        bus: Bus, message: str, options: dict[str, Any]) -> None:
    bus.declare('t', 'sensor_msgs/msg/Imu', {'header.frame_id': 'imu_link'})
    with pytest.raises(TopicError, match="'t'.*choose another name"):
        bus.declare('t', message, **options)


def test_a_message_that_cannot_be_laid_out_leaves_no_topic(bus: Bus) -> None:
    with pytest.raises(LayoutError):
        bus.declare('t', 'std_msgs/msg/NoSuchThing')
    assert bus.topics == ()


def test_an_unknown_topic_names_those_that_are_there(bus: Bus) -> None:
    with pytest.raises(TopicError, match="no topic 'x'; there are: none"):
        bus.publisher('x')
    bus.declare('b', FLOAT)
    bus.declare('a', FLOAT)
    with pytest.raises(TopicError, match="no topic 'x'; there are: a, b"):
        bus.subscribe('x', 'reader')
    assert [topic.name for topic in bus.topics] == ['b', 'a']


def test_more_subscribers_than_declared_are_refused_until_one_leaves(bus: Bus) -> None:
    bus.declare('t', FLOAT, max_subscribers=2)
    first = bus.subscribe('t', 'first')
    bus.subscribe('t', 'second')
    with pytest.raises(TopicError, match="'third' would be subscriber number 3"):
        bus.subscribe('t', 'third')
    bus.unsubscribe(first)
    bus.subscribe('t', 'third')
    assert [s.name for s in bus.statistics()[0].subscribers] == ['second', 'third']


@pytest.mark.parametrize('limit', [0, -1, '3', None, 2.0, True, 1 << 20])
def test_a_number_of_subscribers_that_is_none_is_refused(bus: Bus, limit: Any) -> None:
    with pytest.raises(TopicError, match=rf"'t': max_subscribers {limit!r} must be a"):
        bus.declare('t', FLOAT, max_subscribers=limit)
    assert bus.topics == ()
    bus.declare('t', FLOAT)
    with pytest.raises(TopicError, match='max_subscribers .* must be'):
        bus.declare('t', FLOAT, max_subscribers=limit)


@pytest.mark.parametrize('rate_hz', [-1.0, float('nan'), float('inf'), '5', None, True])
def test_a_rate_that_is_none_is_refused(bus: Bus, rate_hz: Any) -> None:
    with pytest.raises(TopicError, match="'t': rate_hz .* must be a number of at least 0"):
        bus.declare('t', FLOAT, rate_hz=rate_hz)


def test_a_declaration_that_contradicts_an_earlier_one_is_refused(bus: Bus) -> None:
    bus.declare('t', FLOAT, depth=4, max_subscribers=2)
    with pytest.raises(TopicError, match="'t'.*max_subscribers 2 before and 3 now"):
        bus.declare('t', FLOAT, max_subscribers=3)
    with pytest.raises(TopicError, match="'t'.*depth 4 before and 8 now"):
        bus.declare('t', FLOAT, depth=8)
    assert bus.declare('t', FLOAT, depth=4, max_subscribers=2).max_subscribers == 2


def test_a_limit_may_be_given_by_a_later_declaration_when_the_first_gave_none(bus: Bus) -> None:
    bus.declare('t', FLOAT)
    bus.declare('t', FLOAT, max_subscribers=100)
    for i in range(100):
        bus.subscribe('t', f'reader {i}')
    with pytest.raises(TopicError, match=r'raise max_subscribers \(100\)'):
        bus.subscribe('t', 'one too many')


def test_a_limit_below_the_subscribers_that_are_there_is_refused(bus: Bus) -> None:
    bus.declare('t', FLOAT)
    for i in range(3):
        bus.subscribe('t', f'reader {i}')
    with pytest.raises(TopicError, match='max_subscribers 2 is less than the 3 subscribers'):
        bus.declare('t', FLOAT, max_subscribers=2)


def test_what_serves_the_system_needs_no_room_and_takes_none(bus: Bus) -> None:
    bus.declare('t', FLOAT, max_subscribers=1)
    mirrors = [bus.subscribe('t', f'link:{i}', counted=False) for i in range(3)]
    bus.subscribe('t', 'module')
    with pytest.raises(TopicError, match='subscriber number 2'):
        bus.subscribe('t', 'another module')
    late = bus.subscribe('t', 'link:late', counted=False)
    for mirror in (*mirrors, late):
        bus.unsubscribe(mirror)
    with pytest.raises(TopicError, match='subscriber number 2'):
        bus.subscribe('t', 'another module')


def test_a_late_joiner_gets_the_last_sample_only_if_it_asks(bus: Bus) -> None:
    bus.declare('t', FLOAT, depth=4)
    publish(bus, 't', range(10))
    with_initial = bus.subscribe('t', 'with', initial=True)
    without = bus.subscribe('t', 'without')
    assert (with_initial.unread, without.unread) == (1, 0)
    assert with_initial.take()
    assert (with_initial.msg.data, with_initial.seq) == (9.0, 9)
    assert not with_initial.take()
    assert not without.take()
    assert without.status is ReadStatus.NONE


def test_initial_of_an_empty_topic_is_the_first_sample(bus: Bus) -> None:
    bus.declare('t', FLOAT)
    reader = bus.subscribe('t', 'reader', initial=True)
    assert not reader.take()
    publish(bus, 't', [1.0])
    assert reader.take()
    assert reader.seq == 0


def test_a_message_that_was_read_does_not_change_underfoot(bus: Bus) -> None:
    bus.declare('t', FLOAT, depth=1)
    reader = bus.subscribe('t', 'reader')
    publish(bus, 't', [1.0])
    reader.take()
    publish(bus, 't', [2.0])
    assert reader.msg.data == 1.0


def test_each_publisher_has_a_message_of_its_own_that_keeps_its_values(bus: Bus) -> None:
    bus.declare('t', TWIST)
    reader = bus.subscribe('t', 'reader')
    first, second = bus.publisher('t'), bus.publisher('t')
    first.msg.linear.x = 1.0
    second.msg.linear.x = 2.0
    for publisher in (first, second, first):
        publisher.publish()
    seen = []
    while reader.take():
        seen.append(reader.msg.linear.x)
    assert seen == [1.0, 2.0, 1.0]
    assert (first.published, second.published) == (2, 1)


@pytest.mark.parametrize('data', [
    b'', b'\0\1\0\0', b'\0\1\0\0' + bytes(47),
    bytes(52), b'\0\1\0'])
def test_bytes_that_do_not_fit_are_refused_and_nothing_is_published(
        bus: Bus, data: bytes) -> None:
    bus.declare('t', TWIST)
    publisher = bus.publisher('t')
    with pytest.raises(TopicError, match="topic 't': "):
        publisher.publish_cdr(data)
    assert (bus.topic('t').head, publisher.published) == (0, 0)
    assert not bus.kernel.locked


def test_bytes_for_a_topic_with_a_tail_fit_up_to_its_length(bus: Bus) -> None:
    bus.declare('short', 'std_msgs/msg/String', tail=5)
    layout = bus.declare('long', 'std_msgs/msg/String', tail=50).layout
    publisher = bus.publisher('short')
    reader = bus.subscribe('short', 'reader')
    for text in ('12345', '', '123'):
        publisher.publish_cdr(layout.from_dict({'data': text}))
        assert reader.take()
        assert reader.msg.data == text
        assert bytes(reader.buffer[:reader.length]) == layout.from_dict({'data': text})
    with pytest.raises(TopicError, match="'short'"):
        publisher.publish_cdr(layout.from_dict({'data': '123456'}))
    assert not reader.take()


def test_bytes_in_any_buffer_are_published_alike(bus: Bus) -> None:
    topic = bus.declare('t', FLOAT)
    cdr = topic.layout.from_dict({'data': 3.5})
    reader = bus.subscribe('t', 'reader')
    publisher = bus.publisher('t')
    for data in (cdr, bytearray(cdr), memoryview(cdr), array('I', cdr),
                 memoryview(array('i', cdr)), cdr + b'\0\0\0'):
        publisher.publish_cdr(data)  # type: ignore[arg-type]
        assert reader.take()
        assert reader.msg.data == 3.5
        assert not bus.kernel.locked


def test_an_old_sample_becomes_stale_after_ten_periods(bus: Bus) -> None:
    bus.declare('t', FLOAT, rate_hz=10.0)
    reader = bus.subscribe('t', 'reader')
    publish(bus, 't', [1.0])
    reader.take()
    spend = bus.kernel.clock.spend
    spend(2_000_000_000)
    assert reader.status is ReadStatus.NEW, 'until the next read'
    reader.take()
    assert reader.status is ReadStatus.STALE
    publish(bus, 't', [1.0])
    reader.latest()
    reader.latest()
    assert reader.status is ReadStatus.OLD
    spend(1_000_000_000)
    assert reader.status is ReadStatus.OLD
    spend(1)
    assert reader.status is ReadStatus.STALE
    assert reader.age_ns == 1_000_000_001


def test_statistics_say_what_went_through(bus: Bus) -> None:
    bus.declare('t', FLOAT, depth=4, rate_hz=50.0)
    bus.subscribe('t', 'never reads')
    slow = bus.subscribe('t', 'slow')
    picky = bus.subscribe('t', 'picky')
    publish(bus, 't', range(10))
    slow.take()
    picky.latest()
    found, = bus.statistics()
    assert (found.name, found.type_name, found.depth, found.rate_hz) == ('t', FLOAT, 4, 50.0)
    assert (found.published, found.stamp_ns) == (10, 5_000_000_000)
    assert [(s.name, s.reads, s.lost, s.skipped) for s in found.subscribers] == [
        ('never reads', 0, 6, 0), ('slow', 1, 6, 0), ('picky', 1, 0, 9)]
