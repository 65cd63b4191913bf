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

"""A core without devices that hears of a drive, and what the intake of mapping makes of one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import struct
import subprocess
from typing import Any

from benchmarks.slam.drives import Drive
import numpy as np
from processes import GUARD_YAML
from processes import start_core
from processes import TIMEOUT_S
from processes import wait_until

from rt_robot_os.base.errors import LinkError
from rt_robot_os.features.mapping.scan_intake import PosedScan
from rt_robot_os.features.mapping.slam.deskew import LaserMount
from rt_robot_os.link import LinkClient
from rt_robot_os.messages.cdr import LITTLE_ENDIAN

TOPICS = {
    'scan': ('sensor_msgs/msg/LaserScan', '{header.frame_id: base_link, ranges: 180}', 0),
    'odom': ('nav_msgs/msg/Odometry', '{header.frame_id: odom, child_frame_id: base_link}', 0),
    'map': ('nav_msgs/msg/OccupancyGrid', '{header.frame_id: map}', 400000),
    'slam/pose': ('geometry_msgs/msg/PoseWithCovarianceStamped', '{header.frame_id: map}', 0),
    **{f'mapping/{name}': ('std_msgs/msg/String', '{}', most) for name, most in (
        ('state', 200), ('status', 16000), ('command', 1000), ('answer', 2000))}}
YAML = f"""{GUARD_YAML}\
    topics: [cmd_vel, {', '.join(name.replace('/', '_') for name in TOPICS)}]
    cmd_vel: {{message: geometry_msgs/msg/Twist}}
""" + ''.join(f"""\
    {name.replace('/', '_')}:
      {{topic: {name}, message: {kind}, fixed: {fixed}, depth: {64 if tail < 99999 else 2},
       {f'tail: {tail}' if tail else 'rate_hz: 1.0'}}}
""" for name, (kind, fixed, tail) in TOPICS.items()).replace('fixed: {}, ', '')


class Beside:
    """A core, and a client that publishes in it what the devices would."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / 'robot.yaml').write_text(YAML)
        self.heard: dict[str, list[tuple[int, bytes]]] = {}
        self.process: subprocess.Popen[bytes] | None = None
        self.client: Any = None
        self.newest_ns = 0

    def start(self) -> None:
        self.process = start_core(self.folder)
        self.client = wait_until(self._connect, 'the core')
        self.channels = {topic: self.client.advertise(topic) for topic in TOPICS}
        for topic in TOPICS:
            said = self.heard.setdefault(topic, [])
            self.client.sample_handlers[self.client.topics[topic].channel] = (
                lambda stamp_ns, missed, cdr, said=said: said.append((stamp_ns, bytes(cdr))))
            if topic not in ('scan', 'odom'):
                self.client.mirror(topic)

    def _connect(self) -> LinkClient | None:
        try:
            return LinkClient(self.folder / 'robot.sock', 'the test', TIMEOUT_S)
        except LinkError:
            assert self.process is not None and self.process.poll() is None
            return None

    def publish(self, topic: str, cdr: bytes, stamp_ns: int = 0) -> None:
        self.client.publish(self.channels[topic], cdr, stamp_ns)

    def close(self) -> None:
        if self.client is not None:
            self.client.close()
        if self.process is not None:
            self.process.kill()
            self.process.wait()


def scan_message(scan: Any, frame: bytes = b'base_link\0') -> bytes:
    """Write a ``sensor_msgs/msg/LaserScan``."""
    head = struct.pack('<iiI', 0, 0, len(frame)) + frame
    head += bytes(-len(head) % 4)
    return LITTLE_ENDIAN + head + struct.pack(
        '<7fI', scan.angle_min, 0.0, scan.angle_increment, 0.0, 0.0, 0.05, 30.0,
        len(scan.ranges)) + np.asarray(scan.ranges, '<f4').tobytes() + bytes(4)


def odometry_message(pose: Any) -> bytes:
    """Write a ``nav_msgs/msg/Odometry``."""
    head = struct.pack('<iiI8sI', 0, 0, 5, b'odom\0\0\0\0', 10) + b'base_link\0'
    x, y, yaw = map(float, pose)
    return LITTLE_ENDIAN + head + bytes(-len(head) % 8) + struct.pack(
        '<7d', x, y, 0, 0, 0, np.sin(yaw / 2), np.cos(yaw / 2)) + bytes(8 * (36 + 6 + 36))


def sightings_of(drive: Drive, mirrored: bool = False) -> list[PosedScan]:
    """Return what the intake makes of a drive."""
    mount = LaserMount(drive.laser)
    return [PosedScan(replace(each, angle_increment=-each.angle_increment,
                              angle_min=-each.angle_min) if mirrored else each,
                      mount.base(each.odometry), mount) for each in drive.scans]
