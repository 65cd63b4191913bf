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

"""How topics of the core stand in a bag: names, types, quality, and the bytes of messages."""

from __future__ import annotations

from pathlib import Path
import time
from typing import Any

from mcap.reader import make_reader
import pytest
from rosbags.highlevel import AnyReader
from rt_robot_os.link import TopicInfo
from rt_robot_os.link.protocol import Header
from rt_robot_os.link.protocol import PacketKind
from rt_robot_os.motion.mounting import Mounting
from rt_robot_os.recording import definitions
from rt_robot_os.recording.bag import Bag
from rt_robot_os.recording.bag import Limits
from rt_robot_os.recording.graph import read_graph
from rt_robot_os.recording.graph import TopicGraph
from rt_robot_os.recording.reading import Recording
from rt_robot_os.recording.selection import Selection
from rt_robot_os.recording.selection import Wanted
from rt_robot_os.recording.session import RecordingSession
from rt_robot_os.settings import MirrorSettings
from rt_robot_os.settings import RobotSettings
from rt_robot_os.settings import to_json
from rt_robot_os.settings.model import MountedFrame
from rt_robot_os.topics import Layout

TRANSFORM = 'geometry_msgs/msg/TransformStamped'
TRANSFORMS = 'tf2_msgs/msg/TFMessage'
NUMBERS = 'std_msgs/msg/Float64MultiArray'
PATH = 'nav_msgs/msg/Path'
TWIST = 'geometry_msgs/msg/Twist'
S = 1_000_000_000


def mirror(topic: str, message: str, **more: Any) -> MirrorSettings:
    return MirrorSettings(name=topic.replace('/', '_'), topic=topic, message=message, **more)


ROBOT = RobotSettings(
    frames=(MountedFrame('laser', Mounting((0.1, 0.0, 0.2))),),
    mirrors=(
        mirror('odom_to_base', TRANSFORM, as_=TRANSFORMS),
        mirror('map_to_odom', TRANSFORM, as_=TRANSFORMS),
        mirror('odom', 'nav_msgs/msg/Odometry', ros_topic='/base/odom', depth=3),
        mirror('plan', NUMBERS, as_=PATH),
        mirror('path', NUMBERS, as_=PATH, direction='in'),
        mirror('teleop', TWIST, stamped=True, direction='in'),
        mirror('velocity', TWIST, stamped=True, frame_id='base_link'),
        mirror('far', 'geometry_msgs/msg/Point', durability='transient_local'),
        mirror('both', 'geometry_msgs/msg/Point', ros_topic='received', direction='in'),
        mirror('both', 'geometry_msgs/msg/Point', ros_topic='sent')))
TYPES = {each.topic: each.message for each in ROBOT.mirrors} | {'inner': TWIST}
LAYOUTS = {name: Layout.compile(
    type_name, {'header.frame_id': 'odom', 'child_frame_id': 'base_link'}
    if type_name == TRANSFORM else None, tail=30 if type_name == NUMBERS else None)
    for name, type_name in TYPES.items() if name not in ('odom',)}
INFOS = {name: TopicInfo(name, number, type_name, 100, 1000,
                         LAYOUTS[name].stamp_offset if name in LAYOUTS else 4, 8, 0.0)
         for number, (name, type_name) in enumerate(TYPES.items())}


def selected(*topics: str, robot: RobotSettings = ROBOT, name: str = 'robot', **wanted: Any
             ) -> Selection:
    return Selection(INFOS, (), Wanted(topics, **wanted),
                     TopicGraph(robot, name, bool(wanted.get('core_names'))))


def types(chosen: Selection) -> dict[str, str]:
    return {each.facts.name: each.facts.type_name
            for shown in chosen.shown.values() for each in shown}


def test_topics_have_the_names_and_types_of_ros() -> None:
    assert types(selected(name='arm.robot')) == {
        '/tf': TRANSFORMS, '/base/odom': 'nav_msgs/msg/Odometry', '/arm/plan': PATH,
        '/arm/path': PATH, '/arm/teleop': 'geometry_msgs/msg/TwistStamped',
        '/arm/velocity': 'geometry_msgs/msg/TwistStamped', '/arm/far': 'geometry_msgs/msg/Point',
        '/arm/sent': 'geometry_msgs/msg/Point'}


