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

"""A core says who reads a topic, so that nobody waits for an answer that cannot come."""

from __future__ import annotations

from collections.abc import Iterator
import json
from typing import Any

from core_in_process import CoreInProcess
from core_in_process import RawClient
from processes import GUARD_YAML
from processes import in_a_folder
import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.protocol import HEADER
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.link.protocol import PACKET_BYTES_MAXIMUM
from rt_robot_os.link.readers import Readers
from rt_robot_os.link.readers import readers_of

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

# The guard of this robot reads cmd_vel.
YAML = f"""{GUARD_YAML}\
    topics: [cmd_vel, order, answer]
    cmd_vel: {{message: geometry_msgs/msg/Twist}}
    order: {{message: std_msgs/msg/String, tail: 100}}
    answer: {{message: std_msgs/msg/String, tail: 100}}
"""


class World(CoreInProcess[RawClient]):
    """A core, and clients that ask it one thing after the other."""

    def __init__(self, folder: Any) -> None:
        super().__init__(folder, YAML)

    def client(self, name: str) -> RawClient:
        made = RawClient(self.path)
        self.clients.append(made)
        self.ask(made, 'hello', name=name)
        return made

    def ask(self, client: RawClient, do: str, **arguments: Any) -> dict[str, Any]:
        client.request(do, **arguments)
        self.run()
        while True:
            packet = client.socket.recv(PACKET_BYTES_MAXIMUM)
            if HEADER.unpack_from(packet)[-1] == client.number and packet[HEADER_BYTES:]:
                return dict(json.loads(packet[HEADER_BYTES:]))

    def readers(self, client: RawClient, topic: str, answers: str = '') -> Readers:
        return readers_of(self.ask(client, 'readers', topic=topic, answers=answers))


@pytest.fixture
def world() -> Iterator[World]:
    with in_a_folder(World) as made:
        yield made


def test_only_what_reads_and_can_answer_is_named(world: World) -> None:
    node, recorder, mapping = (world.client(name) for name in ('node', 'recorder', 'mapping'))
    assert not world.readers(node, 'order', 'answer')
    world.ask(recorder, 'mirror', topic='order')
    world.ask(mapping, 'advertise', topic='answer')
    assert not world.readers(node, 'order', 'answer')
    assert world.readers(node, 'order').names().startswith('recorder (pid ')
    world.ask(mapping, 'mirror', topic='order')
    found = world.readers(node, 'order', 'answer')
    assert found and [each.name for each in found.clients] == ['mapping']
    assert not found.asker and not found.in_core
    assert world.readers(mapping, 'order', 'answer').asker


def test_a_client_that_has_left_or_stopped_reading_is_none(world: World) -> None:
    node, mapping = world.client('node'), world.client('mapping')
    for _ in range(2):
        world.ask(mapping, 'advertise', topic='answer')
        world.ask(mapping, 'mirror', topic='order')
        before = world.readers(node, 'order', 'answer')
        assert before
        mapping.close()
        world.run()
        assert not world.readers(node, 'order', 'answer')
        mapping = world.client('mapping')
    world.ask(mapping, 'advertise', topic='answer')
    world.ask(mapping, 'mirror', topic='order')
    assert not before.clients & world.readers(node, 'order', 'answer').clients
    world.ask(mapping, 'unmirror', topic='order')
    assert not world.readers(node, 'order', 'answer')


def test_a_module_of_the_core_reads(world: World) -> None:
    assert world.readers(world.client('node'), 'cmd_vel').in_core == 1


def test_a_topic_that_does_not_exist_is_an_error(world: World) -> None:
    node = world.client('node')
    with pytest.raises(LinkError, match="no topic 'orders'"):
        world.readers(node, 'orders')
    with pytest.raises(LinkError, match="no topic 'answers'"):
        world.readers(node, 'order', 'answers')
