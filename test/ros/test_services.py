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

"""Services publish a text in the core and give back its answer, and hold nothing up meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import json
import time
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
pytest.importorskip('std_srvs', reason='ROS 2 messages are not installed')

from nav_msgs.srv import GetMap  # noqa: E402, I100
from nav_msgs.srv import LoadMap  # noqa: E402
import rclpy  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402

from rt_robot_os.base.errors import LinkError  # noqa: E402
from rt_robot_os.link import TopicInfo  # noqa: E402
from rt_robot_os.link.client import Question  # noqa: E402
from rt_robot_os.link.protocol import encode_json  # noqa: E402
from rt_robot_os.link.protocol import PacketKind  # noqa: E402
from rt_robot_os.link.protocol import parse_header  # noqa: E402
from rt_robot_os.link.readers import readers_of  # noqa: E402
from rt_robot_os.messages.cdr import string_in  # noqa: E402
from rt_robot_os.messages.cdr import string_message  # noqa: E402
from rt_robot_os.ros.services import Services  # noqa: E402
from rt_robot_os.ros.services import WAITING_MAXIMUM  # noqa: E402
from rt_robot_os.settings import ServiceSettings  # noqa: E402
from rt_robot_os.topics import Layout  # noqa: E402
from std_srvs.srv import SetBool  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

ACKNOWLEDGE = ServiceSettings(
    name='acknowledge', service='~/alarms/acknowledge', topic='alarms/command',
    text='acknowledge all by ROS', answer_topic='alarms/answer', timeout_s=60.0)
SILENT = ServiceSettings(name='silent', topic='alarms/command', text='test by ROS',
                         answer_topic='alarms/answer', timeout_s=0.05)
NIGHT = ServiceSettings(name='night', type='std_srvs/srv/SetBool', topic='night', text='on',
                        text_false='off')
LOAD = ServiceSettings(name='load', service='~/mapping/load', type='nav_msgs/srv/LoadMap',
                       topic='alarms/command', text='load {map_url}',
                       answer_topic='alarms/answer', timeout_s=60.0)
MAP = ServiceSettings(name='get_map', service='~/mapping/map', type='nav_msgs/srv/GetMap',
                      topic='map')
ASK_MAPPING = ServiceSettings(
    name='ask', service='~/mapping/ask', topic='alarms/command', text='save',
    answer_topic='alarms/answer', started_by='mapping', timeout_s=60.0)
GENEROUS_S = 20.0
UNKNOWN = 'it is not known whether it was done: check before you call again'
NONE = {'in_core': 0, 'asker': False, 'clients': []}
MAPPING = {'in_core': 0, 'asker': False, 'clients': [['mapping', 42, 7]]}


class Client:
    """A connection to a core that notes what it is told."""

    def __init__(self) -> None:
        names = ('alarms/command', 'alarms/answer', 'night')
        self.topics = {name: TopicInfo(name, number, 'std_msgs/msg/String', 8, 300, None, 8, 0)
                       for number, name in enumerate(names)}
        self.topics['map'] = TopicInfo(
            'map', 3, 'nav_msgs/msg/OccupancyGrid', 8, 300, None, 8, 0)
        self.sample_handlers: dict[int, Any] = {}
        self.mirrored: list[str] = []
        self.told: list[tuple[int, str]] = []
        self.gone = False
        self.replies: dict[int, Any] = {}
        self.asked: list[tuple[str, str]] = []
        self.readers_at_first = NONE
        #: What the core says of readers; None: it does not answer.
        self.now: dict[str, Any] | None = MAPPING

    def advertise(self, topic: str) -> int:
        return self.topics[topic].channel

    def mirror(self, topic: str, policy: str, initial: bool, patient: bool = False) -> None:
        assert (policy, initial, patient) == (
            ('latest', True, False) if topic == 'map' else ('drain', False, True))
        self.mirrored.append(topic)

    def readers(self, topic: str, answers: str) -> Any:
        return readers_of(self.readers_at_first)

    def begin(self, do: str, on_packet: Any, topic: str, answers: str) -> Question:
        if self.gone:
            raise LinkError('the core closed the connection')
        assert do == 'readers'
        self.asked.append((topic, answers))
        question = Question(do, self.replies, len(self.asked), on_packet)
        if self.now is not None:
            packet = encode_json(PacketKind.REPLY, self.now, seq=len(self.asked))
            question.put((parse_header(packet), packet))
        return question

    def publish(self, channel: int, cdr: bytes) -> None:
        if self.gone:
            raise LinkError('the core closed the connection')
        self.told.append((channel, string_in(cdr)))

    def answer(self, text: str, stamp_ns: int = 0) -> None:
        cdr = bytearray(string_message(text))
        self.sample_handlers[1](stamp_ns or time.monotonic_ns(), 0, memoryview(cdr))


class Robot:
    """A node with services, somebody who calls them, and one executor."""

    def __init__(self) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node, self.caller = (Node(name, context=self.context, use_global_arguments=False)
                                  for name in ('robot', 'caller'))
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.executor.add_node(self.caller)
        self.services = Services(self.node, (ACKNOWLEDGE, SILENT, NIGHT, LOAD, MAP, ASK_MAPPING),
                                 files=('/a/robot.yaml',))
        self.core = Client()

    def start(self) -> None:
        self.services.connect(self.core)  # type: ignore[arg-type]
        self.services.activate()

    def until(self, condition: Callable[[], Any]) -> None:
        deadline = time.monotonic() + GENEROUS_S
        while not condition():
            assert time.monotonic() < deadline, 'it did not happen'
            self.executor.spin_once(timeout_sec=0.02)

    def ask(self, name: str = 'alarms/acknowledge', kind: Any = Trigger, **request: Any) -> Any:
        client = self.caller.create_client(kind, f'/robot/{name}')
        self.until(client.service_is_ready)
        return client.call_async(kind.Request(**request))

    def answer(self, future: Any) -> tuple[bool, str]:
        self.until(future.done)
        return future.result().success, future.result().message

    def counters(self, name: str = 'alarms/acknowledge') -> dict[str, Any]:
        return dict(self.services.counters())[f'/robot/{name}']

    def close(self) -> None:
        self.executor.shutdown()
        for node in (self.node, self.caller):
            node.destroy_node()
        rclpy.try_shutdown(context=self.context)


@pytest.fixture(scope='module')
def ros() -> Iterator[Robot]:
    made = Robot()
    yield made
    made.close()


@pytest.fixture
def robot(ros: Robot) -> Robot:
    """Give one node for all tests: to be found takes longest."""
    ros.services.deactivate()
    ros.services.disconnect()
    ros.core = Client()
    ros.start()
    return ros


def answer(command: str, ok: bool = True, text: str = '') -> str:
    return json.dumps({'command': command, 'ok': ok, 'text': text, 'alarm': 7})


def test_what_the_core_answers_is_given_back(robot: Robot) -> None:
    before = robot.counters()
    first = robot.ask()
    robot.until(lambda: robot.core.told)
    assert robot.core.told == [(0, 'acknowledge all by ROS')]
    assert robot.core.mirrored == ['alarms/answer', 'map']
    robot.core.answer(answer('acknowledge 3 by anna'))  # somebody else's
    robot.core.answer('nonsense')
    robot.core.answer('{"command": "acknowledge all by ROS", "ok": 1}')
    robot.core.answer(answer('acknowledge all by ROS', text='too old'), stamp_ns=1)
    robot.core.answer(answer('acknowledge all by ROS', text='acknowledged 7'))
    assert robot.answer(first) == (True, 'acknowledged 7')
    second = robot.ask()
    robot.until(lambda: len(robot.core.told) == 2)
    robot.core.answer(answer('acknowledge all by ROS', False, 'no alarm is open'))
    assert robot.answer(second) == (False, 'no alarm is open')
    after = robot.counters()
    assert {key: after[key] - before[key] for key in after} == {
        'calls': 2, 'done': 1, 'refused': 1, 'unanswered': 0, 'waiting': 0, 'malformed': 2}


def test_a_call_that_waits_holds_up_nothing_else(robot: Robot) -> None:
    waiting = robot.ask()
    robot.until(lambda: robot.core.told)
    ticks: list[int] = []
    timer = robot.node.create_timer(0.001, lambda: ticks.append(0))
    done = robot.answer(robot.ask('night', SetBool, data=True))
    assert done == (True, "published 'on' on night") and robot.core.told[-1] == (2, 'on')
    assert robot.answer(robot.ask('night', SetBool, data=False))[0]
    assert robot.core.told[-1] == (2, 'off')
    robot.until(lambda: len(ticks) > 3)
    robot.node.destroy_timer(timer)
    assert not waiting.done()
    robot.core.answer(answer('acknowledge all by ROS'))
    assert robot.answer(waiting) == (True, '')


def test_calls_are_answered_in_turn_and_too_many_are_refused(robot: Robot) -> None:
    waiting = [robot.ask() for _ in range(WAITING_MAXIMUM)]
    robot.until(lambda: len(robot.core.told) == WAITING_MAXIMUM)
    ok, text = robot.answer(robot.ask())
    assert not ok and f'{WAITING_MAXIMUM} calls already wait' in text
    for number in range(WAITING_MAXIMUM):
        robot.core.answer(answer('acknowledge all by ROS', text=str(number)))
        robot.until(lambda: sum(each.done() for each in waiting) > number)
    found = [robot.answer(future)[1] for future in waiting]
    assert sorted(found, key=int) == [str(number) for number in range(WAITING_MAXIMUM)]


def test_without_an_answer_the_caller_is_told_so(robot: Robot) -> None:
    before = robot.counters('silent')['unanswered']
    ok, text = robot.answer(robot.ask('silent'))
    assert not ok
    assert text == ("mapping (pid 42) did not answer 'test by ROS' within 0.05 s; it is not "
                    'known whether it was done: check before you call again')
    assert robot.counters('silent')['unanswered'] == before + 1


def test_who_waits_is_told_that_the_core_is_gone(robot: Robot) -> None:
    waiting = robot.ask()
    robot.until(lambda: robot.core.told)
    robot.services.disconnect()
    ok, text = robot.answer(waiting)
    assert not ok and 'the core has ended before it answered' in text and UNKNOWN in text
    ok, text = robot.answer(robot.ask())
    assert not ok and 'no core is connected' in text
    robot.core = Client()
    robot.services.connect(robot.core)  # type: ignore[arg-type]
    again = robot.ask()
    robot.until(lambda: robot.core.told)
    robot.core.answer(answer('acknowledge all by ROS'))
    assert robot.answer(again)[0]
    robot.core.gone = True
    ok, text = robot.answer(robot.ask())
    assert not ok and 'closed the connection' in text


@pytest.mark.parametrize('name', ['mapping/ask', 'night'])
def test_what_nothing_would_answer_is_refused_at_once(robot: Robot, name: str) -> None:
    robot.core.now = NONE
    before = robot.counters(name)
    ok, text = robot.answer(robot.ask(name, SetBool if name == 'night' else Trigger))
    assert not ok and 'is connected to the robot: nothing was done' in text
    assert name == 'night' or text.endswith(
        ' mapping --robot /robot --ros-args --params-file /a/robot.yaml')
    assert not robot.core.told
    after = robot.counters(name)
    assert {key for key in after if after[key] != before[key]} == {'calls', 'refused'}


def test_what_starts_late_is_found_by_the_next_call(robot: Robot) -> None:
    robot.core.now = NONE
    assert not robot.answer(robot.ask('mapping/ask'))[0]
    robot.core.now = MAPPING
    waiting = robot.ask('mapping/ask')
    robot.until(lambda: robot.core.told)
    robot.core.answer(answer('save', text='saved'))
    assert robot.answer(waiting) == (True, 'saved')
    assert set(robot.core.asked) == {('alarms/command', 'alarms/answer')}


@pytest.mark.parametrize('now', [NONE, {**MAPPING, 'clients': [['mapping', 43, 9]]}])
def test_what_ends_during_a_call_ends_it(robot: Robot, now: dict[str, Any]) -> None:
    """The next process of that name knows nothing of what the one before was asked."""
    before = robot.counters('mapping/ask')['unanswered']
    robot.core.now = MAPPING
    waiting = robot.ask('mapping/ask')
    robot.until(lambda: robot.core.told)
    robot.core.now = now
    ok, text = robot.answer(waiting)
    assert not ok and text.startswith("mapping (pid 42) ended before it answered 'save'; ")
    assert UNKNOWN in text
    assert robot.counters('mapping/ask')['unanswered'] == before + 1


def test_an_answer_counts_also_when_its_process_has_ended(robot: Robot) -> None:
    robot.core.now = MAPPING
    waiting = robot.ask('mapping/ask')
    robot.until(lambda: robot.core.told)
    asked = len(robot.core.asked)
    robot.core.now = NONE
    robot.until(lambda: len(robot.core.asked) > asked)
    robot.core.answer(answer('save', text='saved'))
    assert robot.answer(waiting) == (True, 'saved')


def test_a_core_that_does_not_say_who_answers_gets_no_command(robot: Robot) -> None:
    robot.core.now = None
    ok, text = robot.answer(robot.ask('silent'))
    assert not ok and text == ('the core did not answer within 0.05 s; nothing was published, so '
                               'nothing was done')
    assert not robot.core.told


def test_a_module_of_the_core_is_not_asked_for(robot: Robot) -> None:
    """An acknowledgement goes out also when the core has no time to answer questions."""
    core = Client()
    core.readers_at_first, core.now = {**NONE, 'in_core': 1}, None
    robot.services.connect(core)  # type: ignore[arg-type]
    waiting = robot.ask()
    robot.until(lambda: core.told)
    core.answer(answer('acknowledge all by ROS', text='acknowledged 7'))
    assert robot.answer(waiting) == (True, 'acknowledged 7')
    assert not core.asked


def test_a_map_that_nothing_loads_has_no_reason_of_a_file(robot: Robot) -> None:
    robot.core.now = NONE
    future = robot.ask('mapping/load', LoadMap, map_url='file:///a/flat.yaml')
    robot.until(future.done)
    assert future.result().result == LoadMap.Response.RESULT_UNDEFINED_FAILURE


def test_a_mirror_of_the_answers_goes_on(robot: Robot) -> None:
    carried: list[int] = []
    core = Client()
    core.sample_handlers[1] = lambda stamp_ns, missed, cdr: carried.append(stamp_ns)
    robot.services.connect(core)  # type: ignore[arg-type]
    core.answer('anything', 5)
    assert carried == [5]


def test_a_core_without_the_topic_of_answers_is_refused(robot: Robot) -> None:
    core = Client()
    del core.topics['alarms/answer']
    with pytest.raises(LinkError, match="no topic 'alarms/answer' on which a service is answered"):
        robot.services.connect(core)  # type: ignore[arg-type]


@pytest.mark.parametrize(('ok', 'text', 'result'), [
    (True, 'loaded', 0), (False, '/a/flat.yaml does not exist', 1),
    (False, 'the image flat.pgm is cut off', 2), (False, 'flat.yaml: the key origin lacks', 3),
    (False, 'paused', 255)])
def test_a_map_is_loaded_by_its_url(robot: Robot, ok: bool, text: str, result: int) -> None:
    future = robot.ask('mapping/load', LoadMap, map_url='file:///a/flat.yaml')
    robot.until(lambda: robot.core.told)
    assert robot.core.told == [(0, 'load file:///a/flat.yaml')]
    robot.core.answer(answer('load file:///a/flat.yaml', ok, text))
    robot.until(future.done)
    assert future.result().result == result


def test_a_map_without_a_name_is_not_asked_for(robot: Robot) -> None:
    future = robot.ask('mapping/load', LoadMap, map_url=' ')
    robot.until(future.done)
    assert future.result().result == LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST
    assert not robot.core.told


def test_the_last_map_is_given_also_when_the_core_is_gone(robot: Robot) -> None:
    assert robot.until((nothing := robot.ask('mapping/map', GetMap)).done) is None
    assert not len(nothing.result().map.data)
    layout = Layout.compile('nav_msgs/msg/OccupancyGrid', {'header.frame_id': 'map'}, tail=100)
    buffer = layout.new_buffer()
    grid = layout.view(buffer)
    grid.info.width, grid.info.height, grid.info.resolution = 2, 3, 0.05
    grid.data = [0, 100, -1, -1, 0, 0]
    robot.core.sample_handlers[3](5, 0, buffer[:layout.length(buffer)])
    robot.services.disconnect()
    robot.until((given := robot.ask('mapping/map', GetMap)).done)
    found = given.result().map
    assert (found.info.width, found.info.height, list(found.data)) == (
        2, 3, [0, 100, -1, -1, 0, 0])
