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

"""Files that were damaged anywhere: mended, readers open them, and little is lost."""

from __future__ import annotations

from pathlib import Path
import tempfile

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
import pytest
from rt_robot_os.recording.bag_file import REPLAY
from rt_robot_os.recording.chunk import COMPRESSIONS
from rt_robot_os.recording.mcap_records import file_records
from rt_robot_os.recording.reading import Recording
from rt_robot_os.recording.record_program import main
from rt_robot_os.recording.repair import repair_all
from rt_robot_os.recording.repair import repair_file
from rt_robot_os.recording.summary import MAGIC
from test_bag_files import numbers
from test_bag_files import write

COUNT = 60
DAMAGE = st.lists(st.tuples(
    st.sampled_from(['flip', 'zeros', 'noise', 'insert', 'delete', 'cut']), st.floats(0.0, 1.0),
    st.binary(min_size=1, max_size=80)), min_size=1, max_size=4)


def damaged(data: bytes, damage: list[tuple[str, float, bytes]]) -> bytes:
    """Do some damage behind the magic number."""
    for what, part, noise in damage:
        at = len(MAGIC) + round(part * max(0, len(data) - len(MAGIC) - 1))
        before, after = data[:at], data[at:]
        data = before + {
            'flip': bytes([after[0] ^ (1 << noise[0] % 8)]) + after[1:] if after else b'',
            'zeros': bytes(len(noise)) + after[len(noise):], 'noise': noise + after[len(noise):],
            'insert': noise + after, 'delete': after[len(noise):], 'cut': b''}[what]
    return data


def read_every_way(path: Path) -> list[int]:
    """Read with the public readers, by index and from front to end."""
    with path.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header()
        summary = reader.get_summary()
        found = [message.sequence for _, _, message in reader.iter_messages()]
    assert summary is not None and summary.statistics is not None
    assert summary.statistics.message_count == len(found)
    with path.open('rb') as stream:
        assert list(StreamReader(stream, validate_crcs=True).records)
    return found


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(COMPRESSIONS), DAMAGE)
def test_any_damage_can_be_mended(compression: str, damage: list[tuple[str, float, bytes]]
                                  ) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'a.mcap'
        write(path, COUNT, compression)
        path.write_bytes(damaged(path.read_bytes(), damage))
        lines, failed = repair_all(Path(folder))
        assert not failed
        found = read_every_way(path)
        assert found == sorted(set(found) & set(range(COUNT)))
        assert not repair_file(path)


@pytest.mark.parametrize('number', [0, 2, 5])
@pytest.mark.parametrize('compression', COMPRESSIONS)
def test_what_follows_a_damaged_chunk_stays(tmp_path: Path, compression: str, number: int
                                            ) -> None:
    path = tmp_path / 'a.mcap'
    write(path, COUNT, compression)
    data = bytearray(path.read_bytes())
    chunks = [offset for offset, kind, _ in file_records(path) if kind == 6]
    data[chunks[number] + 60] ^= 1
    path.write_bytes(data)
    assert '1 damaged record skipped' in repair_file(path)
    assert read_every_way(path) == [n for n in range(COUNT) if n // 10 != number]
    assert numbers(path) == read_every_way(path)


@pytest.mark.parametrize('compression', ['zstd', 'lz4'])
def test_what_follows_a_lost_length_stays(tmp_path: Path, compression: str) -> None:
    path = tmp_path / 'a.mcap'
    write(path, COUNT, compression)
    data = bytearray(path.read_bytes())
    chunks = [offset for offset, kind, _ in file_records(path) if kind == 6]
    data[chunks[2] + 1:chunks[2] + 9] = b'\xff' * 8
    path.write_bytes(data)
    repair_file(path)
    assert read_every_way(path) == [n for n in range(COUNT) if not 20 <= n < 30]


def test_a_damaged_index_is_made_anew(tmp_path: Path) -> None:
    path = tmp_path / 'a.mcap'
    write(path, COUNT)
    whole = path.read_bytes()
    indices = [offset for offset, kind, _ in file_records(path) if kind == 7]
    path.write_bytes(whole[:indices[1] + 20] + b'\xaa' * 30 + whole[indices[1] + 50:])
    repair_file(path)
    assert path.read_bytes() == whole


def test_one_file_that_cannot_be_mended_keeps_no_other_from_it(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / 'bag_0.mcap', COUNT)
    (tmp_path / 'bag_1.mcap').write_bytes(b'nonsense')
    write(tmp_path / 'bag_2.mcap', COUNT)
    data = (tmp_path / 'bag_2.mcap').read_bytes()
    (tmp_path / 'bag_2.mcap').write_bytes(data[:len(data) // 2])
    assert main(['--repair', str(tmp_path)]) == 1
    told = capsys.readouterr()
    assert 'bag_1.mcap is not an MCAP file' in told.err
    assert 'bag_0.mcap: intact' in told.out and 'bag_2.mcap: repaired' in told.out
    assert 'metadata.yaml: written' in told.out
    assert len(read_every_way(tmp_path / 'bag_2.mcap')) >= 20


def test_what_is_kept_for_a_replay_can_be_read_second_by_second(recording: Path,
                                                                tmp_path: Path) -> None:
    path = tmp_path / 'a.mcap'
    data = bytearray(next(recording.glob('*.mcap')).read_bytes())
    path.write_bytes(data)
    with path.open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    kept = [each for each in summary.attachment_indexes if each.name == REPLAY]
    assert len(kept) > 2
    data[kept[0].offset + kept[0].length // 2] ^= 1
    path.write_bytes(data)
    assert '1 damaged record' in repair_file(path)
    seen = Recording(path)
    assert {'device/imu/bytes', 'core/schedule'} <= {each.topic for each in seen.samples()}
    assert not seen.problems
