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

"""Recordings that somebody has made up: refused in one line, and nothing of them is run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import random
import struct
import sys
from typing import Any
import zlib

from bag_tools import rewrite
from hypothesis import given
from hypothesis import HealthCheck
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel
from mcap.records import Chunk
from mcap.records import Schema
import pytest
from rt_robot_os.core.tap_format import is_tap
from rt_robot_os.recording.bag_file import BagFile
from rt_robot_os.recording.bag_info import TopicFacts
from rt_robot_os.recording.mcap_records import CHUNK_BYTES_MAXIMUM
from rt_robot_os.recording.mcap_records import DamagedRecordError
from rt_robot_os.recording.mcap_records import unpacked
from rt_robot_os.recording.reading import Recorded
from rt_robot_os.recording.repair import repair_file
from rt_robot_os.recording.replay_program import main
from rt_robot_os.recording.summary import MAGIC
import zstandard

Facts = dict[str, str]
Settings = dict[str, Any]


def refused(path: Path, capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Replay; give the one line that says why not."""
    capsys.readouterr()
    assert main([str(path), *arguments]) == 2
    text = capsys.readouterr().err
    assert 'Traceback' not in text
    assert all(each.isprintable() or each == '\n' for each in text)
    assert len(text) < 2000
    return text


@pytest.mark.parametrize(('key', 'value', 'reason'), [
    ('tasks', '["imu"', 'damaged'), ('tasks', '7', 'damaged'), ('topics', '{}', 'damaged'),
    ('tasks', '[' * 100_000, 'damaged'), ('taps', '["device/x", "a", ""]', 'no schedule'),
    ('taps', '[]', 'made with --no-bytes'), ('core_start_ns', '-' + '9' * 4000, 'damaged'),
    ('core_start_ns', str(-1 << 61), 'damaged'), ('offset_ns', str(1 << 63), 'damaged'),
    ('offset_ns', str((1 << 61) + 1), 'damaged'), ('format', '\x1b[2J', 'has format'),
    ('session', 'first', 'damaged'),
])
def test_nonsense_about_the_session(recording: Path, tmp_path: Path, key: str, value: str,
                                    reason: str, capsys: pytest.CaptureFixture[str]) -> None:
    def change(facts: Facts, settings: Settings) -> None:
        facts[key] = value

    path = rewrite(recording, tmp_path / 'x.mcap', change)
    assert reason in refused(path, capsys)


def gone(facts: Facts, settings: Settings) -> None:
    facts.clear()


def of_no_use(facts: Facts, settings: Settings) -> None:
    settings['devices'][0]['settings'] = {}


def of_another_kind(facts: Facts, settings: Settings) -> None:
    settings['devices'][0]['settings']['baud'] = {'a': []}


@pytest.mark.parametrize('change', [gone, of_no_use, of_another_kind])
def test_nonsense_in_the_settings(recording: Path, tmp_path: Path,
                                  change: Callable[[Facts, Settings], None],
                                  capsys: pytest.CaptureFixture[str]) -> None:
    refused(rewrite(recording, tmp_path / 'x.mcap', change), capsys)


@pytest.mark.parametrize('text', ['', 'null', '[' * 5000, '{"a":' * 500 + '1' + '}' * 500])
def test_settings_that_are_none(recording: Path, tmp_path: Path, text: str,
                                capsys: pytest.CaptureFixture[str]) -> None:
    path = rewrite(recording, tmp_path / 'x.mcap', settings_text=text)
    assert 'configuration in the recording cannot be read' in refused(path, capsys)


SPY = """
raise SystemExit('imported')
"""


def test_only_what_is_registered_is_imported(recording: Path, tmp_path: Path,
                                             monkeypatch: pytest.MonkeyPatch,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'spy.py').write_text(SPY)
    monkeypatch.syspath_prepend(str(tmp_path))

    def wants_module(facts: Facts, settings: Settings) -> None:
        settings['modules'][0]['type'] = 'spy:Spy'

    def wants_message(facts: Facts, settings: Settings) -> None:
        settings['topics'][0]['message'] = 'spy/msg/Spy'

    def wants_driver(facts: Facts, settings: Settings) -> None:
        settings['devices'][0]['type'] = 'spy:Spy'

    path = rewrite(recording, tmp_path / 'a.mcap', wants_module)
    assert '--allow spy:Spy' in refused(path, capsys)
    refused(rewrite(recording, tmp_path / 'b.mcap', wants_message), capsys)
    refused(rewrite(recording, tmp_path / 'c.mcap', wants_driver), capsys)
    assert 'spy' not in sys.modules
    with pytest.raises(SystemExit, match='imported'):
        main([str(path), '--allow', 'spy:Spy'])


