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


"""The position view in a real browser: coordinates, maps, what is old, and go there."""

from __future__ import annotations

from collections.abc import Callable
import math
import re
from typing import Any
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('playwright.sync_api')

from playwright.sync_api import expect  # noqa: E402, I100
from processes import wait_until  # noqa: E402
from rt_robot_os.messages.uplink.maps import MapMessage  # noqa: E402

if TYPE_CHECKING:
    from fake_robot import FakeRobot

SignedIn = Callable[..., Any]
VIEW = "document.querySelector('.view-position').positionView"
# A room of 40 by 30 cells, turned by 30 degrees, with one wall cell in it.
WIDTH, HEIGHT, SIZE_M = 40, 30, 0.1
ORIGIN = (-2.0, 1.5, math.pi / 6)
WALL = (29, 21)
CELLS = bytes(100 if divmod(index, WIDTH)[::-1] == WALL else 0 for index in range(WIDTH * HEIGHT))
NODES = [{'id': 0, 'name': 'sink', 'x': None, 'y': None, 'parent': None, 'hops': 0,
          'state': 'sink', 'recent': None, 'age_s': 0},
         {'id': 3, 'name': 'study', 'x': 0.5, 'y': 3.0, 'parent': 0, 'hops': 1, 'state': 'weak',
          'recent': 0.7, 'age_s': 2}]


def world_of(column: float, row: float) -> tuple[float, float]:
    """Return where a place in cells is, as the map's own module has it."""
    x, y, yaw = ORIGIN
    ahead, left = column * SIZE_M, row * SIZE_M
    return (x + ahead * math.cos(yaw) - left * math.sin(yaw),
            y + ahead * math.sin(yaw) + left * math.cos(yaw))


TRANSFORMS = """async () => {
  const {cellToWorld, worldToCell, Viewport, boundsOf, wrapped} = await import(
    '/views/position/transform.js');
  let seed = 7;
  const random = (low, high) => low + (high - low)
    * ((seed = (seed * 16807) % 2147483647) / 2147483647);
  const worst = {cells: 0, screen: 0, zoom: 0, pan: 0, fit: 0, follow: 0, angle: 0, up: 0};
  const note = (name, ...errors) => {
    worst[name] = Math.max(worst[name], ...errors.map(Math.abs));
  };
  for (let i = 0; i < 400; i += 1) {
    const map = {resolution_m: random(0.01, 1), width: 1 + Math.floor(random(0, 500)),
      height: 1 + Math.floor(random(0, 500)),
      origin: [random(-100, 100), random(-100, 100), random(-7, 7)]};
    const [column, row] = [random(-10, 500), random(-10, 500)];
    const back = worldToCell(map, ...cellToWorld(map, column, row));
    note('cells', back[0] - column, back[1] - row);
    const view = new Viewport(random(200, 2000), random(200, 2000));
    view.fit(boundsOf(map), 20);
    for (const corner of [[0, 0], [map.width, 0], [0, map.height], [map.width, map.height]]) {
      const [x, y] = view.toScreen(...cellToWorld(map, ...corner));
      if (view.scale > 2) {
        note('fit', Math.max(0, 19.9 - x, 19.9 - y, x - view.width + 19.9,
          y - view.height + 19.9));
      }
    }
    const [px, py] = [random(0, view.width), random(0, view.height)];
    const at = view.toWorld(px, py);
    const again = view.toScreen(...at);
    note('screen', again[0] - px, again[1] - py);
    note('up', view.toWorld(px, py - 10)[1] > at[1] ? 0 : 1);
    view.zoom(random(0.2, 5), px, py);
    const kept = view.toScreen(...at);
    note('zoom', kept[0] - px, kept[1] - py);
    view.pan(13, -7);
    const moved = view.toScreen(...at);
    note('pan', moved[0] - px - 13, moved[1] - py + 7);
    view.follow(...at);
    const [fx, fy] = view.toScreen(...at);
    note('follow', fx < view.width * 0.29 || fx > view.width * 0.71 ? 1 : 0,
      fy < view.height * 0.29 || fy > view.height * 0.71 ? 1 : 0);
    const angle = random(-50, 50);
    note('angle', Math.sin(wrapped(angle)) - Math.sin(angle), Math.abs(wrapped(angle)) > Math.PI);
  }
  return worst;
}"""


