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

"""Microphones and speakers of calls: little waits, nothing grows, and files are what they say."""

from __future__ import annotations

import asyncio
from pathlib import Path
import wave

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.gateway.voice_sound import BLOCK
from rt_robot_os.gateway.voice_sound import Ducking
from rt_robot_os.gateway.voice_sound import level_db
from rt_robot_os.gateway.voice_sound import open_microphone
from rt_robot_os.gateway.voice_sound import open_speaker
from rt_robot_os.gateway.voice_sound import Playout
from rt_robot_os.gateway.voice_sound import RATE_HZ
from rt_robot_os.gateway.voice_sound import read_wave
from rt_robot_os.gateway.voice_sound import tone


def write(path: Path, samples: np.ndarray, rate_hz: int = RATE_HZ, channels: int = 1,
          width: int = 2) -> Path:
    with wave.open(str(path), 'wb') as file:
        file.setnchannels(channels)
        file.setsampwidth(width)
        file.setframerate(rate_hz)
        file.writeframes(samples.tobytes())
    return path


def test_sound_is_played_in_order_and_begins_when_there_is_enough() -> None:
    playout = Playout()
    block = np.arange(1, BLOCK + 1, dtype=np.int16)
    playout.put(block)
    assert not playout.pull(480).any()  # one block is no reserve yet
    playout.put(block)
    played = np.concatenate([playout.pull(480) for _ in range(4)])
    assert np.array_equal(played, np.concatenate([block, block]))
    assert not playout.pull(480).any()
    assert playout.gaps == 1


@given(st.lists(st.integers(0, 3000), max_size=60))
def test_no_more_waits_than_a_moment_whatever_comes(counts: list[int]) -> None:
    playout = Playout()
    came = played = 0
    for count in counts:
        playout.put(np.ones(count, np.int16))
        came += count
        assert len(playout.pull(480)) == 480
        assert playout._count <= 8 * BLOCK
    for _ in range(40):
        played += int(playout.pull(480).sum())
    assert played + playout.skipped <= came


def test_the_microphone_is_quieter_while_the_speaker_speaks() -> None:
    ducking = Ducking(20.0)
    samples = np.full(BLOCK, 1000, np.int16)
    assert ducking.heard(samples)[0] == 1000
    ducking.said(-80.0)  # noise
    assert ducking.heard(samples)[0] == 1000
    ducking.said(-20.0)
    assert ducking.heard(samples)[0] == 100
    never = Ducking(0.0)
    never.said(-20.0)
    assert never.heard(samples)[0] == 1000


def test_a_file_of_another_rate_and_two_channels_is_read(tmp_path: Path) -> None:
    at = np.arange(16_000) / 16_000
    both = np.repeat((8000 * np.sin(2 * np.pi * 300 * at)).astype(np.int16), 2)
    found = read_wave(write(tmp_path / 'a.wav', both, 16_000, 2))
    assert len(found) == RATE_HZ
    crossings = np.count_nonzero((found[:-1] < 0) & (found[1:] >= 0))
    assert abs(crossings - 300) <= 1


@pytest.mark.parametrize('content', [b'', b'RIFF', b'\0' * 100, b'RIFF\xff\xff\xff\xffWAVEfmt '])
def test_what_is_no_sound_is_a_clear_error(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / 'a.wav'
    path.write_bytes(content)
    with pytest.raises(DeviceError, match='a.wav'):
        open_microphone(f'file:{path}', lambda utc_ns, sample: None)
    with pytest.raises(DeviceError, match='cannot be written'):
        open_speaker(f'file:{tmp_path}/no/such/folder.wav')


def test_loudness_is_in_db_of_full_scale() -> None:
    assert level_db(np.zeros(BLOCK, np.int16)) == -90.0
    assert abs(level_db(np.full(BLOCK, 32767, np.int16))) < 0.1
    assert abs(level_db(np.full(BLOCK, 3277, np.int16)) + 20) < 0.1
    assert level_db(tone(0)) > -35 and level_db(tone(50)) == -90.0


def test_a_file_is_played_as_a_device_would_and_its_times_are_told(tmp_path: Path) -> None:
    async def play() -> list[int]:
        told: list[int] = []
        source = write(tmp_path / 'in.wav', np.full(3 * BLOCK, 500, np.int16))
        microphone = open_microphone(f'file:{source}', lambda utc_ns, sample: told.append(sample))
        speaker = open_speaker(f'file:{tmp_path}/out.wav')
        for _ in range(6):
            speaker.put(await microphone.read())
        for _ in range(2):  # a single block waits for more, as after a gap in a call
            speaker.put(np.zeros(BLOCK, np.int16))
        while speaker.playout._count:
            await asyncio.sleep(0.005)
        speaker.close()
        return told

    assert asyncio.run(play())[0] == 0
    heard = read_wave(tmp_path / 'out.wav')
    assert np.count_nonzero(heard == 500) == 6 * BLOCK
    times = (tmp_path / 'out.wav.times').read_text().splitlines()
    assert len(times) * 480 == len(heard)
