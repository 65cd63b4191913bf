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


"""The bytes of the wheels: ``m <left> <right>`` (mm/s) to them, ``t <ticks> <speed>`` back."""

from __future__ import annotations

from dataclasses import dataclass
import re

from rt_robot_os.devices import FrameDecoder

STOP = b'm 0 0\r'
ORDER = re.compile(rb'm (-?\d+) (-?\d+)\r')
_TELEMETRY = re.compile(rb't (-?\d+) (-?\d+)\r\n').fullmatch


def order(left_mm_s: int, right_mm_s: int) -> bytes:
    """Return the bytes of a speed."""
    return b'm %d %d\r' % (left_mm_s, right_mm_s)


def telemetry(ticks: int, speed_mm_s: int) -> bytes:
    """Return the bytes of a report."""
    return b't %d %d\r\n' % (ticks, speed_mm_s)


@dataclass(frozen=True)
class Report:
    """What the wheels did."""

    ticks: int
    speed_mm_s: int
    end: int


class WheelsDecoder(FrameDecoder[Report]):
    """Turn bytes into reports."""

    STARTS = b't'
    SHORTEST = 7
    LONGEST = 40

    def end(self, buffer: bytes, at: int) -> int:
        found = buffer.find(b'\n', at, at + self.LONGEST)
        if found >= 0:
            return found + 1
        return 0 if len(buffer) - at >= self.LONGEST else len(buffer) + 1

    def frame(self, buffer: bytes, at: int, end: int, arrived: int) -> Report | None:
        match = _TELEMETRY(buffer, at, end)
        return match and Report(int(match[1]), int(match[2]), arrived)
