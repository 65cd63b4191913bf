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
Play a recorded byte log through a pty, with the timing of the device.

The bytes are those of the log. Lines that begin with ``#`` are comments and are skipped; in a
binary log only those at its beginning, because ``#`` may be data later. A log counts as text
although some of its bytes are not, because of noise on the line.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import dropwhile
import os
from pathlib import Path
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.sim.line import LineTiming
from rt_robot_os.sim.pty_port import PtyPort

MAX_LOG_BYTES: Final = 256 * 1024 * 1024
_BITS_PER_BYTE: Final = 10
# A driver discards bytes that arrive while it opens the port; start after that.
_SETTLE_NS: Final = 200 * NS_PER_MS
_LOOK_FOR_READER_NS: Final = 20 * NS_PER_MS
# Unplugging discards bytes that the reader has not read yet.
_LINGER_NS: Final = NS_PER_S
_PIECE: Final = 1024
_TEXT: Final = bytes((*range(0x20, 0x7f), *b'\t\r\n'))
# One byte in this number may be invalid in a text.
_NOISE_MOST: Final = 20
_DAY_NS: Final = 86_400 * NS_PER_S
# Index of the time of day in the sentences that have one.
_TIME_FIELD: Final = {b'GGA': 1, b'RMC': 1, b'GST': 1, b'ZDA': 1, b'GNS': 1, b'GBS': 1, b'GLL': 5}

Piece = tuple[int, bytes]


def load_log(path: str | os.PathLike[str]) -> tuple[bytes, ...]:
    """
    Read a log.

    :return: its lines with their ends, without comments.
    :raises ConfigError: it cannot be read, is too large, or contains nothing to play.
    """
    try:
        size = os.stat(path).st_size
        if size > MAX_LOG_BYTES:
            raise ConfigError([
                f'{path} has {size} bytes: at most {MAX_LOG_BYTES} can be played, so shorten it'])
        data = Path(path).read_bytes()
    except OSError as error:
        raise ConfigError([f'{path} cannot be read ({error.strerror}): check the path']) from error
    lines = data.splitlines(keepends=True)
    kept = ([line for line in lines if not line.startswith(b'#')] if _is_text(data) else
            list(dropwhile(lambda line: line.startswith(b'#'), lines)))
    if not kept:
        raise ConfigError([f'{path} contains nothing to play: choose another log'])
    return tuple(kept)


def at_line_speed(lines: Sequence[bytes]) -> tuple[Piece, ...]:
    """Send all bytes at the speed of the line."""
    data = b''.join(lines)
    return tuple((0, data[i:i + _PIECE]) for i in range(0, len(data), _PIECE))


def by_nmea_time(lines: Sequence[bytes]) -> tuple[Piece, ...]:
    """
    Send each NMEA epoch at its time.

    A sentence without a time, or with the time of the previous one, follows it immediately; for a
    time that goes back (other than at midnight) there is no pause.

    :raises ConfigError: no sentence has a time.
    """
    pieces = []
    first_ns = last_ns = None
    offset_ns = 0
    for line in lines:
        time_ns = _time_of_day_ns(line)
        if time_ns is not None:
            if last_ns is None:
                first_ns = last_ns = time_ns
            step_ns = (time_ns - last_ns) % _DAY_NS
            if step_ns < _DAY_NS // 2:
                offset_ns += step_ns
            last_ns = time_ns
        pieces.append((offset_ns, line))
    if first_ns is None:
        raise ConfigError([
            'no NMEA sentence of the log has a time: play it at the speed of the line instead'])
    return tuple(pieces)


