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
import dataclasses
import random
import sys
import time
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
from rt_robot_os.devices.bno055 import wire as bno055
from rt_robot_os.devices.hokuyo import wire as scip
from rt_robot_os.devices.maxbotix import wire as maxbotix
from rt_robot_os.devices.nmea import wire as nmea
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.serial.device import SerialDevice
from rt_robot_os.devices.sharp import wire as sharp
from rt_robot_os.devices.stargazer import wire as stargazer
from rt_robot_os.devices.ublox import wire as ubx
from rt_robot_os.devices.witmotion import wire as witmotion
from rt_robot_os.devices.xsens import wire as xbus
from rt_robot_os.features.health.oximeter import wire as oximeter
from rt_robot_os.features.wsn.packets import framing
from rt_robot_os.features.wsn.packets.multihop_lqi import MultihopMsg
from rt_robot_os.features.wsn.packets.paper import BeaconMsg
from rt_robot_os.features.wsn.packets.paper import DataMsg
from rt_robot_os.features.wsn.packets.serial_am import SerialAm
from rt_robot_os.features.wsn.packets.tos_msg import TelosMsg

MAX_PENDING = {'hokuyo': 6001, 'sink': 700, 'ublox': 3000, 'xsens': 2100}
SIZES = {'ranges': 682, 'covariance': 36}


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

    def write(self, data: bytes) -> None:
        """Take what the driver sends."""

    def close(self) -> None:
        """Do nothing."""


class Message(SimpleNamespace):
    """Takes any value under any name; arrays and nested messages come into being when named."""

    def __getattr__(self, name: str) -> Any:
        """Make an array or a nested message."""
        if name.startswith('__'):
            raise AttributeError(name)
        value = np.zeros(SIZES.get(name, 9)) if name.endswith(
            ('covariance', 'ranges')) else Message()
        setattr(self, name, value)
        return value


class Publisher:
    """Counts what was published, and keeps a trace of its content."""

    def __init__(self) -> None:
        self.msg = Message()
        self.trace: list[str] = []

    def fill(self, data: memoryview) -> None:
        """Take the bytes of a message."""
        self.msg.data = bytes(data)

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


def xsens_piece(chance: random.Random) -> bytes:
    """Make a measurement of items that are sensible or not, or an answer."""
    if chance.random() < 0.1:
        return xbus.message(chance.randrange(256), chance.randbytes(chance.randrange(300)))
    kinds = (0x0810, 0x1020, 0x1060, 0x2010, 0x2030, 0x4020, 0x8020, 0xC020, 0xE020, 0x5040)
    items = []
    for _ in range(chance.randrange(6)):
        precision = chance.choice((0, 0, 0, 1, 2, 3))
        count = chance.choice((1, 3, 3, 4))
        identifier = chance.choice(kinds) | precision | chance.choice((0, 0, 4, 8))
        content = xbus.reals([chance.uniform(-2, 2) for _ in range(count)], precision)
        items.append((identifier, chance.choice((content, chance.randbytes(len(content))))))
    return xbus.mtdata2(items)


def bno055_piece(chance: random.Random) -> bytes:
    """Make an answer."""
    part = chance.random()
    if part < 0.2:
        return bno055.data_answer(bytes((chance.choice((0xA0, 0xA0, 0x55)),)))
    if part < 0.5:
        return bno055.status_answer(chance.choice((1, 1, 1, 7, chance.randrange(256))))
    vector = [chance.uniform(-20, 20) for _ in range(3)]
    return bno055.data_answer(bno055.block(
        vector, [v * 1e-6 for v in vector], vector, chance.choice((
            (1, 0, 0, 0), (0.6, 0, 0.8, 0), (0, 0, 0, 0), (1, 1, 1, 1))), vector))


def ublox_piece(chance: random.Random) -> bytes:
    """Make a NAV-PVT of anything, another message, or a sentence."""
    part = chance.random()
    if part < 0.6:
        return ubx.message(1, 7, chance.randbytes(chance.choice((84, 92, 92, 92))))
    if part < 0.8:
        return gps_piece(chance)
    return ubx.message(chance.choice((1, 5, 6, 10)), chance.randrange(256),
                       chance.randbytes(chance.randrange(40)))


