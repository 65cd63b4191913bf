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

"""Alarms from their cause to people, with real processes that are killed again and again."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
from random import Random
import signal
import subprocess
import sys
from typing import Any

from alarms_core import Core
from broad import examples
from processes import environment
from processes import GUARD_YAML
from processes import in_a_folder
from processes import wait_until
import pytest

ROUNDS = min(examples(2), 1000)
YAML = f"""{GUARD_YAML.replace('modules: [guard]', 'modules: [guard, alarms]')}\
    alarms: {{type: alarms, rate_hz: 10.0, priority: 41, delivery_timeout_s: 60.0,
             critical_steps: ['operator 3600']}}
    devices: [journal]
    journal: {{type: journal, port: JOURNAL, rate_hz: 20.0, priority: 25, retry_s: 0.1}}
    topics: [cmd_vel, heartbeat, cause, command, report]
    cmd_vel: {{message: geometry_msgs/msg/Twist}}
    heartbeat: {{topic: notifier/heartbeat, message: std_msgs/msg/String, tail: 4000}}
    cause: {{topic: alarms/causes, message: std_msgs/msg/String, depth: 64, tail: 3000}}
    command: {{topic: alarms/command, message: std_msgs/msg/String, depth: 64, tail: 500}}
    report: {{topic: alarms/report, message: std_msgs/msg/String, depth: 64, tail: 500}}
"""
TOPICS = ('alarms/events', 'alarms/answer')


class Chain:
    """A core with alarms and a journal, and a notifier with a file and a program."""

    def __init__(self, folder: Path) -> None:
        self.core = Core(folder)
        self.folder = folder
        self.calls = folder / 'calls.jsonl'
        (folder / 'robot.yaml').write_text(YAML.replace('JOURNAL', str(folder / 'kept')))
        (folder / 'notifier.yaml').write_text(json.dumps({'/**/notifier': {'ros__parameters': {
            'channels': ['operator'], 'folder': str(folder / 'memory'),
            'operator': {'type': 'file', 'path': str(self.calls)}}}}))
        self.notifier: subprocess.Popen[bytes] | None = None

    def start_core(self) -> None:
        self.core.heard.clear()
        self.core.start(*TOPICS)

    def start_notifier(self) -> None:
        self.notifier = subprocess.Popen(
            [sys.executable, '-m', 'rt_robot_os.features.alarms.notifier.program', '--ros-args',
             '--params-file', str(self.folder / 'notifier.yaml')], cwd='/',
            env=environment(self.folder), stderr=subprocess.DEVNULL)

    def kill_notifier(self) -> None:
        if self.notifier is not None:
            self.notifier.send_signal(signal.SIGKILL)
            self.notifier.wait()
            self.notifier = None

    def said(self, topic: str) -> list[dict[str, Any]]:
        return [json.loads(text) for text in list(self.core.heard.get(topic, []))]

    def called(self) -> list[dict[str, Any]]:
        """Give what the operator was shown; a line that is being written is not there yet."""
        if not self.calls.exists():
            return []
        return [json.loads(line) for line in self.calls.read_text().split('\n')[:-1]]

    def close(self) -> None:
        self.kill_notifier()
        self.core.close()


@pytest.fixture
def chain() -> Iterator[Chain]:
    with in_a_folder(Chain) as made:
        yield made


def test_each_alarm_reaches_somebody_once_whatever_is_killed(chain: Chain) -> None:
    random = Random(4)
    chain.start_core()
    chain.start_notifier()
    everybody = [f'p{number}' for number in range(2 * ROUNDS)]
    for turn in range(ROUNDS):
        for name in everybody[2 * turn:2 * turn + 2]:
            chain.core.publish('alarms/causes', {
                'kind': 'help', 'subject': name, 'level': 'critical', 'source': 'button'})
            known = {'raised', 'suspected'}
            wait_until(lambda: any(each['subject'] == name and each['event'] in known
                                   for each in chain.said('alarms/events')), f'{name} raised')
        # Somewhere between what is told, what is written and what is reported of it.
        seen, more = len(chain.called()), random.randrange(3)
        if turn % 2 == 0:
            wait_until(lambda: len(chain.called()) >= min(seen + more, 2 * turn + 2), 'calls')
            chain.kill_notifier()
            chain.start_notifier()
        else:
            chain.core.kill()
            chain.start_core()

    def shown() -> bool:
        return {each['subject'] for each in chain.called()} == set(everybody)

    wait_until(shown, 'a call about each of them')
    keys = [each['key'] for each in chain.called()]
    assert len(keys) == len(set(keys)) == len(everybody)
    for count, name in enumerate(everybody, 1):
        chain.core.publish('alarms/command', f'acknowledge {name} by mary')
        wait_until(lambda: len(chain.said('alarms/answer')) == count, 'an answer')
    assert all(each['ok'] for each in chain.said('alarms/answer'))
