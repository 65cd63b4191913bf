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

"""Estimates the clock of the server, so that the robot's time of day need not be right."""

from __future__ import annotations

from collections import deque
from typing import Final

_KEPT: Final = 12


class ServerClock:
    """
    Estimate the offset of the server's time of day from this machine's CLOCK_MONOTONIC.

    The answer with the shortest round trip counts: its error is at most half of it.

    :ivar answers: number of answers so far.
    """

    def __init__(self) -> None:
        self.answers = 0
        self._found: deque[tuple[int, int]] = deque(maxlen=_KEPT)

    def heard(self, asked_ns: int, utc_ns: int, now_ns: int) -> None:
        """
        Take an answer.

        :param asked_ns: time of the request, on CLOCK_MONOTONIC.
        :param utc_ns: the server's time of day.
        :param now_ns: on CLOCK_MONOTONIC.
        """
        if 0 <= asked_ns <= now_ns:
            self.answers += 1
            self._found.append((now_ns - asked_ns, utc_ns - (asked_ns + now_ns) // 2))

    def server_ns(self, stamp_ns: int) -> int:
        """Return the server's time of day at a moment of CLOCK_MONOTONIC; 0: not known yet."""
        return stamp_ns + min(self._found)[1] if self._found else 0
