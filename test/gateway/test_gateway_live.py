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
import numpy as np
from processes import wait_until
import pytest
from rt_robot_os.gateway import map_part
from rt_robot_os.link.client import LinkClient
from rt_robot_os.topics import Layout


def grid(width: int, value: int = 0, known: int = 0) -> bytes:
    """Make an OccupancyGrid of 300 rows, all of one value as far as it is known."""
    cells = np.full((300, width), -1, np.int8)
    cells[:, :known or width] = value
    layout = Layout.compile('nav_msgs/msg/OccupancyGrid', {'header.frame_id': 'map'},
                            tail=cells.size)
    return layout.from_dict({'info': {'resolution': 0.05, 'width': width, 'height': 300},
                             'data': cells.ravel()})


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


def test_a_map_that_grows_is_sent_when_it_has_changed(
        core: Any, gateway: Any, server: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_part, 'MAP_S', 0.02)
    said: list[str] = []

    def maps() -> list[int]:
        return [each['width'] for each in server.kinds('map')]

    with gateway(core, said) as made, LinkClient(core.folder / 'robot.sock', 'mapping') as client:
        channel = client.advertise('map')
        part = next(each for each in made.parts if isinstance(each, map_part.MapPart))
        for width in (300, 400):
            client.publish(channel, grid(width))
            wait_until(lambda width=width: maps()[-1:] == [width], 'the map')
        client.publish(channel, grid(500, known=400))  # no more of it is known
        client.publish(channel, grid(300, 101))
        wait_until(lambda: part.maps_refused, 'a refusal')
        assert maps() == [300, 400] and any('it has the value 101' in each for each in said)
        client.publish(channel, grid(600))
        wait_until(lambda: maps()[-1:] == [600], 'the map')
        assert server.connections == 1, 'the server is not greeted anew for each map'
        server.want_map = True
        server.cut()
        wait_until(lambda: len(maps()) == 4, 'the map for a server that has not got it')
        assert server.kinds('hello')[-1]['map'] == server.kinds('map')[-1]['sha256']
    assert made.statistics()['maps_sent'] == 4


def test_a_robot_that_has_become_another_is_greeted_without_alarm(
        core: Any, gateway: Any, server: Any) -> None:
    said: list[str] = []
    with gateway(core, said) as made:
        wait_until(lambda: server.kinds('hello'), 'the greeting')
        made.identity.boot = 'another'
        wait_until(lambda: len(server.kinds('hello')) == 2, 'another greeting')
        wait_until(lambda: made.server.connected, 'the connection')
    assert not [each for each in said if 'ended' in each]
