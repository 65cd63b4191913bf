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
Microphones and speakers of a call: sound devices, files, a tone, or nothing.

Sound is 48 kHz, mono, 16 bits, in blocks of 20 ms. sounddevice is imported where it is needed.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from collections.abc import Sequence
import json
import math
from pathlib import Path
import threading
import time
from typing import Any
from typing import Final
from typing import Protocol
import wave

import numpy as np
import numpy.typing as npt

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.needs import require

Samples = npt.NDArray[np.int16]

RATE_HZ: Final = 48_000
#: 20 ms, as Opus has them.
BLOCK: Final = 960
FILE: Final = 'file:'
#: Sound buffered for the speaker: the least that avoids gaps, and the limit.
_TARGET: Final = 2 * BLOCK
_MOST: Final = 8 * BLOCK
_DEVICE_BLOCK: Final = BLOCK // 2
_QUEUE: Final = 4
_FILE_BYTES: Final = 200 << 20
_RECORDED_S: Final = 900
_LATE_S: Final = 0.2
_SILENCE_DB: Final = -90.0
_FULL: Final = 32768.0
_SPEECH_DB: Final = -45.0
_HOLD_S: Final = 0.3


class CallMicrophone(Protocol):
    """A source of sound."""

    async def read(self) -> Samples:
        """
        Wait for the next block.

        :raises DeviceError: the device has failed.
        """

    def close(self) -> None:
        """Close it; may be called twice."""


class Playout:
    """
    The jitter buffer of a speaker: no larger than necessary.

    A device reads it in a separate thread.

    :ivar gaps: how often the buffer was empty when sound was due.
    :ivar skipped: samples dropped because too many were buffered.
    """

    def __init__(self) -> None:
        self.gaps = self.skipped = 0
        self._lock = threading.Lock()
        self._waiting: list[Samples] = []
        self._count = 0
        self._plays = False

    def put(self, samples: Samples) -> None:
        """Add sound; beyond the limit the oldest is dropped."""
        with self._lock:
            self._waiting.append(samples)
            self._count += len(samples)
            if self._count > _MOST:
                self.skipped += self._count - _TARGET
                self._take(self._count - _TARGET)

    def pull(self, count: int) -> Samples:
        """Return the next samples; silence where there are none."""
        with self._lock:
            if not self._plays and self._count < _TARGET:
                return np.zeros(count, np.int16)
            found = self._take(min(count, self._count))
            self._plays = len(found) == count
        if len(found) < count:
            self.gaps += 1
            found = np.concatenate([found, np.zeros(count - len(found), np.int16)])
        return found

    def _take(self, count: int) -> Samples:
        taken: list[Samples] = [np.zeros(0, np.int16)]
        self._count -= count
        while count:
            first = self._waiting[0]
            taken.append(first[:count])
            if len(first) > count:
                self._waiting[0] = first[count:]
            else:
                del self._waiting[0]
            count -= len(taken[-1])
        return np.concatenate(taken)


class Ducking:
    """
    Lower the microphone while the speaker plays, so that callers do not hear their echo.

    :param duck_db: attenuation; 0 for none.
    """

    def __init__(self, duck_db: float) -> None:
        self._factor = 10.0 ** (-duck_db / 20)
        self._until_s = 0.0

    def said(self, loud_db: float) -> None:
        """Update the level of the speaker."""
        if loud_db > _SPEECH_DB:
            self._until_s = time.monotonic() + _HOLD_S

    def heard(self, samples: Samples) -> Samples:
        """Return the sound of the microphone, attenuated if necessary."""
        if self._factor >= 1.0 or time.monotonic() >= self._until_s:
            return samples
        quiet: Samples = (samples * self._factor).astype(np.int16)
        return quiet


