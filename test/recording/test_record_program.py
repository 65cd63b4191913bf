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

"""The program record: with a real core, read back with readers of others."""

from __future__ import annotations

import os
from pathlib import Path
import resource
import signal
import sys
from typing import Any

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from processes import TIMEOUT_S
import pytest
from rosbags.highlevel import AnyReader
from rt_robot_os.link import LinkClient
from rt_robot_os.recording.record_command import run
from rt_robot_os.topics import Layout
import yaml

RECORD = 'rt_robot_os.recording.record_program'
REPLAY = 'rt_robot_os.recording.replay_program'
TOPICS = {'/imu/data', '/imu/mag', '/gps/fix', '/gps/time', '/cmd_vel_safe', '/imu/attitude'}


def read(path: Path) -> dict[str, list[Any]]:
    """Decode a file with the public reader of MCAP."""
    found: dict[str, list[Any]] = {}
    with path.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == 'ros2'
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message, decoded))
    return found


def read_bag(folder: Path) -> dict[str, int]:
    """Decode a folder with rosbags; give the messages of each topic."""
    counts: dict[str, int] = {}
    with AnyReader([folder]) as reader:
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            counts[connection.topic] = counts.get(connection.topic, 0) + 1
    return counts


def test_public_readers_open_a_recording(recording: Path) -> None:
    files = sorted(recording.glob('*.mcap'))
    assert len(files) == 1
    found = read(files[0])
    assert TOPICS <= set(found)
    message, imu = found['/imu/data'][-1]
    assert imu.header.frame_id == 'imu_link'
    assert abs(imu.linear_acceleration.z) > 1.0
    assert imu.header.stamp.sec * 10**9 + imu.header.stamp.nanosec == message.log_time
    assert not [topic for topic in found if topic.startswith(('/core/', '/device/'))]
    counts = read_bag(recording)
    assert counts == {topic: len(messages) for topic, messages in found.items()}


def test_the_folder_is_a_bag_of_jazzy(recording: Path) -> None:
    info = yaml.safe_load((recording / 'metadata.yaml').read_text())[
        'rosbag2_bagfile_information']
    assert info['version'] == 9
    assert info['storage_identifier'] == 'mcap'
    assert info['relative_file_paths'] == [path.name for path in recording.glob('*.mcap')]
    found = read(next(recording.glob('*.mcap')))
    counts = {each['topic_metadata']['name']: each['message_count']
              for each in info['topics_with_message_count']}
    assert {name: count for name, count in counts.items() if count} == {
        topic: len(messages) for topic, messages in found.items()}
    imu = next(each['topic_metadata'] for each in info['topics_with_message_count']
               if each['topic_metadata']['name'] == '/imu/data')
    assert imu['type_description_hash'].startswith('RIHS01_')
    assert imu['offered_qos_profiles'][0]['reliability'] == 'reliable'


def test_bytes_of_a_device_can_be_asked_for(beside: Any) -> None:
    bag = beside.output / 'bag'
    recorder, log = beside.record('-o', str(bag), 'device/gps/bytes')
    beside.wait_for_messages(log, recorder, 3)
    assert beside.end(recorder) == 0
    found = read(next(bag.glob('*.mcap')))
    assert set(found) == {'/device/gps/bytes'}
    arrays = [decoded for _, decoded in found['/device/gps/bytes']]
    stream = b''.join(bytes(array.data[array.layout.data_offset:]) for array in arrays)
    assert b'GGA,' in stream and b'\r\n$' in stream


