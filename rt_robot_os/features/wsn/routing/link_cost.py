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

"""Cost of a hop, by the link quality indication of a received frame."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

#: Of the CC2420, which has 7 bits of LQI.
LARGEST_LQI: Final = 127
#: LQI of a frame that is hardly received, and of one that is always received.
_WORST_LQI: Final = 50
_BEST_LQI: Final = 110
_U16: Final = 0xFFFF


def link_cost(lqi: int, u16_wrap: bool = True) -> int:
    """
    Return the cost of a hop in MultiHopLQI: about the cube of the difference to the best LQI.

    125 at LQI 110, 1000 at 90, 8000 at 50.

    :param lqi: link quality indication, 0 to 255.
    :param u16_wrap: compute in 16 bits, as the motes do. Below LQI 50 the product overflows, so
        that an unusable link seems as good as a perfect one: 110 at LQI 49. With 32 bits, as in
        TOSSIM, the same C code does not overflow.
    :raises ValueError: the LQI is out of range.
    """
    if not 0 <= lqi <= 0xFF:
        raise ValueError(f'LQI {lqi}: must be 0 to 255')
    lacking = _BEST_LQI + 20 - lqi
    if not u16_wrap:
        lacking = max(lacking, 0)
        return min((lacking * lacking >> 3) * lacking >> 3, _U16)
    lacking &= _U16
    square = lacking * lacking & _U16
    return ((square >> 3) * lacking & _U16) >> 3


@lru_cache(maxsize=2)
def link_costs(u16_wrap: bool) -> tuple[int, ...]:
    """Return the costs by LQI, 0 to 255; one table for all nodes."""
    return tuple(link_cost(lqi, u16_wrap) for lqi in range(0x100))
