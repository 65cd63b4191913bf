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

"""A core with topics of large samples, in this process, and clients that send what a test says."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from core_in_process import CoreInProcess
from core_in_process import MS
from core_in_process import RawClient
from rt_robot_os.link.client_uploads import ClientUploadBuffer
from rt_robot_os.link.client_uploads import ClientUploadBuffers
from rt_robot_os.link.protocol import decode_json
from rt_robot_os.link.protocol import HEADER
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import PACKET_BYTES_MAXIMUM
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.link.session import ClientStatistics
from rt_robot_os.linux.memory_file import FD_BYTES
from rt_robot_os.linux.memory_file import received_fds

TAIL = 400_000
YAML = f"""
robot:
  ros__parameters:
    core: {{cpu: -2, scheduler_priority: 0, lock_memory: false}}
    topics: [map, picture, text]
    map:
      message: nav_msgs/msg/OccupancyGrid
      depth: 4
      tail: {TAIL}
      fixed: {{header.frame_id: map}}
    picture: {{message: sensor_msgs/msg/CompressedImage, depth: 8, tail: {TAIL}}}
    text: {{message: std_msgs/msg/String, depth: 16, tail: 100}}
"""


def grid(cells: int, value: int, frame: bytes = b'map\0') -> bytes:
    """Make the CDR of an OccupancyGrid of one row, all its cells of one value."""
    head = bytes([0, 1, 0, 0]) + bytes(8) + (4).to_bytes(4, 'little') + frame
    head += bytes(12) + cells.to_bytes(4, 'little') + (1).to_bytes(4, 'little') + bytes(4)
    head += bytes(-(len(head) - 4) % 8) + bytes(56)
    return head + cells.to_bytes(4, 'little') + bytes([value]) * cells


class Client(RawClient):
    """A client with the rooms of a real one, which sends what a test tells it to."""

    def __init__(self, world: World, name: str) -> None:
        super().__init__(world.path)
        self.world = world
        self.upload_buffers = ClientUploadBuffers()
        self.answers: list[dict[str, Any]] = []
        self.fds: list[int] = []
        self.refused = 0
        self.ask('hello', name=name)

    def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        self.request(do, **arguments)
        self.world.run()
        self.receive()
        return self.answers[-1]

    def receive(self) -> None:
        buffer = bytearray(PACKET_BYTES_MAXIMUM)
        while not self.ended:
            try:
                length, ancillary, _, _ = self.socket.recvmsg_into([buffer], FD_BYTES)
            except BlockingIOError:
                return
            except ConnectionResetError:
                length, ancillary = 0, []
            if not length:
                self.ended = True
                return
            packet = bytes(buffer[:length])
            if packet[0] == PacketKind.UPLOAD:
                self.upload_buffers.take(memoryview(packet), received_fds(ancillary))
            elif packet[0] == PacketKind.GIVE_BACK:
                self.upload_buffers.returned(Header(*HEADER.unpack_from(packet)).channel, packet)
            elif packet[0] == PacketKind.REPLY:
                self.answers.append(decode_json(packet))
            for fd in received_fds(ancillary) if packet[0] == PacketKind.LIVENESS else ():
                os.close(fd)

    def room(self, topic: str) -> ClientUploadBuffer:
        room = self.upload_buffers.by_channel.get(self.ask('advertise', topic=topic)['channel'])
        assert room is not None
        return room

    def publish(self, room: ClientUploadBuffer, cdr: bytes, stamp_ns: int = 0) -> bool:
        def send(packet: bytes) -> None:
            self.socket.send(packet)

        return room.publish(cdr, stamp_ns, send)

    def close(self) -> None:
        super().close()
        self.upload_buffers.close()


class World(CoreInProcess[Client]):
    """A core with topics of large samples, and a reader of each of them."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, YAML)
        self.reader = self.core.bus.subscribe('map', 'test')
        self.seen: list[tuple[int, int]] = []

    def client(self, name: str = 'writer') -> Client:
        self.clients.append(Client(self, name))
        return self.clients[-1]

    def told(self, name: str = 'writer') -> ClientStatistics:
        return next(each for each in self.core.link.statistics() if each.name == name)

    def run(self, duration_ns: int = 20 * MS) -> None:
        super().run(duration_ns)
        if hasattr(self, 'seen'):
            self.read()

    def read(self) -> None:
        while self.reader.take():
            data = bytes(self.reader.msg.data)[:self.reader.msg.info.width]
            assert len(set(data)) <= 1, 'two samples are mixed'
            self.seen.append((len(data), data[0] if data else -1))