def test_a_bag_holds_what_was_asked_for_and_no_time_before(robot: Any) -> None:
    robot.core('-p', 'core.record_bytes:=true', '-p', 'imu.output_rate_hz:=200.0')
    # Some seconds of bytes and schedule wait in the core by now, and 16 samples of each topic.
    with LinkClient(robot.folder / 'robot.sock', 'test', timeout_s=TIMEOUT_S) as client:
        robot.until(lambda: next(each['published'] for each in client.statistics().topics
                                 if each['name'] == 'device/imu/bytes') > 600, 'a lapped ring')
    bag = robot.output / 'bag'
    code, text = robot.run(RECORD, 'imu/data', '--duration', '2', '-o', str(bag))
    assert code == 0, text
    with AnyReader([bag]) as reader:
        messages = [(each.topic, stamp) for each, stamp, _ in reader.messages()]
        assert {each.topic for each in reader.connections} == {'/imu/data'}
        assert reader.message_count == len(messages)
        assert 1.5e9 < reader.duration <= 2.0e9 + 1
        assert (reader.start_time, reader.end_time - 1) == (messages[0][1], messages[-1][1])
    with (bag / 'bag_0.mcap').open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None and summary.statistics is not None
    assert summary.statistics.message_start_time == messages[0][1]
    assert summary.statistics.message_end_time == messages[-1][1]
    info = yaml.safe_load((bag / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert info['duration']['nanoseconds'] == messages[-1][1] - messages[0][1]
    assert info['starting_time']['nanoseconds_since_epoch'] == messages[0][1]
    code, text = robot.run(REPLAY, str(bag))
    assert code == 0, text
    assert 'imu/data ' in text


def test_what_was_published_once_is_in_the_bag_when_it_begins(robot: Any) -> None:
    parameters = robot.output / 'latched.yaml'
    parameters.write_text("""
/**/robot:
  ros__parameters:
    topics: [place, often]
    place: {message: geometry_msgs/msg/PointStamped}
    often: {message: geometry_msgs/msg/Point}
    mirrors: [place_out, often_out]
    place_out: {topic: place, direction: out, durability: transient_local}
    often_out: {topic: often, direction: out}
""")
    robot.start('rt_robot_os.core.program', '--ros-args', '--params-file', str(parameters),
                *robot.ORDINARY)
    with robot.connect() as client:
        place, often = client.advertise('place'), client.advertise('often')
        client.publish(place, Layout.compile('geometry_msgs/msg/PointStamped').from_dict({}))
        client.publish(often, Layout.compile('geometry_msgs/msg/Point').from_dict({}))
        robot.until(lambda: sum(each['published'] for each in client.statistics().topics) == 2,
                    'two samples')
        bag = robot.output / 'bag'
        recorder, said = robot.record('-o', str(bag), '--duration', '1')
        robot.until(lambda: 'connected to the core' in said.read_text(), 'a recorder')
        while recorder.poll() is None:
            client.publish(often, Layout.compile('geometry_msgs/msg/Point').from_dict({}))
            client.pump(0.05)
    assert recorder.wait() == 0
    found = read(bag / 'bag_0.mcap')
    (message, decoded), = found['/place']
    stamp_ns = decoded.header.stamp.sec * 10**9 + decoded.header.stamp.nanosec
    assert message.publish_time == stamp_ns < message.log_time
    with AnyReader([bag]) as reader:
        order = [connection.topic for connection, _, _ in reader.messages()]
        assert order.index('/place') < order.index('/often')
        assert reader.duration < 1.0e9


def test_a_topic_that_is_not_there_is_refused(beside: Any) -> None:
    bag = beside.output / 'bag'
    code, text = beside.run(RECORD, 'imu/data', 'nosuch', '-o', str(bag))
    assert code == 2
    assert text.startswith('no topic nosuch in the core; known are /cmd_vel, ')
    assert not bag.exists()


def test_a_killed_recorder_leaves_a_file_that_can_be_mended(beside: Any) -> None:
    bag = beside.output / 'bag'
    recorder, log = beside.record('-o', str(bag))
    beside.wait_for_messages(log, recorder, 500)
    beside.end(recorder, signal.SIGKILL)
    code, text = beside.run(RECORD, '--repair', str(bag))
    assert code == 0, text
    assert 'repaired' in text
    found = read(bag / 'bag_0.mcap')
    assert len(found['/imu/data']) > 50
    assert read_bag(bag)['/imu/data'] == len(found['/imu/data'])
    code, text = beside.run(RECORD, '--repair', str(bag))
    assert 'intact' in text


def test_a_full_disk_ends_the_recording_readably(beside: Any) -> None:
    bag = beside.output / 'bag'

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))

    recorder, log = beside.record('-o', str(bag), '--compression', 'none', preexec_fn=limit)
    assert recorder.wait(60) == 1
    text = log.read_text()
    assert 'recording stopped: File too large' in text
    assert 'can be read' in text
    assert len(read(bag / 'bag_0.mcap')['/imu/data']) > 10
    assert read_bag(bag)['/imu/data'] > 10


def test_a_core_that_comes_back_is_another_session(robot: Any) -> None:
    core = robot.core()
    bag = robot.output / 'bag'
    recorder, log = robot.record('-o', str(bag), 'imu/data', '--no-bytes')
    robot.wait_for_messages(log, recorder, 50)
    robot.end(core)
    robot.core()
    robot.until(lambda: log.read_text().count('connected to the core') > 1, 'the other session')
    # However many there were of the first core by its end.
    robot.wait_for_messages(log, recorder, robot.messages(log) + 50)
    assert robot.end(recorder) == 0
    assert 'the core has ended; waiting' in log.read_text()
    assert [path.name for path in sorted(bag.glob('*.mcap'))] == ['bag_0.mcap', 'bag_1.mcap']
    assert set(read(bag / 'bag_1.mcap')) == {'/imu/data'}


def test_old_files_make_room(beside: Any) -> None:
    bag = beside.output / 'bag'
    recorder, log = beside.record(
        '-o', str(bag), '--max-bytes', '64k', '--max-files', '2', '--compression', 'none')
    beside.wait_for_messages(log, recorder, 800)
    assert beside.end(recorder) == 0
    names = sorted(path.name for path in bag.glob('*.mcap'))
    assert len(names) == 2
    assert 'bag_0.mcap' not in names
    assert set(read_bag(bag)) >= {'/imu/data'}


def test_what_is_wrong_is_said(robot: Any) -> None:
    code, text = robot.run(RECORD, '-o', str(robot.output))
    assert code == 1 and 'choose another with -o' in text
    code, text = robot.run(RECORD, '--repair', str(robot.output / 'none'))
    assert code == 1 and 'does not exist' in text
    (robot.output / 'x.mcap').write_bytes(b'nonsense')
    code, text = robot.run(RECORD, '--repair', str(robot.output / 'x.mcap'))
    assert code == 1 and 'is not an MCAP file' in text
    code, text = robot.run(RECORD, '--max-files', '2')
    assert code == 2 and '--max-files needs --max-bytes' in text


def test_a_compression_whose_library_is_missing_is_told_before_anything_is_made(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
        ) -> None:
    monkeypatch.setitem(sys.modules, 'lz4', None)
    assert run(['--compression', 'lz4', '-o', str(tmp_path / 'bag')]) == 1
    assert '--compression lz4 needs lz4 ' in capsys.readouterr().err
    assert os.listdir(tmp_path) == []
