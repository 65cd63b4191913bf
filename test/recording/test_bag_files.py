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

"""Files of a recording: definitions, chunks, and what is left of a file that was cut."""

from __future__ import annotations

from pathlib import Path
import tempfile

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from mcap.reader import make_reader
import pytest

from rt_robot_os.core.tap_format import array_cdr
from rt_robot_os.core.tap_format import device_front
from rt_robot_os.core.tap_format import parse_device
from rt_robot_os.core.tap_format import parse_schedule
from rt_robot_os.core.tap_format import TapKind
from rt_robot_os.recording.bag_file import BagFile
from rt_robot_os.recording.bag_info import TopicFacts
from rt_robot_os.recording.chunk import COMPRESSIONS
from rt_robot_os.recording.definitions import _made
from rt_robot_os.recording.definitions import definition
from rt_robot_os.recording.definitions import type_hash
from rt_robot_os.recording.repair import repair_file
from rt_robot_os.topics import Layout
from rt_robot_os.topics.resolve import resolve

POINT = TopicFacts('/point', 'geometry_msgs/msg/Point', type_hash('geometry_msgs/msg/Point'))


def write(path: Path, count: int, compression: str = 'zstd', every: int = 10) -> None:
    """Write a file with a chunk for so many messages."""
    layout = Layout.compile('geometry_msgs/msg/Point')
    file = BagFile(path, 'test', compression)
    file.note('facts', {'a': 'b'})
    file.attach('settings.json', 'application/json', b'{}')
    channel = file.channel(POINT)
    for number in range(count):
        file.add(channel, 1000 + number, layout.from_dict({'x': float(number)}), number,
                 1000 + number)
        if number % every == every - 1:
            file.flush()
    file.finish()


def numbers(path: Path) -> list[int]:
    """Read the numbers of the messages with the public reader, by its indices."""
    with path.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        found = [message.sequence for _, _, message in reader.iter_messages(topics=['/point'])]
        assert summary.statistics.message_count == len(found)
    return found


@pytest.mark.parametrize('compression', COMPRESSIONS)
def test_every_compression_is_read_back(tmp_path: Path, compression: str) -> None:
    write(tmp_path / 'a.mcap', 95, compression)
    assert numbers(tmp_path / 'a.mcap') == list(range(95))
    assert not repair_file(tmp_path / 'a.mcap')


@settings(max_examples=60)
@given(st.floats(0.0, 1.0))
def test_a_file_cut_anywhere_can_be_mended(part: float) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'a.mcap'
        write(path, 60)
        data = path.read_bytes()
        path.write_bytes(data[:8 + round(part * (len(data) - 9))])
        repair_file(path)
        found = numbers(path)
        assert found == list(range(len(found)))
        assert len(found) % 10 == 0
        assert not repair_file(path)


def test_a_definition_has_all_that_it_is_made_of() -> None:
    text = definition('sensor_msgs/msg/Imu')
    parts = text.split('=' * 80 + '\n')
    assert [part.split('\n')[0] for part in parts[1:]] == [
        'MSG: std_msgs/Header', 'MSG: builtin_interfaces/Time', 'MSG: geometry_msgs/Quaternion',
        'MSG: geometry_msgs/Vector3']
    assert 'float64[9] orientation_covariance' in text


def test_a_definition_can_be_made_without_files() -> None:
    assert _made(resolve('sensor_msgs/msg/Imu')).splitlines()[:3] == [
        'std_msgs/Header header', 'geometry_msgs/Quaternion orientation',
        'float64[9] orientation_covariance']
    assert 'float32[] ranges' in _made(resolve('sensor_msgs/msg/LaserScan'))


@given(st.sampled_from(TapKind), st.integers(0, 1 << 60), st.booleans(),
       st.lists(st.tuples(st.integers(0, 1 << 60), st.booleans()), max_size=64), st.binary())
def test_what_a_tap_notes_is_read_back(kind: TapKind, at_ns: int, command: bool,
                                       idle: list[tuple[int, bool]], data: bytes) -> None:
    front = device_front(kind, at_ns << 1 | command, [t << 1 | c for t, c in idle])
    event = parse_device(array_cdr(front, data))
    assert event == (kind, at_ns, command, tuple(idle), data)


@given(st.binary(max_size=200))
def test_nonsense_in_a_tap_is_a_value_error(data: bytes) -> None:
    for parse in (parse_device, parse_schedule):
        try:
            parse(data)  # type: ignore[operator]
        except ValueError:
            pass
