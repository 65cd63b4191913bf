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

"""The synchronisation of the system clock, as reported by Linux (adjtimex(2))."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

from rt_robot_os.linux import _libc

STA_UNSYNC = 0x40


@dataclass(frozen=True)
class ClockState:
    """
    The state of the system clock.

    :ivar status: the STA_ bits.
    :ivar max_error_us: maximum error, as the synchronising daemon estimates it.
    :ivar frequency_ppm: frequency correction; positive when the clock is sped up.
    """

    status: int
    max_error_us: int
    frequency_ppm: float

    @property
    def synchronised(self) -> bool:
        """Return whether a daemon synchronises it."""
        return not self.status & STA_UNSYNC


def clock_state() -> ClockState:
    """
    Read the state of the system clock; changes nothing and needs no privileges.

    :raises OSError: a seccomp filter forbids it.
    """
    timex = _libc.Timex()
    _libc.adjtimex(ctypes.byref(timex))
    return ClockState(timex.status, timex.maxerror, timex.freq / 65536)
