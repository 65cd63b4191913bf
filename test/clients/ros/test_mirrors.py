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
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from rt_robot_os.clients.ros.mirrors import Mirrors  # noqa: E402, I100
from rt_robot_os.errors import LinkError  # noqa: E402
from rt_robot_os.link import TopicInfo  # noqa: E402
from rt_robot_os.link.stamp_mapper import StampMapper  # noqa: E402
from rt_robot_os.settings import MirrorSettings  # noqa: E402


class Node:
    """Makes publishers that publish nothing."""

    def create_publisher(self, *arguments: Any) -> Any:
        return type('Publisher', (), {'publish': staticmethod(lambda cdr: None)})


class Client:
    """A connection that notes what is asked of the core."""

    def __init__(self) -> None:
        self.topics = {name: TopicInfo(name, number, 'geometry_msgs/msg/Twist', 52, 52, None, 8, 0)
                       for number, name in enumerate(('a', 'b'))}
        self.asked: list[tuple[str, str, float]] = []
        self.refuses = False

    def mirror(self, topic: str, policy: str, max_rate_hz: float, initial: bool = False) -> None:
        if self.refuses:
            raise LinkError('no')
        self.asked.append((topic, policy, max_rate_hz))

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
