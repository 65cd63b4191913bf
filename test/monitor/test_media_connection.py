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

"""The connections with pictures: what a robot's camera gives comes to whoever may look."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
import hashlib
import time
from typing import Any

from fake_robot import FakeRobot
from fake_robot import RobotScript
from fake_robot import token_of
from media_peer import MediaPeer
from monitor_server import logged_in
from monitor_server import quick_services
from monitor_server import served
import pytest
from rt_robot_os.messages.uplink.media import PictureFrame
from rt_robot_os.monitor.live.media_connection import may_view_cameras
from rt_robot_os.monitor.live.robot_media import captured_ns
from rt_robot_os.monitor.live.robot_state import RobotState
from rt_robot_os.monitor.services import Services

JPEG = b'\xff\xd8\xff\xe0' + bytes(1000)
Headers = dict[str, str]
KEY = {'robot': 'robot', 'camera': 'hall'}


def peer(address: str, path: str, headers: Headers | None = None) -> MediaPeer:
    return MediaPeer(address, path, headers or {'Authorization': f"Bearer {token_of('robot')}"})


@pytest.fixture(scope='module')
def services(tmp_path_factory: pytest.TempPathFactory) -> Services:
    return quick_services(tmp_path_factory.mktemp('monitor'))


@pytest.fixture(scope='module')
def address(services: Services) -> Iterator[str]:
    with served(services) as found:
        yield found


def look(address: str, me: Headers) -> MediaPeer:
    return peer(address, '/camera', me)


@pytest.fixture(scope='module')
def me(services: Services) -> Headers:
    return logged_in(services)


@pytest.fixture
def robot(address: str) -> Iterator[MediaPeer]:
    with FakeRobot(f'ws://{address}', script=RobotScript(cameras=['hall'])), closing(
            peer(address, '/robot/media')) as found:
        found.say('hello', version=1, cameras=['hall'])
        # Who looked in the test before may be there for a moment longer.
        while found.next('want')['cameras']:
            pass
        yield found


def test_a_camera_is_wanted_while_somebody_looks_and_its_picture_comes_with_its_moment(
        address: str, me: Headers, robot: MediaPeer) -> None:
    with closing(look(address, me)) as browser:
        browser.say('look', **KEY, rate_hz=10)
        assert robot.next('want')['cameras'] == {'hall': 10.0}
        before_ns = time.time_ns()
        robot.frame('picture', JPEG, camera='hall', n=7, age_ns=30_000_000, utc_ns=5)
        assert robot.next('taken') == {'kind': 'taken', 'camera': 'hall', 'n': 7}
        picture = browser.next('picture')
        assert (picture['robot'], picture['camera'], picture['payload']) == ('robot', 'hall', JPEG)
        # The robot's own time of day, years off, is not used.
        assert before_ns - 30_000_000 <= picture['utc_ns'] <= time.time_ns() - 30_000_000
        browser.say('leave', **KEY)
        assert robot.next('want')['cameras'] == {}


def test_a_browser_that_never_answers_holds_nobody_up(
        address: str, me: Headers, robot: MediaPeer) -> None:
    with closing(look(address, me)) as dead, closing(look(address, me)) as quick:
        for each in (dead, quick):
            each.say('look', **KEY, rate_hz=30)
        robot.next('want')
        seen = []
        for n in range(1, 8):
            robot.frame('picture', JPEG, camera='hall', n=n, age_ns=0)
            robot.next('taken')
            picture = quick.next('picture')
            seen.append(picture['n'])
            quick.say('taken', **KEY, n=picture['n'])
        assert seen == sorted(seen) and len(seen) == 7
        assert dead.next('picture')['n'] == seen[0]
        # What it gets next is the newest, not the second.
        dead.say('taken', **KEY, n=seen[0])
        assert dead.next('picture')['n'] == seen[-1]


def test_what_is_no_picture_of_a_camera_of_this_robot_reaches_nobody(
        address: str, me: Headers, robot: MediaPeer) -> None:
    with closing(look(address, me)) as browser:
        browser.say('look', **KEY, rate_hz=30)
        robot.next('want')
        robot.frame('picture', b'<svg onload="alert(1)"/>', camera='hall', n=1, age_ns=0)
        robot.frame('picture', JPEG, camera='cellar', n=1, age_ns=0)
        robot.frame('picture', JPEG, camera='hall', n='x', age_ns=0)
        robot.socket.send(b'\xff\xff\xff\xff')
        robot.socket.send('[')
        robot.frame('picture', JPEG, camera='hall', n=2, age_ns=0)
        assert browser.next('picture')['payload'] == JPEG


def test_odd_messages_of_a_browser_end_nothing(
        address: str, me: Headers, robot: MediaPeer) -> None:
    with closing(look(address, me)) as browser:
        for odd in ('', '[]', '{"kind": "look"}', '{"kind": "look", "robot": [], "camera": {}}',
                    '{"kind": "taken", "robot": "robot", "camera": "hall", "n": "x"}',
                    '{"kind": "clock", "t": []}', 'x' * 10_000):
            browser.socket.send(odd)
        browser.say('clock', t=3.5)
        assert browser.next('clock')['t'] == 3.5


def test_a_robot_that_nobody_knows_has_no_camera(
        address: str, me: Headers, robot: MediaPeer) -> None:
    with closing(look(address, me)) as browser:
        browser.say('look', robot='other', camera='hall', rate_hz=5)
        assert 'no such camera' in browser.next('gone')['text']


def test_looking_is_in_the_audit(
        address: str, me: Headers, robot: MediaPeer, services: Services) -> None:
    before = sum(row['action'].startswith('camera') for row in services.audit.all_rows())
    with closing(look(address, me)) as browser:
        browser.say('look', **KEY, rate_hz=5)
        robot.next('want')
        browser.say('clock', t=1)
        browser.next('clock')
        rows = [row for row in services.audit.all_rows() if row['action'].startswith('camera')]
        assert len(rows) == before + 1
        assert (rows[-1]['action'], rows[-1]['object']) == ('camera.look', 'robot/hall')


def test_a_camera_is_for_those_who_may_see_everybody_who_lives_there() -> None:
    flat = RobotState('r', 'r', people=frozenset({'anna', 'bob'}))
    assert may_view_cameras(None, flat)
    assert may_view_cameras(frozenset({'anna', 'bob', 'carl'}), flat)
    assert not may_view_cameras(frozenset({'anna'}), flat)
    unknown = RobotState('r', 'r')  # its residents are not known
    assert not may_view_cameras(frozenset({'anna'}), unknown)
    assert not may_view_cameras(None, None)


@pytest.mark.parametrize(('header', 'expected_ns'), [
    ({'age_ns': 100, 'server_ns': 999_700}, 999_700),      # it was 300 on its way and waiting
    ({'age_ns': 100, 'server_ns': 999_950}, 999_900),      # never newer than it says itself
    ({'age_ns': 100, 'server_ns': 1_000_001}, 999_900),    # from the future
    ({'age_ns': 100}, 999_900),
    ({}, 1_000_000)])
def test_a_picture_is_as_old_as_the_older_of_two_clocks_says(
        header: dict[str, Any], expected_ns: int) -> None:
    picture = PictureFrame.from_frame({'camera': 'hall', 'n': 1, **header}, memoryview(b''))
    assert captured_ns(picture, 1_000_000) == expected_ns


def test_a_file_comes_in_parts_goes_on_after_a_break_and_is_kept_once(
        address: str, me: Headers, services: Services) -> None:
    content = JPEG[:4] + bytes(200_000)
    sha256 = hashlib.sha256(content).hexdigest()
    offer = {'id': 'f1', 'sha256': sha256, 'size': len(content)}
    with closing(peer(address, '/robot/media')) as robot:
        robot.say('offer', **offer)
        assert robot.next('have')['offset'] == 0
        robot.frame('part', content[:65536], id='f1', offset=0)
        assert robot.next('have')['offset'] == 65536
    with closing(peer(address, '/robot/media')) as robot:
        robot.frame('part', content[65536:131072], id='f1', offset=65536)
        assert 'not offered' in robot.next('refused')['text']
        robot.say('offer', **offer)
        offset = robot.next('have')['offset']
        assert offset == 65536
        while offset < len(content):
            robot.frame('part', content[offset:offset + 65536], id='f1', offset=offset)
            offset = robot.next('have')['offset']
        robot.say('offer', **{**offer, 'id': 'f2'})
        assert robot.next('have')['offset'] == len(content)
    assert services.media.files.has('robot', sha256)
    assert services.media.files.counts().files == 1
