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

"""However much a mirror has to send, a task above the link's can start in between."""

from __future__ import annotations

import socket

import pytest

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.link import mirror
from rt_robot_os.link.batch import Batch
from rt_robot_os.link.gather import Gather
from rt_robot_os.topics import Bus

DEPTH = 256


def test_a_mirror_lets_alarms_through_between_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = Kernel(VirtualClock())
    bus = Bus(kernel)
    bus.declare('pose', 'geometry_msgs/msg/Pose', depth=DEPTH)
    task = kernel.add_task('link', lambda: None, priority=2)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        ours.setblocking(False)
        carrying = mirror.Mirror(bus, 'pose', 'client', Batch(ours), 0, mirror.Policy.DRAIN, 0.0,
                                 False, Gather(kernel, task, 0))
        publisher = bus.publisher('pose')
        for _ in range(DEPTH):
            publisher.publish()
        sent: list[int] = []
        monkeypatch.setattr(mirror, 'preemption_point', lambda: sent.append(carrying.sent))
        carrying.carry(1)
        sent.append(carrying.sent)
    assert sent[-1] == DEPTH
    assert max(after - before for before, after in zip(sent, sent[1:])) <= 16
