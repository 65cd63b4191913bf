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


"""Check what the server keeps of robots' maps."""

from __future__ import annotations

from pathlib import Path

from fake_robot import FakeRobot
from fake_robot import RobotScript
import httpx
from monitor_server import logged_in
from monitor_server import quick_services
from monitor_server import served
from processes import wait_until
import pytest
from rt_robot_os.messages.uplink.maps import MapMessage
from rt_robot_os.messages.uplink.messages import encode
from rt_robot_os.monitor.live import robot_connection
from rt_robot_os.monitor.maps import Maps
from rt_robot_os.monitor.security.roles import Role

FLAT = MapMessage.pack(3, 2, 0.05, (-0.5, 1.0, 0.25), bytes([0, 100, 255, 0, 50, 100]))
OTHER = MapMessage.pack(1, 1, 0.1, (0.0, 0.0, 0.0), bytes(1))


def test_a_map_is_there_after_a_restart(tmp_path: Path) -> None:
    Maps(tmp_path / 'maps').put('a', FLAT)
    maps = Maps(tmp_path / 'maps')
    assert maps.get('a') == FLAT
    assert maps.has('a', FLAT.sha256)
    assert not maps.has('a', OTHER.sha256)
    assert not maps.has('a', '')


def test_each_robot_has_its_own_map(tmp_path: Path) -> None:
    maps = Maps(tmp_path)
    maps.put('a', FLAT)
    maps.put('b', OTHER)
    maps.put('../../a', OTHER)
    assert [maps.get(each) for each in ('a', 'b', '../../a', 'c')] == [FLAT, OTHER, OTHER, None]
    assert all(each.parent == tmp_path and each.stat().st_mode & 0o077 == 0
               for each in tmp_path.rglob('*'))


def test_a_file_that_is_damaged_is_no_map(tmp_path: Path) -> None:
    maps = Maps(tmp_path)
    maps.put('a', FLAT)
    file, = tmp_path.iterdir()
    for text in ('', '[]', file.read_text()[:-20], '"\ud83d"', '{}'):
        file.write_text(text, errors='surrogatepass')
        assert Maps(tmp_path).get('a') is None


def test_a_robot_sends_its_map_once_and_only_those_who_may_see_it_get_it(tmp_path: Path) -> None:
    services = quick_services(tmp_path)
    script = RobotScript(people=('anna',), map=FLAT.sha256)
    with served(services) as address:
        mary, eve = (logged_in(services, name, Role.VIEWER, people)
                     for name, people in (('mary', ('anna',)), ('eve', ('bob',))))

        def asked(headers: dict[str, str]) -> httpx.Response:
            return httpx.get(f'http://{address}/api/robots/robot/map', headers=headers)

        with FakeRobot(f'ws://{address}', script=script) as robot:
            assert robot.received[0]['want_map'] is True
            assert asked(mary).status_code == 404
            assert 'has sent no map' in asked(mary).json()['detail']['text']
            robot.send(FLAT.to_json())
            wait_until(lambda: asked(mary).status_code == 200, 'the map')
            assert asked(mary).json() == FLAT.content()
            assert asked(eve).status_code == 404
            assert 'no such robot' in asked(eve).json()['detail']['text']
            assert asked({}).status_code == 401
        with FakeRobot(f'ws://{address}', script=script) as robot:
            assert robot.received[0]['want_map'] is False


def test_a_map_that_grows_is_kept_and_told_and_no_more_often_than_a_page_needs(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robot_connection, 'MAP_S', 3600.0)
    services = quick_services(tmp_path)
    script = RobotScript(people=('anna',), map=FLAT.sha256)

    def told() -> object:
        return services.hub.robots['robot'].about['map']

    with served(services) as address, FakeRobot(f'ws://{address}', script=script) as robot:
        assert told() == '', 'a page asks when it hears of a map: not before it is here'
        robot.send(FLAT.to_json())
        wait_until(lambda: told() == FLAT.sha256, 'the map')
        robot.send(OTHER.to_json())
        counts = services.hub.robots['robot'].counts
        wait_until(lambda: counts.get('maps_too_fast'), 'a refusal')
        monkeypatch.setattr(robot_connection, 'MAP_S', 0.0)
        robot.send(encode('map', {**OTHER.content(), 'width': 'wide'}))
        wait_until(lambda: counts.get('maps_wrong'), 'a map that is malformed')
        assert told() == FLAT.sha256
        wait_until(lambda: robot.send(OTHER.to_json()) or told() == OTHER.sha256,
                   'the map that has grown')
        assert services.maps.get('robot') == OTHER