def test_what_comes_from_ros_is_offered_to_every_subscription() -> None:
    facts = {each.facts.name: each.facts for shown in selected().shown.values() for each in shown}
    assert ROBOT.mirrors[4].reliability == 'best_effort', 'what the robot itself asks for'
    assert facts['/path'].reliability == 'reliable'
    assert facts['/far'].durability == 'transient_local'


@pytest.mark.parametrize(('asked', 'found'), [
    ('/tf', {'/tf'}), ('odom_to_base', {'/tf'}), ('/base/odom', {'/base/odom'}),
    ('odom', {'/base/odom'}), ('inner', {'/inner'}), ('/inner', {'/inner'}),
    ('/tf_static', {'/tf_static'}), ('rosout', {'/rosout'})])
def test_a_topic_is_found_by_its_name_in_ros_or_in_the_core(asked: str, found: set[str]) -> None:
    chosen = selected(asked)
    assert chosen.names == found
    assert not chosen.missing


def test_both_transforms_stand_behind_tf() -> None:
    assert [info.name for info in selected('/tf').shown] == ['odom_to_base', 'map_to_odom']


def test_a_topic_that_is_not_there_is_named_with_those_that_are() -> None:
    chosen = selected('/tf', '/nosuch')
    assert chosen.missing.startswith('no topic /nosuch in the core; known are ')
    assert {'/tf', '/tf_static', '/rosout', '/plan', '/inner'} <= set(
        chosen.missing.partition('known are ')[2].split(', '))


def test_topics_of_the_core_alone_are_shown_on_request() -> None:
    assert '/inner' not in selected().names
    assert types(selected(unmirrored=True)) == types(selected()) | {'/inner': TWIST}
    raw = selected(core_names=True)
    assert types(raw) == {f'/{name}': type_name for name, type_name in TYPES.items()}
    assert not raw.frames and not raw.logs


def test_a_robot_without_mirrors_is_shown_as_the_core_has_it() -> None:
    assert set(types(selected(robot=RobotSettings()))) == {f'/{name}' for name in TYPES}


def test_settings_of_another_version_leave_the_names_of_the_core() -> None:
    graph, problem = read_graph('{"format": 1}', 'robot')
    assert problem.endswith('topics have the names and types of the core')
    assert [each.facts.name for each in graph.shown('plan', NUMBERS)] == ['/plan']


# ---- files -----------------------------------------------------------------------------------

def session(chosen: Selection) -> RecordingSession:
    return RecordingSession(0, 1, S, False, (), tuple(INFOS), chosen.shown, chosen.kept, (),
                            to_json(ROBOT), frames=chosen.frames, logs=False)


def sample(name: str, seq: int, value: dict[str, Any], at_ns: int = 5 * S
           ) -> tuple[Header, bytearray]:
    return (Header(PacketKind.DATA, 5, INFOS[name].channel, 0, at_ns + seq, seq),
            bytearray(LAYOUTS[name].from_dict(value)))


def moved(x: float) -> dict[str, Any]:
    return {'transform': {'translation': {'x': x}, 'rotation': {'w': 1.0}}}


