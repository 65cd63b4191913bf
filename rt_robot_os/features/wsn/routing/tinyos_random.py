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
The random numbers of TinyOS 2.x: the minimal standard generator, with the node's id as its seed.

So they are the same at each boot of a node: its first MultiHopLQI beacon has the same delay after
the boot in every network, 16.4 s of 32 s in node 0 and 0.8 s in node 1.
"""

from __future__ import annotations

from typing import Final

_FACTOR: Final = 16_807
_MODULUS: Final = 2**31 - 1


class TinyOsRandom:
    """
    A node's random numbers.

    :param address: of the node.
    """

    __slots__ = ('_state',)

    def __init__(self, address: int) -> None:
        self._state = address + 1

    def number(self) -> int:
        """Return the next number, 1 to 2**31 - 2."""
        self._state = state = self._state * _FACTOR % _MODULUS
        return state

    def below(self, limit: int) -> int:
        """Return the next number modulo a limit."""
        return self.number() % limit