def maxbotix_piece(chance: random.Random) -> bytes:
    """Make a reading."""
    return chance.choice((maxbotix.reading(chance.randrange(10000)), b'R%03d\r' % (
        chance.randrange(1000)), b'R%04d P%d\r' % (chance.randrange(10000), chance.randrange(2))))


def sharp_piece(chance: random.Random) -> bytes:
    """Make a reading of some channel."""
    return sharp.adc(chance.choice((0, 0, 1)), chance.choice((0, 400, 3000, 9999)))


def sink_piece(chance: random.Random) -> bytes:
    """Make a frame of a sensor network: data, beacons, acknowledgements, and what lies."""
    origin, number = chance.choice((0, 1, 2, 0xFFFF)), chance.choice((0, 1, 2, 0xFFFFFFFF))
    body = chance.choice((
        DataMsg(0, 5, 3, number, chance.choice((0, 5, 10, 0xFFFF)), 9).pack(),
        BeaconMsg(3, chance.choice((0, 300)), 1).pack(), chance.randbytes(chance.randrange(20))))
    header = MultihopMsg(chance.randrange(4), origin, 0, number & 0x7FFF, 2, body).pack()
    packet = bytearray(chance.choice((
        TelosMsg(0x7E, chance.choice((17, 250, 99)), header, chance.choice((0x7D, 9))).pack(),
        SerialAm(0xFFFF, origin, chance.randrange(0x70, 0x76), header, 0x22).pack())))
    if chance.random() < 0.2:
        packet[chance.randrange(len(packet))] = chance.randrange(256)
    if chance.random() < 0.1:
        del packet[chance.randrange(len(packet)):]
    token = chance.choice((0x26, 0x27, 0x7E))
    return chance.choice((
        *3 * (framing.frame(0x42, bytes(packet)),),
        framing.frame(0x41, bytes((token,)) + bytes(packet)),
        framing.frame(0x40, bytes((token,))), framing.frame(0x45, bytes(packet)), b'\x7e'))


def stargazer_piece(chance: random.Random) -> bytes:
    """Make a sentence of each form, of marks that agree and that do not."""
    marks = [stargazer.CeilingMark(chance.choice((1, 2, 24706)), chance.uniform(-180, 180),
                                   chance.uniform(-200, 200), chance.uniform(-200, 200), 220.0)
             for _ in range(chance.randrange(1, 5))]
    return chance.choice((
        stargazer.multi(marks), stargazer.single(marks[0], chance.choice('IFZ')),
        stargazer.old(marks[0]), stargazer.sentence('*', 'DeadZone'),
        stargazer.sentence(chance.choice('#@!$^*'), chance.choice((
            'CalcStop', 'ParameterUpdate', 'I+1|2', '0', '9|1', 'I1|1|1|1|1|1')))))


def oximeter_piece(chance: random.Random) -> bytes:
    """Make a packet of any statuses and values, or some of its frames."""
    statuses = [chance.choice((0, 0, 0, 2, 6, chance.randrange(128))) for _ in range(25)]
    data = oximeter.packet(
        chance.choice((7, 7, 7, 2)), statuses, [chance.randrange(65536) for _ in range(25)],
        oximeter.float_bytes(chance.choice((72, 511, chance.randrange(512))),
                             chance.choice((97, 127, chance.randrange(128))),
                             timer=chance.randrange(oximeter.TIMER_TURN)))
    return data if chance.random() < 0.8 else data[5 * chance.randrange(25):]


def hokuyo_piece(chance: random.Random) -> bytes:
    """Make an answer to the set-up, or a scan."""
    echo = scip.scan_command(44, 725)
    part = chance.random()
    if part < 0.3:
        return chance.choice((scip.answer(b'QT'), scip.answer(echo), scip.answer(echo, 4)))
    if part < 0.45:
        return scip.parameters(
            first_step=44, last_step=725, steps_per_turn=1024, front_step=384, minimum_mm=20,
            maximum_mm=5600, rpm=600, model='URG-04LX')
    size = chance.choice((682, 682, 681, chance.randrange(100)))
    return scip.scan(echo, chance.randrange(1 << 24), [
        chance.choice((0, 7, 1000, 262143)) for _ in range(size)])


