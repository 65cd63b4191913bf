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

"""The faults of a motor board, as bits of ``motor_faults``, and their texts."""

from __future__ import annotations

from enum import IntFlag
from typing import Final

from rt_robot_os.base.units import NS_PER_S

# How long a momentary fault is published.
SHOWN_NS: Final = NS_PER_S
BOARD_BITS: Final = 16


class MotorFault(IntFlag):
    """
    The bits that all boards share; bits from 16 on are specific to the board.

    :cvar COUNTS_NEW: the counters restarted: the board was reset or replaced. The motion of the
        wheels meanwhile is unknown.
    :cvar COUNTS_MISSING: no counts arrived for 0.4 s of driving; the robot stands until they do.
    :cvar COMMAND_REFUSED: the last command was not finite, or impossibly fast.
    :cvar LINE: bytes were lost between the board and here.
    """

    LEFT_STANDSTILL = 1
    RIGHT_STANDSTILL = 2
    LEFT_WRONG_WAY = 4
    RIGHT_WRONG_WAY = 8
    COUNTS_NEW = 16
    COUNTS_MISSING = 32
    COMMAND_REFUSED = 64
    LINE = 128
    BATTERY_LOW = 256


#: Bits that report something and stop no wheel.
NEWS: Final = MotorFault.COMMAND_REFUSED | MotorFault.LINE | MotorFault.BATTERY_LOW
_HOLDS: Final = {
    MotorFault.LEFT_STANDSTILL: 'the left wheel stands still',
    MotorFault.RIGHT_STANDSTILL: 'the right wheel stands still',
    MotorFault.LEFT_WRONG_WAY: 'the left wheel turns against its command',
    MotorFault.RIGHT_WRONG_WAY: 'the right wheel turns against its command',
    MotorFault.COUNTS_NEW: 'its counters restarted',
    MotorFault.COUNTS_MISSING: 'no counts of its encoders arrive',
}


def hold_reason(bits: int) -> str:
    """
    Return why a board holds the wheels, or has just stopped them; empty if it does not.

    Safe in the real-time loop.

    :param bits: of ``motor_faults``.
    """
    found = ', '.join(text for fault, text in _HOLDS.items() if bits & fault) if bits else ''
    return f'motor board: {found}' if found else ''


class MotorFaults:
    """
    The current faults of a board; safe in the real-time loop.

    :ivar text: the remedy for the fault that stopped the robot; empty without one.
    """

    def __init__(self) -> None:
        self.text = ''
        self._latched = 0
        self._lasting = 0
        self._board = 0
        self._until_ns: dict[MotorFault, int] = {}

    def latch(self, fault: MotorFault, text: str) -> None:
        """Latch a fault that stopped the robot until :meth:`release`."""
        self._latched |= fault
        self.text = text

    @property
    def is_latched(self) -> bool:
        """Return whether a fault holds the robot."""
        return self.text != ''

    def release(self) -> None:
        """Let the robot move again."""
        self._latched = 0
        self.text = ''

    def clear(self) -> None:
        """Clear everything: the port was reopened."""
        self.release()
        self._lasting = self._board = 0
        self._until_ns.clear()

    def flag_briefly(self, fault: MotorFault, now_ns: int) -> None:
        """Publish a momentary fault for a second."""
        self._until_ns[fault] = now_ns + SHOWN_NS

    def set_active(self, fault: MotorFault, is_there: bool) -> None:
        """Publish a fault while it is active."""
        self._lasting = self._lasting | fault if is_there else self._lasting & ~fault

    def is_active(self, fault: MotorFault) -> bool:
        """Return whether a fault set by :meth:`set_active` is active."""
        return bool(self._lasting & fault)

    def set_board_bits(self, bits: int) -> None:
        """Set the bits that the board reports, at most 16."""
        self._board = (bits & 0xFFFF) << BOARD_BITS

    def bits(self, now_ns: int) -> int:
        """Return all of them."""
        bits = self._latched | self._lasting | self._board
        for fault, until_ns in self._until_ns.items():
            if now_ns < until_ns:
                bits |= fault
        return bits