def test_places_are_the_same_there_and_back(server: Any, opened: Any) -> None:
    page = opened.page()
    page.goto(f'{server.url}/messages/en/position.json')
    worst = page.evaluate(TRANSFORMS)
    assert max(worst.values()) < 1e-6, worst


FRAMES = """() => new Promise((done) => {
  requestAnimationFrame(() => requestAnimationFrame(done));
})"""


@pytest.fixture
def position(server: Any, robot: FakeRobot, signed_in: SignedIn) -> Callable[[str], Any]:
    """Give what opens the view for a role, with the map that the robot has sent."""
    server.services.maps.put('robot', MapMessage.pack(WIDTH, HEIGHT, SIZE_M, ORIGIN, CELLS))
    robot.live(pose={'x': -1.0, 'y': 2.5, 'yaw': 1.0, 'stddev_m': 0.05},
               wsn__nodes={'nodes': NODES}, health__anna__place={'x': -1.5, 'y': 3.0, 'yaw': 0},
               health__anna__place_details={'status': [{'values': {
                   'room': 'bedroom', 'uncertainty_m': '0.7', 'age_s': '400'}}]})

    def open_page(role: str, **options: Any) -> Any:
        page = signed_in(role, '#/position', **options)
        page.wait_for_function(f'() => {VIEW}.map && {VIEW}.scene.pose')
        # Nothing moves any more: neither a note above the map nor a list beside it.
        expect(page.locator('.position-note')).to_be_empty()
        for each in ('people', 'nodes'):
            page.locator(f'.position-{each} .position-item').first.wait_for()
        page.evaluate(FRAMES)
        return page
    return open_page


SCREEN = f"""([x, y]) => {{
  const view = {VIEW};
  const [px, py] = view.view.toScreen(x, y);
  view.layers.people = view.layers.nodes = false;
  view.draw();
  const pixel = view.canvas.getContext('2d').getImageData(px * devicePixelRatio,
    py * devicePixelRatio, 1, 1).data;
  const floor = view.palette.map.floor;
  return {{px, py, isFloor: floor === new Uint32Array(pixel.buffer)[0]}};
}}"""


def test_a_click_on_the_map_sends_the_robot_there(
        position: Callable[..., Any], robot: FakeRobot) -> None:
    page = position('operator')
    canvas = page.locator('.position-canvas')
    # What is drawn at a place is what the map has there.
    wall = page.evaluate(SCREEN, world_of(WALL[0] + 0.5, WALL[1] + 0.5))
    assert not wall['isFloor']
    canvas.click(position={'x': wall['px'], 'y': wall['py']})
    goal = page.locator('.position-goal')
    expect(goal).to_contain_text('Send robot there?')
    expect(goal).to_contain_text('There is a wall')
    go = page.get_by_role('button', name='Go there')
    expect(go).to_be_disabled()
    expect(go).not_to_have_class('button primary')
    assert robot.commands == []
    # Another place, so far away that the ring of the goal is not grabbed, turned by its arrow.
    there = world_of(WALL[0] - 5.2, WALL[1] - 5.3)
    beside = page.evaluate(SCREEN, there)
    assert beside['isFloor']
    canvas.click(position={'x': beside['px'], 'y': beside['py']})
    expect(goal).to_contain_text('Drag the arrow')
    expect(go).to_have_class('button primary')
    page.get_by_label('Heading in °').fill('90')
    page.get_by_role('button', name='Go there').click()
    wait_until(lambda: robot.commands, 'the command')
    command, = robot.commands
    x, y = there
    assert command['do'] == 'goal'
    assert command['args'] == pytest.approx({'x': x, 'y': y, 'yaw': math.pi / 2}, abs=0.02)
    robot.live(planner__state='planned: 2.00 m', plan={'points': [[-1.0, 2.5], [x, y]]})
    expect(goal).to_contain_text(re.compile(r'on its way; [\d.]+\sm to go'))
    page.get_by_role('button', name='Cancel the drive').click()
    wait_until(lambda: len(robot.commands) == 2, 'the cancellation')
    assert robot.commands[1]['do'] == 'cancel'


