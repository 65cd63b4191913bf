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

"""Monitor whether a wheel follows its command, by its encoder."""

from __future__ import annotations

from enum import Enum
from typing import Final

from rt_robot_os.base.units import NS_PER_S

# Share of the commanded distance below which it stands.
_SOME: Final = 0.02
# Commanded distance before it is judged, as a multiple of the noise.
_ENOUGH: Final = 4.0
# Share of the commanded distance that it must move backwards.
_BACKWARDS: Final = 0.2


class WheelState(Enum):
    """
    The state of a wheel.

    STANDSTILL: it is commanded to turn and its encoder stands still. WRONG_WAY: it turns against
    its command, and gets no slower.
    """

    RIGHT = 'right'
    STANDSTILL = 'standstill'
    WRONG_WAY = 'wrong way'


class WheelWatch:
    """
    Watches one wheel; safe in the real-time loop.

    An encoder with a broken channel alternates between two counts: that is a standstill as well.
    """

    def __init__(self, *, patience_s: float, slowest_rad_s: float, noise_rad: float) -> None:
        """
        Set the limits.

        :param patience_s: how long a wheel may deviate.
        :param slowest_rad_s: commands below it are not watched: friction may hold the wheel.
        :param noise_rad: noise of the encoder of a standing wheel.
        """
        self._patience_ns = round(patience_s * NS_PER_S)
        self._slowest_rad_s = slowest_rad_s
        self._noise_rad = noise_rad
        self._command_rad_s = 0.0
        self._looked_ns = 0
        self._still_at_rad = 0.0
        self._still_ns = 0
        self._should_rad = 0.0
        # Position half a patience ago, and the distance in the half before.
        self._half_at_rad = 0.0
        self._half_ns = 0
        self._gone_rad: float | None = None

    def update(self, command_rad_s: float, position_rad: float, now_ns: int) -> WheelState:
        """
        Compare a wheel with its command.

        :param command_rad_s: the commanded speed; 0: it is not monitored.
        :param position_rad: the angle of its encoder.
        """
        before, self._command_rad_s = self._command_rad_s, command_rad_s
        # Its motion between two calls is unknown after a pause.
        unseen = now_ns - self._looked_ns >= self._patience_ns
        if unseen or abs(command_rad_s) < self._slowest_rad_s or command_rad_s * before <= 0.0:
            self._start(position_rad, now_ns)
            return WheelState.RIGHT
        self._should_rad += abs(before) * (now_ns - self._looked_ns) / NS_PER_S
        self._looked_ns = now_ns
        if self._stands_still(position_rad, now_ns):
            self._start(position_rad, now_ns)
            return WheelState.STANDSTILL
        if self._goes_back(command_rad_s, position_rad, now_ns):
            self._start(position_rad, now_ns)
            return WheelState.WRONG_WAY
        return WheelState.RIGHT

    def _start(self, position_rad: float, now_ns: int) -> None:
        self._looked_ns = self._still_ns = self._half_ns = now_ns
        self._still_at_rad = self._half_at_rad = position_rad
        self._should_rad = 0.0
        self._gone_rad = None

    def _stands_still(self, position_rad: float, now_ns: int) -> bool:
        moved_rad = abs(position_rad - self._still_at_rad)
        if moved_rad > max(self._noise_rad, _SOME * self._should_rad):
            self._still_at_rad, self._still_ns = position_rad, now_ns
            self._should_rad = 0.0
            return False
        return (now_ns - self._still_ns >= self._patience_ns
                and self._should_rad >= _ENOUGH * self._noise_rad)

    def _goes_back(self, command_rad_s: float, position_rad: float, now_ns: int) -> bool:
        took_ns = now_ns - self._half_ns
        if 2 * took_ns < self._patience_ns:
            return False
        gone_rad = (position_rad - self._half_at_rad) * (1.0 if command_rad_s > 0.0 else -1.0)
        before_rad, self._gone_rad = self._gone_rad, gone_rad
        self._half_at_rad, self._half_ns = position_rad, now_ns
        enough_rad = _BACKWARDS * abs(command_rad_s) * took_ns / NS_PER_S + self._noise_rad
        return before_rad is not None and gone_rad < -enough_rad and gone_rad <= before_rad < 0.0
