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

"""Signals and the connection: what a server hears of a robot, and how it is lost and found."""

from __future__ import annotations

import json
from typing import Any

from fake_server import FakeServer
from processes import wait_until


def test_a_server_is_greeted_and_sees_what_changes(
        core: Any, server: FakeServer, gateway: Any) -> None:
    with gateway(core, people=['anna']) as made:
        wait_until(lambda: made.server.connected, 'a connection')
        core.publish('alarms/list', {'status': [{'level': 2, 'name': '7', 'message': 'fall'}]})
        wait_until(lambda: 'alarms/list' in server.signals(), 'the signal')
        assert server.signals()['alarms/list']['status'][0]['message'] == 'fall'
        hello = server.kinds('hello')[0]
        assert hello['version'] == 1 and hello['people'] == ['anna'] and hello['name'] == 'robot'
        server.cut()
        wait_until(lambda: len(server.kinds('hello')) == 2, 'a second connection')
        again = server.kinds('hello')[1]
        assert again['robot'] == hello['robot'] and again['boot'] == hello['boot']
        # What is known is told anew: the server may be another.
        wait_until(lambda: server.kinds('live')[-1]['n'] > 1, 'signals again')


def test_signals_become_fewer_never_older(core: Any, server: FakeServer, gateway: Any) -> None:
    server.says_taken = False
    with gateway(core) as made:
        wait_until(lambda: made.server.connected, 'a connection')
        server.send('want', signals_hz=30.0, cameras={})
        for number in range(12):
            core.publish('alarms/list', {'status': [], 'number': number})
            wait_until(lambda: json.loads(_known(made)).get('number') == number, 'the sample')
        assert len(server.kinds('live')) <= 2
        server.says_taken = True
        server.send('taken', n=server.kinds('live')[-1]['n'])
        wait_until(lambda: server.signals()['alarms/list']['number'] == 11, 'the newest')
        assert len(server.kinds('live')) <= 4
        assert made.statistics()['live_passed_over'] > 8


def _known(made: Any) -> str:
    known = made.live._known.get('alarms/list')
    return '{"number": -1}' if known is None else known[3][8:-1].decode()
