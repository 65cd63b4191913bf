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

"""Commands of people far away: each once, with the robot's own answer."""

from __future__ import annotations

from typing import Any

from fake_server import FakeServer
from processes import wait_until


def answer(server: FakeServer, number: str) -> tuple[bool, str]:
    wait_until(lambda: number in server.answers(), f'an answer to {number}')
    found = server.answers()[number]
    return found['ok'], found['text']


def test_an_alarm_is_acknowledged_once_with_the_answer_of_the_robot(
        core: Any, server: FakeServer, gateway: Any) -> None:
    core.answers = lambda text: {'command': text, 'ok': True, 'text': 'acknowledged',
                                 'alarm': '7'}
    words = 'acknowledge 7 by mary I am coming'
    with gateway(core) as made:
        wait_until(lambda: made.robot.connected and made.server.connected, 'both connections')
        server.send('command', id='a1', do='alarm', args={'text': words}, by='mary')
        assert answer(server, 'a1') == (True, 'acknowledged')
        server.heard.clear()
        server.cut()
        wait_until(lambda: server.kinds('hello'), 'a new connection')
        server.send('command', id='a1', do='alarm', args={'text': words}, by='mary')
        assert answer(server, 'a1') == (True, 'acknowledged')  # as it was; not done again
        assert core.heard['alarms/command'].count(words) == 1
        assert made.statistics()['commands_repeated'] == 1


def test_what_cannot_be_done_says_why(core: Any, server: FakeServer, gateway: Any) -> None:
    with gateway(core, command_s=0.2) as made:
        wait_until(lambda: made.robot.connected and made.server.connected, 'both connections')
        server.send('command', id='b1', do='goal', args={'x': 1.0, 'y': 2.0}, by='mary')
        assert answer(server, 'b1') == (False, 'this robot has no topic goal_pose that others may '
                                        'publish: its parameter file lists none (topics)')
        server.send('command', id='b2', do='alarm', args={'text': 'test by mary'}, by='mary')
        assert 'does not answer' in answer(server, 'b2')[1]  # the core has no module of alarms
        for number, args in (('b3', {'x': 'near'}), ('b4', {'x': 1e9, 'y': 0.0})):
            server.send('command', id=number, do='goal', args=args, by='mary')
            assert not answer(server, number)[0]
        server.send('command', id='b5', do='fly', args={}, by='mary')
        assert 'no command' in answer(server, 'b5')[1]
        server.say('nonsense')
        server.say('{"kind":"command","id":{},"do":"stop"}')
        wait_until(lambda: made.statistics()['malformed'] >= 2, 'nonsense that is counted')
        assert made.server.connected


def test_a_command_that_nothing_reads_is_refused(
        core: Any, server: FakeServer, gateway: Any) -> None:
    core.client.request('unmirror', topic='alarms/command')
    with gateway(core) as made:
        wait_until(lambda: made.robot.connected and made.server.connected, 'both connections')
        server.send('command', id='c1', do='alarm', args={'text': 'test by mary'}, by='mary')
        assert answer(server, 'c1') == (False, 'nothing in this robot or connected to it reads '
                                        'alarms/command: nothing was done')


def test_a_heart_beat_goes_both_ways(core: Any, server: FakeServer, gateway: Any) -> None:
    with gateway(core, silence_s=0.5) as made:
        wait_until(lambda: made.server.connected, 'a connection')
        hello = server.kinds('hello')[-1]
        assert 'alarm' in hello['capabilities'] and 'goal' not in hello['capabilities']
        server.status = 503
        server.cut()
        wait_until(lambda: not made.server.connected, 'a server that is away')
        assert '503' in made.statistics()['problem'] or made.statistics()['problem']
        server.status = 0
        wait_until(lambda: made.server.connected, 'a server that is back')