PIECES: dict[str, Callable[[random.Random], bytes]] = {
    'bno055': bno055_piece, 'hokuyo': hokuyo_piece, 'maxbotix': maxbotix_piece, 'nmea': gps_piece,
    'oximeter': oximeter_piece, 'sharp': sharp_piece, 'sink': sink_piece,
    'stargazer': stargazer_piece, 'ublox': ublox_piece,
    'witmotion': imu_piece, 'xsens': xsens_piece}

# What answers the set-up, so that samples are published at all.
BEGINNINGS = {
    'bno055': bno055.data_answer(b'\xa0') + 6 * bno055.status_answer(1),
    'hokuyo': scip.answer(b'QT') + scip.answer(b'PP') + scip.answer(scip.scan_command(44, 725)),
}


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
        while device.waiting_bytes:
            device.read(10**9)
    pending = device.pending_bytes
    # How much waited for a later job depends on the cuts, as it should.
    counters = dataclasses.replace(device.statistics(), deferred_bytes=0)
    return ([p.trace for p in publishers], counters), pending


def check(driver: type[Any], chunks: tuple[bytes, ...], most: int) -> tuple[int, int]:
    """Check one example; gives the numbers of frames and samples."""
    result, pending = run(driver, chunks)
    statistics = result[1]
    data = b''.join(chunks)
    defaults = {field.name: field.default for field in driver.SETTINGS}
    decoder = driver('fuzz', {**defaults, 'port': 'x'})._decoder
    if isinstance(decoder, framing.FrameReader):
        decoder = framing.FrameReader()  # that of a sink keeps acknowledgements for itself
    framed = sum(map(size_of, decoder.feed(data)))
    problems = [text for text, wrong in (
        ('bytes_read', statistics.bytes_read != len(data)),
        ('sum of bytes', framed + statistics.rejected_bytes + pending != len(data)),
        ('memory', pending >= most),
        ('frames', statistics.frames != decoder.frames),
        ('split', run(driver, (data,))[0] != result),
    ) if wrong]
    if problems:
        raise ValueError(f'{", ".join(problems)}: {statistics} pending {pending}')
    return statistics.frames, statistics.samples


def size_of(frame: Any) -> int:
    """Give the number of bytes of a frame."""
    size = getattr(frame, 'size', None)
    if isinstance(size, int):
        return size
    if hasattr(frame, 'sentence'):
        return len(frame.sentence)
    return 2 + len(frame.data) if hasattr(frame, 'data') else 11


def fuzz(name: str, examples: int, seed: int) -> bool:
    """Run the examples of a driver and say what came of it."""
    own = PIECES[name]
    most = MAX_PENDING.get(name, 256)
    driver = DRIVERS.load(name)
    chance = random.Random(seed)
    frames = samples = total = 0
    began = time.monotonic()
    for index in range(examples):
        pieces = [chance.choice((own, own, own, own, imu_piece, gps_piece))(chance)
                  for _ in range(chance.randrange(14))]
        if chance.random() < 0.7:
            pieces.insert(0, BEGINNINGS.get(name, b''))
        chunks = cut(damaged(b''.join(pieces), chance), chance)
        try:
            found = check(driver, chunks, most)
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
    parser.add_argument('drivers', nargs='*', default=sorted(PIECES), help='by default all')
    parser.add_argument('--examples', type=int, default=100_000)
    parser.add_argument('--seed', type=int, default=1)
    arguments = parser.parse_args()
    with mock.patch.object(SerialDevice, 'make_port', ScriptedPort):
        good = [fuzz(name, arguments.examples, arguments.seed) for name in arguments.drivers]
    return 0 if all(good) else 1


if __name__ == '__main__':
    sys.exit(main())
