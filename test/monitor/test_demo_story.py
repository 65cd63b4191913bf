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

"""The demonstration: when anna falls, however slowly the simulated world goes."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
import time
from typing import Any

import pytest

for each in ('fastapi', 'sqlalchemy', 'argon2'):
    pytest.importorskip(each)

from rt_robot_os.monitor import story as story_module  # noqa: E402
from rt_robot_os.monitor.demo import demo  # noqa: E402, I100
from rt_robot_os.monitor.live.hub import Hub  # noqa: E402
from rt_robot_os.monitor.story import DemoStory  # noqa: E402
from rt_robot_os.monitor.story import FALLS_AFTER_S  # noqa: E402
from rt_robot_os.monitor.story import FALLS_MOST  # noqa: E402
from rt_robot_os.monitor.story import NO_PAGE_S  # noqa: E402
from rt_robot_os.monitor.story import NOTICED_S  # noqa: E402
from rt_robot_os.settings.load import load  # noqa: E402
from rt_robot_os.settings.ros_args import parse_ros_args  # noqa: E402

STEP_S = 1.0


class Scene:
    """A story with a clock of its own, a world that notes orders, and lines of the console."""

    def __init__(self) -> None:
        self.orders: list[tuple[float, str]] = []
        self.lines: list[str] = []
        self.now_s = 1000.0
        self.fault = ''
        self.hub = Hub(1.0, 1.0)
        self.robot = self.hub.get_or_create('1', 'demo')
        self.story = DemoStory(self.hub, 'demo', self._order, self.lines.append,
                               lambda: self.now_s)

    def _order(self, what: str) -> None:
        if self.fault:
            raise OSError(self.fault)
        self.orders.append((self.now_s, what))

    def pass_s(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            asyncio.run(self.story.look())

    def is_ready(self, has_page: bool = True) -> None:
        self.robot.connected = True
        self.robot.take(1, 1, {'pose': [1, {}], 'agent/state': [1, 'idle']})
        if has_page:
            self.hub.clients[_Page()] = None  # type: ignore[index]

    def alarm(self, **more: Any) -> None:
        self.robot.take_alarm({'alarm': '1', 'seq': 1, 'state': 'suspected', 'subject': 'anna',
                               'kinds': ['fall'], **more}, time.time_ns())


class _Page:
    """A client that notes nothing."""

    rights = None

    def say(self, *_: object, **__: object) -> None:
        """Take it."""


@pytest.fixture
def scene(monkeypatch: pytest.MonkeyPatch) -> Iterator[Scene]:
    found = Scene()
    monkeypatch.setattr(found.hub, 'tell_robot', lambda robot: None)
    yield found


def test_she_falls_by_the_clock_when_robot_and_page_are_there(scene: Scene) -> None:
    scene.pass_s(300)
    assert (scene.orders, scene.lines) == ([], [])
    scene.is_ready()
    began_s = scene.now_s
    scene.pass_s(FALLS_AFTER_S / 2)
    assert scene.lines[0].startswith(f'demo: anna falls in {FALLS_AFTER_S:.0f} s, at ')
    story = scene.robot.about['story']
    assert (story['what'], story['person']) == ('fall', 'anna')
    assert 0 < story['at_ns'] - time.time_ns() <= FALLS_AFTER_S * 1e9
    scene.pass_s(FALLS_AFTER_S)
    (at_s, what), = scene.orders
    assert what == 'fall anna' and at_s - began_s <= FALLS_AFTER_S + 2 * STEP_S
    scene.alarm()
    scene.pass_s(2 * NOTICED_S)
    assert len(scene.orders) == 1 and scene.robot.about['story'] is None


def test_without_a_page_it_begins_all_the_same(scene: Scene) -> None:
    scene.is_ready(has_page=False)
    scene.pass_s(NO_PAGE_S / 2)
    assert scene.lines == []
    scene.pass_s(NO_PAGE_S / 2 + FALLS_AFTER_S + 3 * STEP_S)
    assert [what for _, what in scene.orders] == ['fall anna']


def test_a_fall_that_nothing_notices_is_repeated_and_then_explained(scene: Scene) -> None:
    scene.is_ready()
    scene.alarm(kinds=['sensor_off'])
    scene.pass_s((FALLS_AFTER_S + NOTICED_S + 5) * (FALLS_MOST + 1))
    assert [what for _, what in scene.orders] == [
        *['fall anna', 'rise anna'] * (FALLS_MOST - 1), 'fall anna']
    assert 'gets up, and falls once more' in scene.lines[2]
    assert f'none of {FALLS_MOST} falls' in scene.lines[-1] and 'CPUs' in scene.lines[-1]


def test_a_world_that_takes_no_orders_is_named(scene: Scene) -> None:
    scene.is_ready()
    scene.fault = 'is the robot running, and simulated?'
    scene.pass_s(3 * FALLS_AFTER_S)
    assert scene.lines[1:] == [f'demo: anna does not fall: {scene.fault}']
    assert scene.robot.about['story'] is None


def test_what_a_hello_of_the_robot_made_forgotten_is_said_again(scene: Scene) -> None:
    scene.is_ready()
    scene.pass_s(2)
    scene.robot.about = {}
    scene.pass_s(1)
    assert scene.robot.about['story']['person'] == 'anna'


def test_the_world_of_the_demonstration_has_no_fall_of_its_own() -> None:
    companions = demo()
    found = parse_ros_args((*companions.ros, *companions.robot), 'robot')
    settings = load(found.params_files, found.overrides, found.node_name, found.namespace)
    assert settings.world is not None and settings.world.events == ()
    # What the gateway and the notifier are given is theirs alone.
    assert not parse_ros_args(companions.ros, 'gateway').overrides
    assert story_module.PERSON in {each.split()[0] for each in settings.world.people}