def test_the_robot_is_sent_by_keys_alone(position: Callable[..., Any], robot: FakeRobot) -> None:
    page = position('operator')
    page.locator('.position-canvas').focus()
    page.keyboard.press('Enter')
    expect(page.get_by_label('x in m')).to_be_focused()
    for text in ('-1.25', '3.5', '-45'):
        page.keyboard.press('Control+a')
        page.keyboard.type(text)
        page.keyboard.press('Tab')
    page.get_by_role('button', name='Go there').press('Enter')
    wait_until(lambda: robot.commands, 'the command')
    assert robot.commands[0]['args'] == pytest.approx(
        {'x': -1.25, 'y': 3.5, 'yaw': -math.pi / 4}, abs=1e-3)


def test_who_may_only_look_sends_nothing_and_reads_all_in_words(
        position: Callable[..., Any], robot: FakeRobot) -> None:
    page = position('viewer', locale='de')
    page.locator('.position-canvas').click()
    expect(page.locator('.position-goal')).to_be_hidden()
    expect(page.locator('.position-robot')).to_contain_text('-1,00, 2,50 m · Richtung 57°')
    person = page.locator('.position-people .position-item')
    expect(person).to_contain_text('Schlafzimmer')
    expect(person).to_contain_text('± 0,7 m')
    expect(person).to_contain_text('vor 6 Min')
    expect(person).to_have_class(re.compile('is-stale'))
    robot.raise_alarm('where')
    expect(page.locator('.position-alarms')).to_contain_text('-1,50, 3,00 m')
    expect(page.locator('.position-nodes')).to_contain_text('Schwach · über sink, schlecht: 70')
    assert robot.commands == []


def test_a_map_that_grows_is_drawn_anew_where_one_looks(
        position: Callable[..., Any], robot: FakeRobot) -> None:
    page = position('viewer')
    looked = f'() => {{const {{x, y, scale}} = {VIEW}.view; return [x, y, scale];}}'
    page.get_by_role('button', name='Zoom in').click()
    page.evaluate(f'() => {VIEW}.view.pan(60, 40)')
    before = page.evaluate(looked)
    robot.send(MapMessage.pack(WIDTH, HEIGHT + 20, SIZE_M, ORIGIN,
                               CELLS + bytes(20 * WIDTH)).to_json())
    page.wait_for_function(f'() => {VIEW}.map.height === {HEIGHT + 20}')
    assert page.evaluate(looked) == before
    assert page.evaluate(f'() => [{VIEW}.picture.height, {VIEW}.scene.pose.x]') == [
        HEIGHT + 20, -1.0]
    expect(page.locator('.position-note')).to_be_empty()


def test_a_robot_without_a_map_is_shown_all_the_same(
        robot: FakeRobot, server: Any, signed_in: SignedIn) -> None:
    for each in (server.services.settings.where / 'maps').glob('*.json'):
        each.unlink()
    robot.live(pose={'x': 7.0, 'y': -2.0, 'yaw': 0.0, 'stddev_m': 0.05})
    page = signed_in('viewer', '#/position')
    expect(page.locator('.position-note')).to_contain_text('has sent no map')
    expect(page.locator('.position-robot')).to_contain_text('7.00, -2.00 m')
