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

"""What it costs the core that a topic is mirrored to a client of the link."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from pathlib import Path
import socket
from typing import Any

from rt_robot_os.core.app import Core
from rt_robot_os.kernel import Kernel
from rt_robot_os.link.protocol import HEADER_BYTES
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.settings.model import RobotSettings
from rt_robot_os.settings.model import TopicSettings
from rt_robot_os.settings.process_model import CoreSettings
from rt_robot_os.tools.bench.cases.mirror.turns import MirrorTurns
from rt_robot_os.tools.bench.harness import Harness
from rt_robot_os.tools.bench.harness import Measurement
from rt_robot_os.tools.bench.subjects.link_client import connect
from rt_robot_os.tools.bench.subjects.link_client import stay
from rt_robot_os.tools.bench.subjects.operation_cost import IMU
from rt_robot_os.tools.bench.subjects.operation_cost import IMU_SHAPE
from rt_robot_os.topics import Layout

MIRRORED, PLAIN = 'bench/mirrored', 'bench/plain'
_CLIENT = f'{__name__}:client'
_RECEIVER = f'{__name__}:receiver'


def settings(topics: Mapping[str, tuple[str, Mapping[str, Any]]],
             gather_ms: float = 5.0, depth: int = 16) -> RobotSettings:
    """
    Make a robot without devices.

    :param topics: message type and fixed fields, by name.
    :param gather_ms: what is mirrored within this time goes out together; the default of a robot.
    :param depth: of each ring.
    """
    declared = tuple(TopicSettings(name=name.replace('/', '_'), topic=name, message=message,
                                   depth=depth, fixed=fixed)
                     for name, (message, fixed) in topics.items())
    return RobotSettings(topics=declared, core=CoreSettings(
        spawn=False, scheduler_priority=0, link_gather_ms=gather_ms))


def core(harness: Harness) -> Measurement:
    """
    Publish on a mirrored topic and on one that is not, in turns, in a core like the real one.

    The client is connected all the time: its heartbeats are in both kinds of stretches.
    """
    a = harness.arguments
    path = socket_path('bench')
    tested = Core(settings({name: (IMU, IMU_SHAPE) for name in (MIRRORED, PLAIN)},
                           a['gather_ms']), path)
    sent = [0]

    def count() -> None:
        sent[0] = sum(m.sent for c in tested.link.statistics() for m in c.mirrors)

    turns = MirrorTurns(tested.bus.publisher(MIRRORED).publish,
                        tested.bus.publisher(PLAIN).publish,
                        count)
    tested.kernel.add_task('bench/publish', turns.job, priority=80, rate_hz=a['rate_hz'])
    # The client waits for the socket, which is there once the core runs.
    arguments = {'path': str(path), 'topic': MIRRORED}
    with harness.helper(_CLIENT, arguments, same_cpu=False):
        harness.prepare(freeze=True)
        tested.run(a['warmup_ns'] + a['measure_ns'])
    if not sent[0]:
        raise RuntimeError('the client got no sample')
    return turns.differences(a['warmup_ns'])


def floor(harness: Harness) -> Measurement:
    """Send packets of that size on such a socket to a process that waits: the least there is."""
    a = harness.arguments
    packet = bytes(HEADER_BYTES + Layout.compile(IMU, IMU_SHAPE).size)
    path = harness.folder / 'floor.sock'
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(path))
        listener.listen(1)
        with harness.helper(_RECEIVER, {'path': str(path)}, same_cpu=False):
            connection, _ = listener.accept()
            with connection:
                connection.setblocking(False)
                return _send(harness, lambda: connection.send(packet), a)


def _send(harness: Harness, send: Callable[[], object], a: Mapping[str, Any]) -> Measurement:
    turns = MirrorTurns(send, lambda: None)
    tested = Kernel()
    tested.add_task('bench/send', turns.job, priority=80, rate_hz=a['rate_hz'])
    harness.prepare(freeze=True)
    tested.run(a['warmup_ns'] + a['measure_ns'])
    return turns.differences(a['warmup_ns'])


def client(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Be a client: take every sample and do nothing with it."""
    ready()
    link = connect(Path(arguments['path']))
    link.mirror(arguments['topic'])
    stay(link)


def receiver(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Be the other end of the bare socket."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as connection:
        connection.connect(arguments['path'])
        ready()
        buffer = bytearray(1024)
        while connection.recv_into(buffer):
            pass
