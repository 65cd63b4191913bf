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
SCIP 2.0, the protocol of Hokuyo laser scanners: lines of text, an empty line ends an answer.

An answer is the echo of the command, the status, and the requested data, each line except the echo
with a sum at its end: the low six bits of the sum of its characters, plus 0x30; the semicolon that
ends a line of information does not count. Numbers are encoded as six bits per character, plus
0x30. A scan (command MD, status 99) has a time stamp and then its distances in mm, three
characters each, in lines of 64 characters.

Commands, and the answers of simulated and recorded scanners, are encoded here as well.
"""

from __future__ import annotations

from collections.abc import Iterable
import re
from typing import Final
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rt_robot_os.devices.framing import StreamDecoder


END: Final = b'\n\n'
SCAN: Final = 99
OK: Final = 0
# The longest answer: a scan of 1440 steps, those of the finest device.
MAX_ANSWER: Final = 6000
LINE_CHARACTERS: Final = 64

_BASE: Final = 0x30
_BITS: Final = 0x3F
# With sum and line end.
_LINE: Final = LINE_CHARACTERS + 2
# An echo of two characters, a status with its sum, and three line ends.
_SHORTEST: Final = 8
_NO_LINE_END: Final = re.compile(rb'[^\n]|\Z').search
_PRINTED: Final = re.compile(rb'[ -~]{2,}').fullmatch
_DIGITS: Final = re.compile(rb'[0-o]{4}').fullmatch
_ECHO: Final = re.compile(rb'(?:M[DS]\d{13}|[A-Z]{2}|SCIP2\.0)(?:;[ -~]{0,16})?$').search

Steps = npt.NDArray[np.int32]


class ScipFrame(NamedTuple):
    """
    One answer with valid sums.

    :ivar echo: the command.
    :ivar status: 0 done, 99 a scan, others errors.
    :ivar lines: of an answer that is not a scan, without the sums.
    :ivar distances_mm: of a scan.
    :ivar time_ms: of a scan, by the clock of the device, 24 bits.
    :ivar size: bytes of the answer.
    :ivar end: index just after its last byte in the chunk that completed it.
    """

    echo: bytes
    status: int
    lines: tuple[bytes, ...]
    distances_mm: Steps | None
    time_ms: int
    size: int
    end: int

    @property
    def command(self) -> bytes:
        """Return the two characters of the command."""
        return self.echo[:2]


class ScipDecoder(StreamDecoder[ScipFrame]):
    """
    Find the answers in a stream of bytes; safe in the loop, keeps at most 6000 bytes.

    An answer is known only by its end, so the decoder looks for ends and reads backwards.
    """

    def feed(self, data: bytes) -> list[ScipFrame]:
        """
        Decode the next bytes of the stream.

        :return: the answers that they complete, in order; independent of how the stream is split.
        """
        held = len(self._pending)
        buffer = self._pending + data
        frames: list[ScipFrame] = []
        used = 0
        at = 0 if held else _past_line_ends(buffer, 0)
        # The end may be split; earlier bytes have been searched already.
        look = max(held - 1, at)
        while True:
            found = buffer.find(END, look)
            if found < 0:
                break
            end = found + len(END)
            if end - at >= _SHORTEST:
                frame = self._answer(buffer[max(at, end - MAX_ANSWER):end], end - held)
                if frame is not None:
                    frames.append(frame)
                    used += frame.size
            at = look = _past_line_ends(buffer, end)
        # Of more bytes than an answer only the last can still be one.
        start = max(at, len(buffer) - MAX_ANSWER)
        self._pending = buffer[start:]
        self.rejected_bytes += start - used
        self.frames += len(frames)
        return frames

    def _answer(self, block: bytes, end: int) -> ScipFrame | None:
        """Decode the lines before an empty one; garbage may precede the echo."""
        newline = block.find(b'\n')
        match = _ECHO(block[:newline])
        while match is None:
            # The end of another answer, or a part of one.
            begin = newline + 1
            newline = block.find(b'\n', begin)
            if newline < 0 or newline >= len(block) - 1:
                return None
            match = _ECHO(block[begin:newline])
        echo = match[0]
        status = block[newline + 1:newline + 4]
        if block[newline + 4:newline + 5] != b'\n' or not _sums_up(status) \
                or not status[:2].isalnum():
            self.rejected_frames += 1
            return None
        size = len(block) - newline + len(echo)
        return self._content(echo, status[:2], block[newline + 5:-1], size, end)

    def _content(
        self, echo: bytes, status: bytes, rest: bytes, size: int, end: int,
    ) -> ScipFrame | None:
        number = int(status) if status.isdigit() else int.from_bytes(status, 'big')
        if number != SCAN or echo[:2] != b'MD':
            lines = tuple(rest.split(b'\n')[:-1])
            if all(map(_informs, lines)):
                return ScipFrame(echo, number, tuple(line[:-1] for line in lines), None, 0, size,
                                 end)
        elif len(rest) >= 6 and rest[5:6] == b'\n' and _sums_up(rest[:5]) and _DIGITS(rest[:4]):
            distances = _distances(rest[6:])
            if distances is not None:
                return ScipFrame(echo, number, (), distances, _number(rest[:4]), size, end)
        self.rejected_frames += 1
        return None


def _past_line_ends(buffer: bytes, at: int) -> int:
    """Skip empty lines, which are not part of the answer behind them."""
    match = _NO_LINE_END(buffer, at)
    return match.start() if match else at


def _sums_up(line: bytes) -> bool:
    return len(line) > 1 and checksum(line[:-1]) == line[-1]


def _informs(line: bytes) -> bool:
    # The sum does not cover the highest bits.
    return _PRINTED(line) is not None and checksum(line[:-1].removesuffix(b';')) == line[-1]


def checksum(content: bytes) -> int:
    """Return the character at the end of a line."""
    return (sum(content) & _BITS) + _BASE


def _number(characters: bytes) -> int:
    result = 0
    for character in characters:
        result = result << 6 | (character - _BASE) & _BITS
    return result


def _distances(content: bytes) -> Steps | None:
    """Join lines of 64 characters and a shorter one; None if a sum or a length is wrong."""
    full = len(content) // _LINE
    last = content[full * _LINE:]
    characters = np.frombuffer(content, np.uint8)
    lines = characters[:full * _LINE].reshape(full, _LINE)
    data = lines[:, :LINE_CHARACTERS]
    sums = (data.sum(axis=1, dtype=np.int32) & _BITS) + _BASE
    if not (np.array_equal(sums, lines[:, -2]) and np.all(lines[:, -1] == 10)):
        return None
    if last and (last[-1:] != b'\n' or not _sums_up(last[:-1])):
        return None
    numbers = np.concatenate((data.reshape(-1), characters[full * _LINE:-2])) if last else (
        data.reshape(-1))
    if numbers.size % 3:
        return None
    digits = numbers.astype(np.int32) - _BASE
    if numbers.size and (digits.min() < 0 or digits.max() > _BITS):
        return None
    result: Steps = digits[0::3] << 12 | digits[1::3] << 6 | digits[2::3]
    return result


# ---- encoding ---------------------------------------------------------------------------------

QUIT: Final = b'QT'
PARAMETERS: Final = b'PP'
_LARGEST: Final = (1 << 18) - 1


def command(text: bytes) -> bytes:
    """Make a command."""
    return text + b'\n'


def scan_command(first_step: int, last_step: int) -> bytes:
    """Encode MD: every scan, every step, without end."""
    return b'MD%04d%04d00000' % (first_step, last_step)


def answer(echo: bytes, status: int = 0, lines: Iterable[bytes] = ()) -> bytes:
    """Encode an answer of lines of data."""
    return b''.join((echo, b'\n', _line(b'%02d' % status), *map(_line, lines), b'\n'))


def parameters(
    *, first_step: int, last_step: int, steps_per_turn: int, front_step: int, minimum_mm: int,
    maximum_mm: int, rpm: int, model: str,
) -> bytes:
    """Make the answer to PP."""
    values = {'MODL': model, 'DMIN': minimum_mm, 'DMAX': maximum_mm, 'ARES': steps_per_turn,
              'AMIN': first_step, 'AMAX': last_step, 'AFRT': front_step, 'SCAN': rpm}
    lines = [f'{key}:{value}'.encode() for key, value in values.items()]
    # The semicolon before the sum is not included.
    content = b''.join(line + b';' + bytes((checksum(line), 10)) for line in lines)
    return PARAMETERS + b'\n' + _line(b'00') + content + b'\n'


def scan(echo: bytes, time_ms: int, distances_mm: Iterable[int]) -> bytes:
    """Encode a scan; distances are limited to 18 bits."""
    data = b''.join(_characters(min(max(mm, 0), _LARGEST), 3) for mm in distances_mm)
    lines = (data[i:i + LINE_CHARACTERS] for i in range(0, len(data), LINE_CHARACTERS))
    return answer(echo, SCAN, (_characters(time_ms & 0xFFFFFF, 4), *lines))


def _line(content: bytes) -> bytes:
    return content + bytes((checksum(content), 10))


def _characters(number: int, count: int) -> bytes:
    return bytes((number >> 6 * (count - 1 - i) & 0x3F) + _BASE for i in range(count))


def is_scip(data: bytes) -> bool:
    """Return whether some bytes are part of a scan, which is longer than them."""
    lines = [line for line in data.split(b'\n')[1:-1] if len(line) == LINE_CHARACTERS + 1]
    return len(lines) > 2 and all(checksum(line[:-1]) == line[-1] for line in lines)
