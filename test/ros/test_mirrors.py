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

"""Mirrors follow the settings: what was changed while the robot runs stays so."""

from __future__ import annotations

from dataclasses import replace
import time
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from rt_robot_os.base.errors import LinkError  # noqa: E402
from rt_robot_os.link import TopicInfo  # noqa: E402
from rt_robot_os.link.client_uploads import SampleTooLong  # noqa: E402
from rt_robot_os.link.stamp_mapper import StampMapper  # noqa: E402
from rt_robot_os.ros.mirrors import Mirrors  # noqa: E402, I100
from rt_robot_os.settings import MirrorSettings  # noqa: E402


class Node:
    """Makes publishers that publish nothing."""

    def create_publisher(self, *arguments: Any) -> Any:
        handle = type('Handle', (), {'publish_raw': staticmethod(lambda cdr: None)})
        return type('Publisher', (), {'handle': handle})


class Client:
    """A connection that notes what is asked of the core."""

    def __init__(self) -> None:
        self.topics = {name: TopicInfo(name, number, 'geometry_msgs/msg/Twist', 52, 52, None, 8, 0)
                       for number, name in enumerate(('a', 'b'))}
        self.asked: list[tuple[str, str, float]] = []
        self.delays_ms: dict[str, float] = {}
        self.clock = SimpleNamespace(interval_ns=0)
        self.refuses = False

    def mirror(self, topic: str, policy: str, max_rate_hz: float, initial: bool = False,
               delay_ms: float = 0.0) -> None:
        if self.refuses:
            raise LinkError('no')
        self.asked.append((topic, policy, max_rate_hz))
        self.delays_ms[topic] = delay_ms

    def request(self, do: str, **arguments: Any) -> None:
        assert do == 'unmirror'


def settings(name: str) -> MirrorSettings:
    return MirrorSettings(name=name, topic=name, ros_topic=name,
                          message='geometry_msgs/msg/Twist', policy='drain')


@pytest.fixture
def both() -> tuple[MirrorSettings, ...]:
    pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')
    return settings('a'), settings('b')


def made(both: tuple[MirrorSettings, ...], client: Client) -> Mirrors:
    mirrors = Mirrors(Node(), both, StampMapper())  # type: ignore[arg-type]
    mirrors.connect(client)  # type: ignore[arg-type]
    return mirrors


def test_only_what_differs_is_asked_for(both: tuple[MirrorSettings, ...]) -> None:
    client = Client()
    mirrors = made(both, client)
    mirrors.activate()
    client.asked.clear()
    mirrors.follow((both[0], replace(both[1], max_rate_hz=5.0)))
    assert client.asked == [('b', 'drain', 5.0)]


def test_mirrors_of_one_pattern_follow_each_for_itself(both: tuple[MirrorSettings, ...]) -> None:
    client = Client()
    same = tuple(replace(each, name='all', pattern='*', ros_pattern='') for each in both)
    mirrors = made(same, client)
    mirrors.activate()
    client.asked.clear()
    mirrors.follow(tuple(replace(each, max_rate_hz=5.0) for each in same))
    assert client.asked == [('a', 'drain', 5.0), ('b', 'drain', 5.0)]
    assert [out.settings.topic for out in mirrors.outward] == ['a', 'b']


def test_a_change_outlasts_the_connection_and_a_pause(both: tuple[MirrorSettings, ...]) -> None:
    first, second = Client(), Client()
    mirrors = made(both, first)
    mirrors.activate()
    mirrors.follow((replace(both[0], policy='latest'), both[1]))
    mirrors.disconnect()
    mirrors.connect(second)  # type: ignore[arg-type]
    assert second.asked == [('a', 'latest', 0.0), ('b', 'drain', 0.0)]
    mirrors.deactivate()
    mirrors.follow((both[0], replace(both[1], max_rate_hz=5.0)))
    second.asked.clear()
    mirrors.activate()
    assert second.asked == [('a', 'drain', 0.0), ('b', 'drain', 5.0)]


def test_a_change_that_the_core_refuses_changes_nothing(both: tuple[MirrorSettings, ...]) -> None:
    client = Client()
    mirrors = made(both, client)
    mirrors.activate()
    client.refuses = True
    with pytest.raises(LinkError):
        mirrors.follow((replace(both[0], policy='latest'), both[1]))
    client.refuses = False
    client.asked.clear()
    mirrors.activate()
    assert client.asked == [('a', 'drain', 0.0), ('b', 'drain', 0.0)]


MS = 1_000_000


def test_core_and_node_share_the_delay_and_never_exceed_it(both: tuple[MirrorSettings, ...]
                                                           ) -> None:
    for delay_ms in (0.0, 0.5, 3.0, 4.0, 20.0, 100.0):
        client = Client()
        mirrors = made(tuple(replace(each, delay_ms=delay_ms) for each in both), client)
        mirrors.activate()
        # poll(2) may wait up to a millisecond more.
        late_ms = client.clock.interval_ns / MS + 1 if client.clock.interval_ns else 0
        assert client.delays_ms['a'] == client.delays_ms['b'] == delay_ms / 2
        assert delay_ms / 2 + late_ms <= delay_ms
        assert bool(client.clock.interval_ns) == (delay_ms >= 4)