def test_messages_are_those_of_the_mirrors_and_a_replay_finds_those_of_the_core(
        tmp_path: Path) -> None:
    bag = Bag(tmp_path / 'bag')
    bag.begin(session(selected()))
    packets = [sample('odom_to_base', 0, moved(1.0)), sample('map_to_odom', 0, moved(2.0)),
               sample('odom_to_base', 1, moved(3.0)),
               sample('plan', 0, {'data': [1.0, 2.0, 0.0]}),
               sample('path', 0, {'data': [3.0, 4.0, 0.0]}),
               sample('velocity', 0, {'linear': {'x': 0.5}}),
               sample('far', 0, {'x': 7.0}), sample('inner', 0, {'linear': {'x': 0.1}})]
    bag.write(packets)
    bag.end()
    found: dict[str, list[Any]] = {}
    with AnyReader([tmp_path / 'bag']) as reader:
        for connection, at_ns, raw in reader.messages():
            found.setdefault(connection.topic, []).append(
                (at_ns, reader.deserialize(raw, connection.msgtype)))
        names = [each.topic for each in reader.connections]
        assert len(names) == len(set(names)), 'a topic has one channel'
        assert reader.message_count == bag.messages == 8
    moves = [message.transforms[0] for _, message in found['/tf']]
    assert [each.transform.translation.x for each in moves] == [1.0, 2.0, 3.0]
    assert all(each.header.stamp.sec * S + each.header.stamp.nanosec == at_ns
               for each, (at_ns, _) in zip(moves, found['/tf']))
    static = found['/tf_static'][0][1].transforms[0]
    assert (static.header.frame_id, static.child_frame_id) == ('base_link', 'laser')
    assert static.transform.translation.x == 0.1
    assert found['/plan'][0][1].poses[0].pose.position.y == 2.0
    assert found['/path'][0][1].header.frame_id == 'map'
    assert found['/velocity'][0][1].header.frame_id == 'base_link'
    assert '/inner' not in found
    stored = {(each.topic, each.number): each.cdr
              for each in Recording(tmp_path / 'bag').samples()}
    names = {info.channel: name for name, info in INFOS.items()}
    assert set(stored) == {(names[head.channel], head.seq) for head, _ in packets}
    assert stored['plan', 0] == bytes(packets[3][1])


def test_each_file_begins_with_what_late_subscribers_need(tmp_path: Path) -> None:
    bag = Bag(tmp_path / 'bag', 'none', Limits(1000, 2))
    bag.begin(session(selected('/far', '/plan', '/tf_static')))
    bag.write([sample('far', 0, {'x': 7.0})])
    for number in range(8):
        bag.write([sample('plan', number, {'data': [1.0] * 30}, (number + 6) * S)])
        bag.tick(time.monotonic_ns() + 2 * S)
    bag.end()
    files = sorted((tmp_path / 'bag').glob('*.mcap'))
    assert len(files) == 2 and bag.removed > 0
    for file in files:
        with file.open('rb') as stream:
            first = [channel.topic for _, channel, _ in make_reader(stream).iter_messages()][:2]
        assert sorted(first) == ['/far', '/tf_static'], file.name
    with AnyReader([tmp_path / 'bag']) as reader:
        far = [reader.deserialize(raw, connection.msgtype)
               for connection, _, raw in reader.messages() if connection.topic == '/far']
    assert [each.x for each in far] == [7.0, 7.0]


def test_a_sample_that_cannot_be_converted_is_counted_and_stored(tmp_path: Path) -> None:
    bag = Bag(tmp_path / 'bag')
    bag.begin(session(selected()))
    head, _ = sample('plan', 0, {})
    bag.write([(head, bytearray(b'\0\1\0\0\xff'))])
    bag.end()
    assert bag.refused == {'plan': 1}
    assert [each.topic for each in Recording(tmp_path / 'bag').samples()] == ['plan']


def test_tf_is_defined_where_its_package_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    definitions.definition.cache_clear()
    installed = definitions.definition(TRANSFORMS) if definitions.find_spec('tf2_msgs') else ''
    known_hash = definitions.type_hash(TRANSFORMS)
    definitions.definition.cache_clear()
    definitions.type_hash.cache_clear()
    monkeypatch.setattr(definitions, 'find_spec', lambda name: None)
    try:
        text = definitions.definition(TRANSFORMS)
        assert not installed or text.replace('\n\n', '\n') == installed.replace('\n\n', '\n')
        assert 'MSG: geometry_msgs/TransformStamped\n' in text and 'MSG: std_msgs/Header' in text
        assert definitions.type_hash(TRANSFORMS) == known_hash
    finally:
        definitions.definition.cache_clear()
        definitions.type_hash.cache_clear()
