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
Feed drivers with damaged streams, many more than the tests have time for; run it by hand.

    PYTHONPATH=. python3 scripts/fuzz_decoders.py [--examples 100000] [--seed 1] [DRIVER ...]

Each example is a stream of valid frames, foreign frames and noise, damaged in a way that serial
lines know (bits flip, bytes go missing, come twice, change places), cut at random. Checked for
each are: nothing is raised, each byte is in a frame or rejected or pending, memory is bounded, and
the same bytes in one piece give the same samples and counters.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import random
import sys
import time
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
from rt_robot_os.drivers import serial_device
from rt_robot_os.drivers.encoders import nmea
from rt_robot_os.drivers.encoders import witmotion
from rt_robot_os.drivers.registry import DRIVERS

MAX_PENDING = 256


class ScriptedPort:
    """Gives chunks in order."""

    chunks: tuple[bytes, ...] = ()

    def __init__(self, path: str, baud: int) -> None:
        self.bytes_read = 0
        self.dropped_write_bytes = 0
        self._left = list(self.chunks)

    def read(self) -> bytes:
        """Give the next chunk."""
        data = self._left.pop(0) if self._left else b''
        self.bytes_read += len(data)
        return data

    def close(self) -> None:
        """Do nothing."""


class Message(SimpleNamespace):
    """Takes any value under any name; arrays and nested messages come into being when named."""

    def __getattr__(self, name: str) -> Any:
        """Make an array or a nested message."""
        if name.startswith('__'):
            raise AttributeError(name)
        value = np.zeros(9) if name.endswith('covariance') else Message()
        setattr(self, name, value)
        return value


class Publisher:
    """Counts what was published, and keeps a trace of its content."""

    def __init__(self) -> None:
        self.msg = Message()
        self.trace: list[str] = []

    def publish(self, stamp_ns: int) -> None:
        """Note what the message holds."""
        self.trace.append(repr(self.msg))
        self.msg = Message()


def imu_piece(chance: random.Random) -> bytes:
    """Make a WitMotion frame, mostly of an ID that is used."""
    kind = chance.choice((0x51, 0x52, 0x53, 0x54, 0x59, chance.randrange(256)))
    return witmotion.frame(kind, *(chance.choice((0, 0x5155, 0x5555, -1, chance.randint(
        -32768, 32767))) for _ in range(4)))


def gps_piece(chance: random.Random) -> bytes:
    """Make a sentence of fields that are sensible, empty or absurd."""
    good = {'GGA': '123519.00,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,',
            'RMC': '123519.00,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W,A',
            'GST': '123519.00,1,2,3,4,2.0,3.0,4.0',
            'GSA': 'A,3,05,12,30,,,,,,,,,,2.5,1.5,2.0,1'}
    kind = chance.choice(tuple(good))
    fields = good[kind].split(',')
    for _ in range(chance.choice((0, 0, 1, 2, 8))):
        fields[chance.randrange(len(fields))] = chance.choice((
            '', '0', '6', '9', '-1', 'nan', 'inf', '1e400', 'V', 'S', '235960.00', '999999',
            '9' * 40, '.', '123520.00', '\x7f', ' ', '1_0', '4807,038'))
    del fields[chance.randrange(len(fields)) if chance.random() < 0.05 else len(fields):]
    talker = chance.choice(('GP', 'GN', 'GL', 'P', 'PU', ''))
    return nmea.sentence(','.join([talker + kind, *fields])[:220])


def damaged(data: bytes, chance: random.Random) -> bytes:
    """Damage a stream."""
    stream = bytearray(data)
    for _ in range(chance.choice((0, 0, 1, 2, 10))):
        if not stream:
            break
        at = chance.randrange(len(stream))
        size = chance.choice((1, 1, 2, 11, 30))
        action = chance.randrange(5)
        if action == 0:
            stream[at] ^= 1 << chance.randrange(8)
        elif action == 1:
            del stream[at:at + size]
        elif action == 2:
            stream[at:at] = stream[at:at + size]
        elif action == 3:
            stream[at:at + size] = reversed(stream[at:at + size])
        else:
            stream[at:at] = chance.randbytes(size)
    return bytes(stream)


