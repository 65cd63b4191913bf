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

"""A core that is too busy to answer in time is asked again, for all that it did not answer."""

from __future__ import annotations

from collections.abc import Iterator
import threading
import time
from typing import Any

from core_in_process import CoreInProcess
from core_in_process import RawClient
from processes import GUARD_YAML
from processes import in_a_folder
import pytest

from rt_robot_os.features.mapping.process.core_link import CoreLink
from rt_robot_os.gateway.reading import Reads
from rt_robot_os.gateway.robot_link import RobotLink
from rt_robot_os.link.client import LinkClient
from rt_robot_os.link.client import LinkSilent
from rt_robot_os.link.reconnecting_client import ReconnectingClient

pytest.importorskip('geometry_msgs', reason='ROS 2 messages are not installed')

YAML = f"""{GUARD_YAML}\
    topics: [cmd_vel, text]
    cmd_vel: {{message: geometry_msgs/msg/Twist, depth: 64}}
    text: {{message: std_msgs/msg/String, depth: 16, tail: 100}}
"""
PATIENCE_S = 60.0


@pytest.fixture
def core() -> Iterator[CoreInProcess[RawClient]]:
    with in_a_folder(lambda folder: CoreInProcess[RawClient](folder, YAML)) as core:
        ending = threading.Event()
        thread = threading.Thread(target=run, args=(core, ending))
        thread.start()
        yield core
        ending.set()
        thread.join()


def run(core: CoreInProcess[RawClient], ending: threading.Event) -> None:
    """Let time pass until it is told to end."""
    while not ending.wait(0.001):
        core.run()


def silent_once(monkeypatch: pytest.MonkeyPatch, method: str, topic: str) -> None:
    """Have the first request of a kind for a topic come to nothing, as of a core that is busy."""
    ask = getattr(LinkClient, method)
    was_silent: list[str] = []

    def asked(self: LinkClient, name: str, **more: Any) -> Any:
        if name == topic and not was_silent:
            was_silent.append(name)
            raise LinkSilent(f'the core did not answer {method!r} within 5 s')
        return ask(self, name, **more)

    monkeypatch.setattr(LinkClient, method, asked)


def wait_for(condition: Any) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.001)


def test_mapping_publishes_all_the_same(core: CoreInProcess[RawClient],
                                        monkeypatch: pytest.MonkeyPatch) -> None:
    silent_once(monkeypatch, 'advertise', 'text')
    told: list[str] = []
    link = CoreLink(core.path, ('cmd_vel',), {}, ('text', 'missing'), lambda is_new: None,
                    told.append)
    link.start()
    try:
        wait_for(lambda: link.has('text'))
    finally:
        link.stop()
    assert told[-2].startswith("the core did not answer 'advertise'"), told
    assert told[-1].startswith('connected to the core')


class Part:
    """A part of the gateway that reads a topic and publishes it."""

    def reads(self) -> tuple[Reads, ...]:
        return Reads('text', lambda sample: None),

    def publishes(self) -> tuple[str, ...]:
        return 'text',

    def met_robot(self, topics: Any) -> None:
        pass


@pytest.mark.parametrize('method', ['advertise', 'mirror'])
def test_a_gateway_publishes_and_reads_all_the_same(
        core: CoreInProcess[RawClient], monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    silent_once(monkeypatch, method, 'text')
    link = RobotLink(core.path, lambda text: None)
    link.start([Part()])
    try:
        wait_for(lambda: link.connected and link.has('text')
                 and core.mirror_of('gateway', 'text'))
    finally:
        link.stop()


def test_who_got_no_answer_has_no_connection(core: CoreInProcess[RawClient]) -> None:
    silences = [LinkSilent('the core did not answer')]

    def connected(client: LinkClient) -> None:
        if silences:
            raise silences.pop()

    told: list[str] = []
    client = ReconnectingClient(core.path, 'test', connected, told.append)
    try:
        assert not client.pump(0.0) and client.client is None
        assert told == ['the core did not answer; waiting for it']
        assert client.pump(0.0) and client.client is not None
    finally:
        client.close()