class PacedMicrophone:
    """
    Generated sound: a block is available when a device would have it, 20 ms after its start.

    :param make: the samples of a block, by its number.
    :param told: is called with a time of day in ns when block 0 begins, here and after a pause.
    """

    def __init__(self, make: Callable[[int], Samples], told: Callable[[int, int], object]) -> None:
        self._make = make
        self._told = told
        self._block = 0
        self._begun_s = 0.0
        self._first = 0

    async def read(self) -> Samples:
        """Wait for the next block."""
        now_s = time.monotonic()
        due_s = self._begun_s + (self._block - self._first + 1) * BLOCK / RATE_HZ
        if now_s - due_s > _LATE_S:  # the first one, or this process was not scheduled
            self._begun_s, self._first = now_s, self._block
            self._told(time.time_ns(), self._block * BLOCK)
            due_s = now_s + BLOCK / RATE_HZ
        await asyncio.sleep(max(0.0, due_s - now_s))
        self._block += 1
        return self._make(self._block - 1)

    def close(self) -> None:
        """Close nothing."""


class DeviceMicrophone:
    """
    A sound device.

    :raises DeviceError: it cannot be opened.
    """

    def __init__(self, name: str) -> None:
        self._loop = asyncio.get_running_loop()
        self._blocks: asyncio.Queue[Samples] = asyncio.Queue(_QUEUE)
        self._stream = _open('RawInputStream', name, BLOCK, self._captured)

    def _captured(self, data: Any, count: int, when: Any, status: Any) -> None:
        block = np.frombuffer(bytes(data), np.int16)
        self._loop.call_soon_threadsafe(self._put, block)

    def _put(self, block: Samples) -> None:
        if self._blocks.full():
            self._blocks.get_nowait()
        self._blocks.put_nowait(block)

    async def read(self) -> Samples:
        """Wait for the next block."""
        try:
            return await asyncio.wait_for(self._blocks.get(), 5.0)
        except (asyncio.TimeoutError, TimeoutError):
            raise DeviceError('the microphone gives no sound any more: check its cable') from None

    def close(self) -> None:
        """Close it; may be called twice."""
        self._stream.close()


class Speaker:
    """A sink of sound; this one discards it."""

    def __init__(self) -> None:
        self.playout = Playout()

    def put(self, samples: Samples) -> None:
        """Take sound."""

    def close(self) -> None:
        """Close it; may be called twice."""


class DeviceSpeaker(Speaker):
    """
    A sound device.

    :raises DeviceError: it cannot be opened.
    """

    def __init__(self, name: str) -> None:
        super().__init__()
        self._stream = _open('RawOutputStream', name, _DEVICE_BLOCK, self._wanted)

    def put(self, samples: Samples) -> None:
        """Take sound."""
        self.playout.put(samples)

    def _wanted(self, data: Any, count: int, when: Any, status: Any) -> None:
        data[:] = self.playout.pull(count).tobytes()

    def close(self) -> None:
        """Close it; may be called twice."""
        self._stream.close()


