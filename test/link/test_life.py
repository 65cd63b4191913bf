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

"""The sign of life: it goes on while the link starves, and names what runs instead."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import socket

from core_in_process import CoreInProcess
from core_in_process import MS
from core_in_process import RawClient
from core_in_process import S
from processes import COMMANDS_YAML
from processes import in_a_folder
import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.core.app import Core
from rt_robot_os.kernel import VirtualClock
from rt_robot_os.link.liveness import LivenessPage
from rt_robot_os.link.liveness import LivenessReader
from rt_robot_os.link.protocol import encode_json
from rt_robot_os.link.protocol import PacketKind


class _World(CoreInProcess[RawClient]):
    def __init__(self, folder: Path) -> None:
        super().__init__(folder, COMMANDS_YAML)


@pytest.fixture
def core() -> Iterator[Core]:
    with in_a_folder(_World) as made:
        yield made.core


def test_a_long_job_at_low_priority_starves_the_link_and_not_the_sign_of_life(
        core: Core) -> None:
    life = LivenessReader(os.dup(core.link._page.fd))
    clock = core.kernel.clock
    assert isinstance(clock, VirtualClock)
    seen = []

    def plan() -> None:
        for _ in range(50):
            clock.spend(100 * MS)
            seen.append(life.read())

    core.kernel.add_task('planner', plan, priority=5, rate_hz=0.1, phase_ns=200 * MS)
    core.kernel.run(8 * S)
    assert len(seen) == 50
    counts = [signs.ticks for signs in seen if signs]
    assert all(a < b for a, b in zip(counts, counts[1:]))
    last = seen[-1]
    assert last is not None and last.task == 'planner'
    assert last.at_ns - last.served_ns > 4 * S
    after = life.read()
    assert after is not None and after.task == '' and after.at_ns - after.served_ns < S
    life.close()


def test_a_module_whose_statistics_take_long_is_named(
        core: Core, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')
    life = LivenessReader(os.dup(core.link._page.fd))
    seen = []

    def statistics() -> dict[str, int]:
        for _ in range(20):
            core.kernel.clock.spend(100 * MS)
            seen.append(life.read())
        return {}

    monkeypatch.setattr(core.modules[0], 'statistics', statistics)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as client:
        client.connect(str(core.link.path))
        client.send(encode_json(PacketKind.REQUEST, {'id': 1, 'do': 'statistics'}))
        core.kernel.run(4 * S)
    last = seen[-1]
    assert last is not None and last.task == 'statistics() of guard'
    after = life.read()
    assert after is not None and after.task == ''
    life.close()


def test_a_page_that_is_none_is_refused_and_closed() -> None:
    read, write = os.pipe()
    os.close(write)
    with pytest.raises(LinkError, match='liveness'):
        LivenessReader(read)
    with pytest.raises(OSError):
        os.fstat(read)


def test_a_page_that_somebody_else_writes_is_not_read_for_ever() -> None:
    page = LivenessPage()
    life = LivenessReader(os.dup(page.fd))
    page.write(1, 2, 'task')
    assert life.read() == (1, 1, 2, 'task')
    os.pwrite(page.fd, b'\xff', 0)
    assert life.read() is None
    life.close()
    page.close()
    page.close()
    page.write(3, 4)
