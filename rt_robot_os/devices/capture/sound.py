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

"""
The sources of a microphone's process: a tone, a simulated room, a WAV file, PortAudio.

Blocks are 16 bit samples, channels interleaved. The stamp is that of the first sample.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Mapping
from dataclasses import dataclass
import math
import time
from typing import Any
from typing import Final
from typing import Protocol
import wave

import numpy as np

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.needs import require
from rt_robot_os.devices.capture.pictures import FrameTimer
from rt_robot_os.devices.capture.scene_memory import SceneMemory

NS_PER_S: Final = 1_000_000_000
FULL_SCALE: Final = 32768.0
# Digital silence; quieter than any 16 bit signal.
SILENCE_DB: Final = -120.0
TONE_HZ: Final = 440.0
TONE_DB: Final = -12.0

Samples = np.ndarray[Any, np.dtype[np.int16]]


class BlockSource(Protocol):
    """
    A source of blocks.

    :ivar overruns: number of losses of sound.
    """

    overruns: int

    def read(self) -> tuple[Samples, int] | None:
        """
        Wait for the next block.

        :return: frames x channels and the time of the first on CLOCK_MONOTONIC; None at the end.
        :raises DeviceError: it is gone.
        """

    def rewind(self) -> None:
        """Restart; called only for a source with an end."""

    def close(self) -> None:
        """Close it."""


class Tone:
    """A sine of 440 Hz, continuous in phase from block to block."""

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self.overruns = 0
        self._rate_hz = settings['sample_rate_hz']
        self._channels = settings['channels']
        self._grid = FrameTimer(self._rate_hz / settings['block'])
        self._step = np.arange(settings['block'])
        self._block = settings['block']
        self._place = 0

    def read(self) -> tuple[Samples, int] | None:
        """Return the next block at the time of its last sample."""
        end_ns = self._grid.wait()
        turns = (self._place + self._step) * (TONE_HZ / self._rate_hz)
        # A level is a root mean square, which for a sine is 3 dB below its peak.
        amplitude = FULL_SCALE * 10 ** (TONE_DB / 20) * math.sqrt(2)
        wanted = np.round(amplitude * np.sin(2 * math.pi * turns)).astype(np.int16)
        self._place += self._block
        first_ns = end_ns - self._block * NS_PER_S // self._rate_hz
        return np.repeat(wanted[:, None], self._channels, axis=1), first_ns

    def rewind(self) -> None:
        """Do nothing: it has no end."""

    def close(self) -> None:
        """Nothing is open."""


class RoomSound:
    """Noise with the level of the simulated world."""

    def __init__(self, settings: Mapping[str, Any], scene: SceneMemory) -> None:
        self.overruns = 0
        self._scene = scene
        self._rate_hz = settings['sample_rate_hz']
        self._shape = settings['block'], settings['channels']
        self._grid = FrameTimer(self._rate_hz / settings['block'])
        self._chance = np.random.default_rng(1)

    def read(self) -> tuple[Samples, int] | None:
        """Return the next block at the time of its last sample."""
        end_ns = self._grid.wait()
        scene = self._scene.read()
        if scene is None:
            raise DeviceError('the simulator has written no level: restart the robot')
        deviation = FULL_SCALE * 10 ** (scene['level_db'] / 20)
        sound = self._chance.normal(0.0, deviation, self._shape).clip(-FULL_SCALE, FULL_SCALE - 1)
        return sound.astype(np.int16), end_ns - self._shape[0] * NS_PER_S // self._rate_hz

    def rewind(self) -> None:
        """Do nothing: it has no end."""

    def close(self) -> None:
        """Nothing is open."""


class WavFile:
    """A WAV file of 16 bit samples, at the pace at which it was recorded."""

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self.overruns = 0
        self._block = settings['block']
        port = settings['port']
        try:
            self._file = wave.open(port, 'rb')
        except (wave.Error, EOFError) as error:
            raise DeviceError(f'{port} is not a WAV file of PCM samples ({error}): convert it, '
                              'for instance with sox or ffmpeg -c:a pcm_s16le') from error
        except OSError as error:
            raise DeviceError(f'{port}: {error.strerror}: check the path') from error
        found = (self._file.getframerate(), self._file.getnchannels(), self._file.getsampwidth())
        wanted = (settings['sample_rate_hz'], settings['channels'], 2)
        if found != wanted:
            self._file.close()
            raise DeviceError(f'{port} has {found[0]} Hz, {found[1]} channels, '
                              f'{8 * found[2]} bit: '
                              f'set sample_rate_hz: {found[0]} and channels: {found[1]}'
                              + ('' if found[2] == 2 else ', and convert it to 16 bit'))
        self._rate_hz, self._channels, _ = found
        self._grid = FrameTimer(self._rate_hz / self._block)

    def read(self) -> tuple[Samples, int] | None:
        """Read the next block at the time of its last sample; the last one is padded."""
        data = self._file.readframes(self._block)
        samples = np.frombuffer(data[:len(data) // 2 * 2], '<i2')
        samples = samples[:len(samples) // self._channels * self._channels]
        if not len(samples):
            return None
        whole = np.zeros((self._block, self._channels), np.int16)
        whole.reshape(-1)[:len(samples)] = samples
        return whole, self._grid.wait() - self._block * NS_PER_S // self._rate_hz

    def rewind(self) -> None:
        """Restart with the first sample."""
        self._file.rewind()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class PortAudioInput:
    """A sound card, by PortAudio through the library sounddevice."""

    def __init__(self, settings: Mapping[str, Any]) -> None:
        require('a sound input', 'sounddevice', error=DeviceError)
        try:
            import sounddevice
        except OSError as error:
            raise DeviceError(f'{error}: apt install libportaudio2') from error
        self.overruns = 0
        self._error = sounddevice.PortAudioError
        port = settings['port']
        self._port = port
        self._rate_hz = settings['sample_rate_hz']
        self._block = settings['block']
        device = None if port == 'default' else int(port) if port.isdigit() else port
        try:
            self._stream = sounddevice.InputStream(
                samplerate=self._rate_hz, blocksize=self._block, device=device,
                channels=settings['channels'], dtype='int16')
            self._stream.start()
        except (self._error, ValueError) as error:
            raise DeviceError(
                f'sound input {port!r}: {error}: python3 -m sounddevice lists the inputs; your '
                'user must be in the group audio; another program may use it, or it does not '
                f'support {self._rate_hz} Hz with {settings["channels"]} channels') from error

    def read(self) -> tuple[Samples, int] | None:
        """Wait for the next block."""
        try:
            data, overflowed = self._stream.read(self._block)
            behind = self._stream.read_available
        except self._error as error:
            raise DeviceError(f'sound input {self._port!r} is gone ({error}): was it unplugged?'
                              ) from error
        now_ns = time.monotonic_ns()
        self.overruns += bool(overflowed)
        return data, now_ns - (self._block + behind) * NS_PER_S // self._rate_hz

    def rewind(self) -> None:
        """Do nothing: it has no end."""

    def close(self) -> None:
        """Stop recording."""
        self._stream.close()


@dataclass(frozen=True)
class Block:
    """A block of sound."""

    samples: Samples
    stamp_ns: int
    seq: int

    def store(self, slot: memoryview) -> tuple[int, int]:
        """Write the samples."""
        size = self.samples.nbytes
        slot[:size] = memoryview(np.ascontiguousarray(self.samples)).cast('B')
        return size, 0

    def levels(self) -> tuple[float, float]:
        """Return root mean square and peak of all channels, in dB below full scale."""
        level = self.samples.astype(np.float64) / FULL_SCALE
        return decibel(math.sqrt(float(np.mean(level * level)))), decibel(
            float(np.max(np.abs(level), initial=0.0)))


def decibel(ratio: float) -> float:
    """Return a ratio of amplitudes in dB, digital silence as ``SILENCE_DB``."""
    return max(SILENCE_DB, 20 * math.log10(ratio)) if ratio > 0 else SILENCE_DB


class SoundBlocks:
    """The blocks of a source."""

    def __init__(self, source: BlockSource, settings: Mapping[str, Any]) -> None:
        self._source = source
        self._settings = settings

    @property
    def overruns(self) -> int:
        """Return the number of losses in the source."""
        return self._source.overruns

    def frames(self) -> Iterator[Block]:
        """Yield block after block."""
        seq = 0
        while True:
            read = self._source.read()
            if read is None:
                if not self._settings['loop']:
                    raise DeviceError(f'{self._settings["port"]} is at its end: set loop: true to '
                                      'repeat it')
                self._source.rewind()
                continue
            yield Block(read[0], read[1], seq)
            seq += 1

    def close(self) -> None:
        """Close the source."""
        self._source.close()


def open_sound(settings: Mapping[str, Any], scene: SceneMemory | None = None) -> SoundBlocks:
    """
    Open the source of a microphone's settings.

    :param scene: the scene of a simulated microphone.
    :raises DeviceError: it cannot be opened, or a library is missing.
    """
    port = settings['port']
    if port == 'synthetic':
        return SoundBlocks(Tone(settings) if scene is None else RoomSound(settings, scene),
                           settings)
    if port.lower().endswith(('.wav', '.wave')):
        return SoundBlocks(WavFile(settings), settings)
    return SoundBlocks(PortAudioInput(settings), settings)
