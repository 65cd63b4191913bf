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
What a board with ros_arduino_bridge did, line by line: orders, answers, state of the motors.

A line is ``SECONDS host->board HEX``, ``SECONDS board->host HEX`` or ``SECONDS plant pwm_l SHARE
pwm_r SHARE ticks_l COUNT ticks_r COUNT``; others are passed over. The orders go to the twin, whose
motors are those of the recording: 3000 counts a second at full voltage, 83 ms to follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.devices.arduino_bridge.simulated import SimulatedArduinoBridge
from rt_robot_os.devices.arduino_bridge.wire import ReplyDecoder
from rt_robot_os.sim.world.drive_base import DriveBase
from rt_robot_os.sim.world_settings import WorldSettings

MOTORS = WorldSettings(motor_lag_s=0.083, coast_s=0.083, motor_speed_rad_s=3000 * math.tau / 1440,
                       motor_acceleration_rad_s2=1e5)
ORDER, ANSWER, PLANT = 'host->board', 'board->host', 'plant'

_START_NS = 100 * NS_PER_S
_AFTER_NS = 50 * NS_PER_MS
_FULL = 255
_PLANT_WORDS, _LINE_WORDS = 10, 3
_LONGEST_S = 86400.0


class Line(NamedTuple):
    """
    One line of the recording.

    :ivar data: bytes of an order or of an answer; empty for the state of the motors.
    :ivar pwm: share of the voltage, left and right.
    :ivar ticks: what the wheels really turned, left and right.
    """

    time_ns: int
    kind: str
    data: bytes = b''
    pwm: tuple[float, float] = (0.0, 0.0)
    ticks: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class Transcript:
    """
    How driver and twin compare with the board.

    :ivar orders: that were given.
    :ivar answers: of the board.
    :ivar unread_bytes: of its answers that the driver's decoder did not understand.
    :ivar unlike: answers of the twin that differ, counts aside; missing and further ones too.
    :ivar counts: answers with counts.
    :ivar counts_off: the largest difference of those.
    :ivar voltage_off: differences of the voltage, as a share of the whole, at each line.
    """

    orders: int
    answers: int
    unread_bytes: int
    unlike: int
    counts: int
    counts_off: int
    voltage_off: Sequence[float]


class Cable:
    """What the twin is plugged into: bytes both ways, without a pty."""

    bytes_sent = bytes_dropped = 0

    def __init__(self) -> None:
        self.to_board = self.from_board = b''

    def plug(self) -> None:
        """Do nothing."""

    def unplug(self) -> None:
        """Do nothing."""

    def read(self) -> bytes:
        """Return what was sent to the board."""
        data, self.to_board = self.to_board, b''
        return data

    def write(self, data: bytes) -> None:
        """Take what the board sends."""
        self.from_board += data


class Board:
    """The twin on a cable, with time in the hand of whoever has it."""

    def __init__(self, **sim: Any) -> None:
        self.cable = Cable()
        port: Any = self.cable
        self.simulated = SimulatedArduinoBridge('simulated', sim, port)
        self.simulated.base = DriveBase(MOTORS)
        self.now_ns = _START_NS
        self.simulated.pump(self.now_ns)

    def run(self, until_ns: int) -> None:
        """Let time pass, a millisecond at a time."""
        while self.now_ns < until_ns:
            self.now_ns = min(self.now_ns + NS_PER_MS, until_ns)
            self.simulated.pump(self.now_ns)

    def run_to(self, time_ns: int) -> None:
        """Let time pass until so long after the start."""
        self.run(_START_NS + time_ns)

    def answers(self, data: bytes, wait_ms: int = 10) -> bytes:
        """Give an order and return what comes within a while."""
        self.cable.from_board = b''
        self.cable.to_board += data
        self.run(self.now_ns + wait_ms * NS_PER_MS)
        return self.cable.from_board


def read(text: str, name: str) -> list[Line]:
    """
    Read a transcript.

    :param name: of the file, for errors.
    :raises ConfigError: a line cannot be understood, or there is no order and answer.
    """
    lines = []
    for number, row in enumerate(text.splitlines(), 1):
        try:
            line = _line(row.split())
        except ValueError as error:
            raise ConfigError([f'{name}: line {number}: {error}']) from error
        if line is not None:
            lines.append(line)
    if not {ORDER, ANSWER} <= {line.kind for line in lines}:
        raise ConfigError([f'{name}: has no lines such as "0.5 {ORDER} 620d" and "0.5 {ANSWER} '
                           '35373630300d0a"'])
    return lines


def _line(words: Sequence[str]) -> Line | None:
    if len(words) < _LINE_WORDS or words[1] not in (ORDER, ANSWER, PLANT):
        return None
    time_s = float(words[0])
    if not 0.0 <= time_s <= _LONGEST_S:
        raise ValueError(f'{words[0]} is no time from 0 to {_LONGEST_S:g} s')
    time_ns = round(time_s * NS_PER_S)
    if words[1] != PLANT:
        return Line(time_ns, words[1], bytes.fromhex(words[2]))
    if len(words) < _PLANT_WORDS:
        raise ValueError('the state of the motors has four numbers')
    return Line(time_ns, PLANT, b'', (float(words[3]), float(words[5])),
                (int(words[7]), int(words[9])))


def compare(lines: Sequence[Line]) -> Transcript:
    """Give the orders to the twin, and read the answers of the board as the driver does."""
    board = Board()
    voltage_off: list[float] = []
    for line in lines:
        board.run_to(line.time_ns)
        if line.kind == ORDER:
            board.cable.to_board += line.data
        elif line.kind == PLANT:
            voltage_off.append(max(abs(ours / _FULL - share) for ours, share in zip(
                board.simulated.pwm, line.pwm)))
    board.run(board.now_ns + _AFTER_NS)
    stream = b''.join(line.data for line in lines if line.kind == ANSWER)
    wanted = stream.splitlines(keepends=True)
    given = board.cable.from_board.splitlines(keepends=True)
    unlike, counts_off = abs(len(wanted) - len(given)), [0]
    for ours, theirs in zip(given, wanted):
        pairs = _counts(ours), _counts(theirs)
        if pairs[0] and pairs[1]:
            counts_off += [abs(one - other) for one, other in zip(*pairs)]
        else:
            unlike += ours != theirs
    return Transcript(
        sum(line.kind == ORDER for line in lines), len(wanted), _unread(stream), unlike,
        len(counts_off) // 2, max(counts_off), voltage_off)


def _counts(answer: bytes) -> tuple[int, ...]:
    """Return the counts of an answer; empty when it has none."""
    words = answer.split()
    try:
        return (int(words[0]), int(words[1])) if len(words) == 2 else ()
    except ValueError:
        return ()


def _unread(stream: bytes) -> int:
    decoder = ReplyDecoder()
    for byte in stream:
        decoder.feed(bytes((byte,)))
    return decoder.rejected_bytes + decoder.pending_bytes
