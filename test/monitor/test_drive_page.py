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

"""The view to drive, in a real browser: stick, keys, gamepad, what opens the hand, taking over."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import threading
import time
from typing import Any
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('playwright.sync_api')
pytest.importorskip('websockets')

from fake_robot import FakeRobot  # noqa: E402, I100
from fake_robot import RobotScript  # noqa: E402
from monitor_server import logged_in  # noqa: E402
from monitor_server import Page as Socket  # noqa: E402
from playwright.sync_api import expect  # noqa: E402
from processes import wait_until  # noqa: E402
from rt_robot_os import monitor  # noqa: E402
from rt_robot_os.gateway.drive_limits import TeleopLimits  # noqa: E402
from rt_robot_os.gateway.teleop_controller import TeleopController  # noqa: E402
from rt_robot_os.messages.uplink.driving import DriveBegin  # noqa: E402
from rt_robot_os.messages.uplink.driving import DriveCommand  # noqa: E402
from rt_robot_os.messages.uplink.messages import encode  # noqa: E402

if TYPE_CHECKING:
    from conftest import Monitor

LIMITS = {'linear_m_s': 0.3, 'angular_rad_s': 0.8}
# Of the robot; whoever waits for it to stand waits for less.
HOLD_S = 120.0
#: What the page takes for a bad link, and what it does on a machine that is busy with other tests.
LINE = {'BAD_MS = 300': 'BAD_MS = 2000', 'UNHEARD_MS = 450': 'UNHEARD_MS = 8000'}
GAMEPAD = """() => {
  window.pad = {index: 0, connected: true, axes: [0, -1, 0, 0], buttons: Array.from({length: 8},
    (each, at) => ({pressed: at === 4}))};
  navigator.getGamepads = () => (window.pad ? [window.pad] : []);
}"""
HIDE = """(isHidden) => {
  Object.defineProperty(document, 'hidden', {value: isHidden, configurable: true});
  document.dispatchEvent(new Event('visibilitychange'));
}"""


class DrivenRobot(FakeRobot):
    """A robot with the gateway's pilot; it holds commands for longer, since tests are slow."""

    def __init__(self, url: str) -> None:
        super().__init__(url, script=RobotScript('robot', ('anna', 'bob'), limits=LIMITS))
        self.controller = TeleopController(TeleopLimits(hold_s=HOLD_S, ticket_s=HOLD_S))
        self.order = (0.0, 0.0)
        self.moved = 0
        self.beats = True
        self.stop_reason = ''
        self.steering = 'teleop'
        self._ending = threading.Event()
        self._beating = threading.Thread(target=self._beat, daemon=True)

    def __enter__(self) -> DrivenRobot:
        super().__enter__()
        self._beating.start()
        return self

    def __exit__(self, *what: object) -> None:
        self._ending.set()
        self._beating.join()
        super().__exit__(*what)

    def _beat(self) -> None:
        seen, due = 0, 0.0
        while not self._ending.is_set():
            while seen < len(self.received):
                message = self.received[seen]
                seen += 1
                self._obey(message)
            if time.monotonic() >= due and self.controller.lease and self.beats:
                due = time.monotonic() + 0.05
                pilot = self.controller
                self.send(encode('beat', {
                    'n': pilot.beat(time.monotonic_ns()), 'lease': pilot.lease, 'seq': pilot.seq,
                    'armed': pilot.is_armed, 'moves': pilot.moves, 'rtt_ms': 12.0, 'runs': True,
                    'stop_reason': self.stop_reason, 'steering': self.steering,
                    'speed': {'linear_m_s': self.order[0]}}))
            time.sleep(0.004)

    def _obey(self, message: dict[str, Any]) -> None:
        kind = message['kind']
        if kind == 'drive':
            order = self.controller.take(DriveCommand.from_json(message), time.monotonic_ns())
        elif kind == 'drive_begin':
            order = self.controller.begin(DriveBegin.from_json(message))
        elif kind == 'drive_end':
            order = self.controller.end(message['lease'])
        else:
            return
        if order is not None:
            self.order = order.linear_m_s, order.angular_rad_s
            self.moved += order.linear_m_s != 0.0 or order.angular_rad_s != 0.0


@pytest.fixture
def robot(server: Monitor) -> Iterator[DrivenRobot]:
    with DrivenRobot(f'ws://{server.address}') as found:
        yield found


def drives(robot: DrivenRobot, ahead: float = 1.0) -> None:
    wait_until(lambda: robot.order[0] * ahead > 0.01, 'driving')


def stands(robot: DrivenRobot) -> None:
    wait_until(lambda: robot.order == (0.0, 0.0), 'standing')


def grip(page: Any, x: float = 0.0, y: float = 0.5) -> None:
    """Press the mouse on the stick, and pull; y is ahead."""
    box = page.locator('.stick').bounding_box()
    page.mouse.move(box['x'] + box['width'] / 2, box['y'] + box['height'] / 2)
    page.mouse.down()
    page.mouse.move(box['x'] + box['width'] * (0.5 + x / 4), box['y'] + box['height'] * (
        0.5 - y / 4))


