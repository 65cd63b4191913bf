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

"""A call between a real browser with fake devices and the gateway of a robot; and its rules."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Iterator
from contextlib import closing
from contextlib import contextmanager
from pathlib import Path
import threading
from typing import Any

from fake_robot import FakeRobot
from fake_robot import RobotScript
from fake_robot import token_of
import pytest

pytest.importorskip('websockets', reason='websockets is not installed')

from rt_robot_os.gateway.gateway import Gateway  # noqa: E402
from rt_robot_os.gateway.settings import GatewaySettings  # noqa: E402
from rt_robot_os.messages.uplink.messages import encode  # noqa: E402
from rt_robot_os.monitor.live import calls as voice  # noqa: E402

SDP = 'v=0\r\n'


@contextmanager
def running(address: str, folder: Path, **settings: Any) -> Iterator[Gateway]:
    """Run a gateway of a robot whose core does not run."""
    token = folder / 'token'
    token.write_text(token_of('robot'))
    token.chmod(0o600)
    made = Gateway(GatewaySettings(server=f'ws://{address}', token_file=str(token),
                                   people=('anna', 'bob'), **settings), 'robot',
                   folder / 'robot.sock', folder / 'files', lambda line: None)
    ended = threading.Event()
    thread = threading.Thread(target=lambda: asyncio.run(made.run(ended.is_set)))
    thread.start()
    try:
        yield made
    finally:
        ended.set()
        thread.join()


def test_a_call_is_set_up_and_the_robot_is_heard(
        server: Any, signed_in: Callable[..., Any], tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip('aiortc', reason='aiortc is not installed: no calls')
    from processes import wait_until
    monkeypatch.setattr(voice, 'ANSWER_S', 600.0)  # other tests keep the machine busy
    heard = tmp_path / 'heard.wav'
    with running(server.address, tmp_path, microphone='tone', speaker=f'file:{heard}') as gateway:
        page = signed_in('carer', '#/camera')
        page.get_by_role('button', name='Call').click()
        page.locator('.voice-ok').wait_for(timeout=120_000)
        assert 'does not hear you' in page.locator('.voice-state').text_content()
        # Everybody who may see the robot sees who talks with it.
        other = signed_in('operator', '#/camera')
        other.get_by_text('talks with this robot now').wait_for()
        assert other.get_by_role('button', name='Call').is_disabled()
        # The robot's tone is heard here.
        page.wait_for_function(
            "() => document.querySelectorAll('.voice-meter meter')[1].value > 20", timeout=120_000)
        # Open the microphone: the browser's beep is heard there.
        page.get_by_role('button', name='Open').click()
        wait_until(lambda: _loudest(heard) > 1000, 'sound at the robot')
        page.get_by_role('button', name='Hang up').click()
        page.get_by_text('The call has ended').first.wait_for()
        other.get_by_text('No call').wait_for()
        wait_until(lambda: not gateway.statistics()['in_call'], 'the end of the call')

    def noted() -> list[str]:
        return [row['action'] for row in server.services.audit.all_rows()
                if row['action'].startswith('voice')]
    # It is noted beside it, so that no audit holds up a call.
    wait_until(lambda: noted()[-2:] == ['voice.ring', 'voice.end'], 'it is in the audit')


def _loudest(path: Path) -> int:
    import numpy as np
    content = path.read_bytes()[44:] if path.exists() else b''
    return int(np.abs(np.frombuffer(content[:len(content) // 2 * 2], '<i2')).max(initial=0))


@pytest.fixture
def called(server: Any) -> Iterator[tuple[FakeRobot, Callable[..., Any]]]:
    """Give a robot, and what makes connections for calls of somebody with a role."""
    from media_peer import MediaPeer
    script = RobotScript('robot', ('anna', 'bob'), capabilities=['talk'])
    opened: list[MediaPeer] = []

    def caller(role: str = 'carer', people: tuple[str, ...] = ('*',)) -> MediaPeer:
        opened.append(MediaPeer(server.address, '/voice',
                                {'Cookie': f'session={server.cookie(role, people)}'}))
        return opened[-1]

    with FakeRobot(f'ws://{server.address}', script=script) as robot:
        yield robot, caller
        for each in opened:
            each.close()


def say(robot: FakeRobot, **content: Any) -> None:
    robot.send(encode('voice', content))


def test_one_call_at_a_time_and_the_end_of_a_page_ends_it(called: Any) -> None:
    robot, caller = called
    first, second = caller(), caller('operator')
    first.say('ring', robot='robot', sdp=SDP)
    ring = robot.wait_for('voice', do='ring')
    assert (ring['sdp'], ring['by']) == (SDP, 'carer-all')
    second.say('ring', robot='robot', sdp=SDP)
    assert second.next('ended')['why'] == 'carer-all talks with this robot now'
    say(robot, call=ring['call'], do='answer', sdp='answer')
    assert first.next('answer')['sdp'] == 'answer'
    first.close()
    assert robot.wait_for('voice', do='end')['call'] == ring['call']


def test_the_robot_and_its_loss_end_a_call(called: Any) -> None:
    robot, caller = called
    with closing(caller()) as page:
        page.say('ring', robot='robot', sdp=SDP)
        ring = robot.wait_for('voice', do='ring')
        say(robot, call='other', do='end', why='of another call')
        say(robot, call=ring['call'], do='end', why='no microphone')
        assert page.next('ended')['why'] == 'no microphone'
        since = len(robot.received)
        page.say('ring', robot='robot', sdp=SDP)
        robot.wait_for('voice', since, do='ring')
        robot.disconnect()
        assert 'lost' in page.next('ended')['why']
        page.say('ring', robot='robot', sdp=SDP)
        assert 'not connected' in page.next('ended')['why']
        robot.connect()


def test_who_may_not_hear_everybody_there_may_not_call(called: Any) -> None:
    robot, caller = called
    page = caller(people=('anna',))
    page.say('ring', robot='robot', sdp=SDP)
    assert 'may not call' in page.next('ended')['why']
    page.say('ring', robot='nobody', sdp=SDP)
    assert 'may not call' in page.next('ended')['why']
    with pytest.raises(Exception, match='403'):
        caller('viewer')


@pytest.mark.parametrize('odd', [
    '', '[]', '{"kind": "ring"}', '{"kind": "ring", "robot": "robot", "sdp": 5}', 'x' * 100_000,
    '{"kind": "ring", "robot": "robot", "sdp": "%s"}' % ('x' * 70_000)])
def test_odd_messages_end_that_connection_alone(called: Any, odd: str) -> None:
    from websockets.exceptions import ConnectionClosed
    robot, caller = called
    page, other = caller(), caller()
    page.socket.send(odd)
    with pytest.raises(ConnectionClosed):
        page.socket.recv(20.0)
    other.say('ring', robot='robot', sdp=SDP)
    other.say('hang_up')
    robot.wait_for('voice', do='end')
