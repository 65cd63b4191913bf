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
Turn on the spot while the global search is ambiguous.

The commands pass the multiplexer and the guard like those of ROS: an operator has priority, an
obstacle stops the turn, and it ends with the process.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Final

from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.engine import Engine
from rt_robot_os.features.mapping.messages import turn_message
from rt_robot_os.features.mapping.settings import MappingSettings

#: Period of the commands: a source without one for 0.1 s loses control.
_PERIOD_NS: Final = NS_PER_S // 30
#: One turn, with a margin for wheels that slip; after it nothing new is in view.
_TURN_RAD: Final = 1.15 * math.tau


class RecoverySpin:
    """
    A turn that is made when it is needed.

    :param publish: publishes a message on a topic.
    :param has: returns whether a topic has subscribers.
    """

    def __init__(self, settings: MappingSettings, engine: Engine,
                 publish: Callable[[str, bytes], bool], has: Callable[[str], bool]) -> None:
        self._topic, self._rate_rad_s = settings.find_topic, settings.find_turn_rad_s
        self._is_allowed = settings.find_turns
        self._engine, self._publish, self._has = engine, publish, has
        self._turned_rad = 0.0
        self._last_ns = 0
        self._is_turning = False

    @property
    def state(self) -> str:
        """Return its state, to be appended to that of mapping; empty: it does nothing."""
        if self._is_turning:
            return 'turning to look round'
        return 'looked round: drive it elsewhere' if self._is_done else ''

    @property
    def _is_done(self) -> bool:
        return self._turned_rad >= _TURN_RAD

    def step(self, now_ns: int, may_drive: bool) -> None:
        """
        Continue or end the turn.

        :param may_drive: an operator has started exploration.
        """
        engine = self._engine
        if not engine.is_searching:
            self._turned_rad = 0.0
        if not (engine.is_ambiguous and (may_drive or self._is_allowed) and not self._is_done
                and self._topic and self._has(self._topic)):
            if self._is_turning:
                self._is_turning = False
                self._publish(self._topic, turn_message(0.0))
            return
        passed_ns = now_ns - self._last_ns
        if passed_ns < _PERIOD_NS:
            return
        if self._is_turning:
            self._turned_rad += self._rate_rad_s * min(passed_ns / NS_PER_S, 0.1)
        self._is_turning, self._last_ns = True, now_ns
        self._publish(self._topic, turn_message(self._rate_rad_s))