@pytest.fixture
def page(robot: DrivenRobot, server: Monitor, opened: Any) -> Any:
    """Open the view; its link is bad when the robot is silent, not when the machine is slow."""
    path = Path(monitor.__file__).parent / 'page/views/drive/line.js'
    text = path.read_text()
    for before, after in LINE.items():
        assert before in text
        text = text.replace(before, after)
    found = opened.page(server.cookie('operator', ('*',)))
    found.route('**/views/drive/line.js', lambda route: route.fulfill(
        body=text, content_type='text/javascript'))
    found.goto(f'{server.url}/#/drive/robot')
    expect(found.locator('.drive')).to_contain_text('not driving')
    return found


def take(page: Any) -> None:
    page.get_by_role('button', name='Take the wheel').click()
    expect(page.locator('.drive')).to_contain_text('You have the wheel')
    expect(page.locator('.drive-facts')).to_contain_text('good')


def test_the_hand_drives_while_it_is_closed_and_whatever_opens_it_stops_the_robot(
        robot: DrivenRobot, page: Any) -> None:
    grip(page)
    expect(page.locator('.drive-told')).to_contain_text('Take the wheel first')
    page.mouse.up()
    take(page)
    assert robot.moved == 0  # nothing moves by taking it
    grip(page)
    drives(robot)
    page.mouse.up()
    stands(robot)
    grip(page, 0.0, -0.5)
    drives(robot, -1.0)
    for event, told in (("window.dispatchEvent(new Event('blur'))", 'lost the focus'),
                        (f'({HIDE})(true)', 'was hidden')):
        page.evaluate(event)
        stands(robot)
        expect(page.locator('.drive-told')).to_contain_text(told)
        moved = robot.moved
        page.mouse.move(5, 5)  # still pressed: that is no new grip
        page.evaluate(f'({HIDE})(false)')
        page.mouse.up()
        assert robot.moved == moved
        grip(page)
        drives(robot)
    page.locator('.stick').dispatch_event('pointercancel', {'pointerId': 1})
    stands(robot)
    page.mouse.up()
    page.evaluate(GAMEPAD)
    drives(robot)
    page.evaluate('() => { window.pad = null; }')
    stands(robot)
    expect(page.locator('.drive-told')).to_contain_text('gamepad is gone')


def test_keys_drive_under_the_space_bar_and_not_in_fields(
        robot: DrivenRobot, page: Any) -> None:
    take(page)
    page.keyboard.down('ArrowUp')
    page.keyboard.down('Space')
    drives(robot)
    page.keyboard.up('Space')
    stands(robot)
    page.keyboard.down('Space')
    drives(robot)
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    stands(robot)
    moved = robot.moved
    page.keyboard.down('Space')  # held: it only repeats
    page.keyboard.up('Space')
    page.keyboard.up('ArrowUp')
    page.get_by_role('slider').focus()
    page.keyboard.down('Space')
    page.keyboard.press('w')
    page.keyboard.up('Space')
    assert robot.moved == moved
    page.locator('.stick').focus()
    page.keyboard.down('Space')
    page.keyboard.down('s')
    drives(robot, -1.0)
    page.keyboard.press('F8')
    wait_until(lambda: [each['do'] for each in robot.commands] == ['stop'], 'the stop')
    page.keyboard.up('s')
    page.keyboard.up('Space')
    robot.steering = 'nobody: e-stop, asked for on estop'
    expect(page.locator('.drive-reason')).to_contain_text('held until it is released')
    page.get_by_role('button', name='Release the stop').click()
    page.get_by_role('dialog').get_by_role('button', name='Release the stop').click()
    wait_until(lambda: [each['do'] for each in robot.commands] == ['stop', 'release'], 'release')


def test_a_bad_link_a_guard_and_somebody_who_takes_over_are_told_in_words(
        robot: DrivenRobot, page: Any, server: Monitor) -> None:
    take(page)
    robot.stop_reason = 'scan: obstacle 0.14 m before the robot, at 12 degrees'
    expect(page.locator('.drive-reason')).to_have_text(
        'Obstacle 0.14 m ahead (seen by scan, at 12°)')
    grip(page)
    drives(robot)
    robot.beats = False
    stands(robot)
    expect(page.locator('.drive-facts')).to_contain_text('not heard')
    expect(page.locator('.drive-told')).to_contain_text('link to the robot is bad')
    moved = robot.moved
    robot.beats = True
    expect(page.locator('.drive-facts')).to_contain_text('good')
    assert robot.moved == moved  # the mouse is pressed still
    page.mouse.up()
    grip(page)
    drives(robot)
    with Socket(server.address, logged_in(server.services, 'dave the driver', people=('*',)),
                '/drive?robot=robot') as dave:
        dave.say(kind='take', over=True)
        stands(robot)
        expect(page.locator('.drive-told')).to_contain_text('Taken over by dave the driver')
        page.mouse.up()
        grip(page)
        expect(page.locator('.drive')).to_contain_text('dave the driver has the wheel')
        page.mouse.up()
        page.get_by_role('button', name='Take over').click()
        page.get_by_role('dialog').get_by_role('button', name='Take over').click()
        assert dave.next('lost')['by'] == 'operator-all'
        page.evaluate('location.hash = "#/network"')
        dave.next('seat', state='free')
