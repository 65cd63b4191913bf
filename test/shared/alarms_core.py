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

"""A core in a process of its own whose alarms are kept by the test, over the link."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
import subprocess
import threading
from typing import Any

from processes import GUARD_YAML
from processes import start_core
from processes import TIMEOUT_S
from processes import wait_until
import pytest

from rt_robot_os.base.errors import LinkError
from rt_robot_os.link import LinkClient
from rt_robot_os.messages.cdr import string_in
from rt_robot_os.messages.cdr import string_message

pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')

TOPICS = {'command': 500, 'answer': 2000, 'events': 6000, 'list': 60000, 'notify': 6000,
          'report': 500}
YAML = f"""{GUARD_YAML}\
    topics: [cmd_vel, heartbeat, map, {', '.join(TOPICS)}]
    cmd_vel: {{message: geometry_msgs/msg/Twist}}
    map: {{message: nav_msgs/msg/OccupancyGrid, depth: 2, tail: 1000000,
          fixed: {{header.frame_id: map}}}}
    heartbeat: {{topic: notifier/heartbeat, message: std_msgs/msg/String, tail: 500}}
""" + ''.join(f"""\
    {name}: {{topic: alarms/{name}, message: std_msgs/msg/String, depth: 64, tail: {size}}}
""" for name, size in TOPICS.items())
Answer = Callable[[str], dict[str, Any] | None]


class Core:
    """
    A core, and a client that does in it what its module of alarms would.

    :ivar heard: what came, by topic.
    :ivar answers: makes the answer to a command; None for silence.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / 'robot.yaml').write_text(YAML)
        self.heard: dict[str, list[str]] = {}
        self.answers: Answer = lambda command: None
        self.process: subprocess.Popen[bytes] | None = None
        self.client: LinkClient | None = None
        self._channels: dict[str, int] = {}
        self._thread: threading.Thread | None = None
        self._stopping = False

    def start(self, *topics: str) -> None:
        self.process = start_core(self.folder)
        self.client = wait_until(self._connect, 'the core')
        self._channels = {f'alarms/{name}': self.client.advertise(f'alarms/{name}')
                          for name in (*TOPICS, 'causes')
                          if f'alarms/{name}' in self.client.topics}
        for topic in ('alarms/command', 'alarms/report', 'notifier/heartbeat', *topics):
            self._hear(self.client, topic)
        self._stopping = False
        self._thread = threading.Thread(target=self._pump, daemon=True)
        self._thread.start()

    def _connect(self) -> LinkClient | None:
        try:
            return LinkClient(self.folder / 'robot.sock', 'the test', TIMEOUT_S)
        except LinkError:
            assert self.process is not None and self.process.poll() is None
            return None

    def _hear(self, client: LinkClient | None, topic: str) -> None:
        assert client is not None
        said = self.heard.setdefault(topic, [])

        def take(stamp_ns: int, missed: int, cdr: memoryview) -> None:
            text = string_in(cdr)
            said.append(text)  # before the answer, which the test waits for
            answer = self.answers(text) if topic == 'alarms/command' else None
            if answer is not None:
                self.publish('alarms/answer', answer)

        client.sample_handlers[client.topics[topic].channel] = take
        client.mirror(topic, oldest=True, patient=True)

    def _pump(self) -> None:
        while not self._stopping:
            try:
                if self.client is not None:
                    self.client.pump(0.02)
            except LinkError:
                return

    def publish(self, topic: str, content: Any, stamp_ns: int = 0) -> None:
        assert self.client is not None
        text = content if isinstance(content, str) else json.dumps(content)
        self.client.publish(self._channels[topic], string_message(text), stamp_ns)

    def kill(self) -> None:
        self._stopping = True
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self.client is not None:
            self.client.close()
            self.client = None
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None

    close = kill