def cut(data: bytes, chance: random.Random) -> tuple[bytes, ...]:
    """Cut a stream into chunks."""
    edges = sorted(chance.randrange(len(data) + 1) for _ in range(chance.randrange(8)))
    return tuple(data[a:b] for a, b in zip([0, *edges], [*edges, len(data)]))


def run(driver: type[Any], chunks: tuple[bytes, ...]) -> tuple[Any, int]:
    """Let a driver read; gives what it published and counted, and what is pending."""
    settings = {f.name: f.default for f in driver.SETTINGS}
    device = driver('fuzz', {**settings, 'port': 'x', 'baud': 0})
    publishers = [Publisher() for _ in device.publications()]
    device.bind(publishers)
    ScriptedPort.chunks = chunks
    device.open()
    for _ in chunks:
        device.read(10**9)
    pending = device.pending_bytes
    return ([p.trace for p in publishers], device.statistics()), pending


def check(driver: type[Any], chunks: tuple[bytes, ...]) -> tuple[int, int]:
    """Check one example; gives the numbers of frames and samples."""
    result, pending = run(driver, chunks)
    statistics = result[1]
    data = b''.join(chunks)
    defaults = {field.name: field.default for field in driver.SETTINGS}
    decoder = driver('fuzz', {**defaults, 'port': 'x'})._decoder
    framed = sum(len(getattr(f, 'sentence', b'x' * 11)) for f in decoder.feed(data))
    problems = [text for text, wrong in (
        ('bytes_read', statistics.bytes_read != len(data)),
        ('sum of bytes', framed + statistics.rejected_bytes + pending != len(data)),
        ('memory', pending >= MAX_PENDING),
        ('frames', statistics.frames != decoder.frames),
        ('split', run(driver, (data,))[0] != result),
    ) if wrong]
    if problems:
        raise ValueError(f'{", ".join(problems)}: {statistics} pending {pending}')
    return statistics.frames, statistics.samples


def fuzz(name: str, examples: int, seed: int) -> bool:
    """Run the examples of a driver and say what came of it."""
    own: Callable[[random.Random], bytes] = {'witmotion': imu_piece, 'nmea': gps_piece}[name]
    driver = DRIVERS.load(name)
    chance = random.Random(seed)
    frames = samples = total = 0
    began = time.monotonic()
    for index in range(examples):
        pieces = [chance.choice((own, own, own, own, imu_piece, gps_piece))(chance)
                  for _ in range(chance.randrange(14))]
        chunks = cut(damaged(b''.join(pieces), chance), chance)
        try:
            found = check(driver, chunks)
        except Exception as error:  # whatever it is, it is what this script looks for
            print(f'{name}: example {index} of seed {seed}: {error!r}\n{chunks!r}')
            return False
        frames, samples, total = frames + found[0], samples + found[1], total + sum(
            map(len, chunks))
    print(f'{name}: {examples} examples, {total} bytes, {frames} frames, {samples} samples, '
          f'nothing wrong ({time.monotonic() - began:.0f} s)')
    return True


def main() -> int:
    """Run the fuzzer."""
    parser = argparse.ArgumentParser(description='Feed drivers with damaged streams.')
    parser.add_argument('drivers', nargs='*', default=['witmotion', 'nmea'])
    parser.add_argument('--examples', type=int, default=100_000)
    parser.add_argument('--seed', type=int, default=1)
    arguments = parser.parse_args()
    with mock.patch.object(serial_device, 'SerialPort', ScriptedPort):
        good = [fuzz(name, arguments.examples, arguments.seed) for name in arguments.drivers]
    return 0 if all(good) else 1


if __name__ == '__main__':
    sys.exit(main())