class FileSpeaker(Speaker):
    """
    A file, written in real time like a device: for tests and measurements.

    :param path: of the WAV; next to it ``PATH.times`` has lines with a time of day in ns and the
        number of the sample that was due then.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._raw = path.open('wb')  # wave fails less cleanly
        self._file = wave.open(self._raw, 'wb')
        self._file.setnchannels(1)
        self._file.setsampwidth(2)
        self._file.setframerate(RATE_HZ)
        self._times = Path(f'{path}.times').open('w')
        self._task = asyncio.ensure_future(self._play())

    def put(self, samples: Samples) -> None:
        """Take sound."""
        self.playout.put(samples)

    async def _play(self) -> None:
        begun_s, blocks = time.monotonic(), 0
        while blocks < _RECORDED_S * RATE_HZ // _DEVICE_BLOCK:
            await asyncio.sleep(max(0.0, begun_s + blocks * _DEVICE_BLOCK / RATE_HZ
                                    - time.monotonic()))
            self._times.write(json.dumps([time.time_ns(), blocks * _DEVICE_BLOCK]) + '\n')
            self._file.writeframes(self.playout.pull(_DEVICE_BLOCK).tobytes())
            blocks += 1

    def close(self) -> None:
        """Close it; may be called twice."""
        self._task.cancel()
        self._file.close()
        self._raw.close()
        self._times.close()


def open_microphone(name: str, told: Callable[[int, int], object]) -> CallMicrophone:
    """
    Open a microphone.

    :param name: of a sound device; ``default``; ``file:PATH`` of a WAV, again and again; ``tone``;
        empty for silence.
    :param told: for generated sound: called with the time of day in ns of a sample, and its
        number.
    :raises DeviceError: it cannot be opened.
    """
    if name == 'tone':
        return PacedMicrophone(tone, told)
    if not name or name == 'none':
        return PacedMicrophone(lambda block: np.zeros(BLOCK, np.int16), told)
    if name.startswith(FILE):
        samples = read_wave(Path(name.removeprefix(FILE)).expanduser())
        places = np.arange(BLOCK)
        return PacedMicrophone(
            lambda block: samples[(block * BLOCK + places) % len(samples)], told)
    return DeviceMicrophone(name)


def open_speaker(name: str) -> Speaker:
    """
    Open a speaker.

    :param name: as of a microphone; ``none`` or empty: sound is discarded.
    :raises DeviceError: it cannot be opened.
    """
    if not name or name in ('none', 'tone'):
        return Speaker()
    if name.startswith(FILE):
        path = Path(name.removeprefix(FILE)).expanduser()
        try:
            return FileSpeaker(path)
        except OSError as error:
            raise DeviceError(f'{path} cannot be written: {error.strerror or error}') from error
    return DeviceSpeaker(name)


def tone(block: int) -> Samples:
    """Return a block of a soft beep of 0.2 s each two seconds: what a simulated robot says."""
    at = block * BLOCK + np.arange(BLOCK)
    sounds = (at % (2 * RATE_HZ)) < RATE_HZ // 5
    found: Samples = (2000 * sounds * np.sin(2 * np.pi * 440 * at / RATE_HZ)).astype(np.int16)
    return found


def read_wave(path: Path) -> Samples:
    """
    Read a WAV of 16 bits; channels are mixed to one, the rate is converted.

    :raises DeviceError: it is not such a file.
    """
    try:
        if path.stat().st_size > _FILE_BYTES:
            raise DeviceError(f'{path} is too long for a call')
        with path.open('rb') as raw, wave.open(raw, 'rb') as file:
            if file.getsampwidth() != 2 or not file.getnframes():
                raise DeviceError(f'{path} must be a WAV of 16 bits that is not empty')
            rate_hz, channels = file.getframerate(), file.getnchannels()
            found = np.frombuffer(file.readframes(file.getnframes()), '<i2')
    except (OSError, EOFError, wave.Error) as error:
        raise DeviceError(f'{path} is not a readable WAV: {error}') from error
    mono = found.reshape(-1, channels).mean(axis=1)
    count = max(BLOCK, round(len(mono) * RATE_HZ / rate_hz))
    at = np.arange(count) * rate_hz / RATE_HZ
    samples: Samples = np.interp(at, np.arange(len(mono)), mono).astype(np.int16)
    return samples


def level_db(samples: Sequence[int] | Samples) -> float:
    """Return how loud sound is, in dB below full scale."""
    values = np.asarray(samples, np.float32)
    power = float(np.mean(values * values)) if len(values) else 0.0
    return max(_SILENCE_DB, 10 * math.log10(power / _FULL**2)) if power > 0 else _SILENCE_DB


def _open(kind: str, name: str, block: int, callback: Callable[..., None]) -> Any:
    require('a sound device', 'sounddevice', error=DeviceError)
    try:
        import sounddevice
    except OSError as error:
        raise DeviceError(f'{error}: sudo apt install libportaudio2') from error
    device = None if name == 'default' else int(name) if name.isdigit() else name
    try:
        stream = getattr(sounddevice, kind)(
            samplerate=RATE_HZ, blocksize=block, device=device, channels=1, dtype='int16',
            latency='low', callback=callback)
        stream.start()
    except (sounddevice.PortAudioError, ValueError) as error:
        raise DeviceError(f'sound device {name!r}: {error}; python3 -m sounddevice lists what '
                          'there is') from error
    return stream