def test_one_topic_that_may_not_wait_has_the_node_wait_for_packets(
        both: tuple[MirrorSettings, ...]) -> None:
    client = Client()
    mirrors = made((replace(both[0], delay_ms=40.0), both[1]), client)
    mirrors.activate()
    assert client.delays_ms == {'a': 20.0, 'b': 0.0} and not client.clock.interval_ns
    mirrors.follow((replace(both[0], delay_ms=40.0), replace(both[1], delay_ms=20.0)))
    assert client.delays_ms == {'a': 20.0, 'b': 10.0} and client.clock.interval_ns == 9 * MS
    assert [row['delay_ms'] for _, row in mirrors.counters()] == [40.0, 20.0]
    mirrors.follow((replace(both[0], delay_ms=40.0), both[1]))
    assert not client.clock.interval_ns, 'from the next packet on'


def test_samples_that_go_by_themselves_have_nothing_to_wait_for(
        both: tuple[MirrorSettings, ...]) -> None:
    client = Client()
    client.topics['b'] = replace(client.topics['b'], max_size=65_537)
    mirrors = made(tuple(replace(each, delay_ms=40.0) for each in both), client)
    mirrors.activate()
    assert not client.clock.interval_ns
    assert [row['delay_ms'] for _, row in mirrors.counters()] == [40.0, 0.0]


class Core(Client):
    """A connection that notes what is published."""

    def __init__(self) -> None:
        super().__init__()
        self.published: list[bytes] = []
        self.stamps: list[int] = []
        self.fails: type[LinkError] | None = None

    def advertise(self, topic: str) -> int:
        return self.topics[topic].channel

    def publish(self, channel: int, cdr: bytes, stamp_ns: int = 0) -> None:
        if self.fails is not None:
            raise self.fails('a sample of 9 bytes')
        self.published.append(cdr)
        self.stamps.append(stamp_ns)


def coming(mirrors: Mirrors) -> Any:
    return mirrors.inward[0].subscription


class Listening(Node):
    """Gives the callbacks of its subscriptions."""

    def create_subscription(self, kind: Any, topic: str, callback: Any, *rest: Any, raw: bool
                            ) -> Any:
        return callback

    def get_clock(self) -> Any:
        raise AssertionError


def inward(both: tuple[MirrorSettings, ...], told: list[str], **changes: Any) -> Mirrors:
    one = replace(both[0], direction='in', **changes)
    return Mirrors(Listening(), (one,), StampMapper(), told.append)  # type: ignore[arg-type]


def counted(mirrors: Mirrors) -> dict[str, Any]:
    return mirrors.counters()[0][1]


def test_what_is_latched_waits_for_a_core_and_is_there_for_the_next(
        both: tuple[MirrorSettings, ...]) -> None:
    mirrors = inward(both, [], durability='transient_local')
    mirrors.active = True
    for each in (b'old', b'new'):
        coming(mirrors)(each, {})
    for _ in range(2):
        core = Core()
        mirrors.connect(core)  # type: ignore[arg-type]
        assert core.published == [b'new']
        mirrors.disconnect()
    assert (counted(mirrors)['received'], counted(mirrors)['dropped']) == (2, 0)


def test_what_is_not_latched_is_not_kept(both: tuple[MirrorSettings, ...]) -> None:
    mirrors, core = inward(both, []), Core()
    mirrors.active = True
    coming(mirrors)(b'old', {})
    mirrors.connect(core)  # type: ignore[arg-type]
    assert core.published == [] and counted(mirrors)['dropped'] == 1


def test_what_is_too_long_for_the_topic_is_told(both: tuple[MirrorSettings, ...]) -> None:
    told: list[str] = []
    mirrors, core = inward(both, told), Core()
    mirrors.active = True
    core.fails = SampleTooLong
    mirrors.connect(core)  # type: ignore[arg-type]
    coming(mirrors)(b'long', {})
    assert told == ['a -> a: refused: a sample of 9 bytes']
    assert counted(mirrors)['refused'] == 1 and 'a sample of 9' in counted(mirrors)['warning']


def test_a_sample_has_the_time_at_which_it_was_published_in_ros(
        both: tuple[MirrorSettings, ...]) -> None:
    mirrors, core = inward(both, []), Core()
    mirrors.active = True
    mirrors.connect(core)  # type: ignore[arg-type]
    for age_ns in (0, 20 * 1000 * MS):
        source_ns = time.time_ns() - age_ns
        before_ns = time.monotonic_ns()
        coming(mirrors)(b'command', {'source_timestamp': source_ns,
                                     'received_timestamp': time.time_ns()})
    assert len(core.stamps) == 2
    assert core.stamps[1] < before_ns - 10_000 * MS, 'it waited, and is as old as that'
    assert counted(mirrors)['delayed'] == 1 and counted(mirrors)['delay_ms'] > 10_000


def test_what_is_kept_for_the_next_core_grows_no_younger(
        both: tuple[MirrorSettings, ...]) -> None:
    mirrors = inward(both, [], durability='transient_local')
    mirrors.active = True
    coming(mirrors)(b'kept', {'source_timestamp': time.time_ns() - 60_000 * MS,
                              'received_timestamp': time.time_ns()})
    stamps = []
    for _ in range(2):
        core = Core()
        mirrors.connect(core)  # type: ignore[arg-type]
        stamps += core.stamps
        mirrors.disconnect()
    assert stamps[0] == stamps[1] <= time.monotonic_ns() - 59_000 * MS or stamps[0] == 1
