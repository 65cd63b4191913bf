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

"""The sensor node of paper 2, `produce_sine`: frames with samples of a sine on a slow wire."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
import math
import os
from pathlib import Path
import pty
import struct
import termios
import time
import tty
from typing import Any

import numpy as np

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.linux.process import die_with_parent
from rt_robot_os.linux.timer import Sleeper
from rt_robot_os.tools.bench.case import Samples

MAGNITUDE, CYCLE = 4.0, 180
BAUD = 57_600
_BITS_A_BYTE = 10
_SYNC = b'\xaa\x55'
_BODY = struct.Struct('<If')
FRAME_BYTES = len(_SYNC) + _BODY.size + 1
WIRE_NS = FRAME_BYTES * _BITS_A_BYTE * NS_PER_S // BAUD


def frame(number: int) -> bytes:
    """Make the frame of a sample: two bytes of synchronisation, number, value, check sum."""
    body = _BODY.pack(number, MAGNITUDE * math.sin(2 * math.pi * number / CYCLE))
    return _SYNC + body + bytes((sum(body) & 0xFF,))


class Decoder:
    """Find frames in bytes; what is none is skipped."""

    def __init__(self) -> None:
        self._held = bytearray()

    def feed(self, data: bytes) -> Iterator[tuple[int, float]]:
        """Yield (number, value) of each frame that is complete."""
        held = self._held
        held += data
        while (begin := held.find(_SYNC)) >= 0 and len(held) >= begin + FRAME_BYTES:
            body = held[begin + len(_SYNC):begin + FRAME_BYTES - 1]
            good = sum(body) & 0xFF == held[begin + FRAME_BYTES - 1]
            del held[:begin + (FRAME_BYTES if good else 1)]
            if good:
                yield _BODY.unpack(body)


class Moments:
    """Moments by number of the sample, in a file that two processes share."""

    def __init__(self, path: Path, room: int, new: bool = False) -> None:
        self.times: Any = np.memmap(path, np.int64, 'w+' if new else 'r+', shape=(room,))

    def note(self, number: int) -> None:
        """Note that it happened now; safe in the real-time loop."""
        if number < len(self.times) and not self.times[number]:
            self.times[number] = time.monotonic_ns()

    def taken(self) -> Samples:
        """Return all; 0 where nothing happened."""
        return np.array(self.times)


def produce(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """
    Be the sensor node: make a pty under ``link``, send a frame every ``interval_ns``.

    Byte by byte at the baud rate; the moment of the last byte of each frame goes to ``sent``.
    """
    master, slave = pty.openpty()
    tty.setraw(slave)
    attributes = termios.tcgetattr(slave)
    attributes[4] = attributes[5] = termios.B57600
    termios.tcsetattr(slave, termios.TCSANOW, attributes)
    os.symlink(os.ttyname(slave), arguments['link'])
    sent = Moments(Path(arguments['sent']), arguments['count'])
    sleeper = Sleeper()
    ready()
    begin_ns = time.monotonic_ns() + arguments['delay_ns']
    byte_ns = _BITS_A_BYTE * NS_PER_S // BAUD
    for number in range(arguments['count']):
        at_ns = begin_ns + number * arguments['interval_ns']
        for index, value in enumerate(frame(number)):
            sleeper.sleep_until_ns(at_ns + (index + 1) * byte_ns)
            if index == FRAME_BYTES - 1:
                sent.note(number)
            os.write(master, bytes((value,)))
    while True:
        time.sleep(1.0)


def loads(arguments: Mapping[str, Any], ready: Callable[[], None]) -> None:
    """Be ``count`` processes that compute, always."""
    parent = os.getpid()
    for _ in range(arguments['count'] - 1):
        if not os.fork():
            if not die_with_parent(parent, 9):
                return
            break
    else:
        ready()
    value = 1
    while True:
        value = (value * 31 + 7) & 0xFFFF