class Player:
    """
    Plays a log through a port; has no clock and no thread, like a simulated device.

    :ivar port: the port of the log.
    :ivar rounds: how often the log has been played to its end.
    """

    def __init__(
        self, pieces: Sequence[Piece], port: PtyPort, baud: int, *, loop: bool = False,
        speed: float = 1.0, wait_for_reader: bool = False,
    ) -> None:
        """
        Store the log; nothing is plugged in yet.

        :param pieces: from :func:`at_line_speed` or :func:`by_nmea_time`.
        :param baud: speed of the line; 0 for no limit, only for a log with times.
        :param speed: factor of the recorded speed, for line and times.
        :raises ConfigError: speed or baud is invalid.
        """
        if not 0.001 <= speed <= 1000:
            raise ConfigError([f'speed {speed:g}: it must be from 0.001 to 1000'])
        if baud < 0 or (loop and baud == 0 and not pieces[-1][0]):
            raise ConfigError([
                f'baud {baud}: a log without times needs the speed of the line, such as 9600'])
        self.port = port
        self.rounds = 0
        self._pieces = pieces
        self._line = LineTiming(max(1, round(baud * speed)) if baud else 0, capacity=65536)
        self._speed = speed
        self._loop = loop
        self._wait = wait_for_reader
        self._at = 0
        self._round_ns: int | None = None
        self._now_ns = 0
        self._reader_ns: int | None = None
        self._last_sent_ns = 0

    @property
    def done(self) -> bool:
        """Return whether everything has been played."""
        return self._at >= len(self._pieces) and not self._line.waiting

    @property
    def over(self) -> bool:
        """Return whether it may be unplugged: all has been played, and read or dropped."""
        return self.done and (self._now_ns - self._last_sent_ns > _LINGER_NS
                              or not self.port.has_reader())

    def pump(self, now_ns: int) -> None:
        """
        Send what is due by now; does not block.

        :raises DeviceError: the port cannot be made.
        """
        self.port.plug()
        self.port.read()
        self._now_ns = now_ns
        if self._round_ns is None:
            if not self._ready(now_ns):
                return
            self._round_ns = now_ns
        while self._push_due(now_ns):
            self._send(now_ns)
        self._send(now_ns)

    def next_event_ns(self) -> int:
        """Return when ``pump`` has to be called next."""
        if self._round_ns is None:
            return self._now_ns + _LOOK_FOR_READER_NS if self._wait and self.port.plugged else 0
        line_ns = self._line.next_ns()
        if line_ns is not None:
            return line_ns
        if self.done:
            return self._now_ns + NS_PER_S
        return self._due_ns()

    def close(self) -> None:
        """Unplug; may be called twice."""
        self.port.unplug()

    def _send(self, now_ns: int) -> None:
        data = self._line.take(now_ns)
        if data:
            self.port.write(data)
            self._last_sent_ns = now_ns

    def _ready(self, now_ns: int) -> bool:
        if not self._wait:
            return True
        if not self.port.has_reader():
            self._reader_ns = None
            return False
        if self._reader_ns is None:
            self._reader_ns = now_ns
        return now_ns - self._reader_ns >= _SETTLE_NS

    def _due_ns(self) -> int:
        return (self._round_ns or 0) + round(self._pieces[self._at][0] / self._speed)

    def _push_due(self, now_ns: int) -> bool:
        """Put the next piece on the line if it is due; return whether there may be more."""
        if self._at >= len(self._pieces):
            return False
        due_ns = self._due_ns()
        if due_ns > now_ns or not self._line.push(self._pieces[self._at][1], due_ns):
            return False
        self._at += 1
        if self._at == len(self._pieces):
            self.rounds += 1
            if self._loop:
                self._at = 0
                self._round_ns = due_ns + self._rest_ns()
        return True

    def _rest_ns(self) -> int:
        """Return the time from the last piece of a round to the first of the next."""
        times = sorted({offset_ns for offset_ns, _ in self._pieces})
        step_ns = times[-1] - times[-2] if len(times) > 1 else 0
        return round(step_ns / self._speed)


def _is_text(data: bytes) -> bool:
    return len(data.translate(None, _TEXT)) * _NOISE_MOST <= len(data)


def _time_of_day_ns(line: bytes) -> int | None:
    # Bytes before the sentence are noise, or another protocol of the same receiver.
    _, dollar, sentence = line.rpartition(b'$')
    fields = sentence.split(b'*')[0].split(b',')
    place = _TIME_FIELD.get(fields[0][2:]) if dollar else None
    if place is None or len(fields) <= place:
        return None
    text = fields[place]
    if len(text) < 6 or not text[:6].isdigit():
        return None
    try:
        seconds = float(text[4:])
    except ValueError:
        return None
    if not 0 <= seconds < 61:
        return None
    return (int(text[:2]) * 3600 + int(text[2:4]) * 60) * NS_PER_S + round(seconds * NS_PER_S)
