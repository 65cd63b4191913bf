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

"""The program replay: on recordings of a real core."""

from __future__ import annotations

from pathlib import Path
import shutil
import time
from typing import Any

from bag_tools import rewrite
from mcap.reader import make_reader
from mcap.writer import Writer
import pytest

from rt_robot_os.core.tap_format import is_tap
from rt_robot_os.core.tap_format import schedule_cdr
from rt_robot_os.core.tap_format import SCHEDULE_TOPIC
from rt_robot_os.core.tap_format import split_array
from rt_robot_os.recording.reading import Recorded
from rt_robot_os.recording.reading import Recording

REPLAY = 'rt_robot_os.recording.replay_program'


def test_a_replay_makes_the_same_publications(recording: Path, robot: Any) -> None:
    outputs = [robot.output / 'one.mcap', robot.output / 'two.mcap']
    for output in outputs:
        code, text = robot.run(REPLAY, str(recording), '--output', str(output))
        assert code == 0, text
        assert text.endswith('identical\n')
        for topic in ('imu/data', 'imu/mag', 'gps/fix', 'gps/time', 'cmd_vel_safe'):
            assert f'{topic} ' in text
    assert outputs[0].read_bytes() == outputs[1].read_bytes()


def test_a_recording_of_the_first_form_is_still_replayed(recording: Path, robot: Any) -> None:
    old = rewrite(recording, robot.output / 'old.mcap', old_form=True)
    with old.open('rb') as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        topics = {each.topic for each in summary.channels.values()}
    assert {'/attitude/imu', '/core/schedule', '/device/imu/bytes'} <= topics
    code, text = robot.run(REPLAY, str(old))
    assert code == 0, text
    assert text.endswith('identical\n')


def test_modules_alone_make_the_same_publications(recording: Path, robot: Any) -> None:
    code, text = robot.run(REPLAY, str(recording), '--from', 'topics')
    # The first samples were published before the recorder could be there.
    assert 'cmd_vel_safe' in text
    assert not [line for line in text.splitlines() if line.startswith('imu/mag ')]
    assert code in (0, 1), text


def test_another_configuration_differs_by_field(recording: Path, robot: Any) -> None:
    shipped = Path(__file__).resolve().parents[2] / 'config' / 'robot.yaml'
    other = robot.output / 'other.yaml'
    other.write_text(shipped.read_text().replace(
        'mag_topic: imu/mag\n', 'mag_topic: imu/mag\n      acceleration_stddev: 0.5\n', 1))
    code, text = robot.run(REPLAY, str(recording), '--params-file', str(other))
    assert code == 1, text
    assert 'first difference: imu/data number ' in text
    assert 'linear_acceleration_covariance[0]: recorded 0.0004, replayed 0.25' in text


FAULTS = """
/**/robot:
  ros__parameters:
    devices: [imu]
    imu:
      {type: witmotion, port: sim, topic: imu/data, rate_hz: 200.0, priority: 80, read: interrupt,
       timeout_s: 0.3, retry_s: 0.1,
       sim: {faults: ['unplug at 1 for 0.3', 'garbage at 2 for 0.2', 'silent at 2.5 for 0.6']}}
"""


def test_faults_are_replayed_too(robot: Any) -> None:
    parameters = robot.output / 'faults.yaml'
    parameters.write_text(FAULTS)
    bag = robot.output / 'bag'
    recorder, log = robot.record('-o', str(bag))
    core, said = robot.start('rt_robot_os.core.program', '--ros-args', '--params-file',
                             str(parameters), *robot.ORDINARY, '-p', 'core.record_bytes:=true')
    robot.until(lambda: said.read_text().count('active again') >= 2 or core.poll() is not None,
                'a device that came back twice')
    robot.end(core)
    robot.end(recorder)
    code, text = robot.run(REPLAY, str(bag))
    assert code == 0, text + said.read_text()