def test_a_module_that_is_allowed_is_replayed(recording: Path, tmp_path: Path) -> None:
    def by_class(facts: Facts, settings: Settings) -> None:
        guard = next(each for each in settings['modules'] if each['name'] == 'guard')
        guard['type'] = 'rt_robot_os.features.navigation.twist_guard:TwistGuard'

    path = rewrite(recording, tmp_path / 'x.mcap', by_class)
    assert main([str(path)]) == 2
    allowed = 'rt_robot_os.features.navigation.twist_guard:TwistGuard'
    assert main([str(path), '--allow', allowed]) == 0


@hypothesis_settings(max_examples=15, deadline=None,
                     suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 1 << 32))
def test_forged_samples_are_survived(recording: Path, tmp_path: Path, seed: int) -> None:
    chosen = random.Random(seed)

    def forge(sample: Recorded) -> bytes | None:
        if not is_tap(sample.topic) or chosen.random() > 0.1:
            return sample.cdr
        data = bytearray(sample.cdr)
        for _ in range(chosen.choice([1, 4])):
            data[chosen.randrange(len(data))] = chosen.randrange(256)
        return bytes(data[:chosen.choice([len(data), chosen.randrange(len(data))])])

    path = tmp_path / 'x.mcap'
    path.unlink(missing_ok=True)
    assert main([str(rewrite(recording, path, each=forge))]) in (0, 1, 2)


# ---- what a few bytes may become -------------------------------------------------------------


def bomb(compression: str, size: int, told: int | None = None) -> bytes:
    """Make the content of a chunk that is long when it is decompressed."""
    data = bytes(size)
    if compression == 'zstd':
        packed = zstandard.ZstdCompressor().compress(data)
    else:
        import lz4.frame
        packed = lz4.frame.compress(data)
    builder = RecordBuilder()
    Chunk(compression=compression, data=packed, message_start_time=0, message_end_time=0,
          uncompressed_crc=0, uncompressed_size=size if told is None else told).write(builder)
    return bytes(builder.end())


@pytest.mark.parametrize('compression', ['zstd', 'lz4'])
@pytest.mark.parametrize('told', [None, 1000])
def test_no_chunk_becomes_longer_than_is_allowed(compression: str, told: int | None,
                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    record = bomb(compression, CHUNK_BYTES_MAXIMUM + 1, told)
    assert len(record) < 400_000
    sums: list[int] = []
    monkeypatch.setattr(zlib, 'crc32', lambda data, *more: sums.append(len(data)) or 0)
    with pytest.raises(DamagedRecordError):
        unpacked(record[9:])
    assert max(sums, default=0) <= 1001


def test_a_chunk_of_empty_records_is_refused_at_the_first(tmp_path: Path) -> None:
    path = tmp_path / 'x.mcap'
    path.write_bytes(MAGIC + struct.pack('<BQII', Opcode.HEADER, 8, 0, 0)
                     + bomb('zstd', CHUNK_BYTES_MAXIMUM))
    assert '1 damaged record' in repair_file(path)
    assert main([str(path)]) == 2


def test_messages_that_do_not_differ_are_refused(tmp_path: Path) -> None:
    message = struct.pack('<BQHIQQ', Opcode.MESSAGE, 22, 1, 0, 1, 1)
    head = RecordBuilder()
    Schema(1, b'', 'ros2msg', 'std_msgs/msg/Empty').write(head)
    Channel(1, '/a', 'cdr', {}, 1).write(head)
    data = bytes(head.end()) + message * 1_000_000
    builder = RecordBuilder()
    Chunk(compression='zstd', data=zstandard.ZstdCompressor().compress(data),
          message_start_time=1, message_end_time=1, uncompressed_crc=0,
          uncompressed_size=len(data)).write(builder)
    path = tmp_path / 'x.mcap'
    path.write_bytes(MAGIC + struct.pack('<BQII', Opcode.HEADER, 8, 0, 0) + bytes(builder.end()))
    assert path.stat().st_size < 20_000
    assert '1 damaged record' in repair_file(path)


def test_many_messages_that_are_alike_are_no_forgery(tmp_path: Path) -> None:
    path = tmp_path / 'x.mcap'
    file = BagFile(path, 'test')
    channel = file.channel(TopicFacts('/a', 'std_msgs/msg/Empty'))
    for number in range(20_000):
        file.add(channel, number * 100_000, b'\0\1\0\0\0', number, number * 100_000)
    file.finish()
    assert not repair_file(path)
