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
Tickets, which give the robot the age of a remote command.

The robot issues one with each heartbeat, and a command contains the newest one that its sender has
received. Its age is measured with the robot's own monotonic clock only: clocks are not compared,
and setting a clock makes no command younger. A command that was delayed anywhere, in a queue, a
socket or a stopped process, arrives with an old ticket.
"""

from __future__ import annotations

from collections import OrderedDict
import secrets
from typing import Final

from rt_robot_os.base.units import NS_PER_S

# Stored longer than they are valid: a late ticket still measures how slow the link is.
_KEPT_NS: Final = 5 * NS_PER_S
_MOST: Final = 256
# JavaScript represents it exactly, with room for years of heartbeats above it.
_BITS: Final = 48


class Tickets:
    """The tickets issued in the last seconds."""

    def __init__(self) -> None:
        # Not from 1: a command delayed across a restart could match a new number.
        self._number = secrets.randbits(_BITS)
        self._given: OrderedDict[int, int] = OrderedDict()

    def give(self, now_ns: int) -> int:
        """Return a new one; ``now_ns`` is on CLOCK_MONOTONIC."""
        self._number += 1
        self._given[self._number] = now_ns
        while len(self._given) > _MOST or now_ns - next(iter(self._given.values())) > _KEPT_NS:
            self._given.popitem(last=False)
        return self._number

    def given_ns(self, number: int) -> int | None:
        """Return when a ticket was issued; None when it is unknown or expired."""
        return self._given.get(number)

    def forget(self) -> None:
        """Make all invalid."""
        self._given.clear()
