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

"""The client that publishes large samples: nonsense of a core, full sockets, a violent end."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

import pytest
from rt_robot_os.base.errors import LinkError
from rt_robot_os.link.client import LinkClient
from rt_robot_os.link.client import LinkSilent
from rt_robot_os.link.client_uploads import ClientUploadBuffers
from rt_robot_os.link.client_uploads import SampleTooLong
from rt_robot_os.link.protocol import GIVE_BACK
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import header
from rt_robot_os.link.protocol import MEMORY
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.linux.memory_file import MemoryFile

pytest.importorskip('sensor_msgs', reason='ROS 2 messages are not installed')


@pytest.mark.parametrize('body', [
    b'', GIVE_BACK.pack(3, 0), GIVE_BACK.pack(4, 1), GIVE_BACK.pack(3, 9)])
def test_a_core_that_gives_back_nonsense_is_refused_by_the_client(body: bytes) -> None:
    rooms = ClientUploadBuffers()
    memory = MemoryFile.create('test', 2, 5000)
    rooms.take(memoryview(header(PacketKind.UPLOAD, 7) + MEMORY.pack(3, 2, 5000)),
               [os.dup(memory.fd)])
    with pytest.raises(LinkError, match='the core returns'):
        rooms.returned(7, header(PacketKind.GIVE_BACK, 7) + body)
    with pytest.raises(LinkError, match='which has no upload'):
        rooms.returned(8, header(PacketKind.GIVE_BACK, 8) + GIVE_BACK.pack(3, 0))
    rooms.close()
    memory.close()
    room = rooms.by_channel.get(7)
    assert room is not None
    with pytest.raises(LinkError, match='is closed'):
        room.publish(b'', 0, print)


def test_a_packet_that_finds_no_room_in_the_socket_keeps_no_slot() -> None:
    rooms = ClientUploadBuffers()
    memory = MemoryFile.create('test', 2, 100_000)
    rooms.take(memoryview(header(PacketKind.UPLOAD, 7) + MEMORY.pack(3, 2, 100_000)),
               [os.dup(memory.fd)])
    room = rooms.by_channel.get(7)
    assert room is not None
    sent: list[bytes] = []

    def full(packet: bytes) -> None:
        raise LinkSilent('full')

    for _ in range(5):
        with pytest.raises(LinkSilent):
            room.publish(bytes(70_000), 0, full)
    assert [room.publish(bytes(70_000), 0, sent.append) for _ in range(3)] == [True, True, False]
    rooms.close()
    memory.close()


def test_a_real_client_publishes_what_is_long_by_itself(
        core: Any, until: Callable[..., Any]) -> None:
    client: LinkClient = core.client('source')
    reader: LinkClient = core.client('viewer')
    channel, text = client.advertise('picture'), client.advertise('text')
    seen: list[int] = []
    reader.on_data = lambda head, cdr: seen.append(cdr[-1])
    reader.mirror('picture')
    with pytest.raises(SampleTooLong):
        client.publish(channel, bytes(200_000))
    with pytest.raises(SampleTooLong):
        client.publish(text, bytes(200_000))
    head = bytes([0, 1, 0, 0]) + bytes(8) + (1).to_bytes(4, 'little') + bytes(4)
    head += (5).to_bytes(4, 'little') + b'jpeg\0' + bytes(3)
    for number in range(8):
        body = bytes([number]) * 100_000

        def publish() -> bool:  # nobody pumps this client but its publishing
            try:
                client.publish(channel, head + len(body).to_bytes(4, 'little') + body)
                return True
            except LinkSilent:
                return False

        until(publish, 'a slot')
        until(lambda: reader.pump(0.1) is not None and len(seen) > number, 'the sample')
    assert seen == list(range(8))
    mine = next(each for each in reader.statistics().clients if each['name'] == 'source')
    assert (mine['received'], mine['large'], mine['refused']) == (8, 8, 0)


KILLED = """
import sys
from pathlib import Path
from rt_robot_os.link.client import LinkClient, LinkSilent
client = LinkClient(Path(sys.argv[1]), 'killed')
channel = client.advertise('picture')
head = (bytes([0, 1, 0, 0]) + bytes(8) + bytes([1, 0, 0, 0]) + bytes(4) + bytes([5, 0, 0, 0])
        + b'jpeg\\0' + bytes(3) + (100_000).to_bytes(4, 'little'))
number = 0
while True:
    number += 1
    try:
        client.publish(channel, head + bytes([number % 251]) * 100_000)
    except LinkSilent:
        client.pump(0.01)
    if number == 20:
        print('many', flush=True)
"""


def test_a_client_that_is_killed_in_the_middle_harms_nobody(
        core: Any, until: Callable[..., Any]) -> None:
    reader: LinkClient = core.client('viewer')
    broken: list[int] = []
    seen: list[int] = []

    def take(head: Header, cdr: memoryview) -> None:
        seen.append(head.seq)
        if len(cdr) != 100_036 or len(set(bytes(cdr[36:]))) != 1:
            broken.append(head.seq)

    reader.on_data = take
    reader.mirror('picture', patient=True)
    victim = subprocess.Popen([sys.executable, '-c', KILLED, str(core.path)],
                              stdout=subprocess.PIPE)
    try:
        assert victim.stdout is not None and victim.stdout.readline()
        until(lambda: reader.pump(0.05) is not None and seen, 'a sample')
    finally:
        victim.kill()
        victim.communicate()

    def gone() -> bool:
        reader.pump(0.05)
        return all(each['name'] != 'killed' for each in reader.statistics().clients)

    until(gone, 'the end of the client')
    assert not broken
    maps = Path(f'/proc/{core.process.pid}/maps').read_text()
    assert maps.count('memfd:rt_robot_os picture') == 1  # of the viewer's mirror
