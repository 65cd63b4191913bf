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

"""Whether the system clock is synchronised, as Linux says (adjtimex(2))."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

from rt_robot_os.linux import _libc

STA_UNSYNC = 0x40


@dataclass(frozen=True)
class ClockState:
    """
    How the time of day is kept.

    :ivar status: the STA_ bits.
    :ivar max_error_us: how far it may be off, as the daemon that synchronises it says.
    :ivar frequency_ppm: by how much it is corrected; positive when it is made faster.
    """

    status: int
    max_error_us: int
    frequency_ppm: float

    @property
    def synchronised(self) -> bool:
        """Whether a daemon synchronises it."""
        return not self.status & STA_UNSYNC


def clock_state() -> ClockState:
    """
    Ask how the time of day is kept; changes nothing, and needs no rights.

    :raises OSError: a seccomp filter forbids it.
    """
    timex = _libc.Timex()
    _libc.adjtimex(ctypes.byref(timex))
    return ClockState(timex.status, timex.maxerror, timex.freq / 65536)