def test_a_recording_cut_short_is_replayed_up_to_there(recording: Path, robot: Any) -> None:
    cut = robot.output / 'cut.mcap'
    data = next(recording.glob('*.mcap')).read_bytes()
    cut.write_bytes(data[:len(data) * 2 // 3])
    code, text = robot.run(REPLAY, str(cut))
    assert code == 0, text
    assert 'truncated' in text


def test_a_recording_in_the_middle_of_a_run_settles(beside: Any) -> None:
    bag = beside.output / 'bag'
    recorder, log = beside.record('-o', str(bag))
    beside.wait_for_messages(log, recorder, 500)
    assert beside.end(recorder) == 0
    code, text = beside.run(REPLAY, str(bag))
    assert 'started in the middle of the run' in text
    # A filter remembers everything, so it is never the same; the others are.
    assert 'attitude/imu: never identical' in text
    assert code == 1
    assert 'first difference' not in text


def test_what_was_recorded_up_to_ctrl_c_can_be_replayed(beside: Any) -> None:
    bag = beside.output / 'bag'
    recorder, log = beside.record('-o', str(bag))
    beside.wait_for_messages(log, recorder, 100)
    stopped_ns = time.monotonic_ns()
    assert beside.end(recorder) == 0
    # A replay ends with the last message of the schedule, which the core writes at times.
    assert max(each.stamp_ns for each in Recording(bag).samples()
               if each.topic == SCHEDULE_TOPIC) > stopped_ns


@pytest.mark.parametrize('change, reason', [
    (lambda path: path.write_bytes(b'nonsense'), 'not an MCAP file'),
    (lambda path: path.unlink(), 'does not exist'),
])
def test_what_is_no_recording_is_refused(robot: Any, change: Any, reason: str) -> None:
    path = robot.output / 'x.mcap'
    path.write_bytes(b'')
    change(path)
    code, text = robot.run(REPLAY, str(path))
    assert code == 2, text
    assert any(each in text for each in reason.split('|')), text


def test_a_recording_of_others_is_refused(robot: Any) -> None:
    path = robot.output / 'x.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start('ros2')
        writer.finish()
    code, text = robot.run(REPLAY, str(path))
    assert code == 2
    assert 'not a recording of record' in text


def test_another_format_is_named(recording: Path, robot: Any) -> None:
    path = robot.output / 'x.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start('ros2')
        writer.add_metadata('rt_robot_os.session', {'format': '99', 'rt_robot_os': '9.1'})
        writer.finish()
    code, text = robot.run(REPLAY, str(path))
    assert code == 2
    assert 'has format 99' in text and '9.1' in text


def test_without_a_schedule_nothing_is_replayed(beside: Any) -> None:
    bag = beside.output / 'bag'
    recorder, log = beside.record('-o', str(bag), '--no-bytes')
    beside.wait_for_messages(log, recorder, 300)
    beside.end(recorder)
    code, text = beside.run(REPLAY, str(bag))
    assert code == 2
    assert 'made with --no-bytes' in text


def test_a_recording_too_short_for_a_schedule_says_so(recording: Path, robot: Any) -> None:
    path = rewrite(recording, robot.output / 'x.mcap',
                   each=lambda sample: None if is_tap(sample.topic) else sample.cdr)
    code, text = robot.run(REPLAY, str(path))
    assert code == 2
    assert 'it has no message of the schedule' in text and '--no-bytes' not in text


def test_what_the_core_dropped_of_its_schedule_is_told(recording: Path, robot: Any) -> None:
    def dropping(sample: Recorded) -> bytes:
        if sample.topic != SCHEDULE_TOPIC:
            return sample.cdr
        front, records = split_array(sample.cdr)
        return schedule_cdr(records, front == b'\1', 77)

    path = rewrite(recording, robot.output / 'x.mcap', each=dropping)
    _, text = robot.run(REPLAY, str(path))
    assert 'the core dropped 77 records of its schedule' in text


def test_a_recording_of_two_files_is_one(recording: Path, tmp_path: Path) -> None:
    copy = tmp_path / 'bag'
    shutil.copytree(recording, copy)
    assert len(list(Recording(copy).samples())) == len(list(Recording(recording).samples()))
