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

"""The module observer: orders to cameras, their answers or their silence, and how loud it is."""

from __future__ import annotations

import json
import math
from typing import Any

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.agent.observer import Observer
from rt_robot_os.features.agent.observer.levels import Levels
from rt_robot_os.testing.fakes import settings_of
from rt_robot_os.testing.module_bench import ModuleBench

pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')

STRING = 'std_msgs/msg/String'


class Scene:
    """An observer with an agent that orders, two cameras and a microphone."""

    def __init__(self, cameras: int = 1, microphone: bool = True) -> None:
        self.bench = ModuleBench()
        topics = [f'camera{number}/observed' for number in range(cameras)]
        for topic in ('agent/observe', *topics):
            self.bench.bus.declare(topic, STRING, {}, tail=3000, depth=16)
        self._order = self.bench.bus.publisher('agent/observe')
        self._cameras = [self.bench.bus.publisher(topic) for topic in topics]
        self._level = self.bench.topic('sound/level', 'std_msgs/msg/Float32')
        self.module = self.bench.add(
            Observer, 'observer', rate_hz=10.0, observed_topics=topics,
            level_topic='sound/level' if microphone else '')
        self._to_cameras = self.bench.watch('camera/observe') if cameras else None
        self._observed = self.bench.watch('agent/observed')

    def order(self, at_s: float, order: Any, **more: Any) -> None:
        text = order if order.startswith('{') else json.dumps(
            {'order': order, 'alarm': 'a1', 'subject': 'anna', **more})
        self._say(at_s, self._order, text)

    def answers(self, at_s: float, camera: int = 0, **told: Any) -> None:
        self._say(at_s, self._cameras[camera], json.dumps(told))

    def says(self, at_s: float, camera: int, text: str) -> None:
        self._say(at_s, self._cameras[camera], text)

    def _say(self, at_s: float, topic: Any, text: str) -> None:
        def do() -> None:
            topic.msg.data = text
            topic.publish()
        self.bench.at(at_s, do)

    def sounds(self, at_s: float, level_db: float) -> None:
        def do() -> None:
            self._level.msg.data = level_db
            self._level.publish()
        self.bench.at(at_s, do)

    def run(self, seconds: float) -> list[tuple[float, dict[str, Any]]]:
        self.bench.run(seconds)
        found = []
        while self._observed.take():
            found.append((self._observed.stamp_ns / NS_PER_S,
                          json.loads(self._observed.msg.data)))
        return found

    def orders(self) -> list[dict[str, Any]]:
        found = []
        assert self._to_cameras is not None
        while self._to_cameras.take():
            found.append(json.loads(self._to_cameras.msg.data))
        return found


def test_a_picture_is_ordered_and_the_answer_told_with_the_sound() -> None:
    scene = Scene()
    for number in range(30):
        scene.sounds(0.1 * number + 0.01, -20.0 if number == 28 else -50.0)
    scene.order(3.0, 'picture')
    scene.answers(3.4, id=1, kind='picture', alarm='a1', file='/x/y.jpg', width=640, version=1)
    (at_s, told), = scene.run(5.0)
    assert scene.orders() == [{'id': 1, 'order': 'picture', 'alarm': 'a1', 'subject': 'anna',
                               'before_s': 0.0, 'after_s': 0.0}]
    assert at_s == pytest.approx(3.4)
    assert (told['file'], told['kind'], told['subject']) == ('/x/y.jpg', 'picture', 'anna')
    assert told['loudest_db'] == -20.0 and -34.0 < told['level_db'] < -32.0


def test_every_camera_answers_and_one_that_does_not_is_told_at_its_deadline() -> None:
    scene = Scene(cameras=2, microphone=False)
    scene.order(1.0, 'clip', before_s=5, after_s=2.0)
    scene.answers(3.2, 0, id=1, kind='clip', file='/x/0.avi')
    told = scene.run(15.0)
    assert [at_s for at_s, _ in told] == pytest.approx([3.2, 1.0 + 2.0 + 8.0])
    assert told[0][1]['file'] == '/x/0.avi' and 'problem' not in told[0][1]
    assert 'camera1/observed has not answered' in told[1][1]['problem']
    assert told[1][1]['alarm'] == 'a1' and told[1][1]['kind'] == 'clip'
    assert scene.module.statistics()['unanswered'] == 1


def test_the_sound_is_that_of_before_and_after() -> None:
    scene = Scene(cameras=0)
    for number in range(100):
        scene.sounds(0.1 * number + 0.01, {5: -3.0, 30: -10.0}.get(number // 10 * 10, -60.0)
                     if number in (5, 30) else -60.0)
    scene.order(4.0, 'sound', before_s=2.0, after_s=3.0)
    (at_s, told), = scene.run(9.0)
    assert at_s == pytest.approx(7.0)
    assert told['loudest_db'] == -10.0 and told['kind'] == 'sound'
    assert told['level_db'] == pytest.approx(-10.0 - 10.0 * math.log10(50.0), abs=0.5)
    assert 'sound over 5 s' in told['text']


def test_a_silent_microphone_and_what_is_not_there_are_problems() -> None:
    scene = Scene(cameras=0)
    scene.order(1.0, 'sound', after_s=1.0)
    scene.order(1.5, 'picture')
    told = [each for _, each in scene.run(4.0)]
    assert 'no camera' in told[0]['problem'] and 'has said nothing' in told[1]['problem']
    without = Scene(microphone=False)
    without.order(1.0, 'sound')
    assert 'no microphone' in without.run(2.0)[0][1]['problem']


def test_answers_of_nobodys_order_and_nonsense_are_counted() -> None:
    scene = Scene()
    scene.answers(1.0, id=7, kind='picture', file='/x')
    scene.says(1.2, 0, 'nonsense')
    scene.says(1.4, 0, '[]')
    assert scene.run(2.0) == []
    assert scene.module.statistics()['unreadable'] == 3


@settings(max_examples=12, deadline=None)
@given(st.lists(st.one_of(st.text(st.characters(codec='ascii', min_codepoint=32), max_size=30).map(
        lambda text: '{' + text), st.dictionaries(
    st.sampled_from(['order', 'alarm', 'before_s', 'after_s']),
    st.one_of(st.sampled_from(['picture', 'clip', 'sound', 1.5, -1, 1e99]), st.none(),
              st.booleans(), st.just([1]))).map(json.dumps)), max_size=6))
def test_each_order_has_one_answer_in_the_end(orders: list[str]) -> None:
    scene = Scene()
    for number, text in enumerate(orders):
        scene.order(0.1 * number, text)
    assert len(scene.run(75.0)) == len(orders)
    assert scene.module.statistics()['open'] == 0


@given(st.lists(st.tuples(st.integers(1, 10**9), st.floats(-200.0, 0.0)), max_size=80))
def test_the_levels_that_are_kept_are_bounded(steps: list[tuple[int, float]]) -> None:
    levels, now_ns = Levels(1.0, most=20), 0
    for step_ns, level_db in steps:
        now_ns += step_ns
        levels.add(now_ns, level_db)
        assert len(levels._times) <= 41
        heard = levels.between(now_ns - NS_PER_S, now_ns)
        assert heard is not None and -120.0 <= heard.mean_db <= heard.loudest_db + 1e-9


def test_there_must_be_something_to_observe_with() -> None:
    with pytest.raises(ConfigError, match='nothing to observe'):
        Observer('observer', settings_of(Observer, observed_topics=[]))
