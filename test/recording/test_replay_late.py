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

"""A coroutine that was late: in a replay each job goes on with what it went on with then."""

from __future__ import annotations

import os
import re
from typing import Any

import pytest

pytest.importorskip('std_msgs.msg', reason='ROS 2 messages are not installed')

YAML = """
robot:
  ros__parameters:
    core: {record_bytes: true}
    devices: []
    modules: [caller, listener]
    caller: {type: 'late_modules:Caller', rate_hz: 20.0, priority: 50}
    listener: {type: 'late_modules:Listener', priority: 40}
"""

# Holds itself up as a machine does that has much else to do.
MODULES = '''
import time

from rt_robot_os.kernel import any_of, Until
from rt_robot_os.modules import Module
from rt_robot_os.topics.ports import Input, Output

TICK_NS = 30_000_000


class Caller(Module):
    """Call; whoever hears it begins much later. And publish where the listener does."""

    call = Output('call', 'std_msgs/msg/Int64', depth=16)
    heard = Output('heard', 'std_msgs/msg/Int64', depth=16)

    def step(self):
        self.call.msg.data += 1
        self.call.publish()
        time.sleep(0.008)
        self.heard.msg.data = 1_000_000 + self.call.msg.data
        self.heard.publish()


class Listener(Module):
    """Tell what came: a call or a point in time, and how many before."""

    call = Input('call', message='std_msgs/msg/Int64')
    heard = Output('heard', 'std_msgs/msg/Int64', depth=16)

    def awaits(self):
        return ('call',)

    def own_rounds_hz(self):
        return 33.0

    async def run(self):
        count, tick_ns = 0, (self.kernel.now_ns() // TICK_NS + 1) * TICK_NS
        while True:
            source = await any_of(Until(tick_ns), self.call.next())
            count += 1
            self.heard.msg.data = count * 2
            if source is None:
                tick_ns += TICK_NS
                self.heard.msg.data += 1
            self.heard.publish()
            if count % 4 == 0:
                time.sleep(0.05)  # the next point passes, and calls come
'''


def test_late_jobs_of_a_coroutine_are_replayed_the_same(
        robot: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    (robot.output / 'late_modules.py').write_text(MODULES)
    (robot.output / 'robot.yaml').write_text(YAML)
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(
        [str(robot.output), os.environ.get('PYTHONPATH', '')]))
    bag = robot.output / 'bag'
    recorder, log = robot.record('-o', str(bag))
    robot.until(lambda: b'waiting' in log.read_bytes(), 'a waiting recorder')
    core, said = robot.start('rt_robot_os.core.program', '--ros-args', *robot.ORDINARY,
                             '--params-file', str(robot.output / 'robot.yaml'))
    robot.wait_for_messages(log, recorder, 60)
    assert core.poll() is None, said.read_text()
    assert robot.end(recorder) == 0, log.read_text()
    code, text = robot.run('rt_robot_os.recording.replay_program', str(bag), '--allow',
                           'late_modules:Caller', '--allow', 'late_modules:Listener')
    assert code == 0, text
    assert int(re.findall(r'^heard +(\d+)', text, re.MULTILINE)[0]) >= 20
